// A ray as wide traversal needs it: SlabRay (accel/ray/bounds.h) in lanes.
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>

#include "accel/bvh/wide/lanes.h"
#include "accel/ray/bounds.h"
#include "accel/ray/triangle.h"

namespace raybench {

/// SlabRay's numbers, an axis a lane; the last lane is not used.
struct SlabRay4 {
  Float4 org, inv_near, inv_far;
  unsigned signs;  ///< bit a: the sign bit of d[a]

  [[gnu::always_inline]] SlabRay4(const rb_ray& ray, Slack slack) {
    constexpr float kMax = std::numeric_limits<float>::max();
    const float near_scale = slack == Slack::kBothEnds ? SlabRay::kNearScale : 1;
    const float far_scale = slack == Slack::kNone ? 1 : 1 + 0x1p-19f;
    org = Load<Float4>(ray.org);
    const Float4 dir = Load<Float4>(ray.dir), inv = 1 / dir;
    signs = Mask(dir) & 7u;
    const Int4 sign = Int4(inv) & int32_t(0x80000000);
    inv_near = Float4(Int4(Smaller<4>(Abs(inv), Splat<Float4>(kMax))) | sign) * near_scale;
    inv_far = inv * far_scale;
  }
};

/// What the node test multiplies and adds. kMoved: t = p inv - o inv, one instruction where t = (p - o) inv takes two.
///
/// That errs by 2^-23 |o inv| more than the shared test, however close p is to o. So the product o inv is moved
/// outward by 2^-22 of itself, and inv by 2^-21, once a ray: then the interval of a box contains the one that the
/// shared test computes of it (with u = 2^-24: relative errors of at most 2 u there and 3 u here; 2 u |o inv| here;
/// a near end below zero may move up, but stays below zero). Boxes grow by no more than the coordinates of the origin
/// are worth. Where products may over- or underflow, Fits says no.
template <int kWidth, bool kMoved>
class WideRay {
 public:
  using F = FloatN<kWidth>;

  /// Neither do products overflow, nor does o inv underflow.
  static bool Fits(const SlabRay4& slab) {
    constexpr float kMost = 0x1p60f;
    const Float4 inv = Abs(slab.inv_far), org = Abs(slab.org);
    return (Mask((inv < kMost) & (inv > 1 / kMost) & (org < kMost) & ((org > 1 / kMost) | (org == 0.0f))) &
            7u) == 7u;
  }

  /// `widening` scales the near ends, as SlabRay::Widened() does.
  [[gnu::always_inline]] explicit WideRay(const SlabRay4& slab, float widening = 1) {
    Float4 n = slab.inv_near * widening, f = slab.inv_far, near_move = slab.org, far_move = slab.org;
    if constexpr (kMoved) {
      n = n * (1 - 0x1p-21f), f = f * (1 + 0x1p-21f);
      const Float4 on = slab.org * n, of = slab.org * f;
      near_move = -on - Abs(on) * 0x1p-22f, far_move = -of + Abs(of) * 0x1p-22f;
    }
    for (unsigned a = 0; a < 3; ++a) {
      near_scale_[a] = Splat<F>(n[a]), far_scale_[a] = Splat<F>(f[a]);
      near_move_[a] = Splat<F>(near_move[a]), far_move_[a] = Splat<F>(far_move[a]);
      near_row_[a] = a + 3 * (slab.signs >> a & 1);
      far_row_[a] = 2 * a + 3 - near_row_[a];
    }
  }

  /// Bit i: the ray may meet box i in [tnear, tfar], from entry[i] on. rows(r): the planes, x y z of the lower ends,
  /// then of the upper ones.
  template <class Rows>
  [[gnu::always_inline]] unsigned Meets(const Rows& rows, F tnear, F tfar, F& entry) const {
    const F nx = T(rows(near_row_[0]), near_scale_[0], near_move_[0]),
            ny = T(rows(near_row_[1]), near_scale_[1], near_move_[1]),
            nz = T(rows(near_row_[2]), near_scale_[2], near_move_[2]),
            fx = T(rows(far_row_[0]), far_scale_[0], far_move_[0]),
            fy = T(rows(far_row_[1]), far_scale_[1], far_move_[1]),
            fz = T(rows(far_row_[2]), far_scale_[2], far_move_[2]);
    if constexpr (kMoved) {  // no NaN, so that operands may come in any order: a shorter chain
      entry = Larger<kWidth>(Larger<kWidth>(nx, ny), Larger<kWidth>(nz, tnear));
      const F exit = Smaller<kWidth>(Smaller<kWidth>(fx, fy), Smaller<kWidth>(fz, tfar));
      return LessEqual<kWidth>(entry, exit);
    }
    entry = Larger<kWidth>(nx, Larger<kWidth>(ny, Larger<kWidth>(nz, tnear)));
    const F exit = Smaller<kWidth>(fx, Smaller<kWidth>(fy, Smaller<kWidth>(fz, tfar)));
    return LessEqual<kWidth>(entry, exit);
  }

 private:
  [[gnu::always_inline]] static F T(F plane, F scale, F move) {
    if constexpr (kMoved) return MultiplyAdd<kWidth>(plane, scale, move);
    return (plane - move) * scale;
  }

  F near_scale_[3], far_scale_[3], near_move_[3], far_move_[3];  // not kMoved: moves are the origin
  unsigned near_row_[3], far_row_[3];
};

}  // namespace raybench
