// A ray as wide traversal needs it: SlabRay (accel/ray/bounds.h) against many boxes at once.
#pragma once

#include "accel/base/lanes.h"
#include "accel/ray/bounds.h"

namespace raybench {

/// kMoved: as MovedSlab has it, where it fits. Number: FloatN<kWidth>, or float, which takes less memory and more time.
template <int kWidth, bool kMoved, class Number = FloatN<kWidth>>
class WideRay {
 public:
  using F = FloatN<kWidth>;

  /// `widening` scales the near ends, as SlabRay::Widened() does; MovedSlab allows for it.
  [[gnu::always_inline]] explicit WideRay(const SlabRay& slab, float widening = 1) {
    Float4 n = slab.inv_near * widening, f = slab.inv_far, near_move = slab.org, far_move = slab.org;
    if constexpr (kMoved) {
      const MovedSlab moved(slab);
      n = moved.near_scale, f = moved.far_scale, near_move = moved.near_move, far_move = moved.far_move;
    }
    for (unsigned a = 0; a < 3; ++a) {
      near_scale_[a] = Kept(n[a]), far_scale_[a] = Kept(f[a]);
      near_move_[a] = Kept(near_move[a]), far_move_[a] = Kept(far_move[a]);
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
  static constexpr bool kIsWide = std::is_same_v<Number, F>;
  [[gnu::always_inline]] static Number Kept(float x) {
    if constexpr (kIsWide)
      return Splat<F>(x);
    else
      return x;
  }
  [[gnu::always_inline]] static F Wide(Number x) {
    if constexpr (kIsWide)
      return x;
    else
      return Splat<F>(x);
  }
  [[gnu::always_inline]] static F T(F plane, Number scale, Number move) {
    if constexpr (kMoved) return MultiplyAdd<kWidth>(plane, Wide(scale), Wide(move));
    return (plane - Wide(move)) * Wide(scale);
  }

  Number near_scale_[3], far_scale_[3], near_move_[3], far_move_[3];  // not kMoved: moves are the origin
  unsigned near_row_[3], far_row_[3];
};

}  // namespace raybench
