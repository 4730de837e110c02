// Ray sets: the frozen batches that every structure is asked.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "accel/base/random.h"
#include "accel/contract/raybench.h"
#include "datasets/scene/scene.h"

namespace raybench {

/// An immutable batch of rays of one kind and depth, in one order.
struct RaySet {
  std::string kind;             ///< camera, shadow, reflection, refraction, random, diffuse, ...
  uint32_t depth = 0;           ///< 0: camera rays and what starts at the camera; n: after n bounces
  std::string order;            ///< "traced" (as the tracer made them, tiled), "shuffled" or "recorded"
  uint32_t query = RB_CLOSEST;  ///< RB_CLOSEST or RB_ANY; never mixed
  std::vector<rb_ray> rays;
  uint64_t invalid_rays = 0;  ///< NaN, zero direction: replaced by a defined miss
  uint64_t outside_rays = 0;  ///< rays that miss the scene's bounds
  std::string hash;           ///< 16 hex digits over kind, depth, order, query and all rays in order
  std::string name = {};      ///< of a replayed set, from its file; empty: kind and depth name it

  /// `name`, else "camera", "shadow.0", "reflection.1", "random", ...: kind, with the depth where a kind
  /// has several.
  std::string Label() const;
};

/// Replaces and counts invalid rays, counts those outside `bounds`, sets the hash. Call once, last.
void Freeze(RaySet& set, const Bounds3& bounds);

/// The set cut down to at most `limit` rays: evenly spaced runs of 64 neighbouring rays, so that coherence
/// survives. Re-frozen. limit 0: all.
RaySet Thin(const RaySet& set, uint64_t limit, const Bounds3& bounds);

/// A shuffled twin (Fisher-Yates with `seed`).
RaySet Shuffle(const RaySet& set, uint64_t seed, const Bounds3& bounds);

/// An isotropic random line through the sphere around `bounds` (the unit sphere if they are empty): entry
/// point uniform on the sphere's surface weighted as for uniformly random lines, tfar infinite.
rb_ray RandomRay(const Bounds3& bounds, Random& random);

/// `count` of these for the scene's bounds; ray i takes stream i of `seed`.
RaySet RandomRays(const Scene& scene, uint64_t count, uint64_t seed);

}  // namespace raybench
