// Every registered structure on input that nobody should give it: rays that are none or that are at the
// limits of float, meshes of points and lines, a hundred thousand copies of one triangle. Answers are
// defined, memory and depth bounded, nothing crashes or runs on. The readers' share is
// tests/datasets/bad_input_test.cpp.
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstring>

#include "harness/run/prepared_set.h"
#include "tests/support/conformance.h"
#include "tests/support/effort.h"
#include "tracer/rays/ray_set.h"

namespace raybench::testing {
namespace {

constexpr float kInf = std::numeric_limits<float>::infinity(), kNan = std::numeric_limits<float>::quiet_NaN(),
                kMax = std::numeric_limits<float>::max(), kTiny = std::numeric_limits<float>::denorm_min();

/// A ball around the origin; where the structure takes them, procedural primitives in its middle.
Scene Target(bool procedural) {
  Scene scene;
  scene.provenance.source = "ball";
  scene.positions = Ball(2).positions;
  scene.triangles = Ball(2).triangles;
  if (procedural) {
    scene.spheres = {{{0, 0, 0}, 0.25f}};
    scene.cones = {{{0.5f, 0, 0}, 0.125f, {0.75f, 0, 0}, 0.0625f}};
    const uint32_t first = uint32_t(scene.positions.size());
    for (Vec3f p :
         {Vec3f{-0.5f, -0.1f, -0.1f}, {-0.5f, 0.1f, -0.1f}, {-0.5f, 0.1f, 0.1f}, {-0.5f, -0.1f, 0.1f}})
      scene.positions.push_back(p);
    scene.polygon_vertices = {first, first + 1, first + 2, first + 3};
    scene.polygons = {{0, 4}};
  }
  scene.Finish();
  return scene;
}

/// From outside through the ball, aside of its middle; hits it at t of about 2 and 4.
rb_ray Through() { return {{0.01f, 0.3f, -3}, 0, {0, 0, 1}, kInf}; }

std::vector<rb_ray> InvalidRays() {
  std::vector<rb_ray> rays;
  for (float bad : {kNan, -kNan, kInf, -kInf}) {
    for (int axis = 0; axis < 3; ++axis) {
      rays.push_back(Through()), rays.back().org[axis] = bad;
      rays.push_back(Through()), rays.back().dir[axis] = bad;
      rays.push_back(rays.back()), rays.back().tnear = -1, rays.back().tfar = kMax;
    }
    rays.push_back(Through());
    for (int axis = 0; axis < 3; ++axis) rays.back().org[axis] = rays.back().dir[axis] = bad;
    rays.push_back(Through()), rays.back().tnear = bad;
  }
  rays.push_back(Through()), rays.back().tfar = kNan;
  for (float tnear : {-1.0f, -kTiny, -kMax}) rays.push_back(Through()), rays.back().tnear = tnear;
  for (float zero : {0.0f, -0.0f}) {
    rays.push_back(Through());
    for (float& d : rays.back().dir) d = zero;
  }
  return rays;
}

struct OddRay {
  const char* what;
  rb_ray ray;
  bool hits;
};

/// Valid all of them, if odd. Where the ray starts in the middle, the primitives there are behind it
/// or beside.
std::vector<OddRay> OddRays() {
  auto with = [](float tnear, float tfar, Vec3f dir = {0, 0, 1}) {
    return rb_ray{{0.01f, 0.3f, 0}, tnear, {dir.x, dir.y, dir.z}, tfar};
  };
  return {
      {"plain", with(0, kInf), true},
      {"-0 wherever there is a 0", {{-0.0f, 0.3f, -0.0f}, -0.0f, {-0.0f, -0.0f, -1}, kInf}, true},
      {"tfar is -0", with(-0.0f, -0.0f), false},
      {"tfar == tnear", with(0.5f, 0.5f), false},
      {"tfar < tnear", with(2, 0.5f), false},
      {"tfar < 0", with(0, -1), false},
      {"tfar is -inf", with(0, -kInf), false},
      {"the interval ends before the surface", with(0, 0.5f), false},
      {"the interval begins behind it", with(1.5f, kInf), false},
      {"tnear is the largest float", with(kMax, kInf), false},
      {"the interval is all floats", with(0, kMax), true},
      {"direction is the largest power of two", with(0, kInf, {0, 0, 0x1p127f}), true},
      {"direction is the largest float", with(0, kInf, {0, 0, kMax}), true},
      {"direction is large in every component", with(0, 1, {kMax, -kMax, kMax}), true},
      {"direction is largest and smallest", with(0, kInf, {kTiny, -kTiny, kMax}), true},
      {"direction is subnormal", with(0, kInf, {0, 0, 0x1p-127f}), true},
      {"direction is subnormal, the interval all floats", with(0, kMax, {0, -0.0f, 0x1p-127f}), true},
      {"direction is so small that no float is t", with(0, kInf, {0, 0, kTiny}), false},
      {"direction is so small that no float is t, nor in the interval", with(0, 1, {kTiny, kTiny, kTiny}),
       false},
      {"origin is far away and the direction leads off", {{kMax, kMax, kMax}, 0, {1, 0, 0}, kInf}, false},
      {"origin is the smallest float", {{kTiny, -kTiny, kTiny}, kTiny, {0, 1, kTiny}, kInf}, true},
  };
}

/// All answers of a tree to rays, by every way of asking: they must be the same.
struct Asked {
  std::vector<rb_hit> hits;
  std::vector<uint8_t> occluded;
};
Asked AskEveryWay(const Tree& tree, const std::vector<rb_ray>& rays) {
  const Asked asked{Closest(tree, rays), Occluded(tree, rays)};
  if ((tree.structure().capabilities & RB_CAN_COUNT) == 0) return asked;
  const size_t n = rays.size();
  Asked counted{std::vector<rb_hit>(n), std::vector<uint8_t>(n, 9)};
  std::vector<rb_counts> counts(n);
  rb_query q{};
  q.struct_size = sizeof q, q.n = n, q.rays = rays.data(), q.counts = counts.data();
  q.kind = RB_CLOSEST, q.hits = counted.hits.data();
  tree.QueryCounted(q);
  q.kind = RB_ANY, q.occluded = counted.occluded.data();
  tree.QueryCounted(q);
  EXPECT_EQ(std::memcmp(counted.hits.data(), asked.hits.data(), n * sizeof(rb_hit)), 0);
  EXPECT_EQ(counted.occluded, asked.occluded);
  return asked;
}

/// The claim of a tree makes it answer odd rays rightly, too; what claims less shall answer at all.
bool Promises(const Tree& tree) {
  return tree.Claims() == RB_CLAIM_WATERTIGHT || tree.Claims() == RB_CLAIM_EXACT;
}

class BadInput : public ::testing::TestWithParam<std::string> {
 protected:
  Tree BuildOver(const Scene& scene) const { return Build(GetParam(), scene.Geometry()); }
  bool TakesProcedurals() const {
    static const Registry registry;
    const Contestant contestant = ParseContestant(registry, GetParam());
    return (contestant.structure->capabilities & RB_CAN_PROCEDURAL) != 0 && !HasQuantisedLeaves(GetParam());
  }
};

TEST_P(BadInput, RaysThatAreNoneMiss) {
  const std::vector<rb_ray> rays = InvalidRays();
  for (bool procedural : {false, true}) {
    if (procedural && !TakesProcedurals()) continue;
    const Scene scene = Target(procedural);
    const Tree tree = BuildOver(scene);
    const Asked asked = AskEveryWay(tree, rays);
    for (size_t i = 0; i < rays.size(); ++i) {
      ASSERT_FALSE(IsValidRay(rays[i])) << i;
      EXPECT_EQ(asked.hits[i].prim, RAYBENCH_NONE) << i;
      EXPECT_EQ(std::bit_cast<uint32_t>(asked.hits[i].t), std::bit_cast<uint32_t>(rays[i].tfar)) << i;
      EXPECT_EQ(asked.occluded[i], 0) << i;
    }
  }
}

TEST_P(BadInput, OddRaysAreAnswered) {
  std::vector<rb_ray> rays;
  for (const OddRay& odd : OddRays()) rays.push_back(odd.ray);
  for (bool procedural : {false, true}) {
    if (procedural && !TakesProcedurals()) continue;
    const Scene scene = Target(procedural);
    const Tree tree = BuildOver(scene);
    const Asked asked = AskEveryWay(tree, rays);
    for (size_t i = 0; i < rays.size(); ++i) {
      const OddRay odd = OddRays()[i];
      SCOPED_TRACE(odd.what);
      ASSERT_TRUE(IsValidRay(odd.ray));
      const rb_hit& hit = asked.hits[i];
      const bool is_hit = hit.prim != RAYBENCH_NONE;
      ASSERT_LE(asked.occluded[i], 1);
      if (is_hit) {
        EXPECT_LT(hit.prim, scene.primitive_count());
        EXPECT_TRUE(hit.t > odd.ray.tnear && hit.t <= odd.ray.tfar && std::isfinite(hit.t)) << hit.t;
      } else {
        EXPECT_EQ(hit.t, odd.ray.tfar);
      }
      if (!odd.hits || Promises(tree)) {
        EXPECT_EQ(is_hit, odd.hits && tree.Claims() != RB_CLAIM_NOTHING);
        EXPECT_EQ(asked.occluded[i], is_hit);
      }
    }
  }
}

TEST_P(BadInput, DirectionsOfAnyLengthGiveTheSameHit) {
  const Scene scene = Target(TakesProcedurals());
  const Tree tree = BuildOver(scene);
  if (!Promises(tree)) return;  // OddRaysAreAnswered has asked for what the others owe
  rb_ray unit{{0.01f, 0.3f, 0.02f}, 0, {-0.25f, 0.5f, 0.75f}, kInf};
  std::vector<rb_ray> rays;
  std::vector<int> exponents;
  for (int e = -126; e <= 127; ++e) {
    rays.push_back(unit), exponents.push_back(e);
    for (float& d : rays.back().dir) d = std::ldexp(d, e);
  }
  const rb_hit expected = Closest(tree, {unit})[0];
  ASSERT_NE(expected.prim, RAYBENCH_NONE);
  const std::vector<rb_hit> hits = Closest(tree, rays);
  for (size_t i = 0; i < rays.size(); ++i) {
    EXPECT_EQ(hits[i].prim, expected.prim) << exponents[i];
    // A subnormal t is rounded from the exact one, not from the float that `expected` has.
    const float t = float(std::ldexp(double(expected.t), -exponents[i]));
    const bool is_normal = t >= std::numeric_limits<float>::min();
    EXPECT_NEAR(hits[i].t, t, is_normal ? 0 : std::numeric_limits<float>::denorm_min()) << exponents[i];
  }
}

// The way that a run takes: invalid rays are replaced and counted before anybody is asked, and nobody is
// refused for what they answer to the rest.
TEST_P(BadInput, ARunCountsInvalidRaysAndRefusesNobodyForThem) {
  const Scene scene = Target(false);
  const Tree tree = BuildOver(scene);
  const auto oracle = MakeOracle(scene);
  for (uint32_t query : {RB_CLOSEST, RB_ANY}) {
    PreparedSet set;
    set.set.kind = "recorded", set.set.query = query;
    set.set.rays = InvalidRays();
    for (const OddRay& odd : OddRays()) set.set.rays.push_back(odd.ray);
    Freeze(set.set, scene.bounds());
    EXPECT_EQ(set.set.invalid_rays, InvalidRays().size());
    for (uint32_t i = 0; i < set.set.rays.size(); ++i) set.picks.push_back(i);
    set.truth = oracle->Ask(set.set.rays, 1);
    Answers answers(set.set.rays.size()), counted(set.set.rays.size());
    Row values;
    EXPECT_EQ(CheckAnswers(tree, *oracle, scene, set, values, answers, counted), "");
    for (size_t i = 0; i < set.set.invalid_rays; ++i) {
      EXPECT_FALSE(query == RB_ANY ? answers.occluded[i] != 0 : answers.hits[i].prim != RAYBENCH_NONE) << i;
    }
  }
}

TEST_P(BadInput, PointsAndLinesAreNeverHit) {
  Mesh mesh{"points_and_lines", {}, {}};
  Random random(5);
  for (uint32_t i = 0; i < 500; ++i) {
    const Vec3f p = ToFloat(random.UnitVector()), d = ToFloat(random.UnitVector());
    const Vec3f step{std::round(d.x * 64) / 64, std::round(d.y * 64) / 64, std::round(d.z * 64) / 64};
    const Vec3f at{std::round(p.x * 64) / 64, std::round(p.y * 64) / 64, std::round(p.z * 64) / 64};
    for (Vec3f corner : {at, at + step, at + step * 2.0f}) mesh.positions.push_back(corner);
    mesh.triangles.push_back({3 * i, 3 * i, 3 * i});
    mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  const Scene scene = SceneOf(mesh);
  EXPECT_EQ(scene.stats.degenerate_triangles, 1000u);
  EXPECT_EQ(scene.triangles.size(), 0u);
  const Tree tree = BuildOver(scene);
  std::vector<rb_ray> rays;
  for (const rb_ray& ray : NastyRays(mesh, 50, 3)) {
    if (IsValidRay(ray)) rays.push_back(ray);
  }
  ASSERT_GT(rays.size(), 200u);
  const Asked asked = AskEveryWay(tree, rays);
  for (size_t i = 0; i < rays.size(); ++i) {
    EXPECT_EQ(asked.hits[i].prim, RAYBENCH_NONE);
    EXPECT_EQ(asked.occluded[i], 0);
  }
}

TEST_P(BadInput, WhatIsLeftOutChangesNothing) {
  const Mesh ball = Ball(2);
  Mesh dirty = ball;
  const uint32_t n = uint32_t(ball.positions.size());
  for (Vec3f p : {Vec3f{kNan, 0, 0}, {0, kInf, 0}, {0, 0, -kInf}, {1e30f, -1e30f, 2e18f}, {3, 3, 3}})
    dirty.positions.push_back(p);
  for (std::array<uint32_t, 3> t : {std::array{0u, 1u, n},
                                    {n + 1, 2u, 3u},
                                    {4u, n + 2, 5u},
                                    {0u, 1u, n + 5},
                                    {RAYBENCH_NONE, 0u, 1u},
                                    {0u, 0u, 1u}})
    dirty.triangles.push_back(t);
  const Scene clean = SceneOf(ball), scene = SceneOf(dirty, true);
  EXPECT_EQ(scene.stats.dropped_triangles, 5u);
  EXPECT_EQ(scene.stats.degenerate_triangles, 1u);
  EXPECT_EQ(scene.scale_exponent, 0) << "vertices of nobody have no say in the scale";
  EXPECT_EQ(scene.bounds().hi, clean.bounds().hi);
  const Tree over_clean = BuildOver(clean), over_dirty = BuildOver(scene);
  const std::vector<rb_ray> rays = NastyRays(ball, 30, 4);
  const auto a = Closest(over_clean, rays), b = Closest(over_dirty, rays);
  EXPECT_EQ(std::memcmp(a.data(), b.data(), a.size() * sizeof(rb_hit)), 0);
}

/// How deep a tree is and how many references its leaves hold.
struct Shape {
  uint32_t depth = 0;
  uint64_t references = 0;
};
Shape ShapeOf(const Tree& tree) {
  Shape shape;
  const auto look = [](void* context, const rb_node* node) {
    auto& s = *static_cast<Shape*>(context);
    s.depth = std::max(s.depth, node->depth);
    if (node->is_leaf != 0) s.references += node->prim_count;
    return 0;
  };
  tree.structure().visit(tree.get(), look, &shape);
  return shape;
}

TEST_P(BadInput, AHundredThousandCopiesOfOneTriangleStayBounded) {
  constexpr auto kCopies = uint32_t(Effort(50'000));  // of two triangles
  const Scene scene = SceneOf(Coincident(kCopies));
  const Tree tree = BuildOver(scene);
  uint64_t nodes = 0, prims = 0;
  int needs_geometry = 0;
  tree.structure().memory(tree.get(), &nodes, &prims, &needs_geometry);
  // Cells of a grid repeat what covers them all; how often does not grow with the copies.
  EXPECT_LE(nodes + prims, 1024u * scene.triangles.size());
  if (tree.structure().visit != nullptr) {
    const Shape shape = ShapeOf(tree);
    EXPECT_GE(shape.references, scene.triangles.size());
    EXPECT_LE(shape.references, 24 * scene.triangles.size());
    EXPECT_LE(shape.depth, 8 + 2 * std::log2(double(scene.triangles.size())));
  }
  std::vector<rb_ray> rays;
  for (float x : {0.125f, 0.25f, 0.5f, 0.75f})
    rays.push_back({{x, 0.375f, 2}, 0, {0.0625f, 0.03125f, -1}, kInf});
  const Asked asked = AskEveryWay(tree, rays);
  for (size_t i = 0; i < rays.size(); ++i) {
    const rb_hit& hit = asked.hits[i];
    if (tree.Claims() == RB_CLAIM_NOTHING) continue;
    ASSERT_LT(hit.prim, scene.triangles.size());
    EXPECT_EQ(asked.occluded[i], 1);
    EXPECT_TRUE(hit.prim < 2 || !Promises(tree)) << "the lowest id of those at one t wins, not " << hit.prim;
  }
}

// As far apart as two sizes can be in a scene that is not rescaled, and in one that is.
TEST_P(BadInput, HugeAndTinyTogetherAreAnswered) {
  for (float scale : {1.0f, 0x1p60f}) {
    Mesh mesh = Moved(Ball(2), 0x1p29f * scale, {0, 0, 0}, "huge_and_tiny");
    const Mesh tiny = Moved(Ball(1), 0x1p-29f * scale, {0, 0, 0}, "tiny");
    const uint32_t n = uint32_t(mesh.positions.size());
    for (Vec3f p : tiny.positions) mesh.positions.push_back(p);
    for (auto [a, b, c] : tiny.triangles) mesh.triangles.push_back({a + n, b + n, c + n});
    const Scene scene = SceneOf(mesh);
    EXPECT_EQ(scene.scale_exponent != 0, scale != 1);
    const Tree tree = BuildOver(scene);
    std::vector<rb_ray> rays;
    for (const rb_ray& ray : NastyRays({mesh.name, scene.positions, scene.triangles}, 50, 6)) {
      if (IsValidRay(ray)) rays.push_back(ray);
    }
    const Asked asked = AskEveryWay(tree, rays);
    uint64_t hits = 0;
    for (size_t i = 0; i < rays.size(); ++i) {
      const rb_hit& hit = asked.hits[i];
      hits += hit.prim != RAYBENCH_NONE;
      if (hit.prim == RAYBENCH_NONE) {
        EXPECT_EQ(hit.t, rays[i].tfar);
      } else {
        EXPECT_LT(hit.prim, scene.triangles.size());
        EXPECT_TRUE(hit.t > rays[i].tnear && hit.t <= rays[i].tfar);
      }
    }
    EXPECT_TRUE(hits > rays.size() / 2 || tree.Claims() == RB_CLAIM_NOTHING) << hits;
  }
}

INSTANTIATE_TEST_SUITE_P(Every, BadInput, ::testing::ValuesIn(Specs()),
                         [](const auto& info) { return TestName(info.param); });

}  // namespace
}  // namespace raybench::testing
