// The ray-triangle tests that all structures share, one class each, chosen by the build parameter `numerics`.
//
// Each test offers Intersect, which decides, and double and exact MayHit, a filter over some triangles at once, which
// never rejects what Intersect accepts. Fast and watertight decide some triangles at once (fast_lanes.h,
// watertight_lanes.h).
//
//   fast        Moeller-Trumbore in float: leaks
//   watertight  Woop, vertices sheared in float, signs exact given these: no leaks, ids beside edges by rounding
//   double      the same in double: right but where surfaces are closer than 2^-50, t within half an ulp
//   exact       membership by exact predicates, t correctly rounded: the truth
//
// All but `fast` are right down to subnormal numbers, of vertices, origins and directions alike.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>

#include "accel/base/simd.h"
#include "accel/base/vec3.h"
#include "accel/contract/parameters.h"
#include "accel/contract/raybench.h"
#include "accel/ray/exact.h"

namespace raybench {

/// Index of the parameter `numerics`; procedural primitives get it too.
enum class Numerics : uint32_t { kFast, kWatertight, kDouble, kExact };
inline constexpr const char* kNumericsChoices[] = {"fast", "watertight", "double", "exact", nullptr};
inline constexpr const char* kNumericsDoc =
    "arithmetic of the ray tests: fast (float, leaks at edges), watertight (vertices sheared in float, signs "
    "exact, no leaks), double (the same in double), exact (exact predicates, t correctly rounded)";
/// The build parameter that chooses among them, `watertight` by default.
constexpr rb_param NumericsParam(size_t offset) {
  return ChoiceParam("numerics", kNumericsDoc, offset, kNumericsChoices, uint32_t(Numerics::kWatertight),
                     RB_PARAM_APPROXIMATE);
}

/// Vertex access for MayHit: corner, axis -> the coordinate of kWidth triangles.
template <int kWidth>
struct Lanes {
  const float (*v)[3][kWidth];  ///< [corner][axis][lane]
  FloatN<kWidth> operator()(int corner, int axis) const { return Load<FloatN<kWidth>>(v[corner][axis]); }
};
/// The same for one triangle.
struct Corners {
  const Vec3f p[3];
  float operator()(int corner, int axis) const { return p[corner][axis]; }
};

/// Candidate hit of one primitive, before the interval and the order are looked at.
struct PrimHit {
  float t, u, v;
  int beyond = 0;  ///< sign of (exact t - t), where the test knows it and t is an end of the ray's interval
};

/// What traversal must allow for, so that it finds whatever the test accepts (ray/bounds.h).
enum class Slack {
  kNone,      ///< nothing: textbook traversal, which may lose hits
  kFarEnd,    ///< errors of float tests; t may err as much as it likes and is clamped into the box
  kBothEnds,  ///< t is right to 2^-20, and the box must not move it
};

/// Moeller and Trumbore (1997) in float. Fast; leaks at shared edges.
class FastTest {
  friend class FastLanes;
  template <class F>
  struct Terms {
    F det, u, v, e2[3], q[3];
  };

  /// 0 <= u, 0 <= v, u + v <= 1 after division by det, whatever its sign.
  template <class F>
  static auto Inside(const Terms<F>& k) {
    const F zero{};
    return ((k.det > zero) & (k.u >= zero) & (k.v >= zero) & (k.u + k.v <= k.det)) |
           ((k.det < zero) & (k.u <= zero) & (k.v <= zero) & (k.u + k.v >= k.det));
  }

 public:
  static constexpr Numerics kNumerics = Numerics::kFast;
  static constexpr Slack kSlack = Slack::kNone;

  [[gnu::always_inline]] explicit FastTest(const rb_ray& ray)
      : org_(LoadVec3(ray.org)), dir_(LoadVec3(ray.dir)) {
    const float length = std::max(std::fabs(dir_.x), std::max(std::fabs(dir_.y), std::fabs(dir_.z)));
    if (length >= 0x1p-60f && length <= 0x1p60f) [[likely]]
      return;
    // Products with it would leave the range of float.
    scale_ = std::ldexp(1.0f, (length < 1 ? -60 : 60) - std::ilogb(length));
    dir_ = dir_ * scale_;
  }

