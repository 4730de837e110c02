// Which vertices lie at the same place.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "accel/base/vec3.h"

namespace raybench {

/// For each position the lowest index of one that is equal to it, coordinate by coordinate (0 equals -0; NaN
/// must not occur).
std::vector<uint32_t> WeldVertices(std::span<const Vec3f> positions);

}  // namespace raybench
