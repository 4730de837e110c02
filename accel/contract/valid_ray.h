// Which rays may be asked about. Callers check before they ask; structures answer the others with a miss.
#pragma once

#include <limits>

#include "accel/base/simd.h"
#include "accel/contract/raybench.h"

namespace raybench {

/// No |component| of the origin is above `farthest`, none of the direction above `longest` and one at least
/// `shortest` (all finite); tnear is finite and >= 0, tfar not NaN. A few instructions, for it stands before
/// every ray that is traced.
inline bool IsRayWithin(const rb_ray& ray, float farthest, float longest, float shortest) {
  constexpr float kMax = std::numeric_limits<float>::max(), kInf = std::numeric_limits<float>::infinity();
  // Magnitudes are compared as integers: NaN is larger than all of them, and subnormals count even where the
  // thread's floating-point state takes them for zero.
  const float* const r = reinterpret_cast<const float*>(&ray);
  const Int4 org_tnear = Int4(Load<Float4>(r)), distance = org_tnear & 0x7FFFFFFF,
             length = Int4(Load<Float4>(r + 4)) & 0x7FFFFFFF;
  const Int4 within = (distance <= Int4(Float4{farthest, farthest, farthest, kMax})) &
                      (length <= Int4(Float4{longest, longest, longest, kInf})) &
                      ((org_tnear >= 0) | (distance == 0) | Int4{-1, -1, -1, 0});
  return Mask(within) == 15u && (Mask(length >= Int4(Splat<Float4>(shortest))) & 7u) != 0;
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