  bool Intersect(Vec3f p0, Vec3f p1, Vec3f p2, PrimHit& hit) const {
    const Terms<float> k = Compute<float>(Corners{{p0, p1, p2}});
    if (!Inside(k)) return false;
    hit = {T(k), k.u / k.det, k.v / k.det};
    return true;
  }

 private:
  template <class F>
  F T(const Terms<F>& k) const {
    return (k.e2[0] * k.q[0] + k.e2[1] * k.q[1] + k.e2[2] * k.q[2]) / k.det * scale_;
  }
  template <class F, class Get>
  Terms<F> Compute(Get v) const {
    Terms<F> k;
    F e1[3], s[3], p[3];
    for (int a = 0; a < 3; ++a)
      e1[a] = v(1, a) - v(0, a), k.e2[a] = v(2, a) - v(0, a), s[a] = org_[a] - v(0, a);
    for (int a = 0; a < 3; ++a) {
      const int b = (a + 1) % 3, c = (a + 2) % 3;
      p[a] = dir_[b] * k.e2[c] - dir_[c] * k.e2[b];
      k.q[a] = s[b] * e1[c] - s[c] * e1[b];
    }
    k.det = e1[0] * p[0] + e1[1] * p[1] + e1[2] * p[2];
    k.u = s[0] * p[0] + s[1] * p[1] + s[2] * p[2];
    k.v = dir_[0] * k.q[0] + dir_[1] * k.q[1] + dir_[2] * k.q[2];
    return k;
  }

  Vec3f org_, dir_;
  float scale_ = 1;
};

/// a b - c d with the right sign. Nothing may over- or underflow.
inline double DifferenceOfProducts(double a, double b, double c, double d) {
  const double ab = a * b, cd = c * d;
  return ab != cd ? ab - cd : std::fma(a, b, -ab) - std::fma(c, d, -cd);
}

/// The map into the space where the ray is the z axis (Woop, Benthin, Wald 2013): axes permuted, then
/// sheared. The same vertex gives the same point there for every primitive it belongs to.
///
/// In float it errs by a few 2^-24 of a vertex's distances to the origin along the axes, as long as nothing
/// underflows. All vertices are sheared in double where the slope of a ray that is nearly parallel to an axis
/// underflows, or where the origin is so far away that kTiny would not hold; a single vertex is where its
/// product with the slope underflows and its distance is as small.
struct RayShear {
  /// What underflow may change of an edge function of points sheared in float: a point that Point() has in
  /// double differs by 2^-150 and lies within 2^-125 of the ray, all others within 2^35.
  static constexpr float kTiny = 0x1p-88f;
  static constexpr float kFarthest = 0x1p33f;

  Vec3f org, dir;
  int kx, ky, kz;  ///< kz: the ray's main axis
  float sx, sy;    ///< slopes; NaN: in double

  [[gnu::always_inline]] explicit RayShear(const rb_ray& ray)
      : org(LoadVec3(ray.org)), dir(LoadVec3(ray.dir)) {
    const float ax = std::fabs(dir.x), ay = std::fabs(dir.y), az = std::fabs(dir.z);
    // Which axis it is changes from ray to ray: no branches.
    const int of_xy = int(!(ax > ay)), is_z = int(!(std::max(ax, ay) > az));
    kz = of_xy + (2 - of_xy) * is_z;
    kx = 0b001001 >> 2 * kz & 3;  // 1, 2, 0
    ky = 0b010010 >> 2 * kz & 3;  // 2, 0, 1
    sx = ray.dir[kx] / ray.dir[kz], sy = ray.dir[ky] / ray.dir[kz];
    const float farthest = std::max(std::fabs(org.x), std::max(std::fabs(org.y), std::fabs(org.z)));
    const bool underflows =
        (std::fabs(sx) < kMinNormal && dir[kx] != 0) | (std::fabs(sy) < kMinNormal && dir[ky] != 0);
    if (underflows | (farthest > kFarthest)) [[unlikely]]
      sx = sy = std::numeric_limits<float>::quiet_NaN();
  }

