// Verdicts on hand-made answers of every class, and on real ones.
#include <gtest/gtest.h>

#include "accel/host/registry.h"
#include "harness/rays/from_inside.h"
#include "harness/truth/oracle.h"
#include "tests/support/effort.h"
#include "tests/support/oracle_scenes.h"

namespace raybench {
namespace {

using namespace testing;

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

/// Both oracles judge by the same rules.
class VerdictTest : public ::testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    if (std::string(GetParam()) == "cgal" && !MakeCgalOracle(MakeLatticeBox(1)))
      GTEST_SKIP() << "built without CGAL";
  }
  std::unique_ptr<Oracle> Make(const Scene& scene) const {
    return std::string(GetParam()) == "cgal" ? MakeCgalOracle(scene) : MakeBoxOracle(scene);
  }
};
INSTANTIATE_TEST_SUITE_P(Oracles, VerdictTest, ::testing::Values("cgal", "boxes"),
                         [](const auto& info) { return std::string(info.param); });

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
  uint32_t prim() const { return truth.tied.at(0); }
};

/// The unit square at x = 1 in two triangles that meet at y == z, and a larger one behind it at x = 2.
Scene TwoSquares() {
  return MakeScene(
      {{1, 0, 0}, {1, 1, 0}, {1, 1, 1}, {1, 0, 1}, {2, -9, -9}, {2, 9, -9}, {2, 9, 9}, {2, -9, 9}},
      {{0, 1, 2}, {0, 2, 3}, {4, 5, 6}, {4, 6, 7}});
}

TEST_P(VerdictTest, ExactAndTie) {
  const Scene scene = TwoSquares();
  const auto oracle = Make(scene);
  const Trial inside(*oracle, MakeRay({0, 0.5f, 0.25f}, {1, 0, 0})),
      edge(*oracle, MakeRay({0, 0.5f, 0.5f}, {1, 0, 0}));
  EXPECT_EQ(inside.Hit(0, 1), "exact");
  EXPECT_EQ(inside.Hit(0, 1 + 4e-7), "exact");
  EXPECT_EQ(inside.Hit(0, 1.001), "wrong");
  EXPECT_EQ(inside.Hit(1, 1), "wrong");
  EXPECT_EQ(inside.Any(true), "exact");
  EXPECT_EQ(edge.truth.tied, (std::vector<uint32_t>{0, 1}));
  EXPECT_EQ(edge.truth.feature, Feature::kEdge);
  EXPECT_EQ(edge.Hit(0, 1), "exact");
  EXPECT_EQ(edge.Hit(1, 1), "tie");
  const Trial nothing(*oracle, MakeRay({0, 0.5f, 0.5f}, {-1, 0, 0}));
  EXPECT_EQ(nothing.Miss(), "exact");
  EXPECT_EQ(nothing.Any(false), "exact");
}

TEST_P(VerdictTest, NeighbourOnlyWithinTheBound) {
  const Scene scene = TwoSquares();
  const auto oracle = Make(scene);
  const Trial near(*oracle, MakeRay({0, 0.5f, 0.5f}, {1, 1e-9f, 0})),
      clear(*oracle, MakeRay({0, 0.5f, 0.5f}, {1, 1e-5f, 0}));
  EXPECT_EQ(near.truth.tied, std::vector<uint32_t>{0});
  EXPECT_EQ(near.Hit(1, 1), "neighbour");
  EXPECT_EQ(near.Hit(1, 1.0001), "wrong");
  EXPECT_EQ(clear.Hit(1, 1), "wrong");
}

TEST_P(VerdictTest, LeakAtAnInteriorEdge) {
  const Scene scene = TwoSquares();
  const auto oracle = Make(scene);
  for (const float off : {0.0f, 1e-9f, -1e-9f}) {
    const Trial edge(*oracle, MakeRay({0, 0.25f, 0.25f}, {1, off, 0}));
    EXPECT_EQ(edge.Miss(), "leak");
    EXPECT_EQ(edge.Any(false), "leak");
    for (uint32_t behind : {2, 3}) EXPECT_EQ(edge.Hit(behind, 2), "leak") << off;
  }
  const Trial interior(*oracle, MakeRay({0, 0.5f, 0.25f}, {1, 0, 0}));
  EXPECT_EQ(interior.Miss(), "false_miss");
  EXPECT_EQ(interior.Any(false), "false_miss");
  EXPECT_EQ(interior.Hit(2, 2), "wrong");
}

