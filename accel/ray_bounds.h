// The ray-box test that all structures share.
//
// A plane p of an axis is met at t = (p - o) / d. Which of a box's two planes comes first is told by the sign
// of d, NaN (0 * inf: the origin on the plane of a parallel ray) drops out of min and max, and both ends of
// the interval are moved outward by a slack, so that no primitive the triangle test accepts is culled. Ize
// (2013) scales the far end by 1 + 2 gamma_3, which covers the errors of this test itself; the triangle test
// errs too, in proportion to the distance of its *vertices*, not of the hit point, so a relative padding does
// not cover triangles much longer than the ray. Let S be the largest |p - o| over the scene's planes and u =
// 2^-24. The sheared vertex of Woop's test, fl(fl(A.x-o.x) - fl(Sx fl(A.z-o.z))), is off by at most 6 u S to
// first order; given sheared vertices its signs are exact; the interpolated point therefore lies within 6 u S
// of the primitive's box along x and y, and within its z extent. The slab arithmetic adds 3 u S. The slack is
// 16 u S / |d|.
//
// Rounding is monotone, so the interval of a box contains the interval of each box inside it.
#pragma once

#include <cmath>
#include <limits>

#include "accel/raybench.h"
#include "accel/vec3.h"

namespace raybench {

/// What a ray brings to slab tests. With `conservative` the slack above is used, else none.
struct SlabRay {
  Vec3f org;
  Vec3f inv_near, inv_far;  ///< 1/d; the near one stays finite
  Vec3f slack;              ///< in units of t
  bool negative[3];         ///< sign bit of d: the upper plane is met first

  SlabRay(const rb_ray& ray, const Bounds3& scene, bool conservative) : org(LoadVec3(ray.org)) {
    constexpr float kMax = std::numeric_limits<float>::max();
    float reach = 0;
    if (conservative && !scene.Empty()) {
      for (int a = 0; a < 3; ++a) {
        reach = std::fmax(reach, std::fmax(std::fabs(scene.lo[a] - org[a]), std::fabs(scene.hi[a] - org[a])));
      }
    }
    const float shift = reach * 0x1p-20f;
    for (int a = 0; a < 3; ++a) {
      const float inv = 1 / ray.dir[a];
      const bool finite = std::fabs(inv) <= kMax;
      negative[a] = std::signbit(ray.dir[a]);
      inv_far[a] = inv;
      inv_near[a] = finite ? inv : std::copysign(kMax, inv);
      slack[a] = finite ? shift * std::fabs(inv) : 0;
    }
  }

  /// The t interval inside the box; `tnear > tfar` if there is none.
  void Interval(const Bounds3& box, float& tnear, float& tfar) const {
    tnear = -std::numeric_limits<float>::infinity();
    tfar = std::numeric_limits<float>::infinity();
    for (int a = 0; a < 3; ++a) {
      const float first = negative[a] ? box.hi[a] : box.lo[a];
      const float last = negative[a] ? box.lo[a] : box.hi[a];
      const float n = (first - org[a]) * inv_near[a] - slack[a];
      const float f = (last - org[a]) * inv_far[a] + slack[a];
      tnear = n > tnear ? n : tnear;
      tfar = f < tfar ? f : tfar;
    }
  }
};

}  // namespace raybench
