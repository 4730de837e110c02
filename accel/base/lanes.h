// What tests of boxes and triangles need of vectors beyond simd.h: operations for which the compiler may not find the one
// instruction, chosen by the target it compiles for. The portable ways give the same results to the bit, but for
// MultiplyAdd.
#pragma once

#include "accel/base/simd.h"

namespace raybench {

/// a b + c, rounded once where the processor can, else twice.
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

/// a > b ? a : b, lane by lane; b where one is NaN.
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

/// a < b ? a : b, lane by lane; b where one is NaN.
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

/// max(|a|, |b|) of numbers.
template <int kWidth>
[[gnu::always_inline]] inline FloatN<kWidth> LargerMagnitude(FloatN<kWidth> a, FloatN<kWidth> b) {
#if defined(__AVX512DQ__) && defined(__AVX512VL__)
  constexpr int kLargerWithoutSign = 0b1011;
  if constexpr (kWidth == 4) return _mm_range_ps(a, b, kLargerWithoutSign);
  if constexpr (kWidth == 8) return _mm256_range_ps(a, b, kLargerWithoutSign);
#endif
  return Larger<kWidth>(Abs(a), Abs(b));
}

/// Small integers as floats.
template <int kWidth, class Grid>
[[gnu::always_inline]] inline FloatN<kWidth> FloatsOf(const Grid* p) {
  static_assert(sizeof(Grid) <= 2);
  [[maybe_unused]] constexpr bool kBytes = sizeof(Grid) == 1;
#if defined(__SSE4_1__)
  if constexpr (kWidth == 4) {
    int64_t bits = 0;
    std::memcpy(&bits, p, kWidth * sizeof(Grid));
    const __m128i v = _mm_cvtsi64_si128(bits);
    return _mm_cvtepi32_ps(kBytes ? _mm_cvtepu8_epi32(v) : _mm_cvtepu16_epi32(v));
  }
#endif
#if defined(__AVX2__)
  if constexpr (kWidth == 8) {
    __m128i v{};
    std::memcpy(&v, p, kWidth * sizeof(Grid));
    return _mm256_cvtepi32_ps(kBytes ? _mm256_cvtepu8_epi32(v) : _mm256_cvtepu16_epi32(v));
  }
#endif
#if defined(__AVX512F__)
  if constexpr (kWidth == 16) {
    __m256i v{};
    std::memcpy(&v, p, kWidth * sizeof(Grid));
    constexpr __mmask16 kAll(-1);
    return _mm512_maskz_cvtepi32_ps(kAll, kBytes ? _mm512_maskz_cvtepu8_epi32(kAll, _mm256_castsi256_si128(v))
                                                 : _mm512_maskz_cvtepu16_epi32(kAll, v));
  }
#endif
  FloatN<kWidth> v;
  for (int i = 0; i < kWidth; ++i) v[i] = float(p[i]);
  return v;
}

/// The least lane.
template <int kWidth>
[[gnu::always_inline]] inline int32_t Least(IntN<kWidth> v) {
  if constexpr (kWidth == 1) {
    return v[0];
  } else if constexpr (kWidth == 4) {
    // Swapped, not halved: vectors of two lanes are no registers.
    IntN<4> w = __builtin_shufflevector(v, v, 2, 3, 0, 1);
    v = v < w ? v : w;
    w = __builtin_shufflevector(v, v, 1, 0, 3, 2);
    v = v < w ? v : w;
    return v[0];
  } else {
    const auto half = [&]<int... i>(std::integer_sequence<int, i...>) {
      const auto low = __builtin_shufflevector(v, v, i...),
                 high = __builtin_shufflevector(v, v, (i + kWidth / 2)...);
      return low < high ? low : high;
    }
    (std::make_integer_sequence<int, kWidth / 2>());
    return Least<kWidth / 2>(half);
  }
}

/// Among the lanes in `mask`, which is not 0, one of a least value; values are >= 0. The last bits of values do not
/// count: they hold the lane's number.
template <int kWidth>
[[gnu::always_inline]] inline unsigned LaneOfLeast(FloatN<kWidth> values, unsigned mask) {
  using I = IntN<kWidth>;
  const I keys = (I(values) & ~(kWidth - 1)) | Iota<I>();
  constexpr int32_t kMost = 0x7FFFFFFF;
#if defined(__AVX512VL__)
  if constexpr (kWidth == 4)
    return unsigned(Least<4>(I(_mm_mask_mov_epi32(_mm_set1_epi32(kMost), __mmask8(mask), __m128i(keys))))) &
           3;
  if constexpr (kWidth == 8)
    return unsigned(
               Least<8>(I(_mm256_mask_mov_epi32(_mm256_set1_epi32(kMost), __mmask8(mask), __m256i(keys))))) &
           7;
  if constexpr (kWidth == 16)
    return unsigned(Least<16>(
               I(_mm512_mask_mov_epi32(_mm512_set1_epi32(kMost), __mmask16(mask), __m512i(keys))))) &
           15;
#endif
  const I bit = Splat<I>(1) << Iota<I>();
  return unsigned(Least<kWidth>((bit & int32_t(mask)) != 0 ? keys : Splat<I>(kMost))) & (kWidth - 1);
}

}  // namespace raybench
