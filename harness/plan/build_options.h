// How every command builds its trees.
#pragma once

#include <cstdint>

#include "accel/contract/raybench.h"

namespace raybench {

/// Threads that this process may run on, at least 1.
uint32_t AllThreads();

/// What checking a tree asks of it whatever the scene: both kinds of query, and answers that are compared to
/// the bit.
inline constexpr uint64_t kCheckedNeeds = RB_NEED_UV | RB_NEED_ANY;

/// The defaults with these threads (0: all), seed and needs (RB_NEED_*), cancelled by Ctrl-C.
rb_build_options BuildOptions(uint32_t threads, uint64_t seed, uint64_t needs = kCheckedNeeds);

}  // namespace raybench