  /// For filters, from a vertex's coordinates on the axes kx, ky, kz: what Point() says but for kTiny; x and
  /// y are NaN where that is in double. z stays along the main axis, relative to the origin.
  template <class F>
  [[gnu::always_inline]] void Apply(F px, F py, F pz, F& x, F& y, F& z) const {
    z = pz - org[kz];
    x = (px - org[kx]) - sx * z;
    y = (py - org[ky]) - sy * z;
  }

  /// The sheared vertex by which tests decide; where all are in double, x and y are in units of dir[kz]. GCC
  /// inlines two of a triangle's three by itself, or all.
  [[gnu::always_inline]] Vec3d Point(Vec3f p) const {
    if (std::isnan(sx)) [[unlikely]]
      return PointInDouble(p);
    const float z = p[kz] - org[kz];
    return {Across(p[kx] - org[kx], sx, z), Across(p[ky] - org[ky], sy, z), z};
  }
  /// Without a division: two products and a difference a coordinate, exact where the bits suffice, as on a
  /// lattice, and elsewhere off by 2^-52 of the vertex's distance; in units of dir[kz].
  Vec3d PointInDouble(Vec3f p) const {
    const Vec3d a = ToDouble(p) - ToDouble(org), d = ToDouble(dir);
    return {DifferenceOfProducts(a[kx], d[kz], d[kx], a[kz]),
            DifferenceOfProducts(a[ky], d[kz], d[ky], a[kz]), a[kz]};
  }

  static double Across(float a, float s, float z) {
    const float product = s * z;
    if (std::max(std::fabs(a), std::fabs(product)) < kMinNormal) [[unlikely]]
      return double(a) - double(s) * double(z);
    return a - product;
  }

 private:
  static constexpr float kMinNormal = std::numeric_limits<float>::min();
};

/// t of the ray in the triangle's plane, measured from the vertex that is nearest to the origin, and, since a
/// ray that all but lies in the plane may meet it anywhere, not beyond the vertices. The plane is spanned by the two
/// shorter edges: between two that are far longer than the third the difference would be lost. `otherwise` if the
/// triangle has no plane.
[[gnu::noinline]] inline double PlaneT(const RayShear& ray, const Vec3d (&a)[3],
                                       const std::array<Vec3f, 3>& p, double otherwise) {
  const Vec3d org = ToDouble(ray.org),
              from[3] = {ToDouble(p[0]) - org, ToDouble(p[1]) - org, ToDouble(p[2]) - org};
  const Vec3d corner[3] = {ToDouble(p[0]), ToDouble(p[1]), ToDouble(p[2])},
              edge[3] = {corner[2] - corner[1], corner[0] - corner[2], corner[1] - corner[0]};
  const auto distance = [](Vec3d v) { return std::max({std::fabs(v.x), std::fabs(v.y), std::fabs(v.z)}); };
  int longest = 0;
  for (int k = 1; k < 3; ++k)
    if (distance(edge[k]) > distance(edge[longest])) longest = k;
  const Vec3d normal = Cross(edge[(longest + 1) % 3], edge[(longest + 2) % 3]);
  const double along = Dot(normal, ToDouble(ray.dir));
  if (along == 0) return otherwise;
  int nearest = 0;
  for (int k = 1; k < 3; ++k)
    if (distance(from[k]) < distance(from[nearest])) nearest = k;
  const double t = Dot(normal, from[nearest]) / along, dz = ray.dir[ray.kz], t0 = a[0].z / dz,
               t1 = a[1].z / dz, t2 = a[2].z / dz;
  return std::min(std::max(t, std::min({t0, t1, t2})), std::max({t0, t1, t2}));
}

/// A triangle of sheared vertices (RayShear) against the z axis, edges included. The signs of the edge
/// functions, the same two products for both triangles at an edge, are exact given these vertices. t weights
/// the vertices' z, which suits slivers; where that leaves no more than rounding errors, as for a ray that
/// starts in the triangle's plane, it is the plane's, which is exact on a lattice.
inline bool IntersectSheared(const RayShear& ray, const Vec3d (&a)[3], Vec3f p0, Vec3f p1, Vec3f p2,
                             PrimHit& hit) {
  const double u = DifferenceOfProducts(a[2].x, a[1].y, a[2].y, a[1].x),
               v = DifferenceOfProducts(a[0].x, a[2].y, a[0].y, a[2].x),
               w = DifferenceOfProducts(a[1].x, a[0].y, a[1].y, a[0].x);
  if ((u < 0 || v < 0 || w < 0) && (u > 0 || v > 0 || w > 0)) return false;
  const double det = u + v + w;
  if (det == 0) return false;
  const double z = (u * a[0].z + v * a[1].z + w * a[2].z) / det;
  double t = z / double(ray.dir[ray.kz]);
  if (std::fabs(z) < 0x1p-48 * (std::fabs(a[0].z) + std::fabs(a[1].z) + std::fabs(a[2].z))) [[unlikely]]
    t = PlaneT(ray, a, {p0, p1, p2}, t);
  hit = {float(t), float(v / det), float(w / det)};
  return true;
}

/// Woop, Benthin, Wald (2013): vertices are sheared in float into a space where the ray is the z axis; edge
/// functions are products of floats there, exact in double, and so are their signs. Needs -ffp-contract=off.
class WatertightTest {
 public:
  static constexpr Numerics kNumerics = Numerics::kWatertight;
  static constexpr Slack kSlack = Slack::kFarEnd;

