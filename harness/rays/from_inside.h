// Rays that show what random rays hide: from inside a closed mesh, aimed at its edges and vertices.
#pragma once

#include <cstdint>
#include <optional>

#include "tracer/rays/ray_set.h"

namespace raybench {

/// `count` rays of kind "aimed": even ones to the midpoint of a random triangle's random edge, rounded to
/// float, odd ones to a vertex. Origins are uniform in `origins`, by default a box around the centre of the
/// scene's bounds with 5 % of their extent: choose it inside the mesh. Directions are float differences,
/// not normalised, so t is about 1 at the target; tnear 0, tfar infinite. Throws InputError if the scene
/// has no triangles.
RaySet AimedRays(const Scene& scene, uint64_t count, uint64_t seed, std::optional<Bounds3> origins = {});

}  // namespace raybench
