// Ray-triangle tests as they were published, for the study of speed against accuracy (ray/study.h). None is robust
// beyond what its authors say: no filter, no clamp, no care for under- and overflow. All take both sides of a triangle.
//
//   MollerTrumbore  Moeller and Trumbore 1997: Fast, minimum storage ray/triangle intersection; in float or double,
//                   without a least determinant
//   BaldwinWeber    Baldwin and Weber 2016: Fast ray-triangle intersections by coordinate transformation
//   Pluecker        signs of the products of ray and edges in Pluecker coordinates from the ray's origin (Jones 2000:
//                   Intersecting a ray and a triangle with Pluecker coordinates), with an edge's coordinates from the
//                   sum and difference of its ends, as Embree has them (Wald et al. 2014): equal but for the sign in
//                   both triangles at the edge
//   Woop            Woop, Benthin, Wald 2013: Watertight ray/triangle intersection; in float with its fallback to
//                   double where an edge function is zero, or all in double
//
// Each comes with every product rounded (Rounded), or with each sum of products fused (Fused), as a compiler that may
// contract would write it: a b + c in one rounding, and of a b - c d the second product alone is rounded.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <type_traits>

#include "accel/base/vec3.h"
#include "accel/contract/raybench.h"
#include "accel/ray/triangle.h"

namespace raybench::published {

/// Sums of products; the two differ in Sum alone.
template <class Rounding>
struct Products {
  template <class F>
  static F Difference(F a, F b, F c, F d) {
    return Rounding::Sum(a, b, -(c * d));
  }
  template <class F>
  static F Dot(Vec3<F> a, Vec3<F> b) {
    return Rounding::Sum(a.z, b.z, Rounding::Sum(a.y, b.y, a.x * b.x));
  }
  template <class F>
  static Vec3<F> Cross(Vec3<F> a, Vec3<F> b) {
    return {Difference(a.y, b.z, a.z, b.y), Difference(a.z, b.x, a.x, b.z), Difference(a.x, b.y, a.y, b.x)};
  }
};
struct Rounded : Products<Rounded> {
  template <class F>
  static F Sum(F a, F b, F c) {
    return a * b + c;
  }
};
struct Fused : Products<Fused> {
  template <class F>
  static F Sum(F a, F b, F c) {
    return std::fma(a, b, c);
  }
};

template <class F>
Vec3<F> To(Vec3f v) {
  return {F(v.x), F(v.y), F(v.z)};
}

/// What RayState needs to know of a test; t is what the test computes, be it outside the triangle's box.
struct Unguarded {
  static constexpr Numerics kNumerics = Numerics::kFast;
  static constexpr Slack kSlack = Slack::kNone;
};

/// All of one sign, zeros included; false where one is NaN.
template <class F>
bool SameSign(F u, F v, F w) {
  return (u >= 0 && v >= 0 && w >= 0) || (u <= 0 && v <= 0 && w <= 0);
}

template <class F, class R>
class MollerTrumbore : public Unguarded {
 public:
  explicit MollerTrumbore(const rb_ray& ray)
      : org_(To<F>(LoadVec3(ray.org))), dir_(To<F>(LoadVec3(ray.dir))) {}

  bool Intersect(Vec3f p0, Vec3f p1, Vec3f p2, PrimHit& hit) const {
    const Vec3<F> a = To<F>(p0), e1 = To<F>(p1) - a, e2 = To<F>(p2) - a, p = R::Cross(dir_, e2);
    const F det = R::Dot(e1, p);
    if (det == 0) return false;
    const F inv = 1 / det;
    const Vec3<F> s = org_ - a;
    const F u = R::Dot(s, p) * inv;
    if (!(u >= 0 && u <= 1)) return false;
    const Vec3<F> q = R::Cross(s, e1);
    const F v = R::Dot(dir_, q) * inv;
    if (!(v >= 0 && u + v <= 1)) return false;
    hit = {float(R::Dot(e2, q) * inv), float(u), float(v)};
    return true;
  }

 private:
  Vec3<F> org_, dir_;
};

/// Of one triangle, made when the structure is built: the affine map that takes it to the unit triangle, as far as it
/// is not 0 or 1. `axis` is that along which the normal is longest, the two others follow in cyclic order.
struct BaldwinWeberMap {
  std::array<float, 3> u, v,
      plane;  ///< of the second and third coordinate, and a constant; plane: of the first 1
  uint32_t axis;

  /// In double, rounded once at the end: in float, as first published, up to twice as many rays leak.
  static BaldwinWeberMap Of(Vec3f p0, Vec3f p1, Vec3f p2) {
    const Vec3d a = ToDouble(p0), e1 = ToDouble(p1) - a, e2 = ToDouble(p2) - a, n = Cross(e1, e2);
    const int axis = std::fabs(n.x) > std::fabs(n.y) ? (std::fabs(n.x) > std::fabs(n.z) ? 0 : 2)
                                                     : (std::fabs(n.y) > std::fabs(n.z) ? 1 : 2);
    const int b = (axis + 1) % 3, c = (axis + 2) % 3;
    const auto row = [&](double y, double z, double constant) {
      const double k = n[axis];
      return std::array{float(y / k), float(z / k), float(constant / k)};
    };
    return {row(e2[c], -e2[b], e2[b] * a[c] - e2[c] * a[b]), row(-e1[c], e1[b], e1[c] * a[b] - e1[b] * a[c]),
            row(n[b], n[c], -Dot(n, a)), uint32_t(axis)};
  }
};

template <class R>
class BaldwinWeber : public Unguarded {
 public:
  explicit BaldwinWeber(const rb_ray& ray) {
    for (int a = 0; a < 5; ++a) org_[a] = ray.org[a % 3], dir_[a] = ray.dir[a % 3];
  }