  [[gnu::always_inline]] explicit WatertightTest(const rb_ray& ray) : shear_(ray) {}
  const RayShear& shear() const { return shear_; }

  bool Intersect(Vec3f p0, Vec3f p1, Vec3f p2, PrimHit& hit) const {
    const Vec3d a[3] = {shear_.Point(p0), shear_.Point(p1), shear_.Point(p2)};
    return IntersectSheared(shear_, a, p0, p1, p2, hit);
  }

 private:
  RayShear shear_;
};

/// The filter before the tests in double and exact: Woop's edge functions in float, with a bound of all their
/// errors. Let u = 2^-24, M the largest |x|+|y|+|z| of a vertex relative to the origin, X the largest |x| or
/// |y| of a sheared one. A sheared coordinate errs by at most 4 u M (verdict.cpp has the derivation), so an
/// edge function, two products and a difference, by 16 u M X + 32 u^2 M^2, and by rounding 4 u X^2 <= 8 u M X
/// more; 32 u M (X + 4 u M) covers that with X as computed. Only edges that are surely on both sides reject.
class BoundedFilter {
 public:
  explicit BoundedFilter(const rb_ray& ray) : shear_(ray) {}

  /// Bit i: triangle i may be hit.
  template <int kWidth>
  unsigned MayHit(Lanes<kWidth> p) const {
    using F = FloatN<kWidth>;
    F x[3], y[3], reach{}, across{};
    for (int i = 0; i < 3; ++i) {
      F z;
      const F px = p(i, shear_.kx), py = p(i, shear_.ky), pz = p(i, shear_.kz);
      shear_.Apply(px, py, pz, x[i], y[i], z);
      reach = MaxOrSecond(Abs(px - shear_.org[shear_.kx]) + Abs(py - shear_.org[shear_.ky]) + Abs(z), reach);
      across = MaxOrSecond(MaxOrSecond(Abs(x[i]), Abs(y[i])), across);
    }
    const F bound = reach * (across + reach * 0x1p-22f) * 0x1p-19f + 0x1p-140f;
    const F u = x[2] * y[1] - y[2] * x[1], v = x[0] * y[2] - y[0] * x[2], w = x[1] * y[0] - y[1] * x[0];
    const auto negative = (u < -bound) | (v < -bound) | (w < -bound);
    const auto positive = (u > bound) | (v > bound) | (w > bound);
    return ~Mask(negative & positive) & kAllLanes<kWidth>;
  }

