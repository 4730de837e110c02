// How far one surface is from another, such as a level of detail from its original.
#pragma once

#include <cstdint>

#include "datasets/scene/scene.h"

namespace raybench {

/// Over samples of one surface, their distances to the other, in the units of both.
struct OneSided {
  uint64_t samples = 0;
  double max = 0, mean = 0, rms = 0;
};

/// From the vertices and the face centres of `from`, exactly to the nearest point of a triangle of `to` (in double).
/// The largest of both directions is the Hausdorff distance of the samples; that of the surfaces is as large or
/// larger. Both must have triangles, no procedural primitives, and the same scale_exponent.
OneSided DistanceTo(const Scene& from, const Scene& to);

/// Share of the lines that meet just one of two surfaces among those that meet `a`: parallel lines in `directions`
/// random directions, `across` x `across` each, over the sphere around both scenes.
struct SilhouetteError {
  uint64_t lines = 0;  ///< that meet `a`
  uint64_t differ = 0;
  double Share() const { return lines > 0 ? double(differ) / double(lines) : 0; }
};
SilhouetteError CompareSilhouettes(const Scene& a, const Scene& b, uint32_t directions, uint32_t across,
                                   uint64_t seed);

}  // namespace raybench