  /// For a triangle that has no map yet.
  bool Intersect(Vec3f p0, Vec3f p1, Vec3f p2, PrimHit& hit) const {
    return Intersect(BaldwinWeberMap::Of(p0, p1, p2), hit);
  }
  bool Intersect(const BaldwinWeberMap& map, PrimHit& hit) const {
    const float *o = org_ + map.axis, *d = dir_ + map.axis;
    const float height = R::Sum(map.plane[1], o[2], R::Sum(map.plane[0], o[1], o[0])) + map.plane[2],
                descent = R::Sum(map.plane[1], d[2], R::Sum(map.plane[0], d[1], d[0]));
    const float t = -height / descent, y = R::Sum(t, d[1], o[1]), z = R::Sum(t, d[2], o[2]);
    const float u = R::Sum(map.u[1], z, R::Sum(map.u[0], y, map.u[2]));
    if (!(u >= 0 && u <= 1)) return false;
    const float v = R::Sum(map.v[1], z, R::Sum(map.v[0], y, map.v[2]));
    if (!(v >= 0 && u + v <= 1)) return false;
    hit = {t, u, v};
    return true;
  }

 private:
  float org_[5], dir_[5];  // x y z x y: three in a row in any cyclic order
};

template <class R>
class Pluecker : public Unguarded {
 public:
  explicit Pluecker(const rb_ray& ray) : org_(LoadVec3(ray.org)), dir_(LoadVec3(ray.dir)) {}

  bool Intersect(Vec3f p0, Vec3f p1, Vec3f p2, PrimHit& hit) const {
    const Vec3f a = p0 - org_, b = p1 - org_, c = p2 - org_;
    const float u = Side(b, c), v = Side(c, a), w = Side(a, b), sum = u + v + w;
    if (!SameSign(u, v, w) || sum == 0) return false;
    const Vec3f n = R::Cross(p1 - p0, p2 - p0);
    hit = {R::Dot(n, a) / R::Dot(n, dir_), v / sum, w / sum};
    return true;
  }

 private:
  /// On which side of the ray the edge from a to b passes, times twice the volume that they span.
  float Side(Vec3f a, Vec3f b) const { return R::Dot(dir_, R::Cross(b - a, a + b)); }

  Vec3f org_, dir_;
};

template <class F, class R>
class Woop : public Unguarded {
 public:
  explicit Woop(const rb_ray& ray) : org_(To<F>(LoadVec3(ray.org))) {
    const Vec3<F> dir = To<F>(LoadVec3(ray.dir));
    kz_ = std::fabs(dir.x) > std::fabs(dir.y) ? (std::fabs(dir.x) > std::fabs(dir.z) ? 0 : 2)
                                              : (std::fabs(dir.y) > std::fabs(dir.z) ? 1 : 2);
    kx_ = (kz_ + 1) % 3, ky_ = (kz_ + 2) % 3;
    sx_ = dir[kx_] / dir[kz_], sy_ = dir[ky_] / dir[kz_], sz_ = 1 / dir[kz_];
  }

  bool Intersect(Vec3f p0, Vec3f p1, Vec3f p2, PrimHit& hit) const {
    const Vec3<F> a = Sheared(p0), b = Sheared(p1), c = Sheared(p2);
    F u = R::Difference(c.x, b.y, c.y, b.x), v = R::Difference(a.x, c.y, a.y, c.x),
      w = R::Difference(b.x, a.y, b.y, a.x);
    if constexpr (std::is_same_v<F, float>) {
      if (u == 0 || v == 0 || w == 0) {
        u = Exactly(c.x, b.y, c.y, b.x), v = Exactly(a.x, c.y, a.y, c.x), w = Exactly(b.x, a.y, b.y, a.x);
      }
    }
    const F det = u + v + w;
    if (!SameSign(u, v, w) || det == 0) return false;
    const F t = R::Dot({u, v, w}, Vec3<F>{sz_ * a.z, sz_ * b.z, sz_ * c.z}), inv = 1 / det;
    hit = {float(t * inv), float(v * inv), float(w * inv)};
    return true;
  }

 private:
  /// Of products that double holds exactly.
  static float Exactly(float a, float b, float c, float d) {
    return float(double(a) * double(b) - double(c) * double(d));
  }
  Vec3<F> Sheared(Vec3f p) const {
    const Vec3<F> a = To<F>(p) - org_;
    return {R::Sum(-sx_, a[kz_], a[kx_]), R::Sum(-sy_, a[kz_], a[ky_]), a[kz_]};
  }

  Vec3<F> org_;
  int kx_, ky_, kz_;
  F sx_, sy_, sz_;
};

}  // namespace raybench::published
