// Rays and numbers that many tests want.
#pragma once

#include <limits>

#include "accel/base/vec3.h"
#include "accel/contract/raybench.h"

namespace raybench::testing {

inline constexpr float kInf = std::numeric_limits<float>::infinity();
inline constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

inline rb_ray MakeRay(Vec3f o, Vec3f d, float tnear = 0, float tfar = kInf) {
  return {{o.x, o.y, o.z}, tnear, {d.x, d.y, d.z}, tfar};
}

}  // namespace raybench::testing
