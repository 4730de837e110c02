// Rays that leave surfaces, as a tracer sends them.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "accel/host/registry.h"
#include "harness/offset/leaving.h"
#include "tracer/tracer.h"

namespace raybench {

/// A ray before any cure: where it leaves, as a hit has told it, and where to.
struct Departing {
  uint32_t prim;  ///< a triangle
  float u, v;     ///< as answered: rounding may have put them beside it
  float side;     ///< 1: towards the normal by winding; -1
  Vec3f dir;      ///< unit; leaves to that side, exactly

  Spot At() const { return SpotOf(prim, u, v, side); }
};

struct DepartureOptions {
  uint64_t count = 1000000, seed = 1;
  bool aimed = false;  ///< eye rays are aimed at edges and vertices
  uint32_t threads = 0;
  std::function<void(double fraction)> progress = {};
};

/// Paths of up to six rays each through the scene, from its first camera and from the sphere around it in turn,
/// hits found by bvh_wide: the same rays whatever structure is under test, and at any number of threads. Directions
/// are uniform over the hemisphere on the side that the path came from; on a surface that transmits, half of them are
/// on the other side. Throws InputError where no ray finds a surface.
std::vector<Departing> MakeDepartures(const Registry& registry, const Scene& scene, const LeavingTruth& truth,
                                      const DepartureOptions& options);

/// The ray that a cure makes of one.
struct Departed {
  rb_ray ray;
  uint32_t skip;  ///< RAYBENCH_NONE: nothing
  Vec3d begin;    ///< from here on hits count
};

/// As the tracer does it (tracer/self_intersection.h). `size`: in the scene's present units.
Departed Depart(const Scene& scene, const Departing& departing, SelfIntersection cure, double size);

}  // namespace raybench
