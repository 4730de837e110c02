// Truth and verdicts for procedural primitives, and scenes of all kinds of primitives through
// every structure.
#include <gtest/gtest.h>

#include "accel/host/registry.h"
#include "harness/truth/oracle.h"
#include "tests/support/effort.h"
#include "tests/support/meshes.h"
#include "tests/support/rays.h"
#include "tracer/tracer.h"

namespace raybench::testing {
namespace {

void AddPolygon(Scene& scene, const std::vector<Vec3f>& corners) {
  scene.polygons.push_back({uint32_t(scene.polygon_vertices.size()), uint32_t(corners.size())});
  for (Vec3f p : corners) {
    scene.polygon_vertices.push_back(uint32_t(scene.positions.size()));
    scene.positions.push_back(p);
  }
}

/// One ray and its truth, to be tried with answers.
struct Trial {
  const Oracle& oracle;
  rb_ray ray;
  Truth truth;

  Trial(const Oracle& o, rb_ray r) : oracle(o), ray(r), truth(o.Ask(std::span(&ray, 1), 1)[0]) {}
  std::string Hit(uint32_t prim, double t) const {
    return VerdictName(oracle.Judge(ray, truth, {float(t), 0, 0, prim}));
  }
  std::string Miss() const { return VerdictName(oracle.Judge(ray, truth, {ray.tfar, 0, 0, RAYBENCH_NONE})); }
  std::string Any(bool occluded) const { return VerdictName(oracle.JudgeAny(ray, truth, occluded)); }
};

TEST(OracleProcedural, Cones) {
  Scene scene;
  scene.provenance.source = "test";
  scene.cones = {{{0, 0, 0}, 1, {0, 0, 4}, 1}, {{0, 0, 5}, 2, {0, 0, 7}, 0}, {{9, 0, 0}, -1, {9, 0, 4}, -1}};
  scene.Finish();
  const auto oracle = MakeOracle(scene);
  EXPECT_TRUE(oracle->Exact());

  const Trial across(*oracle, MakeRay({-3, 0, 2}, {1, 0, 0}, 0, 5));
  EXPECT_EQ(across.truth.tied, std::vector<uint32_t>{0});
  EXPECT_EQ(across.truth.t, 2);
  EXPECT_EQ(across.Hit(0, 2), "exact");
  EXPECT_EQ(across.Hit(0, 2.001), "wrong");
  EXPECT_EQ(across.Hit(0, 4), "wrong") << "the far side";
  EXPECT_EQ(across.Hit(1, 2), "wrong");
  EXPECT_EQ(across.Miss(), "false_miss");
  EXPECT_EQ(across.Any(false), "false_miss");

  const Trial inside(*oracle, MakeRay({0, 0, 6}, {1, 0, 0}));
  EXPECT_EQ(inside.truth.t, 1);
  const Trial apex(*oracle, MakeRay({-5, 0, 7}, {1, 0, 0}, 0, 9));
  EXPECT_TRUE(apex.truth.hit);
  EXPECT_EQ(apex.Miss(), "false_miss_marginal");
  const Trial above(*oracle, MakeRay({-5, 0, 7.001f}, {1, 0, 0}));
  EXPECT_FALSE(above.truth.hit);
  EXPECT_EQ(above.Hit(1, 5), "false_hit");
  EXPECT_EQ(above.Any(true), "false_hit");

  const Trial rim(*oracle, MakeRay({-3, 0, 4}, {1, 0, 0}, 0, 9));
  EXPECT_EQ(rim.truth.t, 2);
  EXPECT_EQ(rim.Miss(), "false_miss_marginal");
  const Trial beside_rim(*oracle, MakeRay({-3, 0, std::nextafter(4.0f, 5.0f)}, {1, 0, 0}, 0, 9));
  EXPECT_FALSE(beside_rim.truth.hit);
  EXPECT_EQ(beside_rim.Hit(0, 2), "false_hit_marginal");
  EXPECT_EQ(beside_rim.Hit(0, 3), "false_hit");
  const Trial tangent(*oracle, MakeRay({-3, 1, 2}, {1, 0, 0}, 0, 9));
  EXPECT_EQ(tangent.truth.t, 3);
  EXPECT_EQ(tangent.Miss(), "false_miss_marginal");
  EXPECT_EQ(tangent.Hit(0, 3), "exact");
  const Trial through_ends(*oracle, MakeRay({0.5f, 0, -1}, {0, 0, 1}, 0, 5));
  EXPECT_EQ(through_ends.Miss(), "exact");

  const Trial inside_only(*oracle, MakeRay({20, 0, 2}, {-1, 0, 0}, 0, 13));
  EXPECT_EQ(inside_only.truth.t, 12) << "in unseen at 10, out at 12";
  EXPECT_EQ(inside_only.Hit(2, 12), "exact");
  EXPECT_EQ(inside_only.Hit(2, 10), "wrong");
}

TEST(OracleProcedural, Polygons) {
  Scene scene;
  scene.provenance.source = "test";
  // A U, and a square behind it.
  AddPolygon(scene, {{0, 0, 0}, {3, 0, 0}, {3, 3, 0}, {2, 3, 0}, {2, 1, 0}, {1, 1, 0}, {1, 3, 0}, {0, 3, 0}});
  AddPolygon(scene, {{-9, -9, -2}, {9, -9, -2}, {9, 9, -2}, {-9, 9, -2}});
  scene.Finish();
  const auto oracle = MakeOracle(scene);
  const auto down = [](float x, float y) { return MakeRay({x, y, 4}, {0, 0, -2}, 0, 5); };
  const Trial arm(*oracle, down(0.5f, 2)), gap(*oracle, down(1.5f, 2)), edge(*oracle, down(1, 2)),
      beside(*oracle, MakeRay({4, 2, 4}, {std::nextafter(-1.5f, 0.0f), 0, -2}, 0, 5));
  EXPECT_EQ(arm.truth.tied, std::vector<uint32_t>{0});
  EXPECT_EQ(arm.truth.t, 2);
  EXPECT_EQ(arm.Hit(0, 2), "exact");
  EXPECT_EQ(arm.Hit(1, 3), "wrong");
  EXPECT_EQ(arm.Miss(), "false_miss");
  EXPECT_EQ(gap.truth.tied, std::vector<uint32_t>{1});
  EXPECT_EQ(gap.Hit(0, 2), "wrong");
  EXPECT_EQ(edge.truth.feature, Feature::kEdge);
  EXPECT_EQ(edge.Hit(1, 3), "wrong_marginal");
  EXPECT_EQ(edge.Any(false), "false_miss") << "the square behind is missed as well";
  EXPECT_EQ(beside.truth.tied, std::vector<uint32_t>{1});
  EXPECT_EQ(beside.Hit(0, 2), "wrong_marginal");
  // In the plane either is right.
  const Trial in_plane(*oracle, MakeRay({-1, 0.5f, 0}, {1, 0, 0}));
  EXPECT_EQ(in_plane.Miss(), "exact");
  EXPECT_EQ(in_plane.Hit(0, 1), "exact");
  EXPECT_EQ(in_plane.Hit(0, 9), "wrong" == in_plane.Hit(0, 9) ? "wrong" : "false_hit");
}

/// Triangles, spheres, cones and polygons, some seen from inside only, through each other in a ball of radius
/// 2 around `center`, all `size` times as large.
Scene MixedScene(uint64_t seed, double size, Vec3d center) {
  Random random(seed);
  Scene scene;
  scene.name = scene.provenance.source = "mixed";
  const auto point = [&](double reach) {
    return ToFloat(center + random.UnitVector() * (reach * size * random.NextDouble()));
  };
  const auto radius = [&](double r) { return float((0.1 + r * random.NextDouble()) * size); };
  for (uint32_t i = 0; i < 60; ++i) {
    const Vec3f a = point(2);
    const uint32_t first = uint32_t(scene.positions.size());
    scene.positions.insert(scene.positions.end(), {a, point(2), point(2)});
    scene.triangles.push_back({first, first + 1, first + 2});
  }
  for (int i = 0; i < 40; ++i) scene.spheres.push_back({point(2), radius(0.4) * (i % 5 ? 1.0f : -1.0f)});
  for (int i = 0; i < 40; ++i) {
    const float sign = i % 5 ? 1.0f : -1.0f, r = radius(0.4);
    scene.cones.push_back({point(2), r * sign, point(2),
                           i % 3 == 0   ? 0
                           : i % 3 == 1 ? r * sign
                                        : radius(0.2) * sign});
  }
  for (int i = 0; i < 40; ++i) {
    const Vec3d u = random.UnitVector(), w = Normalize(Cross(u, random.UnitVector())), v = Cross(w, u);
    const Vec3d at = center + random.UnitVector() * (2 * size * random.NextDouble());
    const int n = 4 + int(random.Below(30));
    std::vector<Vec3f> corners;
    for (int k = 0; k < n; ++k) {
      const double s = 4.0 * k / n, side = std::floor(s), f = 2 * (s - side) - 1;
      const Vec3d p = side == 0 ? u + v * f : side == 1 ? v - u * f : side == 2 ? -u - v * f : -v + u * f;
      corners.push_back(ToFloat(at + p * ((0.1 + random.NextDouble()) * size)));
    }
    AddPolygon(scene, corners);
  }
  scene.Finish();
  return scene;
}

/// At random, along axes with +-0, from points of surfaces, at corners, at rims and apexes.
std::vector<rb_ray> RaysAt(const Scene& scene, double size, Vec3d center, uint64_t count, uint64_t seed) {
  std::vector<rb_ray> rays;
  for (uint64_t i = 0; i < count; ++i) {
    Random random(seed, i);
    const auto point = [&](double reach) {
      return center + random.UnitVector() * (reach * size * random.NextDouble());
    };
    Vec3f org = ToFloat(point(i % 7 == 0 ? 200 : 5)), target = ToFloat(point(2));
    if (i % 5 == 1) target = scene.positions[random.Below(scene.positions.size())];
    if (i % 5 == 2) {
      const Cone& c = scene.cones[random.Below(scene.cones.size())];
      const Vec3d base = ToDouble(c.base), axis = ToDouble(c.apex) - base;
      const Vec3d across = Normalize(Cross(axis, random.UnitVector()));
      const double s = random.Below(3) / 2.0;  // a rim, the middle, the other rim
      target = ToFloat(base + axis * s + across * (c.base_radius + s * (c.apex_radius - c.base_radius)));
    }
    if (i % 5 == 3) {
      const Sphere& s = scene.spheres[random.Below(scene.spheres.size())];
      org = ToFloat(ToDouble(s.center) + random.UnitVector() * double(s.radius));  // starts on it
    }
    rb_ray ray = MakeRay(org, target - org);
    if (i % 11 == 4) {
      const int axis = int(random.Below(3));
      for (int k = 0; k < 3; ++k) ray.dir[k] = k == axis ? 1.0f : random.Below(2) ? 0.0f : -0.0f;
      org = target, org[axis] -= float(4 * size);
      for (int k = 0; k < 3; ++k) ray.org[k] = org[k];
    }
    if (i % 13 == 6) ray.tfar = random.NextFloat();
    if (IsValidRay(ray)) rays.push_back(ray);
  }
  return rays;
}

class Mixed : public ::testing::TestWithParam<std::tuple<double, double>> {};

TEST_P(Mixed, EveryStructureKeepsItsClaimAndAgreesWithBrute) {
  const auto [size, distance] = GetParam();
  const Vec3d center = Vec3d{0.6, -0.48, 0.64} * (size * distance);
  const Scene scene = MixedScene(61, size, center);
  ASSERT_EQ(scene.cones.size(), 40u);
  ASSERT_GT(scene.polygons.size(), 30u);
  const auto rays = RaysAt(scene, size, center, Effort(6000), 62);
  const auto oracle = MakeOracle(scene);
  const auto truth = oracle->Ask(rays, 0);
  uint64_t hits_of[4] = {}, missed = 0;
  for (const Truth& t : truth) t.hit ? ++hits_of[size_t(scene.Locate(t.tied[0]).kind)] : ++missed;
  if (distance < 1e5) {
    for (uint64_t n : hits_of) EXPECT_GT(n, Effort(100));
  }
  EXPECT_GT(missed, Effort(100));

  const auto expected = Closest(Build("brute", scene.Geometry()), rays);
  const Registry registry;
  for (const rb_structure* structure : registry.structures()) {
    if ((structure->capabilities & RB_CAN_PROCEDURAL) == 0) continue;
    const Tree tree = Build(structure->name, scene.Geometry());
    const auto hits = Closest(tree, rays);
    const auto occluded = Occluded(tree, rays);
    const VerdictCounts closest = JudgeAll(*oracle, RB_CLOSEST, rays, truth, hits, {}, 0);
    const VerdictCounts any = JudgeAll(*oracle, RB_ANY, rays, truth, {}, occluded, 0);
    for (const VerdictCounts* counts : {&closest, &any})
      EXPECT_FALSE(BreaksClaim(tree.Claims(), *counts))
          << structure->name << ": leaks " << counts->leaks() << ", plain errors " << counts->plain_errors();
    if (tree.Claims() == RB_CLAIM_NOTHING) continue;
    for (size_t i = 0; i < rays.size() && tree.Claims() == RB_CLAIM_WATERTIGHT; ++i) {
      const Verdict verdict = oracle->Judge(rays[i], truth[i], hits[i]);
      const bool is_plain = verdict == Verdict::kWrong || verdict == Verdict::kFalseMiss ||
                            verdict == Verdict::kFalseHit || verdict == Verdict::kLeak;
      const auto kind = [&](uint32_t prim) {
        return prim == RAYBENCH_NONE ? -1 : int(scene.Locate(prim).kind);
      };
      EXPECT_FALSE(is_plain) << structure->name << " ray " << i << ": " << VerdictName(verdict) << ", prim "
                             << hits[i].prim << " of kind " << kind(hits[i].prim) << " at " << hits[i].t
                             << "; truth " << (truth[i].hit ? truth[i].tied[0] : RAYBENCH_NONE) << " of kind "
                             << kind(truth[i].hit ? truth[i].tied[0] : RAYBENCH_NONE) << " at " << truth[i].t;
    }
    EXPECT_LE(closest.leaks() + closest.plain_errors(), rays.size() / 10) << structure->name;
    if (tree.Claims() != RB_CLAIM_WATERTIGHT) continue;
    // Marginal answers are for where float arithmetic cannot tell, so few.
    if (distance < 1e3) {
      EXPECT_GT(closest[Verdict::kExact] + closest[Verdict::kTie] + closest[Verdict::kNeighbour],
                rays.size() * 97 / 100)
          << structure->name;
    }
    for (size_t i = 0; i < rays.size(); ++i) {
      ASSERT_EQ(hits[i].prim, expected[i].prim) << structure->name << " ray " << i;
      ASSERT_EQ(hits[i].t, expected[i].t) << structure->name << " ray " << i;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(ScalesAndDistances, Mixed,
                         ::testing::Values(std::tuple(1.0, 0.0), std::tuple(1.0, 1e3), std::tuple(1.0, 1e6),
                                           std::tuple(1e-6, 0.0), std::tuple(1e6, 10.0)));

}  // namespace
}  // namespace raybench::testing