TEST_P(VerdictTest, MarginalAtABoundaryEdge) {
  const float below = std::nextafter(0.5f, 0.0f);
  const Scene scene = TwoSquares();
  const auto oracle = Make(scene);
  const Trial edge(*oracle, MakeRay({0, 0.5f, 0}, {1, 0, 0})), corner(*oracle, MakeRay({0, 1, 0}, {1, 0, 0})),
      outside(*oracle, MakeRay({0, 0.5f, -0.5f}, {1, 0, below})),
      clear(*oracle, MakeRay({0, 0.5f, -0.5f}, {1, 0, 0.49999f}));
  for (const Trial* trial : {&edge, &corner}) {
    EXPECT_EQ(trial->Hit(0, 1), "exact");
    EXPECT_EQ(trial->Hit(2, 2), "wrong_marginal");
    // Missing both squares is more than the boundary excuses: the one behind is met in its interior.
    EXPECT_EQ(trial->Miss(), "false_miss");
  }
  EXPECT_EQ(outside.prim(), 2u);
  EXPECT_EQ(outside.Hit(0, 1), "wrong_marginal");
  EXPECT_EQ(clear.Hit(0, 1), "wrong");
  const Scene alone = MakeScene({{1, 0, 0}, {1, 1, 0}, {1, 1, 1}}, {{0, 1, 2}});
  const auto other = Make(alone);
  const Trial last(*other, MakeRay({0, 0.5f, 0}, {1, 0, 0}));
  EXPECT_EQ(last.Miss(), "false_miss_marginal");
  EXPECT_EQ(last.Any(false), "false_miss_marginal");
  const Trial past(*other, MakeRay({0, 0.5f, -0.5f}, {1, 0, below}));
  EXPECT_EQ(past.Miss(), "exact");
  EXPECT_EQ(past.Hit(0, 1), "false_hit_marginal");
  EXPECT_EQ(past.Any(true), "false_hit_marginal");
  const Trial far(*other, MakeRay({0, 0.5f, -0.5f}, {1, 0, 0.49999f}));
  EXPECT_EQ(far.Hit(0, 1), "false_hit");
  EXPECT_EQ(far.Any(true), "false_hit");
}

TEST_P(VerdictTest, MarginalAtASilhouetteOfAClosedMesh) {
  const Scene scene = MakeLatticeBox(1);
  const auto oracle = Make(scene);
  // (1, -1, 0) touches the cube at the edge x == y == 0 only.
  const Trial touch(*oracle, MakeRay({-1, 1, 0.3f}, {1, -1, 0}));
  EXPECT_EQ(touch.truth.feature, Feature::kEdge);
  EXPECT_EQ(touch.Miss(), "false_miss_marginal");
  const Trial past(*oracle, MakeRay({-1, std::nextafter(1.0f, 0.0f), 0.3f}, {1, -1, 0}));
  EXPECT_FALSE(past.truth.hit);
  EXPECT_EQ(past.Hit(touch.prim(), 1), "false_hit_marginal");
  EXPECT_EQ(past.Any(true), "false_hit_marginal");
  const Trial clear(*oracle, MakeRay({-1, 0.999f, 0.3f}, {1, -1, 0}));
  EXPECT_EQ(clear.Hit(touch.prim(), 1), "false_hit");
  EXPECT_EQ(clear.Any(true), "false_hit");
}

TEST_P(VerdictTest, LeakAtEdgesAndVerticesOfClosedMeshes) {
  // Vertices of the box are not shared between its faces; copies and flipped triangles must not hide a
  // leak either.
  Scene flipped = MakeIcosphere(2);
  std::vector<std::array<uint32_t, 3>> triangles = flipped.triangles;
  for (size_t i = 0; i < triangles.size(); i += 3) std::swap(triangles[i][0], triangles[i][1]);
  const Scene scenes[] = {MakeLatticeBox(2), MakeLatticeBox(2, {0, 0, 0}, 1, 3), MakeIcosphere(2),
                          MakeScene(flipped.positions, triangles)};
  for (const Scene& scene : scenes) {
    const auto oracle = Make(scene);
    const RaySet set = AimedRays(scene, 300, 5);
    for (const rb_ray& ray : set.rays) {
      const Trial trial(*oracle, ray);
      ASSERT_EQ(trial.Miss(), "leak");
      ASSERT_EQ(trial.Any(false), "leak");
    }
  }
}