 protected:
  RayShear shear_;
};

/// Woop's test in double.
class DoubleTest : public BoundedFilter {
 public:
  static constexpr Numerics kNumerics = Numerics::kDouble;
  static constexpr Slack kSlack = Slack::kBothEnds;

  using BoundedFilter::BoundedFilter;

  bool Intersect(Vec3f p0, Vec3f p1, Vec3f p2, PrimHit& hit) const {
    const Vec3d a[3] = {shear_.PointInDouble(p0), shear_.PointInDouble(p1), shear_.PointInDouble(p2)};
    return IntersectSheared(shear_, a, p0, p1, p2, hit);
  }
};

/// The truth: whether the ray meets the closed triangle by exact predicates behind a filter in double
/// (Shewchuk 1997), t correctly rounded. A triangle in whose plane the ray lies is not hit. u and v are those
/// of double.
class ExactTest : public BoundedFilter {
 public:
  static constexpr Numerics kNumerics = Numerics::kExact;
  static constexpr Slack kSlack = Slack::kBothEnds;

  explicit ExactTest(const rb_ray& ray)
      : BoundedFilter(ray),
        line_(ray),
        tnear_(ray.tnear),
        last_(std::min(ray.tfar, std::numeric_limits<float>::max())) {}

  bool Intersect(Vec3f p0, Vec3f p1, Vec3f p2, PrimHit& hit) const {
    const exact::Corners p = {ToDouble(p0), ToDouble(p1), ToDouble(p2)};
    const exact::Meeting meeting = exact::Meet(line_, p);
    if (meeting == exact::Meeting::kNone || meeting == exact::Meeting::kInPlane) return false;
    const auto [t, error] = exact::PlaneApproximate(line_, p);
    hit.t = float(t), hit.beyond = 0;
    const bool rounds_surely = float(t - error) == float(t + error);  // false where the error is infinite
    if (!rounds_surely || hit.t == tnear_ || hit.t == last_) {
      const exact::Ratio ratio = exact::PlaneRatio(line_, p);
      hit.t = exact::RoundToFloat(ratio);
      if (hit.t == tnear_ || hit.t == last_) hit.beyond = exact::Compare(ratio, hit.t);
    }
    const Vec3d a = p[0] - line_.org, b = p[1] - line_.org, c = p[2] - line_.org;
    const double w0 = Dot(line_.dir, Cross(b, c)), w1 = Dot(line_.dir, Cross(c, a)),
                 w2 = Dot(line_.dir, Cross(a, b)), sum = w0 + w1 + w2;
    hit.u = sum != 0 ? float(w1 / sum) : 0, hit.v = sum != 0 ? float(w2 / sum) : 0;
    return true;
  }

 private:
  exact::Line line_;
  float tnear_, last_;  // no answer lies behind the largest float
};

/// Calls fn.operator()<Test>() with the test that the parameter names.
template <class Fn>
decltype(auto) WithNumerics(uint32_t numerics, Fn&& fn) {
  switch (Numerics(numerics)) {
    case Numerics::kFast:
      return fn.template operator()<FastTest>();
    case Numerics::kDouble:
      return fn.template operator()<DoubleTest>();
    case Numerics::kExact:
      return fn.template operator()<ExactTest>();
    default:
      return fn.template operator()<WatertightTest>();
  }
}

/// Whether traversal must find whatever the triangle test accepts.
inline bool IsConservative(uint32_t numerics) { return Numerics(numerics) != Numerics::kFast; }

/// RB_CLAIM_* that a tree with conservative traversal may make with these tests. Procedural primitives are
/// tested in floating point whatever the numerics.
inline uint32_t ClaimOf(uint32_t numerics, const rb_geometry& geometry) {
  if (Numerics(numerics) == Numerics::kFast) return RB_CLAIM_INEXACT;
  return Numerics(numerics) == Numerics::kExact && geometry.procedural_count == 0 ? RB_CLAIM_EXACT
                                                                                  : RB_CLAIM_WATERTIGHT;
}

}  // namespace raybench
