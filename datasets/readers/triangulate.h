// Polygons of mesh files into triangles.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "accel/base/vec3.h"

namespace raybench {

/// Cuts one polygon of n >= 3 corners into n - 2 triangles of its corners (0 to n - 1), in `triangles`.
///
/// The polygon may be non-convex, may have collinear corners, and may touch itself (a hole joined to the
/// outline by an edge there and back). It is cut as it looks along the largest component of its normal, with
/// exact orientation tests. Where the fan from corner 0 covers it, as for every convex polygon, it is that
/// fan. Returns false if there is no such cut, because the outline crosses itself, or none was found in
/// bounded time (some 10^8 tests); `triangles` is the fan then. So it is for corners that are not finite.
bool Triangulate(std::span<const Vec3f> corners, std::vector<std::array<uint32_t, 3>>& triangles);

}  // namespace raybench