TEST_P(VerdictTest, MarginalAtTheEndsOfTheInterval) {
  const Scene scene = TwoSquares();
  const auto oracle = Make(scene);
  const Vec3f org{0, 0.5f, 0.25f}, dir{1, 0, 0};
  const float below = std::nextafter(1.0f, 0.0f), above = std::nextafter(1.0f, 2.0f);
  EXPECT_EQ(Trial(*oracle, MakeRay(org, dir, 0, 1)).Hit(0, 1), "exact");
  EXPECT_EQ(Trial(*oracle, MakeRay(org, dir, 0, 1)).Miss(), "false_miss_marginal");
  EXPECT_EQ(Trial(*oracle, MakeRay(org, dir, 0, 1.1f)).Miss(), "false_miss");
  EXPECT_EQ(Trial(*oracle, MakeRay(org, dir, 0, below)).Miss(), "exact");
  EXPECT_EQ(Trial(*oracle, MakeRay(org, dir, 0, below)).Hit(0, below), "false_hit_marginal");
  EXPECT_EQ(Trial(*oracle, MakeRay(org, dir, 0, below)).Any(true), "false_hit_marginal");
  EXPECT_EQ(Trial(*oracle, MakeRay(org, dir, 0, 0.9f)).Hit(0, 0.9), "false_hit");
  EXPECT_EQ(Trial(*oracle, MakeRay(org, dir, 0, 0.9f)).Any(true), "false_hit");
  EXPECT_EQ(Trial(*oracle, MakeRay(org, dir, 1)).prim(), 2u);
  EXPECT_EQ(Trial(*oracle, MakeRay(org, dir, 1)).Hit(0, above), "wrong_marginal");
  EXPECT_EQ(Trial(*oracle, MakeRay(org, dir, below)).Hit(2, 2), "wrong_marginal");
  EXPECT_EQ(Trial(*oracle, MakeRay(org, dir, 0.9f)).Hit(2, 2), "wrong");
}

TEST_P(VerdictTest, MalformedAnswersArePlain) {
  const Scene scene = TwoSquares();
  const auto oracle = Make(scene);
  const Trial hit(*oracle, MakeRay({0, 0.5f, 0.25f}, {1, 0, 0})),
      nothing(*oracle, MakeRay({0, 0.5f, 0.25f}, {-1, 0, 0}, 0, 7));
  EXPECT_EQ(hit.Hit(0, kNaN), "wrong");
  EXPECT_EQ(hit.Hit(0, kInf), "wrong");
  EXPECT_EQ(hit.Hit(0, 0), "wrong");
  EXPECT_EQ(hit.Hit(4, 1), "wrong");
  EXPECT_EQ(hit.Hit(RAYBENCH_NONE, 1), "false_miss");
  EXPECT_EQ(nothing.Hit(0, kNaN), "false_hit");
  EXPECT_EQ(nothing.Hit(99, 1), "false_hit");
  EXPECT_EQ(nothing.Hit(0, 1), "false_hit");
  EXPECT_EQ(nothing.Hit(RAYBENCH_NONE, 6), "false_hit");
  EXPECT_EQ(nothing.Miss(), "exact");
}

