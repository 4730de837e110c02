// Some numbers at once, in as many lanes as the type says, by the compilers' vector extension: the same
// results on every machine. Intrinsics stand only where the compiler does not find the one instruction; it
// finds those of maximum and minimum.
#pragma once

#include <cstdint>
#include <cstring>
#include <type_traits>
#include <utility>

#if defined(__SSE__)
#include <immintrin.h>
#endif

namespace raybench {

template <class T, int kWidth>
using Vec __attribute__((vector_size(sizeof(T) * kWidth))) = T;

template <int kWidth>
using FloatN = Vec<float, kWidth>;
template <int kWidth>
using IntN = Vec<int32_t, kWidth>;
using Float4 = FloatN<4>;
using Int4 = IntN<4>;

/// Of a lane of the vector V, and their number.
template <class V>
using LaneOf = std::remove_cvref_t<decltype(std::declval<V&>()[0])>;
template <class V>
inline constexpr int kLanesOf = int(sizeof(V) / sizeof(LaneOf<V>));

template <class V>
V Load(const LaneOf<V>* p) {
  V v;
  std::memcpy(&v, p, sizeof v);
  return v;
}
template <class V>
V Splat(LaneOf<V> x) {
  return x - V{};  // x, also if that is -0
}
/// 0, 1, 2 ...
template <class V>
constexpr V Iota() {
  return []<int... i>(std::integer_sequence<int, i...>) { return V{LaneOf<V>(i)...}; }
  (std::make_integer_sequence<int, kLanesOf<V>>());
}

/// Lane-wise a > b ? a : b; a NaN in `a` gives b.
template <class V>
V MaxOrSecond(V a, V b) {
  return a > b ? a : b;
}
/// Lane-wise a < b ? a : b; a NaN in `a` gives b.
template <class V>
V MinOrSecond(V a, V b) {
  return a < b ? a : b;
}

/// Lane-wise |v|, of floats.
template <class V>
V Abs(V v) {
  return V(IntN<kLanesOf<V>>(v) & 0x7FFFFFFF);
}

/// A permutation of lanes by the signs of a ray's direction: lane i comes from lane i ^ signs.
template <int kWidth>
class LaneXor {
 public:
  LaneXor() = default;
  explicit LaneXor(int signs) : from_(Iota<IntN<kWidth>>() ^ signs) {}

  FloatN<kWidth> operator()(FloatN<kWidth> v) const {
#if defined(__AVX__)
    if constexpr (kWidth == 4) return _mm_permutevar_ps(v, __m128i(from_));
#endif
#if defined(__AVX2__)
    if constexpr (kWidth == 8) return _mm256_permutevar8x32_ps(v, __m256i(from_));
#endif
#if defined(__AVX512F__)
    // GCC 12 warns of the one without a mask.
    if constexpr (kWidth == 16) return _mm512_maskz_permutexvar_ps(__mmask16(-1), __m512i(from_), v);
#endif
    return Swap<1>(v);
  }

 private:
  /// Bit by bit: lanes that are kBit apart change places if signs & kBit.
  template <int kBit>
  FloatN<kWidth> Swap(FloatN<kWidth> v) const {
    if constexpr (kBit < kWidth) {
      const FloatN<kWidth> swapped = [&]<int... i>(std::integer_sequence<int, i...>) {
        return __builtin_shufflevector(v, v, (i ^ kBit)...);
      }
      (std::make_integer_sequence<int, kWidth>());
      return Swap<2 * kBit>(((from_ ^ Iota<IntN<kWidth>>()) & kBit) != 0 ? swapped : v);
    } else {
      return v;
    }
  }

  IntN<kWidth> from_;
};

/// Bit i is set if lane i is true.
template <class V>
unsigned Mask(V v) {
  static_assert(sizeof(LaneOf<V>) == 4);
  constexpr int kWidth = kLanesOf<V>;
#if defined(__SSE__)
  if constexpr (kWidth == 4) return unsigned(_mm_movemask_ps(__m128(v)));
#endif
#if defined(__AVX__)
  if constexpr (kWidth == 8) return unsigned(_mm256_movemask_ps(__m256(v)));
#endif
#if defined(__AVX512F__)
  if constexpr (kWidth == 16) return _mm512_cmplt_epi32_mask(__m512i(v), __m512i{});
#endif
  unsigned m = 0;
  for (int i = 0; i < kWidth; ++i) m |= unsigned(v[i] < 0) << i;
  return m;
}

/// What Mask says where all lanes are true.
template <int kWidth>
inline constexpr unsigned kAllLanes = (1u << kWidth) - 1;

}  // namespace raybench
