// The recorder for other programs writes what raybench reads, names geometry as raybench does, and fails
// without leaving anything behind. (That its example runs and replays: tests/harness/recorder_test.cpp.)
#define RAYBENCH_RECORDER_IMPLEMENTATION
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstring>
#include <limits>
#include <memory>

#include "accel/base/random.h"
#include "tests/support/files.h"
#include "tests/support/rays.h"
#include "tracer/rays/ray_file.h"
#include "tracer/rays/recorder/raybench_recorder.h"

namespace raybench {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using testing::kNan;

/// Odd numbers of vertices and triangles: both arrays end in half a word.
Scene OddMesh() {
  Scene scene;
  scene.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1.5f, 0}, {0, 0, -2}, {9, 9, 9}};
  scene.triangles = {{0, 2, 1}, {0, 1, 3}, {1, 1, 3}};  // with an unused vertex and a degenerate triangle
  return scene;
}

class TracerRecorder : public ::testing::Test {
 protected:
  TracerRecorder() : folder_(fs::path(::testing::TempDir()) / fmt::format("raybench_recorder_{}", getpid())) {
    fs::create_directories(folder_);
  }
  ~TracerRecorder() override { fs::remove_all(folder_); }

  std::string In(const std::string& name) const { return (folder_ / name).string(); }
  static int Mesh(rbrec_scene& scene, const char* path, const Scene& mesh) {
    return rbrec_mesh(&scene, path, &mesh.positions[0].x, mesh.positions.size(), 0, mesh.triangles[0].data(),
                      mesh.triangles.size());
  }
  size_t Files() const {
    size_t files = 0;
    for ([[maybe_unused]] const auto& entry : fs::directory_iterator(folder_)) ++files;
    return files;
  }

  fs::path folder_;
  rbrec_scene scene_ = {};
  std::unique_ptr<rbrec_set> set_ = std::make_unique<rbrec_set>();
};

TEST_F(TracerRecorder, NamesTheGeometryAsRaybenchDoes) {
  Scene mesh = OddMesh();
  ASSERT_EQ(Mesh(scene_, nullptr, mesh), RBREC_OK);
  EXPECT_EQ(Files(), 0u);
  struct Vertex {
    float p[3], uv[2];
  };
  std::vector<Vertex> interleaved;
  for (Vec3f p : mesh.positions) interleaved.push_back({{p.x, p.y, p.z}, {kNan, 7}});
  rbrec_scene strided;
  ASSERT_EQ(rbrec_mesh(&strided, nullptr, interleaved[0].p, 5, sizeof(Vertex), mesh.triangles[0].data(), 3),
            RBREC_OK);
  mesh.Finish();
  EXPECT_EQ(fmt::format("{:016x}", scene_.hash), mesh.hash());
  EXPECT_EQ(strided.hash, scene_.hash);

  Scene soup;
  soup.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  soup.triangles = {{0, 1, 2}};
  soup.Finish();
  ASSERT_EQ(rbrec_mesh(&scene_, nullptr, &soup.positions[0].x, 3, 0, nullptr, 1), RBREC_OK);
  EXPECT_EQ(fmt::format("{:016x}", scene_.hash), soup.hash());
}

TEST_F(TracerRecorder, RaysArriveToTheBitHoweverTheyAreAdded) {
  Scene mesh = OddMesh();
  ASSERT_EQ(Mesh(scene_, In("mesh.ply").c_str(), mesh), RBREC_OK);
  mesh.Finish();
  for (const size_t count : {1u, 255u, 256u, 257u, 3000u}) {
    RaySet set = RandomRays(mesh, count, 5);
    set.rays[count / 2].dir[1] = kNan;
    const auto* rays = reinterpret_cast<const rbrec_ray*>(set.rays.data());
    static_assert(sizeof(rbrec_ray) == sizeof(rb_ray));
    ASSERT_EQ(
        rbrec_begin(set_.get(), In("a.rays").c_str(), &scene_, "reflection", 2, RBREC_CLOSEST, "engine 7"),
        RBREC_OK);
    Random random(count);
    for (size_t at = 0; at < count;) {
      const size_t block = std::min<size_t>(random.Below(700), count - at);
      ASSERT_EQ(rbrec_add(set_.get(), rays + at, block), RBREC_OK);
      at += block;
    }
    EXPECT_EQ(set_->count, count);
    ASSERT_EQ(rbrec_end(set_.get()), RBREC_OK) << set_->message;
    const RayFile file = ReadRayFile(In("a.rays"));
    EXPECT_EQ(file.header.kind, "reflection");
    EXPECT_EQ(file.header.depth, 2u);
    EXPECT_EQ(file.header.query, uint32_t(RB_CLOSEST));
    EXPECT_EQ(file.header.order, "recorded");
    EXPECT_EQ(file.header.software, "engine 7");
    EXPECT_EQ(file.header.scene, "mesh.ply");
    ASSERT_EQ(file.rays.size(), count);
    EXPECT_EQ(std::memcmp(file.rays.data(), set.rays.data(), 32 * count), 0);
    EXPECT_EQ(ReplayedSet(file, mesh).invalid_rays, 1u);
  }
  EXPECT_EQ(Files(), 2u);  // no temporary files
}

