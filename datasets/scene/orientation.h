// On which side of a line a point lies, exactly.
#pragma once

#include "accel/base/vec3.h"

namespace raybench {

/// Sign (-1, 0, 1) of component `axis` of (b - a) x (c - a): of the area of the triangle seen along that
/// axis. Exact for all finite floats.
int Orientation(Vec3f a, Vec3f b, Vec3f c, int axis);

/// True if the three points are exactly collinear or coincide. Exact for all finite floats.
bool IsDegenerate(Vec3f a, Vec3f b, Vec3f c);

}  // namespace raybench
