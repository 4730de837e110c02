// numerics=exact at its seams: correct rounding beside midpoints, the interval's ends, resuming.
#include "accel/ray/exact.h"

#include <gtest/gtest.h>

#include "accel/ray/triangle.h"
#include "tests/support/meshes.h"

namespace raybench::testing {
namespace {

/// value = a + b, as an expansion.
exact::Expansion<24> Sum(double a, double b) {
  exact::Expansion<24> e;
  double error;
  const double sum = exact::TwoSum(a, b, error);
  e.Push(error);
  e.Push(sum);
  return e;
}

TEST(Exact, RoundsToTheNearestFloatBesideMidpoints) {
  Random random(41);
  size_t rounded_twice = 0;
  for (int i = 0; i < 20000; ++i) {
    const float below = std::ldexp(1 + random.NextFloat(), int(random.Below(60)) - 30);
    const float above = std::nextafterf(below, 1e30f);
    const double middle = 0.5 * (double(below) + double(above));
    const float even = (std::bit_cast<uint32_t>(below) & 1u) == 0 ? below : above;
    // t = (middle + nudge) d / d, for nudges far below an ulp of double.
    const double d = 1 + random.NextDouble(), nudge = std::ldexp(middle, -60 - int(random.Below(40)));
    for (const int sign : {-1, 0, 1}) {
      const exact::Ratio ratio{Compressed(Sum(middle, sign * nudge) * d), exact::Expansion<24>(d)};
      const float want = sign < 0 ? below : sign > 0 ? above : even;
      ASSERT_EQ(exact::RoundToFloat(ratio), want) << i << ' ' << sign;
      rounded_twice += float(ratio.Value()) != want;
      exact::Ratio negative = ratio;
      negative.numerator.Negate();
      ASSERT_EQ(exact::RoundToFloat(negative), -want) << i << ' ' << sign;
    }
  }
  EXPECT_GT(rounded_twice, 1000u) << "the values are not near enough to midpoints to need exact rounding";
}

/// A triangle across the z axis, met at z / 3, which no float is.
Mesh Third(float z) { return {"third", {{-1, -1, z}, {3, -1, z}, {-1, 3, z}}, {{0, 1, 2}}}; }

TEST(Exact, IntervalHoldsForTheExactT) {
  constexpr float kInf = std::numeric_limits<float>::infinity();
  size_t above = 0, below = 0;
  for (int i = 1; i < 200; ++i) {
    const float z = float(i);
    if (i % 3 == 0) continue;
    const float t = z / 3;                    // correctly rounded
    const bool exact_is_above = 3.0 * t < z;  // 3 t is exact in double
    (exact_is_above ? above : below) += 1;
    const Mesh mesh = Third(z);
    for (const char* name : {"brute(numerics=exact)", "bvh_sah(numerics=exact)"}) {
      SCOPED_TRACE(std::string(name) + " at " + std::to_string(i));
      const Tree tree = Build(name, mesh.Geometry());
      const auto ask = [&](float tnear, float tfar) {
        const rb_hit hit = Closest(tree, {{{0, 0, 0}, tnear, {0, 0, 3}, tfar}})[0];
        EXPECT_EQ(Occluded(tree, {{{0, 0, 0}, tnear, {0, 0, 3}, tfar}})[0] != 0, hit.prim == 0);
        return hit;
      };
      EXPECT_EQ(ask(0, kInf).t, t);
      // Rounded up to tfar, the exact t lies before it and counts; rounded down, it lies behind.
      EXPECT_EQ(ask(0, t).prim, exact_is_above ? RAYBENCH_NONE : 0u);
      const rb_hit after = ask(t, kInf);
      EXPECT_EQ(after.prim, exact_is_above ? 0u : RAYBENCH_NONE);
      if (exact_is_above) {
        EXPECT_EQ(after.t, std::nextafter(t, kInf)) << "an answer lies behind tnear";
      }
    }
  }
  EXPECT_GT(above, 20u);
  EXPECT_GT(below, 20u);
}

TEST(Exact, ResumingGoesOnFromTheRoundedT) {
  // Sheets closer than the floats at their distance: one float t, several exact ones, in the wrong order of
  // ids. All are met once.
  Mesh mesh{"sheets", {}, {}};
  const int sheets = 40;
  for (int i = 0; i < sheets; ++i) {
    const float z = std::ldexp(float(sheets - i), -26);
    const uint32_t first = uint32_t(mesh.positions.size());
    for (Vec3f p : {Vec3f{-1, -1, z}, {3, -1, z}, {-1, 3, z}}) mesh.positions.push_back(p);
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  for (const char* name : {"brute(numerics=exact)", "bvh_sah(numerics=exact)"}) {
    const Tree tree = Build(name, mesh.Geometry());
    rb_ray ray{{0, 0, 1}, 0, {0, 0, -1}, INFINITY};
    std::vector<std::pair<float, uint32_t>> seen;
    uint32_t after = RAYBENCH_NONE;
    for (int i = 0; i < 2 * sheets; ++i) {
      rb_hit hit{};
      rb_query q{};
      q.struct_size = sizeof q, q.kind = RB_CLOSEST, q.n = 1, q.rays = &ray, q.after = &after, q.hits = &hit;
      tree.Query(q);
      if (hit.prim == RAYBENCH_NONE) break;
      seen.emplace_back(hit.t, hit.prim);
      ray.tnear = hit.t, after = hit.prim;
    }
    EXPECT_EQ(seen.size(), size_t(sheets)) << name;
    EXPECT_TRUE(std::is_sorted(seen.begin(), seen.end())) << name;
    EXPECT_NE(seen.front().second, uint32_t(sheets - 1)) << name << ": no two sheets share a float t";
  }
}

TEST(Exact, ATriangleInWhosePlaneTheRayLiesIsNotHit) {
  const Mesh mesh{"flat", {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}};
  const Tree tree = Build("bvh_sah(numerics=exact)", mesh.Geometry());
  EXPECT_EQ(Closest(tree, {{{-1, 0.25f, 0}, 0, {1, 0, 0}, INFINITY}})[0].prim, RAYBENCH_NONE);
  EXPECT_EQ(Closest(tree, {{{-1, 0.25f, -1e-30f}, 0, {1, 0, 1e-30f}, INFINITY}})[0].prim, 0u);
}

}  // namespace
}  // namespace raybench::testing
