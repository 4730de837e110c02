// Long tests under the sanitizers.
#pragma once

#include <cstdint>

namespace raybench::testing {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr bool kSanitized = true;
#else
inline constexpr bool kSanitized = false;
#endif

/// How many rays, copies, rounds a test takes: an eighth under the sanitizers, which make it some twelve
/// times as long and look for mistakes that show at once.
constexpr uint64_t Effort(uint64_t whole) { return kSanitized ? (whole + 7) / 8 : whole; }

}  // namespace raybench::testing
