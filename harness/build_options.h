// How every command builds its trees.
#pragma once

#include <cstdint>

#include "accel/raybench.h"

namespace raybench {

/// Threads that this process may run on, at least 1.
uint32_t AllThreads();

/// The defaults with these threads (0: all) and seed, cancelled by Ctrl-C.
rb_build_options BuildOptions(uint32_t threads, uint64_t seed);

}  // namespace raybench
