#include "accel/kd/split.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "accel/ray/bounds.h"

namespace raybench {
namespace {

Bounds3 Intersection(const Bounds3& a, const Bounds3& b) { return {Max(a.lo, b.lo), Min(a.hi, b.hi)}; }

/// A convex polygon. A plane adds one vertex to a convex polygon; rounding may bend it, so there is room for
/// what seven planes can make of any triangle: each crosses as many edges as there are, and keeps half of the
/// vertices then.
struct Polygon {
  Vec3d v[52];
  int n = 0;

  /// Becomes what of `from` lies on the side of the plane where sign * (coordinate - pos) <= 0 (Sutherland
  /// and Hodgman 1974). Errs by rounding in double alone, as if the plane were moved by some 2^-50 of the
  /// coordinates: padding is at least 2^-23 of them, and a quarter of it is spare (ray/bounds.h).
  void Clip(const Polygon& from, int axis, double pos, double sign) {
    n = 0;
    for (int i = 0; i < from.n; ++i) {
      const Vec3d &a = from.v[i], &b = from.v[i + 1 == from.n ? 0 : i + 1];
      const double da = sign * (a[axis] - pos), db = sign * (b[axis] - pos);
      if (da <= 0) v[n++] = a;
      if ((da < 0 && db > 0) || (da > 0 && db < 0)) {
        v[n] = a + (b - a) * (da / (da - db));
        v[n++][axis] = pos;
      }
    }
  }

  /// Box around it, grown by `pad` and rounded outward.
  Bounds3 Box(double pad) const {
    constexpr float kInf = std::numeric_limits<float>::infinity();
    Bounds3 box;
    if (n == 0) return box;
    for (int a = 0; a < 3; ++a) {
      double lo = v[0][a], hi = v[0][a];
      for (int i = 1; i < n; ++i) {
        lo = std::min(lo, v[i][a]);
        hi = std::max(hi, v[i][a]);
      }
      lo -= pad;
      hi += pad;
      box.lo[a] = float(lo);
      box.hi[a] = float(hi);
      if (double(box.lo[a]) > lo) box.lo[a] = std::nextafter(box.lo[a], -kInf);
      if (double(box.hi[a]) < hi) box.hi[a] = std::nextafter(box.hi[a], kInf);
    }
    return box;
  }
};

}  // namespace

KdParts SplitRef(const rb_geometry& geometry, const KdRef& ref, int axis, const Bounds3& left,
                 const Bounds3& right, bool clip, bool padded) {
  const Bounds3 in_left = Intersection(ref.box, left), in_right = Intersection(ref.box, right);
  if (!clip || ref.prim >= geometry.triangle_count) return {in_left, in_right};

  Polygon polygons[2];
  Polygon *part = &polygons[0], *next = &polygons[1];
  Bounds3 tight;
  part->n = 3;
  for (int k = 0; k < 3; ++k) {
    const Vec3f p = Vertex(geometry, ref.prim, k);
    tight.Extend(p);
    part->v[k] = ToDouble(p);
  }
  double pad = 0;
  if (padded) {
    const Bounds3 box = PaddedBounds(tight);
    for (int a = 0; a < 3; ++a)
      pad = std::max({pad, double(tight.lo[a]) - box.lo[a], double(box.hi[a]) - tight.hi[a]});
  }
  // Clip by the parent cell's faces where the triangle reaches beyond, then by the plane.
  for (int a = 0; a < 3; ++a) {
    const double lo = left.lo[a] - pad, hi = right.hi[a] + pad;
    if (tight.lo[a] < lo) {
      next->Clip(*part, a, lo, -1);
      std::swap(part, next);
    }
    if (tight.hi[a] > hi) {
      next->Clip(*part, a, hi, 1);
      std::swap(part, next);
    }
  }
  const double pos = right.lo[axis];
  KdParts parts;
  next->Clip(*part, axis, pos + pad, 1);
  parts.left = Intersection(next->Box(pad), in_left);
  next->Clip(*part, axis, pos - pad, -1);
  parts.right = Intersection(next->Box(pad), in_right);
  return parts;
}

}  // namespace raybench
