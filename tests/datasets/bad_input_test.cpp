// The same faults in a file of every format: refused in one line that names the file and the place, or, when
// asked, left out and counted. What is peculiar to a format stands in its own tests; what structures make of
// bad input, in tests/conformance/bad_input_test.cpp.
#include <gmock/gmock.h>

#include <cmath>
#include <numbers>

#include "tests/support/datasets.h"
#include "tests/support/mesh_files.h"
#include "tests/support/rays.h"

namespace raybench {
namespace {

using ::testing::AllOf;
using ::testing::AnyOf;
using ::testing::ElementsAre;
using testing::FileMesh;
using ::testing::HasSubstr;
using testing::kInf;
using testing::kNan;
using testing::MeshFormat;

/// Two triangles; vertex 3 belongs to the second alone.
FileMesh TwoTriangles() {
  return {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0.5}, {1, 1, 0.25}}, {{0, 1, 2}, {2, 1, 3}}};
}

class BadFile : public ::testing::TestWithParam<MeshFormat> {
 protected:
  std::string Write(const FileMesh& mesh) const {
    return files_.Write(GetParam().file, GetParam().write(mesh));
  }
  Scene Load(const FileMesh& mesh, bool drop_bad = false) const {
    LoadOptions options;
    options.drop_bad = drop_bad;
    return LoadScene(Write(mesh), options);
  }
  /// Where the file has what is wrong with vertex 3 and face 1, in the words of its format.
  const char* Place() const {
    const std::string_view file = GetParam().file;
    if (file == "m.obj") return "line 5: vertex 3";
    if (file == "m.off") return "line 6: vertex 3";
    if (file == "ascii.ply") return "line 13: vertex 3";
    if (file.ends_with(".ply")) return "vertex 3";
    if (file == "ascii.stl") return "line 13: facet 1";
    if (file == "binary.stl") return "facet 1";
    if (file == "m.nff") return "line 9";
    return "vertex 3";
  }

  ScratchDirectory files_;
};

TEST_P(BadFile, CoordinatesThatAreNotFinite) {
  for (double bad : {double{kNan}, -double{kNan}, double{kInf}, -double{kInf}, 1e39, -1e39, 1e300}) {
    for (int axis = 0; axis < 3; ++axis) {
      SCOPED_TRACE(::testing::Message() << bad << " on axis " << axis);
      FileMesh mesh = TwoTriangles();
      mesh.positions[3][axis] = bad;
      const std::string error = LoadError(Write(mesh));
      EXPECT_THAT(error, HasSubstr("finite"));
      EXPECT_THAT(error, HasSubstr(Place()));
      const Scene scene = Load(mesh, true);
      EXPECT_THAT(scene.triangle_face, ElementsAre(0));
      EXPECT_EQ(scene.stats.dropped_triangles, 1u);
      EXPECT_EQ(scene.stats.faces, 2u);
      for (Vec3f p : scene.positions) EXPECT_TRUE(std::isfinite(p.x + p.y + p.z));
    }
  }
}

TEST_P(BadFile, IndicesOutOfRange) {
  if (!GetParam().has_indices) return;  // corners are coordinates
  for (int64_t bad : {int64_t{4}, int64_t{5}, int64_t{1} << 30, int64_t{-1}, int64_t{-100}}) {
    SCOPED_TRACE(bad);
    FileMesh mesh = TwoTriangles();
    mesh.triangles[1][2] = bad;
    const bool from_one = std::string_view(GetParam().file) == "m.obj";
    EXPECT_THAT(LoadError(Write(mesh)),
                AllOf(HasSubstr("refers to vertex"),
                      HasSubstr(from_one ? "allowed are 1 to 4" : "allowed are 0 to 3")));
    const Scene scene = Load(mesh, true);
    EXPECT_THAT(scene.triangle_face, ElementsAre(0));
    EXPECT_EQ(scene.stats.dropped_triangles, 1u);
  }
}

TEST_P(BadFile, FilesOfNothing) {
  FileMesh mesh = TwoTriangles();
  mesh.triangles.clear();
  const auto nothing =
      AnyOf(HasSubstr("no faces"), HasSubstr("no facets"), HasSubstr("no triangles"),
            HasSubstr("no primitives"), HasSubstr("byteLength"), HasSubstr("refers to buffer"));
  EXPECT_THAT(LoadError(Write(mesh)), nothing) << "no faces";
  mesh.positions.clear();
  EXPECT_THAT(LoadError(Write(mesh)), nothing) << "nothing at all";
  EXPECT_THAT(LoadError(files_.Write(GetParam().file, "")), HasSubstr("is empty"));
  if (!GetParam().has_indices) return;
  mesh.triangles = {{0, 1, 2}};
  EXPECT_THAT(LoadError(Write(mesh)),
              AnyOf(HasSubstr("refers to vertex"), HasSubstr("byteLength"), HasSubstr("refers to buffer")))
      << "no vertices";
}

