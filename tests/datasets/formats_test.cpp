// One model in every format is one model.

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>

#include "datasets/models/fetch.h"
#include "tests/support/mesh_files.h"
#include "tests/support/meshes.h"

namespace raybench {
namespace {

std::vector<rb_ray> RaysThrough(const Scene& scene, int count) {
  std::vector<rb_ray> rays;
  Random random(7);
  const Vec3d lo = ToDouble(scene.bounds().lo), size = ToDouble(scene.bounds().hi) - lo;
  auto somewhere = [&] {
    Vec3d p = lo;
    for (int k = 0; k < 3; ++k) p[k] += size[k] * random.NextDouble();
    return ToFloat(p);
  };
  for (int i = 0; i < count; ++i) {
    const Vec3f from = somewhere(), d = somewhere() - from;
    rays.push_back({{from.x, from.y, from.z}, 0, {d.x, d.y, d.z}, std::numeric_limits<float>::infinity()});
  }
  return rays;
}

void ExpectOneModel(const Scene& model) {
  const std::vector<rb_ray> rays = RaysThrough(model, 2000);
  const std::vector<rb_hit> truth = testing::Closest(testing::Build("bvh_sah", model.Geometry()), rays);
  EXPECT_GT(
      std::count_if(truth.begin(), truth.end(), [](const rb_hit& h) { return h.prim != RAYBENCH_NONE; }), 50);
  ScratchDirectory files;
  testing::FileMesh file;
  for (Vec3f p : model.positions) file.positions.push_back(ToDouble(p));
  for (auto [a, b, c] : model.triangles) file.triangles.push_back({a, b, c});
  for (const testing::MeshFormat& format : testing::MeshFormats()) {
    const char* name = format.file;
    const Scene scene = LoadScene(files.Write(name, format.write(file)));
    ASSERT_EQ(scene.triangles.size(), model.triangles.size()) << name;
    EXPECT_EQ(scene.stats.faces, model.triangles.size()) << name;
    size_t different = 0;
    for (size_t i = 0; i < scene.triangles.size(); ++i)
      different += CornersOf(scene, i) != CornersOf(model, i) || scene.triangle_face[i] != i;
    EXPECT_EQ(different, 0u) << name;
    const std::vector<rb_hit> hits = testing::Closest(testing::Build("bvh_sah", scene.Geometry()), rays);
    size_t other_hits = 0;
    for (size_t i = 0; i < rays.size(); ++i)
      other_hits += std::memcmp(&hits[i], &truth[i], sizeof hits[i]) != 0;
    EXPECT_EQ(other_hits, 0u) << name;
  }
}

TEST(FormatsTest, AGeneratedModelIsTheSameInEach) { ExpectOneModel(LoadScene("sphereflake(depth=2)")); }

TEST(FormatsTest, ARealModelIsTheSameInEach) {
  for (const char* name : {"bunny", "armadillo", "engine"})
    if (IsFetched(FindManifestEntry(name))) return ExpectOneModel(LoadScene(name));
  GTEST_SKIP() << "no real model is fetched; 'raybench fetch bunny' gets one";
}

}  // namespace
}  // namespace raybench
