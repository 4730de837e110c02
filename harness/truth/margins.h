// Private to the oracles: what float arithmetic may say of one ray and one procedural primitive.
#pragma once

#include <cstdint>

#include "accel/contract/raybench.h"
#include "datasets/scene/scene.h"

namespace raybench {

/// One ray against one primitive as float tests may see it.
struct Appraisal {
  bool possible = false;      ///< some rounding within the bound makes the ray meet it, at any t
  bool grazing = false;       ///< procedural: some rounding within the bound makes the ray miss it
  double t = 0, t_error = 0;  ///< a float test answers t +- t_error (or 8 ulp, whichever is more)
};

/// The axes along which the direction is longest: one, but for ties. A test shears along one of them, whichever
/// it takes, and what it may err by is another along each.
struct MainAxes {
  int axis[3], count = 0;

  explicit MainAxes(const rb_ray& ray);
  const int* begin() const { return axis; }
  const int* end() const { return axis + count; }
};

/// What a test may say that does as `a` or as `b`; one of them is that of no test at all if it is empty.
Appraisal Either(const Appraisal& a, const Appraisal& b);

/// `root`: for curved primitives 0 where the ray enters, 1 where it leaves; polygons have root 0 only.
Appraisal AppraiseProcedural(const Scene& scene, const rb_ray& ray, uint32_t prim, int root);

/// How many values `root` has for a primitive.
int RootCount(const Scene& scene, uint32_t prim);

/// True if the ray lies in the polygon's plane or the cone's side, up to rounding, and t within its bounds:
/// then the primitive is as right an answer as a miss.
bool LiesInSurface(const Scene& scene, const rb_ray& ray, uint32_t prim, double t);

}  // namespace raybench