TEST_P(VerdictTest, InThePlaneEitherIsRight) {
  const Scene scene = MakeScene({{0, 0, 0}, {2, 0, 0}, {0, 2, 0}}, {{0, 1, 2}});
  const auto oracle = Make(scene);
  const Trial trial(*oracle, MakeRay({-1, 0.5f, 0}, {1, 0, 0}));  // inside from t = 1 to 2.5
  EXPECT_TRUE(trial.truth.coplanar);
  EXPECT_FALSE(trial.truth.hit);
  EXPECT_EQ(trial.Miss(), "exact");
  for (double t : {1.0, 1.7, 2.5}) EXPECT_EQ(trial.Hit(0, t), "exact") << t;
  for (double t : {0.9, 3.1}) EXPECT_EQ(trial.Hit(0, t), "false_hit") << t;
  EXPECT_EQ(trial.Any(true), "exact");
  EXPECT_EQ(trial.Any(false), "exact");
  EXPECT_FALSE(Trial(*oracle, MakeRay({-1, 0.5f, 0}, {1, 0, 0}, 2.5f)).truth.coplanar);
  EXPECT_TRUE(Trial(*oracle, MakeRay({-1, 0.5f, 0}, {1, 0, 0}, 0, 1)).truth.coplanar);
  EXPECT_FALSE(Trial(*oracle, MakeRay({-1, 0.5f, 0}, {1, 0, 0}, 0, 0.99f)).truth.coplanar);
  EXPECT_FALSE(Trial(*oracle, MakeRay({-1, 2.5f, 0}, {1, 0, 0})).truth.coplanar);
}

TEST_P(VerdictTest, GapsBelowTheArithmeticAreMarginal) {
  for (const bool thin : {true, false}) {
    const float back = thin ? std::nextafter(1.0f, 2.0f) : 1.001f;
    const Scene scene = MakeScene({{1, 0, 0}, {1, 1, 0}, {1, 0, 1}, {back, 0, 0}, {back, 1, 0}, {back, 0, 1}},
                                  {{0, 1, 2}, {3, 4, 5}});
    const auto oracle = Make(scene);
    const Trial trial(*oracle, MakeRay({0, 0.2f, 0.3f}, {1, 0, 0}));
    EXPECT_EQ(trial.truth.tied, std::vector<uint32_t>{0});
    EXPECT_EQ(trial.Hit(1, back), thin ? "wrong_marginal" : "wrong");
  }
}

TEST_P(VerdictTest, StrictIsToTheBit) {
  const Scene scene = TwoSquares();
  const auto oracle = Make(scene);
  const auto strict = [&](const Trial& t, uint32_t prim, float at) {
    return oracle->IsStrict(t.ray, t.truth, {at, 0, 0, prim});
  };
  const float below = std::nextafter(1.0f, 0.0f), above = std::nextafter(1.0f, 2.0f);
  const Trial edge(*oracle, MakeRay({0, 0.5f, 0.5f}, {1, 0, 0}));
  EXPECT_TRUE(strict(edge, 0, 1));
  EXPECT_FALSE(strict(edge, 1, 1));
  EXPECT_FALSE(strict(edge, 0, above));
  EXPECT_FALSE(strict(edge, 0, below));
  EXPECT_FALSE(strict(edge, RAYBENCH_NONE, kInf));
  const Trial nothing(*oracle, MakeRay({0, 0.5f, 0.5f}, {-1, 0, 0}, 0, 7));
  EXPECT_TRUE(strict(nothing, RAYBENCH_NONE, 7));
  EXPECT_FALSE(strict(nothing, RAYBENCH_NONE, 6));
  EXPECT_FALSE(strict(nothing, 0, 1));

  // In its plane a triangle may be answered or not, but never behind the truth.
  const Scene corner =
      MakeScene({{0, 0, 0}, {2, 0, 0}, {0, 2, 0}, {1, 0, -1}, {1, 4, -1}, {1, 0, 1}}, {{0, 1, 2}, {3, 4, 5}});
  const auto other = Make(corner);
  const Trial plane(*other, MakeRay({-1, 0.5f, 0}, {1, 0, 0}));
  ASSERT_EQ(plane.truth.tied, std::vector<uint32_t>{1});
  EXPECT_EQ(plane.Hit(1, 2), "exact");
  EXPECT_EQ(plane.Hit(0, 1), "exact");
  for (const auto& [prim, t, right] : {std::tuple{1u, 2.0f, true}, {0u, 1.0f, true}, {0u, 2.4f, false}})
    EXPECT_EQ(other->IsStrict(plane.ray, plane.truth, {t, 0, 0, prim}), right) << prim << ' ' << t;
  EXPECT_FALSE(other->IsStrict(plane.ray, plane.truth, {kInf, 0, 0, RAYBENCH_NONE}));
}

