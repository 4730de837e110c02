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

/// Bit i: a[i] < b[i].
template <int kWidth>
[[gnu::always_inline]] inline unsigned Less(FloatN<kWidth> a, FloatN<kWidth> b) {
#if defined(__SSE__)
  if constexpr (kWidth == 4) return unsigned(_mm_movemask_ps(_mm_cmplt_ps(a, b)));
#endif
#if defined(__AVX__)
  if constexpr (kWidth == 8) return unsigned(_mm256_movemask_ps(_mm256_cmp_ps(a, b, _CMP_LT_OQ)));
#endif
#if defined(__AVX512F__)
  if constexpr (kWidth == 16) return _mm512_cmp_ps_mask(a, b, _CMP_LT_OQ);
#endif
  return Mask(a < b);
}

/// SlabRay in four lanes, the last one unused: the same numbers.
struct SlabRay4 {
  Float4 org, inv_near, inv_far;
  Int4 negative;   ///< lanes all set where the sign bit of d is
  unsigned signs;  ///< the same as bits

  SlabRay4(const rb_ray& ray, Slack slack) {
    constexpr float kMax = std::numeric_limits<float>::max();
    const float near_scale = slack == Slack::kBothEnds ? 1 - 0x1p-19f : 1;
    const float far_scale = slack == Slack::kNone ? 1 : 1 + 0x1p-19f;
    org = Load<Float4>(ray.org);
    const Float4 dir = Load<Float4>(ray.dir), inv = 1 / dir;
    signs = Mask(dir) & 7u;
    negative = Int4(dir) >> 31;
    const Int4 sign = Int4(inv) & int32_t(0x80000000);
    inv_near = Float4(Int4(Smaller<4>(Abs(inv), Splat<Float4>(kMax))) | sign) * near_scale;
    inv_far = inv * far_scale;
  }

  /// The interval of PaddedBounds of a triangle, as SlabRay::Interval has it.
  [[gnu::always_inline]] void PaddedInterval(const Float4 (&p)[3], float& tnear, float& tfar) const {
    constexpr float kInf = std::numeric_limits<float>::infinity();
    Float4 lo = Smaller<4>(p[0], Smaller<4>(p[1], p[2])), hi = Larger<4>(p[0], Larger<4>(p[1], p[2]));
    const Float4 e = hi - lo;
    const float extent = std::max(e[0], std::max(e[1], e[2]));
    const Float4 pad = Splat<Float4>(std::max(extent * 0x1p-20f, std::numeric_limits<float>::denorm_min()));
    lo = lo - Larger<4>(pad, Abs(lo) * 0x1p-23f), hi = hi + Larger<4>(pad, Abs(hi) * 0x1p-23f);
    Float4 n = ((negative ? hi : lo) - org) * inv_near, f = ((negative ? lo : hi) - org) * inv_far;
    n = Larger<4>(n, Splat<Float4>(-kInf)), f = Smaller<4>(f, Splat<Float4>(kInf));
    tnear = std::max(n[0], std::max(n[1], n[2])), tfar = std::min(f[0], std::min(f[1], f[2]));
  }
};

template <int kWidth, bool kFused>
struct WideRay {
  using F = FloatN<kWidth>;
  F near_scale[3], far_scale[3];
  F near_move[3], far_move[3];  ///< fused; else near_move is the origin
  uint32_t near_at[3], far_at[3];  ///< byte offsets of a node's planes

  /// Whether no product overflows.
  static bool Fits(const SlabRay4& slab) {
    constexpr float kMost = 0x1p60f;
    const Float4 inv = Abs(slab.inv_far);
    return (Mask((inv < kMost) & (inv > 1 / kMost) & (Abs(slab.org) < kMost)) & 7u) == 7u;
  }

  [[gnu::always_inline]] explicit WideRay(const SlabRay4& slab) {
    Float4 n = slab.inv_near, f = slab.inv_far, move_near = slab.org, move_far = slab.org;
    if constexpr (kFused) {
      // t = (p - o) inv errs by 2^-23 |t|, p inv + move by less than that and what the move allows for.
      n = n * (1 - 0x1p-21f), f = f * (1 + 0x1p-21f);
      const Float4 on = slab.org * n, of = slab.org * f;
      move_near = -on - Abs(on) * 0x1p-22f, move_far = -of + Abs(of) * 0x1p-22f;
    }
    constexpr uint32_t kRow = sizeof(F);
    for (uint32_t a = 0; a < 3; ++a) {
      near_scale[a] = Splat<F>(n[a]), far_scale[a] = Splat<F>(f[a]);
      near_move[a] = Splat<F>(move_near[a]), far_move[a] = Splat<F>(move_far[a]);
      near_at[a] = (a + 3 * (slab.signs >> a & 1)) * kRow;
      far_at[a] = (2 * a + 3) * kRow - near_at[a];
    }
  }
  [[gnu::always_inline]] F Near(int a, F p) const {
    if constexpr (kFused) return MultiplyAdd<kWidth>(p, near_scale[a], near_move[a]);
    else return (p - near_move[a]) * near_scale[a];
  }
  [[gnu::always_inline]] F Far(int a, F p) const {
    if constexpr (kFused) return MultiplyAdd<kWidth>(p, far_scale[a], far_move[a]);
    else return (p - far_move[a]) * far_scale[a];
  }
};

}  // namespace raybench
