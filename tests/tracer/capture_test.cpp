// Ray sets by depth: that each holds what the hits of the depth before it call for, no more and no less.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <vector>

#include "tests/support/tracer.h"
#include "tracer/surface.h"

namespace raybench {
namespace {

using testing::BuildTree;
using testing::Dir;
using testing::FindSet;
using testing::MixedScene;

/// Rays that the hits of a depth send out.
struct Outgoing {
  uint64_t hits = 0, shadow = 0, reflection = 0, refraction = 0;
};

bool Lets(Vec3f color) { return color.x != 0 || color.y != 0 || color.z != 0; }

/// Counted from the recorded rays and the materials alone: the rules of Whitted's tracer, by themselves.
void AddOutgoing(const Scene& scene, const Tree& tree, const RaySet* set, Outgoing& out) {
  if (set == nullptr) return;
  std::vector<rb_hit> hits(set->rays.size());
  rb_query query{};
  query.struct_size = sizeof query;
  query.kind = RB_CLOSEST;
  query.n = hits.size(), query.rays = set->rays.data(), query.hits = hits.data();
  tree.Query(query);
  for (size_t i = 0; i < hits.size(); ++i) {
    if (hits[i].prim == RAYBENCH_NONE) continue;
    ++out.hits;
    const SurfacePoint surface = SurfaceAt(scene, set->rays[i], hits[i]);
    const Material& material = scene.materials[scene.MaterialOf(hits[i].prim)];
    const Vec3d view = Normalize(Dir(set->rays[i]));
    const bool leaving = Dot(surface.normal, view) > 0;
    const Vec3d facing = surface.normal * (leaving ? -1.0 : 1.0);
    for (const Light& light : scene.lights)
      out.shadow += Dot(facing, ToDouble(light.position) - surface.point) > 0;
    const double cosine = Dot(facing, view), eta = leaving ? material.ior : 1 / double(material.ior);
    const bool total = eta * eta * (1 - cosine * cosine) > 1, glass = Lets(material.transmit);
    out.reflection += Lets(material.reflect) || (glass && total);
    out.refraction += glass && !total;
  }
}

uint64_t SizeOf(const RaySet* set) { return set == nullptr ? 0 : set->rays.size(); }

TEST(TracerCaptureByDepth, EachSetHoldsWhatTheHitsBeforeItCallFor) {
  const uint32_t depth = 4;
  for (uint64_t seed : {21, 22}) {
    const Scene scene = MixedScene(seed);
    const Tree tree = BuildTree(scene, "bvh_sah");
    const TraceResult result =
        Trace(scene, tree, {.width = 90, .height = 70, .max_depth = depth, .capture = true});
    uint64_t refracted = 0;
    for (uint32_t d = 0; d <= depth; ++d) {
      const std::string at = "." + std::to_string(d), next = "." + std::to_string(d + 1);
      Outgoing out;
      if (d == 0) AddOutgoing(scene, tree, FindSet(result, "camera"), out);
      AddOutgoing(scene, tree, FindSet(result, "reflection" + at), out);
      AddOutgoing(scene, tree, FindSet(result, "refraction" + at), out);
      EXPECT_GT(out.hits, 0u) << "choose another scene";
      EXPECT_EQ(SizeOf(FindSet(result, "shadow" + at)), out.shadow) << seed << " depth " << d;
      const bool last = d == depth;
      EXPECT_EQ(SizeOf(FindSet(result, "reflection" + next)), last ? 0 : out.reflection) << seed << " " << d;
      EXPECT_EQ(SizeOf(FindSet(result, "refraction" + next)), last ? 0 : out.refraction) << seed << " " << d;
      refracted += out.refraction;
    }
    EXPECT_GT(refracted, 100u) << "choose another scene";
  }
}

TEST(TracerCaptureByDepth, LessDepthRecordsTheSameSetsAndLeavesOutTheDeeper) {
  const Scene scene = MixedScene(23);
  const Tree tree = BuildTree(scene, "bvh_sah");
  const TraceResult deep = Trace(scene, tree, {.width = 64, .height = 48, .max_depth = 4, .capture = true});
  for (uint32_t depth = 0; depth < 4; ++depth) {
    const TraceResult shallow =
        Trace(scene, tree, {.width = 64, .height = 48, .max_depth = depth, .capture = true});
    size_t expected = 0;
    for (const RaySet& set : deep.ray_sets) expected += set.depth <= depth;
    EXPECT_EQ(shallow.ray_sets.size(), expected);
    for (const RaySet& set : shallow.ray_sets) {
      EXPECT_LE(set.depth, depth);
      const RaySet* same = FindSet(deep, set.Label());
      ASSERT_NE(same, nullptr) << set.Label();
      EXPECT_EQ(set.hash, same->hash) << set.Label();
    }
  }
}

TEST(TracerCaptureByDepth, EverySetIsBitwiseTheSameAtOtherThreadsAndBands) {
  const Scene scene = MixedScene(24);
  const Tree tree = BuildTree(scene, "bvh_sah");
  const TraceOptions options{.width = 100, .height = 50, .max_depth = 3, .threads = 1, .capture = true};
  const TraceResult reference = Trace(scene, tree, options);
  for (const char* label : {"shadow.0", "reflection.1", "refraction.2", "shadow.3"})
    ASSERT_NE(FindSet(reference, label), nullptr) << label;
  for (uint32_t threads : {1u, 2u})
    for (uint32_t band : {64u, 999u, 4097u}) {
      TraceOptions other = options;
      other.threads = threads, other.band_rays = band;
      const TraceResult result = Trace(scene, tree, other);
      ASSERT_EQ(result.ray_sets.size(), reference.ray_sets.size());
      for (size_t i = 0; i < result.ray_sets.size(); ++i) {
        const RaySet &a = reference.ray_sets[i], &b = result.ray_sets[i];
        ASSERT_EQ(a.Label(), b.Label());
        ASSERT_EQ(a.rays.size(), b.rays.size()) << a.Label() << " bands of " << band;
        ASSERT_EQ(std::memcmp(a.rays.data(), b.rays.data(), a.rays.size() * sizeof(rb_ray)), 0)
            << a.Label() << ", " << threads << " threads, bands of " << band;
        EXPECT_EQ(a.invalid_rays, b.invalid_rays);
        EXPECT_EQ(a.outside_rays, b.outside_rays);
      }
    }
}

}  // namespace
}  // namespace raybench
