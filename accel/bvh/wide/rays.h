// A ray as the lanes of wide nodes need it.
#pragma once

#include <cstddef>
#include <cstdint>

#include "accel/base/simd.h"
#include "accel/ray/bounds.h"

namespace raybench {

#if defined(__FMA__)
inline constexpr bool kHasFma = true;
#else
inline constexpr bool kHasFma = false;
#endif

/// a * b + c, rounded once.
template <int kWidth>
[[gnu::always_inline]] inline FloatN<kWidth> MultiplyAdd(FloatN<kWidth> a, FloatN<kWidth> b,
                                                         FloatN<kWidth> c) {
#if defined(__FMA__)
  if constexpr (kWidth == 4) return _mm_fmadd_ps(a, b, c);
  if constexpr (kWidth == 8) return _mm256_fmadd_ps(a, b, c);
#endif
#if defined(__AVX512F__)
  if constexpr (kWidth == 16) return _mm512_fmadd_ps(a, b, c);
#endif
  return a * b + c;
}

template <int kWidth>
[[gnu::always_inline]] inline FloatN<kWidth> Larger(FloatN<kWidth> a, FloatN<kWidth> b) {
#if defined(__SSE__)
  if constexpr (kWidth == 4) return _mm_max_ps(a, b);
#endif
#if defined(__AVX__)
  if constexpr (kWidth == 8) return _mm256_max_ps(a, b);
#endif
#if defined(__AVX512F__)
  if constexpr (kWidth == 16) return _mm512_maskz_max_ps(__mmask16(-1), a, b);
#endif
  return MaxOrSecond(a, b);
}
template <int kWidth>
[[gnu::always_inline]] inline FloatN<kWidth> Smaller(FloatN<kWidth> a, FloatN<kWidth> b) {
#if defined(__SSE__)
  if constexpr (kWidth == 4) return _mm_min_ps(a, b);
#endif
#if defined(__AVX__)
  if constexpr (kWidth == 8) return _mm256_min_ps(a, b);
#endif
#if defined(__AVX512F__)
  if constexpr (kWidth == 16) return _mm512_maskz_min_ps(__mmask16(-1), a, b);
#endif
  return MinOrSecond(a, b);
}
/// Bit i: a[i] <= b[i].
template <int kWidth>
[[gnu::always_inline]] inline unsigned LessEqual(FloatN<kWidth> a, FloatN<kWidth> b) {
#if defined(__SSE__)
  if constexpr (kWidth == 4) return unsigned(_mm_movemask_ps(_mm_cmple_ps(a, b)));
#endif
#if defined(__AVX512VL__) && defined(RAYBENCH_KMASK)
  if constexpr (kWidth == 8) return _mm256_cmp_ps_mask(a, b, _CMP_LE_OQ);
#endif
#if defined(__AVX__)
  if constexpr (kWidth == 8) return unsigned(_mm256_movemask_ps(_mm256_cmp_ps(a, b, _CMP_LE_OQ)));
#endif
#if defined(__AVX512F__)
  if constexpr (kWidth == 16) return _mm512_cmp_ps_mask(a, b, _CMP_LE_OQ);
#endif
  return Mask(a <= b);
}

template <int kWidth, bool kFused>
struct WideRay {
  using F = FloatN<kWidth>;
  F near_scale[3], far_scale[3];
  F near_move[kFused ? 3 : 0], far_move[kFused ? 3 : 0];  ///< fused
  F org[kFused ? 0 : 3];
  uint32_t near_at[3], far_at[3];  ///< rows of a node's planes: axis, plus 3 for the upper ones

  explicit WideRay(const SlabRay& slab) {
    for (int a = 0; a < 3; ++a) {
      near_at[a] = uint32_t(a) + (slab.negative[a] ? 3 : 0);
      far_at[a] = uint32_t(a) + (slab.negative[a] ? 0 : 3);
      if constexpr (kFused) {
        // t = (p - o) inv errs by 2^-23 |t|, p inv + move by less than that and what the move allows for.
        const float n = slab.inv_near[a] * (1 - 0x1p-21f), f = slab.inv_far[a] * (1 + 0x1p-21f);
        const float on = slab.org[a] * n, of = slab.org[a] * f;
        near_scale[a] = Splat<F>(n), far_scale[a] = Splat<F>(f);
        near_move[a] = Splat<F>(-on - std::fabs(on) * 0x1p-22f);
        far_move[a] = Splat<F>(-of + std::fabs(of) * 0x1p-22f);
      } else {
        org[a] = Splat<F>(slab.org[a]);
        near_scale[a] = Splat<F>(slab.inv_near[a]);
        far_scale[a] = Splat<F>(slab.inv_far[a]);
      }
    }
  }
  [[gnu::always_inline]] F Near(int a, F p) const {
    if constexpr (kFused) return MultiplyAdd<kWidth>(p, near_scale[a], near_move[a]);
    else return (p - org[a]) * near_scale[a];
  }
  [[gnu::always_inline]] F Far(int a, F p) const {
    if constexpr (kFused) return MultiplyAdd<kWidth>(p, far_scale[a], far_move[a]);
    else return (p - org[a]) * far_scale[a];
  }
};

}  // namespace raybench
