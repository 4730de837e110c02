// The ray-box test that all structures share, and the boxes it is asked about.
//
// A plane p of an axis is met at t = (p - o) / d. Which of a box's two planes comes first is told by the sign
// of d, NaN (0 * inf: the origin on the plane of a parallel ray) drops out of min and max. Rounding is
// monotone, so the interval of a box contains the interval of each box inside it.
//
// Nothing that the triangle test accepts may be culled. That takes more than Ize's (2013) far * (1 + 2
// gamma_3), which covers the errors of this test alone. Let u = 2^-24, o the origin, z the ray's main axis, S = d.x / d.z,
// |S| <= 1, and a = A.x - o.x, b = A.z - o.z for each vertex A. Woop's sheared x = fl(fl(a) - fl(fl(S) fl(b))) is
// a (1 + d1) - S b (1 + d2) (1 + d3) (1 + d4), times 1 + d5, each |d| <= u, and d3, the slope's, is the same at all
// vertices. Given sheared vertices the signs of the edge functions are exact, so an accepted ray passes through them: there
// are weights, none negative, of sum 1, for which their weighted sum is 0. Let p be that sum of the true vertices, a point of
// the triangle, and D = |S (p.z - o.z)| how far the ray goes along x. At p.z the ray is |sum of weights (x - true x)| beside
// p. Numbers from an interval lie half its length from their mean in the mean, at most. So with e the triangle's extent
// along x and E its largest one, d1 gives u (|p.x - o.x| + e / 2), d2 and d4 give u (2 D + E), d3 gives u D, and d5,
// since the sheared x are 0 in the mean, u (e + E) / 2. Where the product underflows, it is off by no more than u |a|
// (RayShear), u (|p.x - o.x| + e / 2) again. In all: the ray passes p within 5 u D + 1.5 u (e + E) on x, on y likewise, and
// exactly at its z. The first term moves t by 5 u relatively, the slab arithmetic by 3 u more, at either end: the far
// end is scaled by 1 + 32 u. The second does not depend on the ray: when the tree is built, a triangle's box is padded by it
// and by half an ulp of the coordinate, which rounding may take back; so the box of a triangle that is large, or near 0, ends
// closer to it than origins of rays that leave it begin.
//
// Tests in double and exact ones find t itself to within rounding. Their t must not be clamped into an
// interval that float arithmetic computed (ray/primitive.h), so the near end is scaled too, by 1 - 32 u: then
// the interval of every box around the primitive holds the exact t and its rounding. A near end below zero
// moves up, but stays below zero, where it decides nothing.
//
// Where boxes hold only a part of a primitive, clipped to a cell or found to lie in it, t is clamped into the interval
// of the whole primitive's box, not of the part's, and the test's t may come before the part's near plane by its own
// error. So there, too, traversal scales both ends (Widened()); what the clamp uses stays as it is, so that all
// structures give the same t.
//
// Subnormal numbers: a difference of floats does not underflow; where t does, it is rounded as the interval's
// ends are, and rounding is monotone; where 1/d does, it keeps enough bits for the scaling above; where 1/d
// overflows, the near end is taken with the largest float, hence too early, and the far one is infinite.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "accel/base/lanes.h"
#include "accel/base/vec3.h"
#include "accel/contract/raybench.h"
#include "accel/contract/structure.h"
#include "accel/ray/triangle.h"

namespace raybench {

inline float LargestExtent(Vec3f lo, Vec3f hi) {
  const Vec3f e = hi - lo;
  return std::max(e.x, std::max(e.y, e.z));
}

/// 1.5 u and u, with a little more for what is rounded here.
inline constexpr float kPadding = 0x1.9p-24f, kHalfUlp = 0x1.000004p-24f;

/// The box, padded as above for a triangle of these extents; at least by one ulp of each coordinate, since
/// less would be rounded away.
inline Bounds3 Padded(const Bounds3& box, Vec3f extent) {
  const float most = std::max(extent.x, std::max(extent.y, extent.z)) * kPadding;
  Bounds3 b;
  for (int a = 0; a < 3; ++a) {
    const float pad = std::max(extent[a] * kPadding + most, std::numeric_limits<float>::denorm_min());
    b.lo[a] = box.lo[a] - (pad + std::fabs(box.lo[a]) * kHalfUlp);
    b.hi[a] = box.hi[a] + (pad + std::fabs(box.hi[a]) * kHalfUlp);
  }
  return b;
}

/// The same for what fills the box; `times` as much for what is tested otherwise than triangles.
inline Bounds3 PaddedBounds(const Bounds3& box, float times = 1) { return Padded(box, box.Extent() * times); }

/// The triangle's bounds, padded.
inline Bounds3 PaddedBounds(Vec3f p0, Vec3f p1, Vec3f p2) {
  return PaddedBounds(Bounds3{Min(Min(p0, p1), p2), Max(Max(p0, p1), p2)});
}

/// What builders must enclose so that conservative traversal finds the primitive. Procedural primitives bring
/// bounds that are rounded outward already.
inline Bounds3 PaddedPrimBounds(const rb_geometry& g, uint32_t prim) {
  if (prim >= g.triangle_count) return PrimBounds(g, prim);
  return PaddedBounds(Vertex(g, prim, 0), Vertex(g, prim, 1), Vertex(g, prim, 2));
}

/// What a ray brings to slab tests, with its ends scaled as above: an axis a lane; the last lane is not used.
struct SlabRay {
  static constexpr float kNearScale = 1 - 0x1p-19f;

