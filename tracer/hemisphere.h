// Rays into the hemisphere over surfaces that a picture shows: what path tracers and ambient occlusion ask.
#pragma once

#include <cstdint>

#include "accel/host/registry.h"
#include "tracer/rays/ray_set.h"

namespace raybench {

/// Cosine-distributed rays from `count` seeded picks among the first hits of `camera` on `tree`; kind
/// "diffuse", depth 1, infinite. Fewer than `count` only if nothing was hit (then empty).
RaySet DiffuseBounce(const Scene& scene, const Tree& tree, const RaySet& camera, uint64_t count,
                     uint64_t seed);

/// Rays from one point, side by side.
inline constexpr uint32_t kOcclusionRaysPerPoint = 8;
/// Length of an occlusion ray in diagonals of the scene's bounds.
inline constexpr double kOcclusionReach = 0.1;

/// The same for ambient occlusion (Zhukov, Iones, Kronin 1998): any-hit rays, kOcclusionRaysPerPoint from
/// each pick, that end after kOcclusionReach; kind "ambient_occlusion", depth 1.
RaySet AmbientOcclusion(const Scene& scene, const Tree& tree, const RaySet& camera, uint64_t count,
                        uint64_t seed);

}  // namespace raybench
