// Four floats at once, by the compilers' vector extension: the same results on every machine, no intrinsics
// needed but where the compiler does not find the one instruction.
#pragma once

#include <cstdint>
#include <cstring>

#if defined(__SSE__)
#include <immintrin.h>
#endif

namespace raybench {

using Float4 = float __attribute__((vector_size(16)));
using Int4 = int32_t __attribute__((vector_size(16)));

inline Float4 Load4(const float* p) {
  Float4 v;
  std::memcpy(&v, p, sizeof v);
  return v;
}
inline Float4 Splat4(float x) { return Float4{x, x, x, x}; }

/// Lane-wise a > b ? a : b; a NaN in `a` gives b.
inline Float4 MaxOrSecond(Float4 a, Float4 b) {
#if defined(__SSE__)
  return _mm_max_ps(a, b);
#else
  return a > b ? a : b;
#endif
}
/// Lane-wise a < b ? a : b; a NaN in `a` gives b.
inline Float4 MinOrSecond(Float4 a, Float4 b) {
#if defined(__SSE__)
  return _mm_min_ps(a, b);
#else
  return a < b ? a : b;
#endif
}

/// Lane-wise |v|.
inline Float4 Abs(Float4 v) { return Float4(Int4(v) & 0x7FFFFFFF); }

/// Lane i of the result is lane order[i] of v. Only {0,1,2,3} and {2,3,0,1} are used.
inline Float4 Permute(Float4 v, Int4 order) {
#if defined(__AVX__)
  return _mm_permutevar_ps(v, __m128i(order));
#else
  const Float4 swapped = __builtin_shufflevector(v, v, 2, 3, 0, 1);
  return order == Int4{0, 1, 2, 3} ? v : swapped;
#endif
}

/// Bit i is set if lane i is true.
inline unsigned Mask(Int4 v) {
#if defined(__SSE__)
  return unsigned(_mm_movemask_ps(Float4(v)));
#else
  unsigned m = 0;
  for (int i = 0; i < 4; ++i) m |= unsigned(v[i] < 0) << i;
  return m;
#endif
}

}  // namespace raybench
