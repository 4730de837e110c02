// The ray-triangle tests that all structures share, one class each, chosen by the build parameter `numerics`.
//
// Each test offers MayHit, a filter over one triangle (F = float) or four at once (F = Float4), and
// Intersect, which decides. MayHit computes what Intersect computes, in the same order, so it never rejects
// what Intersect accepts.
#pragma once

#include <cstdint>
#include <utility>

#include "accel/raybench.h"
#include "accel/simd.h"
#include "accel/vec3.h"

namespace raybench {

/// Index of the parameter `numerics`; procedural primitives get it too. Later: double, exact.
enum class Numerics : uint32_t { kFast, kWatertight };
inline constexpr const char* kNumericsChoices[] = {"fast", "watertight", nullptr};
inline constexpr const char* kNumericsDoc =
    "arithmetic of the ray tests: fast (float, leaks at edges), watertight (float with double fallback, no "
    "leaks)";

/// Vertex access for MayHit: corner, axis -> the coordinate of four triangles.
struct Lanes {
  const float (*v)[3][4];  ///< [corner][axis][lane]
  Float4 operator()(int corner, int axis) const { return Load4(v[corner][axis]); }
};
/// The same for one triangle.
struct Corners {
  const Vec3f p[3];
  float operator()(int corner, int axis) const { return p[corner][axis]; }
};

/// Candidate hit of one primitive, before the interval and the order are looked at.
struct PrimHit {
  float t, u, v;
};

/// Moeller and Trumbore (1997) in float. Fast; leaks at shared edges.
class FastTest {
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
  static constexpr bool kConservative = false;

  explicit FastTest(const rb_ray& ray) : org_(LoadVec3(ray.org)), dir_(LoadVec3(ray.dir)) {}

  /// Bit i: triangle i may be hit.
  unsigned MayHit(Lanes v) const { return Mask(Inside(Compute<Float4>(v))); }

  bool Intersect(Vec3f p0, Vec3f p1, Vec3f p2, PrimHit& hit) const {
    const Terms<float> k = Compute<float>(Corners{{p0, p1, p2}});
    if (!Inside(k)) return false;
    hit = {(k.e2[0] * k.q[0] + k.e2[1] * k.q[1] + k.e2[2] * k.q[2]) / k.det, k.u / k.det, k.v / k.det};
    return true;
  }

 private:
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
};

/// The map into the space where the ray is the z axis (Woop, Benthin, Wald 2013): axes permuted, then
/// sheared. The same vertex gives the same point there for every primitive it belongs to.
struct RayShear {
  Vec3f org;
  int kx, ky, kz;    ///< kz: the ray's main axis
  float sx, sy, sz;  ///< sz: from the main axis to t

  explicit RayShear(const rb_ray& ray) : org(LoadVec3(ray.org)) {
    const Vec3f d = LoadVec3(ray.dir);
    const float ax = std::fabs(d.x), ay = std::fabs(d.y), az = std::fabs(d.z);
    kz = ax > ay ? (ax > az ? 0 : 2) : (ay > az ? 1 : 2);
    kx = kz == 2 ? 0 : kz + 1;
    ky = kx == 2 ? 0 : kx + 1;
    sx = d[kx] / d[kz], sy = d[ky] / d[kz], sz = 1 / d[kz];
  }

  /// From a vertex's coordinates on the axes kx, ky, kz; z stays along the main axis, relative to the origin.
  template <class F>
  void Apply(F px, F py, F pz, F& x, F& y, F& z) const {
    z = pz - org[kz];
    x = (px - org[kx]) - sx * z;
    y = (py - org[ky]) - sy * z;
  }
};

/// Woop, Benthin, Wald (2013): vertices are sheared into a space where the ray is the z axis; the signs of
/// the edge functions, the same two products for both triangles at an edge, are exact given the sheared
/// vertices: a non-zero difference of rounded products has the right sign, a zero one is computed again in
/// double, where products of floats are exact. Needs -ffp-contract=off.
class WatertightTest {
 public:
  static constexpr Numerics kNumerics = Numerics::kWatertight;
  static constexpr bool kConservative = true;

  explicit WatertightTest(const rb_ray& ray) : shear_(ray) {}

  /// Bit i: triangle i may be hit.
  unsigned MayHit(Lanes v) const {
    const Edges<Float4> e = Compute<Float4>(v);
    const Float4 zero{};
    const auto negative = (e.u < zero) | (e.v < zero) | (e.w < zero);
    const auto positive = (e.u > zero) | (e.v > zero) | (e.w > zero);
    return ~Mask(negative & positive) & 15u;
  }

  bool Intersect(Vec3f p0, Vec3f p1, Vec3f p2, PrimHit& hit) const {
    const Edges<float> e = Compute<float>(Corners{{p0, p1, p2}});
    if (e.u == 0 || e.v == 0 || e.w == 0) return Finish<double>(Again(e), e.z, hit);
    return Finish<float>(e, e.z, hit);
  }

 private:
  template <class F>
  struct Edges {
    F u, v, w;     // edge functions opposite p0, p1, p2
    F x[3], y[3];  // sheared vertices
    F z[3];        // along the ray's main axis, relative to the origin
  };

  template <class F, class Get>
  Edges<F> Compute(Get p) const {
    Edges<F> e;
    for (int i = 0; i < 3; ++i)
      shear_.Apply(p(i, shear_.kx), p(i, shear_.ky), p(i, shear_.kz), e.x[i], e.y[i], e.z[i]);
    e.u = e.x[2] * e.y[1] - e.y[2] * e.x[1];
    e.v = e.x[0] * e.y[2] - e.y[0] * e.x[2];
    e.w = e.x[1] * e.y[0] - e.y[1] * e.x[0];
    return e;
  }

  static Edges<double> Again(const Edges<float>& f) {
    Edges<double> e;
    for (int i = 0; i < 3; ++i) e.x[i] = f.x[i], e.y[i] = f.y[i], e.z[i] = f.z[i];
    e.u = e.x[2] * e.y[1] - e.y[2] * e.x[1];
    e.v = e.x[0] * e.y[2] - e.y[0] * e.x[2];
    e.w = e.x[1] * e.y[0] - e.y[1] * e.x[0];
    return e;
  }

  template <class F>
  bool Finish(const Edges<F>& e, const float (&z)[3], PrimHit& hit) const {
    if ((e.u < 0 || e.v < 0 || e.w < 0) && (e.u > 0 || e.v > 0 || e.w > 0)) return false;
    const F det = e.u + e.v + e.w;
    if (det == 0) return false;
    const float sz = shear_.sz;
    hit = {float((e.u * F(sz * z[0]) + e.v * F(sz * z[1]) + e.w * F(sz * z[2])) / det), float(e.v / det),
           float(e.w / det)};
    return true;
  }

  RayShear shear_;
};

/// Calls fn.operator()<Test>() with the test that the parameter names.
template <class Fn>
decltype(auto) WithNumerics(uint32_t numerics, Fn&& fn) {
  if (Numerics(numerics) == Numerics::kFast) return fn.template operator()<FastTest>();
  return fn.template operator()<WatertightTest>();
}

/// Whether traversal must find whatever the triangle test accepts.
inline bool IsConservative(uint32_t numerics) {
  return WithNumerics(numerics, []<class Test>() { return Test::kConservative; });
}

/// RB_CLAIM_* that a tree with conservative traversal may make with these tests.
inline uint32_t ClaimOf(uint32_t numerics) {
  return Numerics(numerics) == Numerics::kFast ? RB_CLAIM_INEXACT : RB_CLAIM_WATERTIGHT;
}

}  // namespace raybench
