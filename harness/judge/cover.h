// Whether boxes together cover a triangle: what the leaves of a space partition must do.
#pragma once

#include <span>

#include "accel/base/vec3.h"

namespace raybench {

/// True if the triangle lies in the union of the closed boxes, but for pieces thinner than 2^-44 times the
/// largest coordinate of its corners. The triangle's pieces outside of one box are followed through the
/// others, in double.
bool BoxesCover(std::span<const Bounds3> boxes, Vec3f p0, Vec3f p1, Vec3f p2);

}  // namespace raybench