TEST_P(VerdictTest, RoundedToFloatTheLowestIdIsFirst) {
  // From far away, t of both squares rounds to one float; the nearer one has the higher id.
  const float gap = 0x1p-8f;
  const Scene scene = MakeScene({{gap, 0, 0}, {gap, 1, 0}, {gap, 1, 1}, {0, 0, 0}, {0, 1, 0}, {0, 1, 1}},
                                {{0, 1, 2}, {3, 4, 5}});
  const auto oracle = Make(scene);
  const Trial far(*oracle, MakeRay({-0x1p20f, 0.5f, 0.25f}, {1, 0, 0}));
  EXPECT_EQ(far.truth.tied, std::vector<uint32_t>{1});
  EXPECT_EQ(far.truth.first, 0u);
  EXPECT_EQ(far.truth.t_rounded, 0x1p20f);
  EXPECT_TRUE(oracle->IsStrict(far.ray, far.truth, {0x1p20f, 0, 0, 0}));
  EXPECT_FALSE(oracle->IsStrict(far.ray, far.truth, {0x1p20f, 0, 0, 1}));
  EXPECT_EQ(far.Hit(0, 0x1p20f), "exact");
  EXPECT_EQ(far.Hit(1, 0x1p20f), "exact");
  // Just behind tnear: t itself rounds to what no answer may say.
  const float behind = std::nextafter(0x1p20f, kInf);
  const Trial start(*oracle, MakeRay({-0x1p20f, 0.5f, 0.25f}, {1, 0, 0}, 0x1p20f));
  EXPECT_EQ(start.truth.tied, std::vector<uint32_t>{0});
  EXPECT_EQ(start.truth.t_rounded, behind);
  EXPECT_EQ(start.Hit(0, behind), "exact");
  EXPECT_FALSE(oracle->IsStrict(start.ray, start.truth, {0x1p20f, 0, 0, 0}));
}

/// A square at x = 1 in two triangles that meet at y == z, and behind that edge what `extra` has.
Scene SquareAnd(std::vector<Vec3f> positions, std::vector<std::array<uint32_t, 3>> extra) {
  std::vector<Vec3f> p = {{1, 0, 0}, {1, 1, 0}, {1, 1, 1}, {1, 0, 1}};
  p.insert(p.end(), positions.begin(), positions.end());
  extra.insert(extra.begin(), {{0, 1, 2}, {0, 2, 3}});
  return MakeScene(std::move(p), std::move(extra));
}

TEST_P(VerdictTest, SteepTrianglesBehindExcuseNothing) {
  // Triangle 2 hangs along the ray, so that its t may be anything from 1 to 20: a fin at the square's
  // diagonal, or apart from the square. Both are plausible answers, and neither can be seen without a leak.
  const Scene fin = SquareAnd({{20, 0.5f, 0.5f}}, {{0, 2, 4}}),
              apart = SquareAnd({{2, 0.4f, 0.4f}, {2, 0.6f, 0.6f}, {20, 0.5f, 0.5f}}, {{4, 5, 6}});
  for (const Scene* scene : {&fin, &apart}) {
    const auto oracle = Make(*scene);
    const Trial edge(*oracle, MakeRay({0, 0.5f, 0.5f}, {1, 1e-9f, 0}));
    EXPECT_EQ(edge.truth.tied, std::vector<uint32_t>{0});
    EXPECT_EQ(edge.Hit(1, 1), "neighbour");
    for (double t : {1.0001, 3.0, 15.0})
      EXPECT_EQ(edge.Hit(2, t), scene == &fin || t > 2 ? "leak" : "wrong") << t;
  }
  // Clear of the square's edges.
  const Scene beside = SquareAnd({{2, 0.4f, 0.1f}, {2, 0.6f, 0.3f}, {20, 0.5f, 0.2f}}, {{4, 5, 6}});
  const auto oracle = Make(beside);
  EXPECT_EQ(Trial(*oracle, MakeRay({0, 0.5f, 0.2f}, {1, 1e-9f, 0})).Hit(2, 3), "wrong");
}