TEST_P(BadFile, OneFaceIsEnough) {
  FileMesh mesh = TwoTriangles();
  mesh.triangles.pop_back();
  EXPECT_THAT(Load(mesh).triangle_face, ElementsAre(0));
  mesh.positions[1].y = kNan;
  const Scene scene = Load(mesh, true);
  EXPECT_EQ(scene.primitive_count(), 0u) << "nothing is left: an empty scene, which counts what it lost";
  EXPECT_EQ(scene.stats.dropped_triangles, 1u);
}

TEST_P(BadFile, FacesWithoutAreaAreLeftOutAndCounted) {
  FileMesh mesh = TwoTriangles();
  mesh.positions.push_back({2, 0, 0});
  mesh.triangles = {{0, 0, 0}, {0, 0, 1}, {0, 1, 4}};  // a point, a line, three points of a line
  const Scene scene = Load(mesh);
  EXPECT_EQ(scene.primitive_count(), 0u);
  EXPECT_EQ(scene.stats.degenerate_triangles, 3u);
  EXPECT_EQ(scene.stats.dropped_triangles, 0u);
  mesh.triangles.push_back({0, 1, 2});
  EXPECT_THAT(Load(mesh).triangle_face, ElementsAre(3));
}

// Where other libraries give up (Embree drops what lies beyond 1.8e18), a power of two brings
// everything back.
TEST_P(BadFile, CoordinatesBeyondWhatStructuresTakeAreRescaledWithoutLoss) {
  for (double size : {1e10, 2e18, 1e30, 1e38, 1e-12, 1e-36}) {
    SCOPED_TRACE(size);
    FileMesh mesh = TwoTriangles();
    for (Vec3d& p : mesh.positions) p = ToDouble(ToFloat(p * (size * std::numbers::phi)));
    const Scene scene = Load(mesh);
    ASSERT_EQ(scene.triangles.size(), 2u);
    EXPECT_NE(scene.scale_exponent, 0);
    for (size_t i = 0; i < 2; ++i) {
      for (size_t k = 0; k < 3; ++k) {
        const Vec3d want = mesh.positions[size_t(mesh.triangles[i][k])];
        for (int a = 0; a < 3; ++a)
          EXPECT_EQ(std::ldexp(double(CornersOf(scene, i)[k][a]), -scene.scale_exponent), want[a]);
      }
    }
  }
}

TEST_P(BadFile, CoordinatesTooFarApartToBeRescaled) {
  FileMesh mesh = TwoTriangles();
  mesh.positions[0].x = double(1e38f), mesh.positions[3].z = double(1.2345678e-20f);
  EXPECT_THAT(LoadError(Write(mesh)), HasSubstr("too small beside the largest coordinate"));
  const Scene scene = Load(mesh, true);
  EXPECT_THAT(scene.triangle_face, ElementsAre(0));
  EXPECT_EQ(scene.stats.dropped_triangles, 1u);
}

TEST_P(BadFile, EveryTruncationLoadsOrNamesTheFile) {
  const std::string text = GetParam().write(TwoTriangles());
  // OBJ and NFF do not say how much is to come.
  const std::string_view file = GetParam().file;
  const bool may_end_anywhere = file == "m.obj" || file == "m.nff";
  for (size_t n = 0; n + 1 < text.size(); ++n) {
    LoadOptions options;
    options.drop_bad = n % 2 == 1;
    const std::string path = files_.Write(GetParam().file, text.substr(0, n));
    try {
      const Scene scene = LoadScene(path, options);
      EXPECT_TRUE(may_end_anywhere ||
                  (file == "ascii.stl" && text.substr(0, n).find("endsolid") != text.npos))
          << n;
      EXPECT_LE(scene.triangles.size(), 2u);
    } catch (const InputError& e) {
      const std::string message = e.what();
      EXPECT_TRUE(message.starts_with(path + ": ")) << message;
      EXPECT_EQ(message.find('\n'), message.npos) << message;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Every, BadFile, ::testing::ValuesIn(testing::MeshFormats()), [](const auto& info) {
  std::string name = info.param.file;
  std::replace(name.begin(), name.end(), '.', '_');
  return name;
});

}  // namespace
}  // namespace raybench
