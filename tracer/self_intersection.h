// Where a ray that leaves a surface starts, so that it does not find that surface again.
#pragma once

#include "tracer/surface.h"
#include "tracer/tracer.h"

namespace raybench {

struct Departure {
  Vec3f org;
  double distance = 0;            ///< that the ray goes before hits count
  uint32_t skip = RAYBENCH_NONE;  ///< primitive that is not hit
};

/// The start of a ray that leaves `surface`, on primitive `prim`, towards +normal (side > 0) or -normal
/// (side < 0). `size` is that of kFixedTnear and kNormalOffset, in the scene's present units; `flat`: the
/// primitive is a triangle or polygon, which cannot be hit again.
Departure Depart(const SurfacePoint& surface, double side, SelfIntersection cure, double size, uint32_t prim,
                 bool flat);

}  // namespace raybench