TEST_P(VerdictTest, TheStepBelowMayBeAnsweredAtTheEdgeOfATread) {
  // Tread at x = 1 for y > z, riser down to x = 3, the step below for y < z.
  const Scene stairs = MakeScene({{1, 0, 0}, {1, 1, 0}, {1, 1, 1}, {3, 0, 0}, {3, 1, 1}, {3, 0, 1}},
                                 {{0, 1, 2}, {0, 2, 4}, {0, 4, 3}, {3, 4, 5}});
  const auto oracle = Make(stairs);
  const Trial edge(*oracle, MakeRay({0, 0.5f, 0.5f}, {1, 1e-9f, 0}));
  EXPECT_EQ(edge.truth.tied, std::vector<uint32_t>{0});
  EXPECT_EQ(edge.Hit(3, 3), "wrong_marginal");
  EXPECT_EQ(edge.Hit(1, 1.5), "neighbour");
  EXPECT_EQ(edge.Miss(), "leak");
  // The same with the step out of reach.
  rb_ray until = edge.ray;
  until.tfar = 2;
  EXPECT_EQ(Trial(*oracle, until).Miss(), "false_miss_marginal");
  EXPECT_EQ(Trial(*oracle, MakeRay({0, 0.5f, 0.4f}, {1, 0, 0})).Hit(3, 3), "wrong");
}

TEST_P(VerdictTest, CountsPercentilesAndRefusesOddSizes) {
  const Scene scene = TwoSquares();
  const auto oracle = Make(scene);
  std::vector<rb_ray> rays(100, MakeRay({0, 0.5f, 0.25f}, {1, 0, 0}));
  std::vector<rb_hit> hits(100, rb_hit{1, 0, 0, 0});
  hits[0].t += 0x1p-23f, hits[1].t += 0x1p-22f, hits[2] = {kInf, 0, 0, RAYBENCH_NONE}, hits[3] = {2, 0, 0, 2};
  hits[4].t = 1.5f;  // wrong, but the primitive is right: its t counts
  const auto truth = oracle->Ask(rays, 1);
  const VerdictCounts counts = JudgeAll(*oracle, RB_CLOSEST, rays, truth, hits, {}, 2);
  EXPECT_EQ(counts.rays, 100u);
  EXPECT_EQ(counts[Verdict::kExact], 97u);
  EXPECT_EQ(counts[Verdict::kFalseMiss], 1u);
  EXPECT_EQ(counts[Verdict::kWrong], 2u);
  EXPECT_EQ(counts.strict, 95u);
  EXPECT_EQ(counts.plain_errors(), 3u);
  EXPECT_EQ(counts.t_error_p50, 0);
  EXPECT_EQ(counts.t_error_p99, 0x1p22);  // nearest rank of 98: the last but none
  EXPECT_EQ(counts.t_error_max, 0x1p22);
  const std::vector<uint8_t> occluded(100, 1);
  const VerdictCounts any = JudgeAll(*oracle, RB_ANY, rays, truth, {}, occluded, 1);
  EXPECT_EQ(any[Verdict::kExact], 100u);
  EXPECT_EQ(any.strict, 100u);
  EXPECT_THROW(JudgeAll(*oracle, RB_ANY, rays, truth, hits, {}, 1), InputError);
}

TEST(Verdicts, BreaksClaim) {
  const auto counts = [](Verdict verdict) {
    VerdictCounts c;
    c.rays = 5, c.by_class[size_t(Verdict::kExact)] = 4, c.by_class[size_t(verdict)] += 1;
    c.strict = c[Verdict::kExact];
    return c;
  };
  for (int i = 0; i < int(Verdict::kCount); ++i) {
    const Verdict v = Verdict(i);
    const bool plain =
        v == Verdict::kLeak || v == Verdict::kWrong || v == Verdict::kFalseMiss || v == Verdict::kFalseHit;
    EXPECT_EQ(BreaksClaim(RB_CLAIM_EXACT, counts(v)), v != Verdict::kExact) << VerdictName(v);
    EXPECT_EQ(BreaksClaim(RB_CLAIM_WATERTIGHT, counts(v)), plain) << VerdictName(v);
    EXPECT_FALSE(BreaksClaim(RB_CLAIM_INEXACT, counts(v)));
    EXPECT_FALSE(BreaksClaim(RB_CLAIM_NOTHING, counts(v)));
  }
  VerdictCounts close = counts(Verdict::kExact);
  close.strict = 4;
  EXPECT_TRUE(BreaksClaim(RB_CLAIM_EXACT, close));
  EXPECT_FALSE(BreaksClaim(RB_CLAIM_WATERTIGHT, close));
}