  Float4 org, dir;           ///< what needs no 1/d need not wait for it
  Float4 inv;                ///< 1/d
  Float4 inv_near, inv_far;  ///< the same, scaled; the near one stays finite
  unsigned signs;            ///< bit a: the sign bit of d[a]

  [[gnu::always_inline]] SlabRay(const rb_ray& ray, Slack slack) {
    constexpr float kMax = std::numeric_limits<float>::max();
    const float near_scale = slack == Slack::kBothEnds ? kNearScale : 1;
    const float far_scale = slack == Slack::kNone ? 1 : 1 + 0x1p-19f;
    org = Load<Float4>(ray.org);
    dir = Load<Float4>(ray.dir), inv = 1 / dir;
    signs = Mask(dir) & 7u;
    const Int4 sign = Int4(inv) & int32_t(0x80000000);
    inv_near = Float4(Int4(Smaller<4>(Abs(inv), Splat<Float4>(kMax))) | sign) * near_scale;
    inv_far = inv * far_scale;
  }

  /// The upper plane is met first.
  bool negative(int axis) const { return (signs >> axis & 1) != 0; }

  /// For boxes of parts of primitives, where `slack` is that of this: none, or at both ends.
  SlabRay Widened(Slack slack) const {
    SlabRay wide = *this;
    wide.inv_near = inv_near * Widening(slack);
    return wide;
  }
  static constexpr float Widening(Slack slack) { return slack == Slack::kFarEnd ? kNearScale : 1; }

  /// The t interval inside the box; `tnear > tfar` if there is none.
  void Interval(const Bounds3& box, float& tnear, float& tfar) const {
    tnear = -std::numeric_limits<float>::infinity();
    tfar = std::numeric_limits<float>::infinity();
    for (int a = 0; a < 3; ++a) {
      const float n = ((negative(a) ? box.hi[a] : box.lo[a]) - org[a]) * inv_near[a];
      const float f = ((negative(a) ? box.lo[a] : box.hi[a]) - org[a]) * inv_far[a];
      tnear = n > tnear ? n : tnear;
      tfar = f < tfar ? f : tfar;
    }
  }
};

/// A SlabRay for tests that take t = p scale + move, one instruction where t = (p - o) / d takes two.
///
/// That errs by 2^-23 |o / d| more than (p - o) / d does, however close p is to o. So the product o / d is moved outward
/// by 2^-22 of itself, and 1/d by 2^-18, once a ray, whatever the slack and Widened(), but none: then the interval of a box
/// contains the one that SlabRay computes of it (with u = 2^-24: 32 u there, and relative errors of at most 2 u there and
/// 4 u here; 2 u |o / d| here; a near end below zero may move up, but stays below zero). Boxes grow by no more than the
/// coordinates of the origin are worth. No plane, be it infinite, gives NaN. A ray begins by waiting for its division: only
/// two products follow that.
struct MovedSlab {
  Float4 near_scale, far_scale, near_move, far_move;

  /// Neither do products overflow, nor does o / d underflow: else the above does not hold.
  static bool Fits(const SlabRay& slab) {
    constexpr float kMost = 0x1p60f;
    const Float4 inv = Abs(slab.inv), org = Abs(slab.org);
    return (Mask((inv < kMost) & (inv > 1 / kMost) & (org < kMost) & ((org > 1 / kMost) | (org == 0.0f))) &
            7u) == 7u;
  }

  [[gnu::always_inline]] explicit MovedSlab(const SlabRay& slab)
      : near_scale(slab.inv * (1 - 0x1p-18f)), far_scale(slab.inv * (1 + 0x1p-18f)) {
    // With the sign of o / d.
    const Int4 sign = (Int4(slab.org) ^ Int4(slab.dir)) & int32_t(0x80000000);
    const Float4 outward = Float4(sign | Int4(Splat<Float4>(0x1p-22f)));
    near_move = slab.org * (-1.0f - outward) * near_scale, far_move = slab.org * (outward - 1.0f) * far_scale;
  }
};

}  // namespace raybench
