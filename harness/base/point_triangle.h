// How far a point is from a triangle.
#pragma once

#include <array>

#include "accel/base/vec3.h"

namespace raybench {

/// Of a point and a closed triangle (Ericson, Real-Time Collision Detection, 2005, 5.1.5).
inline double SquaredDistance(Vec3d p, const std::array<Vec3d, 3>& c) {
  const Vec3d ab = c[1] - c[0], ac = c[2] - c[0], ap = p - c[0], bp = p - c[1], cp = p - c[2];
  const double d1 = Dot(ab, ap), d2 = Dot(ac, ap), d3 = Dot(ab, bp), d4 = Dot(ac, bp), d5 = Dot(ab, cp),
               d6 = Dot(ac, cp);
  const auto to = [&](double u, double v) {
    const Vec3d d = ap - ab * u - ac * v;
    return Dot(d, d);
  };
  if (d1 <= 0 && d2 <= 0) return to(0, 0);
  if (d3 >= 0 && d4 <= d3) return to(1, 0);
  if (d6 >= 0 && d5 <= d6) return to(0, 1);
  const double vc = d1 * d4 - d3 * d2, vb = d5 * d2 - d1 * d6, va = d3 * d6 - d5 * d4;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return to(d1 / (d1 - d3), 0);
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return to(0, d2 / (d2 - d6));
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
    const double w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
    return to(1 - w, w);
  }
  return to(vb / (va + vb + vc), vc / (va + vb + vc));
}

}  // namespace raybench