VerdictCounts JudgeStructure(const Scene& scene, const Oracle& oracle, std::span<const rb_ray> rays,
                             const char* spec, uint32_t kind) {
  const Registry registry;
  const rb_geometry geometry = scene.Geometry();
  const Tree tree(ParseContestant(registry, spec), geometry, DefaultBuildOptions());
  std::vector<rb_hit> hits(rays.size());
  std::vector<uint8_t> occluded(rays.size());
  rb_query query{};
  query.struct_size = sizeof query, query.kind = kind, query.n = rays.size(), query.rays = rays.data();
  query.hits = hits.data(), query.occluded = occluded.data();
  tree.Query(query);
  return JudgeAll(oracle, kind, rays, oracle.Ask(rays, 2), hits, occluded, 2);
}

TEST(Verdicts, AimedRaysShowTheLeaksOfFastAndNoneOfWatertight) {
  const Scene scene = MakeIcosphere(2);
  const auto oracle = MakeOracle(scene);
  const RaySet set = AimedRays(scene, Effort(20000), 1);
  for (const uint32_t kind : {uint32_t(RB_CLOSEST), uint32_t(RB_ANY)}) {
    const VerdictCounts watertight =
        JudgeStructure(scene, *oracle, set.rays, "brute(numerics=watertight)", kind);
    EXPECT_EQ(watertight.leaks(), 0u);
    EXPECT_EQ(watertight.plain_errors(), 0u);
    EXPECT_GT(JudgeStructure(scene, *oracle, set.rays, "brute(numerics=fast)", kind).leaks(), Effort(200));
  }
}

/// From outside, edges of the silhouette are among the targets, and every second ray ends or starts on
/// the surface.
TEST(Verdicts, WatertightHasNoPlainErrorFromOutside) {
  for (const Vec3f shift : {Vec3f{0, 0, 0}, Vec3f{1e3f, -700, 30}}) {
    Scene sphere = MakeIcosphere(3);
    for (Vec3f& p : sphere.positions) p = p + shift;
    const Scene scene = MakeScene(sphere.positions, sphere.triangles);
    const auto oracle = MakeOracle(scene);
    RaySet set = AimedRays(scene, Effort(6000), 2, Bounds3{shift + Vec3f{2, 2, 2}, shift + Vec3f{3, 4, 5}});
    for (size_t i = 0; i < set.rays.size(); i += 3) {
      rb_ray& ray = set.rays[i];
      if (i % 2) {
        ray.tfar = 1;
      } else {
        for (int k = 0; k < 3; ++k) ray.org[k] += ray.dir[k];
      }
    }
    const VerdictCounts counts = JudgeStructure(scene, *oracle, set.rays, "brute", RB_CLOSEST);
    EXPECT_EQ(counts.leaks() + counts.plain_errors(), 0u);
    EXPECT_GT(counts[Verdict::kFalseMissMarginal] + counts[Verdict::kFalseHitMarginal], 0u);
  }
}

TEST(AimedRays, HitTheMeshFromInsideAndAreRepeatable) {
  const Scene scene = MakeIcosphere(2);
  const RaySet set = AimedRays(scene, 500, 4), again = AimedRays(scene, 500, 4),
               other = AimedRays(scene, 500, 5);
  EXPECT_EQ(set.kind, "aimed");
  EXPECT_EQ(set.hash, again.hash);
  EXPECT_NE(set.hash, other.hash);
  for (const Truth& truth : MakeOracle(scene)->Ask(set.rays, 2)) {
    EXPECT_TRUE(truth.hit);
    EXPECT_NEAR(truth.t, 1, 1e-2);
  }
  EXPECT_THROW(AimedRays(MakeScene({}, {}), 1, 1), InputError);
}

}  // namespace
}  // namespace raybench
