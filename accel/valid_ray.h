// Which rays may be asked about. Callers check before they ask; structures answer the others with a miss.
#pragma once

#include <limits>

#include "accel/raybench.h"
#include "accel/simd.h"

namespace raybench {

/// No |component| of the origin is above `farthest`, none of the direction above `longest` and one at least
/// `shortest` (all finite); tnear is finite and >= 0, tfar not NaN. A few instructions, for it stands before
/// every ray that is traced.
inline bool IsRayWithin(const rb_ray& ray, float farthest, float longest, float shortest) {
  constexpr float kMax = std::numeric_limits<float>::max(), kInf = std::numeric_limits<float>::infinity();
  const float* const r = reinterpret_cast<const float*>(&ray);
  const Float4 org_tnear = Load4(r), dir_tfar = Load4(r + 4), length = Abs(dir_tfar);
  // Comparisons are false for NaN.
  const auto within = (org_tnear >= Float4{-farthest, -farthest, -farthest, 0}) &
                      (org_tnear <= Float4{farthest, farthest, farthest, kMax}) &
                      (length <= Float4{longest, longest, longest, kInf});
  return Mask(within) == 15u && (Mask(length >= Splat4(shortest)) & 7u) != 0;
}

/// Finite origin and direction, direction not zero, tnear finite and >= 0, tfar not NaN: what a structure may
/// be given. Callers replace other rays by InvalidRayStandIn() and count them.
inline bool IsValidRay(const rb_ray& ray) {
  constexpr float kMax = std::numeric_limits<float>::max(), kMin = std::numeric_limits<float>::denorm_min();
  return IsRayWithin(ray, kMax, kMax, kMin);
}

/// A valid ray that misses everything (tfar < tnear).
inline rb_ray InvalidRayStandIn() { return {{0, 0, 0}, 1, {0, 0, 1}, 0}; }

}  // namespace raybench
