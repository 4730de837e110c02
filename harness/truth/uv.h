// u and v of a hit against the point where the ray meets the triangle's plane. VERDICTS.md has the bound.
#pragma once

#include "accel/contract/raybench.h"
#include "datasets/scene/scene.h"

namespace raybench {

/// What u and v of an answer are, and how far a sound float test may be off.
struct UvTruth {
  /// False: the answer is a miss or no triangle, or the ray so nearly parallel to it that float arithmetic
  /// may say anything. Nothing below is set then.
  bool known = false;
  double u = 0, v = 0, u_bound = 0, v_bound = 0;

  /// The larger error of u and v in units of its bound: no sound test has more than 1. Infinite where one of
  /// them is no finite number. What is known.
  double Error(const rb_hit& answer) const;
};

/// Of the answered triangle, whatever the truth. Costs about as much as testing the triangle once.
UvTruth TrueUv(const Scene& scene, const rb_ray& ray, const rb_hit& answer);

}  // namespace raybench
