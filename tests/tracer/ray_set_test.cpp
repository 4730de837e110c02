#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <limits>

#include "tests/support/tracer.h"

namespace raybench {
namespace {

using testing::kInf;
using testing::kNan;
using testing::MixedScene;

Bounds3 UnitBox() { return {{0, 0, 0}, {1, 1, 1}}; }

RaySet NumberedSet(size_t n) {
  RaySet set;
  set.kind = "camera", set.order = "traced";
  for (size_t i = 0; i < n; ++i) set.rays.push_back({{float(i), 0.5f, 0.5f}, 0, {-1, 0, 0}, kInf});
  Freeze(set, UnitBox());
  return set;
}

bool SameRays(const std::vector<rb_ray>& a, const std::vector<rb_ray>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(rb_ray)) == 0;
}

TEST(TracerRaySet, LabelsCarryTheDepthWhereAKindHasSeveral) {
  RaySet set;
  set.kind = "camera";
  EXPECT_EQ(set.Label(), "camera");
  set.kind = "random";
  EXPECT_EQ(set.Label(), "random");
  set.kind = "diffuse", set.depth = 1;
  EXPECT_EQ(set.Label(), "diffuse");
  set.kind = "shadow", set.depth = 0;
  EXPECT_EQ(set.Label(), "shadow.0");
  set.kind = "reflection", set.depth = 3;
  EXPECT_EQ(set.Label(), "reflection.3");
  set.kind = "refraction", set.depth = 2;
  EXPECT_EQ(set.Label(), "refraction.2");
}

TEST(TracerRaySet, InvalidRaysAreReplacedAndCountedOnce) {
  RaySet set = NumberedSet(5);
  EXPECT_EQ(set.invalid_rays, 0u);
  set.rays[1].dir[2] = kNan;
  set.rays[2].org[0] = kInf;
  set.rays[4].dir[0] = 0;  // zero direction
  Freeze(set, UnitBox());
  EXPECT_EQ(set.invalid_rays, 3u);
  EXPECT_EQ(set.outside_rays, 0u);
  const rb_ray stand_in = InvalidRayStandIn();
  for (size_t i : {1, 2, 4}) EXPECT_EQ(std::memcmp(&set.rays[i], &stand_in, sizeof stand_in), 0) << i;
  EXPECT_EQ(set.rays[3].org[0], 3);
  // Thinned and shuffled sets still know.
  EXPECT_EQ(Thin(set, 0, UnitBox()).invalid_rays, 3u);
  EXPECT_EQ(Shuffle(set, 1, UnitBox()).invalid_rays, 3u);
}

TEST(TracerRaySet, RaysThatMissTheBoundsAreCounted) {
  RaySet set;
  set.kind = "camera", set.order = "traced";
  set.rays = {
      {{-1, 0.5f, 0.5f}, 0, {1, 0, 0}, kInf},      // through the middle
      {{-1, 1, 1}, 0, {1, 0, 0}, kInf},            // along an edge: closed box
      {{1, 1, 1}, 0, {1, 1, 1}, kInf},             // touches a corner
      {{0.5f, 0.5f, 0.5f}, 0, {0, 0, 1}, 0.125f},  // ends inside
      {{-1, 0.5f, 0.5f}, 0, {1, 0, 0}, 0.5f},      // ends before: outside
      {{2, 0.5f, 0.5f}, 0, {1, 0, 0}, kInf},       // looks away: outside
      {{-1, 1.5f, 0.5f}, 0, {1, 0, 0}, kInf},      // parallel, beside: outside
      {{-1, 0, 0}, 0, {1, 1.25f, 0}, kInf},        // passes a corner: outside
  };
  Freeze(set, UnitBox());
  EXPECT_EQ(set.outside_rays, 4u);
  Freeze(set, Bounds3{});
  EXPECT_EQ(set.outside_rays, 8u);  // an empty scene
}

TEST(TracerRaySet, TheHashDependsOnEverythingThatMatters) {
  const RaySet set = NumberedSet(100);
  EXPECT_EQ(set.hash.size(), 16u);
  EXPECT_EQ(NumberedSet(100).hash, set.hash);
  auto changed = [&](auto change) {
    RaySet copy = set;
    change(copy);
    Freeze(copy, UnitBox());
    return copy.hash;
  };
  EXPECT_NE(changed([](RaySet& s) { s.kind = "random"; }), set.hash);
  EXPECT_NE(changed([](RaySet& s) { s.depth = 1; }), set.hash);
  EXPECT_NE(changed([](RaySet& s) { s.order = "shuffled"; }), set.hash);
  EXPECT_NE(changed([](RaySet& s) { s.query = RB_ANY; }), set.hash);
  EXPECT_NE(changed([](RaySet& s) { s.rays[50].tfar = 7; }), set.hash);
  EXPECT_NE(changed([](RaySet& s) { std::swap(s.rays[3], s.rays[4]); }), set.hash);
  EXPECT_NE(changed([](RaySet& s) { s.rays.pop_back(); }), set.hash);
}

TEST(TracerRaySet, ThinningKeepsEvenlySpacedRunsOf64) {
  for (size_t n : {1u, 63u, 64u, 100u, 1000u, 4096u, 10007u}) {
    const RaySet set = NumberedSet(n);
    for (uint64_t limit : {1u, 10u, 64u, 65u, 99u, 640u, 1000u, 5000u}) {
      const RaySet thin = Thin(set, limit, UnitBox());
      ASSERT_EQ(thin.rays.size(), std::min<uint64_t>(n, limit));
      size_t runs = 1, longest_jump = 0;
      for (size_t i = 1; i < thin.rays.size(); ++i) {
        const float jump = thin.rays[i].org[0] - thin.rays[i - 1].org[0];
        ASSERT_GE(jump, 1) << "a ray came twice";
        ASSERT_TRUE(i % 64 == 0 || jump == 1) << "a run was broken, n " << n << " limit " << limit;
        if (jump > 1) ++runs, longest_jump = std::max(longest_jump, size_t(jump));
      }
      ASSERT_LE(runs, (thin.rays.size() + 63) / 64);
      // Even: no gap is longer than its share and the rounding to whole runs.
      const size_t share = n / ((limit + 63) / 64);
      ASSERT_LE(longest_jump, share + 64) << "n " << n << " limit " << limit;
    }
    EXPECT_EQ(Thin(set, 0, UnitBox()).hash, set.hash);
    EXPECT_EQ(Thin(set, n, UnitBox()).hash, set.hash);
  }
  const RaySet none = Thin(NumberedSet(0), 10, UnitBox());
  EXPECT_TRUE(none.rays.empty());
}

TEST(TracerRaySet, ShufflingPermutes) {
  const RaySet set = NumberedSet(1000), twin = Shuffle(set, 7, UnitBox());
  EXPECT_EQ(twin.order, "shuffled");
  EXPECT_EQ(twin.hash, Shuffle(set, 7, UnitBox()).hash);
  EXPECT_NE(twin.hash, Shuffle(set, 8, UnitBox()).hash);
  std::vector<rb_ray> sorted = twin.rays;
  EXPECT_FALSE(SameRays(sorted, set.rays));
  std::sort(sorted.begin(), sorted.end(),
            [](const rb_ray& a, const rb_ray& b) { return a.org[0] < b.org[0]; });
  EXPECT_TRUE(SameRays(sorted, set.rays));
  // Every position is equally likely: the first ray's place averages to the middle (sigma of the mean: 20).
  double place = 0;
  for (uint64_t seed = 0; seed < 200; ++seed) {
    const RaySet s = Shuffle(set, seed, UnitBox());
    for (size_t i = 0; i < s.rays.size(); ++i)
      if (s.rays[i].org[0] == 0) place += double(i) / 200;
  }
  EXPECT_NEAR(place, 499.5, 100);
}

TEST(TracerRandomRays, AreIsotropicLinesThroughTheBoundingSphere) {
  const Scene scene = MixedScene(3);
  const size_t n = 200000;
  const RaySet set = RandomRays(scene, n, 5);
  ASSERT_EQ(set.rays.size(), n);
  EXPECT_EQ(set.kind, "random");
  EXPECT_EQ(set.query, uint32_t(RB_CLOSEST));
  EXPECT_EQ(set.invalid_rays, 0u);
  EXPECT_GT(set.outside_rays, 0u);  // the sphere is larger than the box
  const Vec3d lo = ToDouble(scene.bounds().lo), hi = ToDouble(scene.bounds().hi), center = (lo + hi) * 0.5;
  const double radius = 0.5 * Length(hi - lo);
  Vec3d mean{0, 0, 0}, square{0, 0, 0}, mixed{0, 0, 0};
  double chord = 0, chord_square = 0;
  for (const rb_ray& ray : set.rays) {
    const Vec3d d = Normalize(testing::Dir(ray)), o = testing::Org(ray) - center;
    ASSERT_NEAR(Length(o), radius, radius * 1e-6);
    ASSERT_EQ(ray.tfar, kInf);
    ASSERT_EQ(ray.tnear, 0);
    const double length = -2 * Dot(o, d);
    ASSERT_GT(length, -1e-5 * radius);
    mean = mean + d, square = square + d * d, mixed = mixed + Vec3d{d.x * d.y, d.y * d.z, d.z * d.x};
    chord += length, chord_square += length * length;
  }
  const double k = 1 / double(n);
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(mean[i] * k, 0, 0.006) << i;          // sigma 0.0013
    EXPECT_NEAR(square[i] * k, 1.0 / 3, 0.004) << i;  // sigma 0.0007
    EXPECT_NEAR(mixed[i] * k, 0, 0.003) << i;
  }
  EXPECT_NEAR(chord * k / radius, 4.0 / 3, 0.006);  // sigma 0.001
  EXPECT_NEAR(chord_square * k / (radius * radius), 2, 0.01);
}

TEST(TracerRandomRays, AreSeededAndPrefixStable) {
  const Scene scene = MixedScene(3);
  const RaySet a = RandomRays(scene, 5000, 5), b = RandomRays(scene, 5000, 5), c = RandomRays(scene, 5000, 6);
  EXPECT_EQ(a.hash, b.hash);
  EXPECT_NE(a.hash, c.hash);
  RaySet shorter = RandomRays(scene, 100, 5);
  EXPECT_EQ(std::memcmp(shorter.rays.data(), a.rays.data(), 100 * sizeof(rb_ray)), 0);
}

TEST(TracerRandomRays, AnEmptySceneStillGivesValidRays) {
  Scene scene;
  const RaySet set = RandomRays(scene, 100, 1);
  EXPECT_EQ(set.rays.size(), 100u);
  EXPECT_EQ(set.invalid_rays, 0u);
  EXPECT_EQ(set.outside_rays, 100u);
}

}  // namespace
}  // namespace raybench
