#include "tracer/hemisphere.h"

#include <gtest/gtest.h>

#include <cstring>
#include <set>

#include "tests/support/tracer.h"

namespace raybench {
namespace {

using testing::AddFloor;
using testing::AddMaterial;
using testing::BuildTree;
using testing::Dir;
using testing::FindSet;
using testing::MixedScene;

TEST(TracerHemisphere, IsCosineDistributedOnTheSideTheRayCameFrom) {
  for (bool up : {true, false}) {
    Scene scene;
    AddMaterial(scene, {});
    AddFloor(scene, {0, 0, 0}, 10, up);
    scene.cameras = {{.eye = {1, 3, 0}, .at = {0, 0, 0}, .tan_half_fov = 0.3f}};
    scene.Finish();
    const Tree tree = BuildTree(scene);
    const TraceResult traced = Trace(scene, tree, {.width = 64, .height = 64, .capture = true});
    const size_t n = 100000;
    for (const bool diffuse : {true, false}) {
      const auto make = diffuse ? &DiffuseBounce : &AmbientOcclusion;
      const RaySet set = make(scene, tree, *FindSet(traced, "camera"), n, 9);
      ASSERT_EQ(set.rays.size(), n);
      EXPECT_EQ(set.Label(), diffuse ? "diffuse" : "ambient_occlusion");
      EXPECT_EQ(set.depth, 1u);
      EXPECT_EQ(set.query, uint32_t(diffuse ? RB_CLOSEST : RB_ANY));
      Vec3d mean{0, 0, 0}, square{0, 0, 0};
      double quartic = 0;
      for (const rb_ray& ray : set.rays) {
        const Vec3d d = Dir(ray);
        ASSERT_NEAR(Length(d), 1, 1e-6);
        ASSERT_GE(d.y, -1e-6);
        ASSERT_GT(ray.org[1], 0);
        ASSERT_LT(ray.org[1], 1e-4);
        mean = mean + d, square = square + d * d, quartic += d.y * d.y * d.y * d.y;
      }
      const double k = 1 / double(n);  // sigmas: 0.0007 .. 0.0016
      EXPECT_NEAR(mean.x * k, 0, 0.008);
      EXPECT_NEAR(mean.z * k, 0, 0.008);
      EXPECT_NEAR(mean.y * k, 2.0 / 3, 0.005);
      EXPECT_NEAR(square.x * k, 0.25, 0.005);
      EXPECT_NEAR(square.z * k, 0.25, 0.005);
      EXPECT_NEAR(square.y * k, 0.5, 0.005);
      EXPECT_NEAR(quartic * k, 1.0 / 3, 0.006);
    }
  }
}

TEST(TracerHemisphere, PicksHitsOnlyAndIsSeeded) {
  const Scene scene = MixedScene(12);
  const Tree tree = BuildTree(scene);
  const TraceResult traced = Trace(scene, tree, {.width = 40, .height = 40, .capture = true});
  const RaySet& camera = *FindSet(traced, "camera");
  for (const auto make : {&DiffuseBounce, &AmbientOcclusion}) {
    const RaySet a = make(scene, tree, camera, 3000, 1), b = make(scene, tree, camera, 3000, 1),
                 c = make(scene, tree, camera, 3000, 2);
    EXPECT_EQ(a.hash, b.hash);
    EXPECT_NE(a.hash, c.hash);
    EXPECT_EQ(a.rays.size(), 3000u);
    EXPECT_EQ(a.invalid_rays, 0u);
    std::set<std::array<float, 3>> origins;
    for (const rb_ray& ray : a.rays) origins.insert({ray.org[0], ray.org[1], ray.org[2]});
    EXPECT_GT(origins.size(), a.query == RB_ANY ? 300u : 600u);  // spread over all hits
  }
}

TEST(TracerHemisphere, NothingHitGivesNoRays) {
  Scene scene;
  scene.Finish();
  RaySet camera;
  camera.rays = {{{0, 0, 0}, 0, {0, 0, 1}, 1}};
  for (const auto make : {&DiffuseBounce, &AmbientOcclusion})
    EXPECT_TRUE(make(scene, BuildTree(scene), camera, 100, 1).rays.empty());
}

TEST(TracerAmbientOcclusion, SeveralShortRaysLeaveEachPoint) {
  const Scene scene = MixedScene(12);
  const Tree tree = BuildTree(scene);
  const TraceResult traced = Trace(scene, tree, {.width = 40, .height = 40, .capture = true});
  const RaySet set = AmbientOcclusion(scene, tree, *FindSet(traced, "camera"), 1003, 1);  // no multiple of 8
  ASSERT_EQ(set.rays.size(), 1003u);
  const double diagonal = Length(ToDouble(scene.bounds().hi) - ToDouble(scene.bounds().lo));
  std::set<std::array<float, 3>> directions;
  for (size_t i = 0; i < set.rays.size(); ++i) {
    const rb_ray &ray = set.rays[i], &first = set.rays[i / kOcclusionRaysPerPoint * kOcclusionRaysPerPoint];
    ASSERT_EQ(std::memcmp(ray.org, first.org, sizeof ray.org), 0) << i;
    ASSERT_EQ(ray.tnear, 0);
    ASSERT_EQ(ray.tfar, float(0.1 * diagonal));
    directions.insert({ray.dir[0], ray.dir[1], ray.dir[2]});
  }
  EXPECT_EQ(directions.size(), set.rays.size());
}

}  // namespace
}  // namespace raybench
