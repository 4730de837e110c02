// What OpenMesh's readers, which share no code with ours, see in good files: the same vertices and faces.

#include <gtest/gtest.h>

#include <OpenMesh/Core/IO/importer/ImporterT.hh>
#include <OpenMesh/Core/IO/reader/OBJReader.hh>
#include <OpenMesh/Core/IO/reader/OFFReader.hh>
#include <OpenMesh/Core/IO/reader/PLYReader.hh>
#include <OpenMesh/Core/IO/reader/STLReader.hh>
#include <OpenMesh/Core/Mesh/PolyMesh_ArrayKernelT.hh>
#include <OpenMesh/Core/System/omstream.hh>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <sstream>

#include "datasets/models/fetch.h"
#include "datasets/readers/mesh_sink.h"
#include "datasets/readers/readers.h"
#include "tests/support/mesh_files.h"

namespace raybench {
namespace {

/// Takes what a reader passes on into a MeshSink; half-edges, which refuse what is not manifold, stay out.
class SinkImporter : public OpenMesh::IO::ImporterT<OpenMesh::PolyMesh_ArrayKernelT<>> {
 public:
  SinkImporter() : ImporterT(vertices_) {}

  OpenMesh::FaceHandle add_face(const VHandles& corners) override {
    faces_.emplace_back();
    for (OpenMesh::VertexHandle corner : corners) faces_.back().push_back(uint32_t(corner.idx()));
    return OpenMesh::FaceHandle(int(faces_.size()) - 1);
  }
  size_t n_faces() const override { return faces_.size(); }
  void add_face_texcoords(OpenMesh::FaceHandle, OpenMesh::VertexHandle,
                          const std::vector<OpenMesh::Vec2f>&) override {}
  void add_face_texcoords(OpenMesh::FaceHandle, OpenMesh::VertexHandle,
                          const std::vector<OpenMesh::Vec3f>&) override {}

  Scene Take() {
    Scene scene;
    MeshSink sink(scene);
    for (const auto v : vertices_.vertices()) {
      const OpenMesh::Vec3f& p = vertices_.point(v);
      sink.AddVertex({p[0], p[1], p[2]});
    }
    for (const std::vector<uint32_t>& face : faces_) sink.AddFace(face, 0);
    sink.Close();
    return scene;
  }

