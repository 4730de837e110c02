// u and v: their truth against rational arithmetic, the bound, and whom it catches.
#include "harness/truth/uv.h"

#include <gtest/gtest.h>

#include <boost/multiprecision/cpp_int.hpp>

#include "harness/truth/oracle.h"
#include "tests/support/conformance.h"
#include "tests/support/effort.h"
#include "tests/support/oracle_scenes.h"

namespace raybench {
namespace {

using namespace testing;
using Rational = boost::multiprecision::cpp_rational;

/// By Moeller and Trumbore's formulas. False: the ray is parallel to the triangle.
bool ExactUv(const Scene& scene, const rb_ray& ray, uint32_t prim, Rational& u, Rational& v) {
  using Triple = std::array<Rational, 3>;
  const auto minus = [](const float* a, const float* b) {
    return Triple{Rational(a[0]) - Rational(b[0]), Rational(a[1]) - Rational(b[1]),
                  Rational(a[2]) - Rational(b[2])};
  };
  const auto cross = [](const Triple& a, const Triple& b) {
    return Triple{a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
  };
  const auto dot = [](const Triple& a, const Triple& b) -> Rational {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  };
  const auto corner = [&](size_t i) { return &scene.positions[scene.triangles[prim][i]].x; };
  const Triple e1 = minus(corner(1), corner(0)), e2 = minus(corner(2), corner(0)),
               s = minus(ray.org, corner(0)),
               d{Rational(ray.dir[0]), Rational(ray.dir[1]), Rational(ray.dir[2])};
  const Rational det = dot(e1, cross(d, e2));
  if (det == 0) return false;
  u = dot(s, cross(d, e2)) / det, v = dot(d, cross(s, e1)) / det;
  return true;
}

TEST(Uv, TruthIsRightToAMillionthOfTheBound) {
  for (const Scene& scene :
       {MakeLatticeBox(2), MakeLatticeBox(2, {1e6f, -3e6f, 7e5f}), MakeIcosphere(1), MakeLatticeSoup(40, 3),
        MakeSlivers(40, 5), SceneOf(Moved(Ball(2), 0x1p29f, {0, 0, 0}, "large"))}) {
    size_t known = 0, parallel = 0, tight = 0;
    const std::vector<rb_ray> rays =
        NastyRays(Mesh{scene.name, scene.positions, scene.triangles}, int(Effort(600)), 9);
    for (size_t i = 0; i < rays.size(); ++i) {
      const auto prim = uint32_t(i % scene.triangles.size());
      const UvTruth uv = TrueUv(scene, rays[i], {1, 0, 0, prim});
      Rational u, v;
      if (!ExactUv(scene, rays[i], prim, u, v)) {
        EXPECT_FALSE(uv.known) << "ray " << i;
        ++parallel;
      } else if (uv.known) {
        ++known, tight += uv.u_bound < 1e-4;
        EXPECT_LE(abs(Rational(uv.u) - u), Rational(uv.u_bound * 1e-6)) << "ray " << i;
        EXPECT_LE(abs(Rational(uv.v) - v), Rational(uv.v_bound * 1e-6)) << "ray " << i;
      }
    }
    EXPECT_GT(known, rays.size() / 16) << scene.triangles.size();
    if (scene.name == "large") {
      EXPECT_GT(tight, rays.size() / 8);
    }
  }
}

/// One triangle in the plane x = 1, met at u = 0.5, v = 0.125, and one that the ray lies in.
class UvOfOne : public ::testing::Test {
 protected:
  Judged Judge(float u, float v, uint32_t prim = 0, bool has_uv = true) const {
    return JudgeHit(*oracle_, ray_, truth_, {1, u, v, prim}, has_uv);
  }
  const Scene scene_ =
      MakeScene({{1, 0, 0}, {1, 1, 0}, {1, 1, 1}, {0, 0.625f, 0.125f}, {3, 0.625f, 0.125f}, {3, 1, 9}},
                {{0, 1, 2}, {3, 4, 5}});
  const std::unique_ptr<Oracle> oracle_ = MakeBoxOracle(scene_);
  const rb_ray ray_ = MakeRay({-1, 0.625f, 0.125f}, {2, 0, 0});
  const Truth truth_ = oracle_->Ask(std::span(&ray_, 1), 1)[0];
};

TEST_F(UvOfOne, WithinTheBoundHoldsBeyondItBreaks) {
  const UvTruth uv = oracle_->Uv(ray_, {1, 0, 0, 0});
  ASSERT_TRUE(uv.known);
  EXPECT_EQ(uv.u, 0.5);
  EXPECT_EQ(uv.v, 0.125);
  EXPECT_LT(uv.u_bound, 2e-6);
  EXPECT_LT(uv.v_bound, 2e-6);
  EXPECT_EQ(Judge(0.5f, 0.125f).uv_error, 0);
  EXPECT_FALSE(Judge(0.5f + float(0.9 * uv.u_bound), 0.125f).UvWrong());
  const Judged off = Judge(0.5f, 0.125f - float(1.1 * uv.v_bound));
  EXPECT_EQ(off.verdict, Verdict::kExact);
  EXPECT_TRUE(off.strict);
  for (const Judged& j : {off, Judge(0.5f + float(1.1 * uv.u_bound), 0.125f), Judge(0.125f, 0.5f),
                          Judge(0.5f, 0.375f), Judge(kNan, 0.125f), Judge(0.5f, kInf)}) {
    EXPECT_TRUE(j.UvWrong());
    EXPECT_TRUE(j.Breaks(RB_CLAIM_EXACT));
    EXPECT_TRUE(j.Breaks(RB_CLAIM_WATERTIGHT));
    EXPECT_FALSE(j.Breaks(RB_CLAIM_INEXACT));
    EXPECT_FALSE(j.Breaks(RB_CLAIM_NOTHING));
  }
}

TEST_F(UvOfOne, IsCountedAndBreaksTheClaimOfASet) {
  const std::vector<rb_ray> rays(4, ray_);
  const std::vector<Truth> truth(4, truth_);
  std::vector<rb_hit> hits(4, {1, 0.5f, 0.125f, 0});
  EXPECT_FALSE(BreaksClaim(RB_CLAIM_EXACT, JudgeAll(*oracle_, RB_CLOSEST, rays, truth, hits, {}, 1)));
  hits[1].u = 0.5001f, hits[2].v = kNan, hits[3] = {kInf, 7, 7, RAYBENCH_NONE};
  const VerdictCounts counts = JudgeAll(*oracle_, RB_CLOSEST, rays, truth, hits, {}, 1);
  EXPECT_EQ(counts.uv_judged, 3u);
  EXPECT_EQ(counts.uv_wrong, 2u);
  EXPECT_GT(counts.uv_error_max, 50);
  EXPECT_TRUE(std::isfinite(counts.uv_error_max));
  hits[3] = hits[0];
  const VerdictCounts all_hit = JudgeAll(*oracle_, RB_CLOSEST, rays, truth, hits, {}, 1);
  for (uint32_t claim : {RB_CLAIM_WATERTIGHT, RB_CLAIM_EXACT}) EXPECT_TRUE(BreaksClaim(claim, all_hit));
  EXPECT_FALSE(BreaksClaim(RB_CLAIM_INEXACT, all_hit));
}

TEST_F(UvOfOne, SaysNothingWhereThereIsNothingToSay) {
  EXPECT_FALSE(Judge(0.9f, 0.9f, 0, false).uv_error) << "built without";
  EXPECT_FALSE(oracle_->Uv(ray_, {1, 9, 9, 1}).known) << "the ray lies in its plane";
  EXPECT_FALSE(oracle_->Uv(ray_, {ray_.tfar, 9, 9, RAYBENCH_NONE}).known) << "a miss";
  EXPECT_FALSE(oracle_->Uv(ray_, {1, 9, 9, 2}).known) << "no such primitive";
  const Judged wrong = JudgeHit(*oracle_, ray_, truth_, {0.5f, 9, 9, 0});
  EXPECT_EQ(wrong.verdict, Verdict::kWrong);
  EXPECT_FALSE(wrong.uv_error) << "an error already";
}

TEST(Uv, TheBoundGrowsUntilItExcusesAll) {
  const Scene scene = MakeScene({{0, 0, 0}, {1, 0, 0}, {0, 1, 1}}, {{0, 1, 2}});
  double last = 0;
  for (const float slope : {1e-2f, 1e-4f, 1e-6f}) {
    const UvTruth uv =
        TrueUv(scene, MakeRay({-10, 0.25f, 0.25f + 10.25f * slope}, {1, 0, -slope}), {1, 0, 0, 0});
    ASSERT_TRUE(uv.known) << slope;
    EXPECT_GT(uv.u_bound, 10 * last) << slope;
    last = uv.u_bound;
  }
  EXPECT_FALSE(
      TrueUv(scene, MakeRay({-10, 0.25f, 0.25f + 10.25f * 1e-8f}, {1, 0, -1e-8f}), {1, 0, 0, 0}).known);
}

TEST(Uv, ProceduralPrimitivesHaveNone) {
  Scene scene;
  scene.name = scene.provenance.source = "sphere";
  scene.spheres.push_back({{0, 0, 0}, 1});
  scene.sphere_material.push_back(0);
  scene.Finish();
  EXPECT_FALSE(TrueUv(scene, MakeRay({-2, 0, 0}, {1, 0, 0}), {1, 9, 9, 0}).known);
}

}  // namespace
}  // namespace raybench