TEST_F(TracerRecorder, AMeshThatCannotBeIsRefused) {
  Scene mesh = OddMesh();
  const std::string path = In("mesh.ply");
  EXPECT_EQ(rbrec_mesh(nullptr, path.c_str(), &mesh.positions[0].x, 5, 0, nullptr, 1), RBREC_BAD_ARGUMENT);
  EXPECT_EQ(rbrec_mesh(&scene_, path.c_str(), nullptr, 5, 0, nullptr, 1), RBREC_BAD_ARGUMENT);
  EXPECT_EQ(rbrec_mesh(&scene_, path.c_str(), &mesh.positions[0].x, 5, 0, nullptr, 2), RBREC_BAD_ARGUMENT);
  EXPECT_THAT(scene_.message, HasSubstr("mesh.ply: triangle 1 refers to vertex 5 of 5"));
  mesh.triangles[2][0] = 5;
  EXPECT_EQ(Mesh(scene_, path.c_str(), mesh), RBREC_BAD_ARGUMENT);
  EXPECT_THAT(scene_.message, HasSubstr("triangle 2 refers to vertex 5 of 5"));
  mesh = OddMesh();
  mesh.positions[4].y = -std::numeric_limits<float>::infinity();
  EXPECT_EQ(Mesh(scene_, path.c_str(), mesh), RBREC_BAD_ARGUMENT);
  EXPECT_THAT(scene_.message, HasSubstr("vertex 4 is not finite"));
  EXPECT_EQ(Mesh(scene_, In("no/such/mesh.ply").c_str(), OddMesh()), RBREC_CANNOT_WRITE);
  fs::create_symlink("/dev/full", path + ".tmp");
  EXPECT_EQ(Mesh(scene_, path.c_str(), OddMesh()), RBREC_CANNOT_WRITE);
  EXPECT_THAT(scene_.message, HasSubstr("mesh.ply: cannot be written"));
  EXPECT_EQ(Files(), 0u);
}

TEST_F(TracerRecorder, ASetThatFailsLeavesNothingAndSaysWhy) {
  ASSERT_EQ(Mesh(scene_, nullptr, OddMesh()), RBREC_OK);
  const std::string path = In("a.rays");
  const auto begin = [&](const char* file, const char* kind, int query, const rbrec_scene* scene) {
    return rbrec_begin(set_.get(), file, scene, kind, 0, query, nullptr);
  };
  const rbrec_ray ray = {{0, 0, 0}, 0, {0, 0, 1}, 1};
  const rbrec_scene none = {};
  for (const char* kind : {"", "Camera", "a b", "a.b", "a_kind_of_thirty_two_characters_"})
    EXPECT_EQ(begin(path.c_str(), kind, RBREC_ANY, &scene_), RBREC_BAD_ARGUMENT) << kind;
  EXPECT_EQ(begin(path.c_str(), nullptr, RBREC_ANY, &scene_), RBREC_BAD_ARGUMENT);
  EXPECT_EQ(begin(path.c_str(), "camera", 2, &scene_), RBREC_BAD_ARGUMENT);
  EXPECT_EQ(begin(path.c_str(), "camera", RBREC_ANY, &none), RBREC_BAD_ARGUMENT);
  EXPECT_EQ(begin(path.c_str(), "camera", RBREC_ANY, nullptr), RBREC_BAD_ARGUMENT);
  EXPECT_EQ(begin(nullptr, "camera", RBREC_ANY, &scene_), RBREC_BAD_ARGUMENT);
  EXPECT_EQ(begin(std::string(1024, 'a').c_str(), "camera", RBREC_ANY, &scene_), RBREC_BAD_ARGUMENT);
  EXPECT_EQ(begin(In("no/such.rays").c_str(), "camera", RBREC_ANY, &scene_), RBREC_CANNOT_WRITE);
  EXPECT_THAT(set_->message, HasSubstr("no/such.rays: cannot be written"));
  // It stays in its error.
  EXPECT_EQ(rbrec_add(set_.get(), &ray, 1), RBREC_CANNOT_WRITE);
  EXPECT_EQ(rbrec_end(set_.get()), RBREC_CANNOT_WRITE);

  ASSERT_EQ(begin(path.c_str(), "camera", RBREC_ANY, &scene_), RBREC_OK);
  EXPECT_EQ(rbrec_end(set_.get()), RBREC_EMPTY);
  EXPECT_EQ(rbrec_add(set_.get(), &ray, 1), RBREC_EMPTY);
  ASSERT_EQ(begin(path.c_str(), "camera", RBREC_ANY, &scene_), RBREC_OK);
  rbrec_abort(set_.get());
  rbrec_abort(set_.get());
  EXPECT_EQ(rbrec_end(set_.get()), RBREC_EMPTY);
  ASSERT_EQ(begin(path.c_str(), "camera", RBREC_ANY, &scene_), RBREC_OK);
  EXPECT_EQ(rbrec_add(set_.get(), nullptr, 1), RBREC_BAD_ARGUMENT);
  EXPECT_EQ(Files(), 0u);

  fs::create_symlink("/dev/full", path + ".tmp");  // a full disk
  ASSERT_EQ(begin(path.c_str(), "camera", RBREC_ANY, &scene_), RBREC_OK);
  for (int i = 0; i < 1000; ++i) rbrec_add(set_.get(), &ray, 1);
  EXPECT_EQ(rbrec_end(set_.get()), RBREC_CANNOT_WRITE);
  EXPECT_THAT(set_->message, HasSubstr("a.rays: cannot be written"));
  EXPECT_EQ(Files(), 0u);
}

}  // namespace
}  // namespace raybench