 private:
  OpenMesh::PolyMesh_ArrayKernelT<> vertices_;
  std::vector<std::vector<uint32_t>> faces_;
};

struct ReaderPair {
  Scene (*ours)(const std::filesystem::path&, const LoadOptions&);
  OpenMesh::IO::BaseReader& theirs;
};

ReaderPair ReadersOf(const std::filesystem::path& path) {
  const std::string ending = path.extension().string();
  if (ending == ".obj") return {kObj.read, OpenMesh::IO::OBJReader()};
  if (ending == ".off") return {kOff.read, OpenMesh::IO::OFFReader()};
  if (ending == ".ply") return {kPly.read, OpenMesh::IO::PLYReader()};
  return {kStl.read, OpenMesh::IO::STLReader()};
}

/// The corners of all triangles but those with two at one place: of these OpenMesh leaves out some.
std::vector<std::array<Vec3f, 3>> SolidCorners(const Scene& scene) {
  std::vector<std::array<Vec3f, 3>> all;
  for (size_t i = 0; i < scene.triangles.size(); ++i)
    if (const auto [a, b, c] = CornersOf(scene, i); !(a == b) && !(b == c) && !(c == a))
      all.push_back({a, b, c});
  return all;
}

/// To the bit. Vertices of an OBJ file may become several, for their looks; the corners of an STL file are
/// no vertices.
void ExpectSameMesh(const std::filesystem::path& path) {
  SCOPED_TRACE(path.filename().string());
  const auto [ours, theirs] = ReadersOf(path);
  const Scene scene = ours(path, {});
  SinkImporter importer;
  OpenMesh::IO::Options options;
  omerr().disable();
  const bool is_read = theirs.read(path.string(), importer, options);
  omerr().enable();
  ASSERT_TRUE(is_read);
  const Scene expected = importer.Take();
  const auto corners = SolidCorners(scene), expected_corners = SolidCorners(expected);
  ASSERT_EQ(corners.size(), expected_corners.size());
  EXPECT_EQ(std::memcmp(corners.data(), expected_corners.data(), corners.size() * sizeof corners[0]), 0);
  if (corners.size() == scene.triangles.size()) {
    EXPECT_EQ(scene.stats.faces, expected.stats.faces);
    EXPECT_EQ(scene.triangle_face, expected.triangle_face);
  }
  if (path.extension() == ".stl") return;
  ASSERT_GE(scene.positions.size(), expected.positions.size());
  EXPECT_TRUE(std::equal(expected.positions.begin(), expected.positions.end(), scene.positions.begin()));
}

TEST(OpenMeshReadersTest, SeeTheSameTriangles) {
  // Decimal numbers of 16 digits, which lie anywhere between two floats.
  Random random(14);
  testing::FileMesh mesh;
  constexpr int64_t kVertices = 2000;
  for (int64_t i = 0; i < kVertices; ++i) {
    Vec3d p;
    for (int k = 0; k < 3; ++k) p[k] = std::ldexp(2 * random.NextDouble() - 1, int(random.Below(60)) - 30);
    mesh.positions.push_back(p);
  }
  for (int64_t i = 0; i < 2 * kVertices; ++i) {
    const int64_t far = 1 + int64_t(random.Below(kVertices / 2 - 1)), farther = far + kVertices / 2;
    mesh.triangles.push_back({i % kVertices, (i + far) % kVertices, (i + farther) % kVertices});
  }
  ScratchDirectory files;
  for (const testing::MeshFormat& format : testing::MeshFormats())
    if (const std::string ending = std::filesystem::path(format.file).extension().string();
        ending == ".obj" || ending == ".off" || ending == ".ply" || ending == ".stl")
      ExpectSameMesh(files.Write(format.file, format.write(mesh)));
}

TEST(OpenMeshReadersTest, SeeTheSamePolygons) {
  // A floor of quads whose gables are pentagons, one of them not convex.
  std::string obj, off, ply, faces_of_obj, faces;
  const int n = 12;
  for (int i = 0; i < n; ++i)
    for (const auto& [x, y] :
         {std::pair{0.0, 0.0}, {2.0, 0.1}, {2.25, 1.3}, {1.1, i == 5 ? 0.2 : 1.7}, {-0.3, 1.0}})
      off += fmt::format("{} {} {}\n", x, y, i * 0.3);
  for (int i = 0; i < n; ++i)
    for (int k = 0; k < 5; ++k) {
      const int a = 5 * i + k, b = 5 * i + (k + 1) % 5;
      if (k == 0 && i % 4 == 1) {
        faces += fmt::format("5 {} {} {} {} {}\n", a, a + 1, a + 2, a + 3, a + 4);
        faces_of_obj += fmt::format("f {} {} {} {} {}\n", a + 1, a + 2, a + 3, a + 4, a + 5);
      } else if (i + 1 < n) {
        faces += fmt::format("4 {} {} {} {}\n", a, b, b + 5, a + 5);
        faces_of_obj += fmt::format("f {}/1 {}//2 {} {}\n", a + 1, b + 1, b + 6, a + 6);
      }
    }
  std::istringstream lines(off);
  for (std::string line; std::getline(lines, line);) obj += "v " + line + "\n";
  const auto count = std::count(faces.begin(), faces.end(), '\n');
  ScratchDirectory files;
  ExpectSameMesh(files.Write("m.obj", obj + faces_of_obj));
  ExpectSameMesh(files.Write("m.off", fmt::format("OFF\n{} {} 0\n", 5 * n, count) + off + faces));
  ExpectSameMesh(files.Write(
      "m.ply", fmt::format("ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\n"
                           "property float z\nelement face {}\nproperty list uchar int vertex_indices\n"
                           "end_header\n",
                           5 * n, count) +
                   off + faces));
}

TEST(OpenMeshReadersTest, SeeTheSameModels) {
  int compared = 0;
  for (const ManifestEntry& entry : Manifest()) {
    const std::filesystem::path path = CachedFile(entry);
    if (!IsFetched(entry) || path.extension() == ".glb" || path.extension() == ".gltf") continue;
    ExpectSameMesh(path);
    ++compared;
  }
  if (compared == 0)
    GTEST_SKIP() << "no model that OpenMesh reads has been fetched into " << CacheDirectory();
}

}  // namespace
}  // namespace raybench
