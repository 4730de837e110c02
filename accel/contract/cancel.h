// The flag by which the host stops a build (rb_build_options.cancel). A signal handler or another thread sets it, so it is
// read as an atomic.
#pragma once

#include <stdexcept>

namespace raybench {

/// `cancel` may be null: then nobody stops the build.
inline bool IsCancelled(const volatile int* cancel) {
  return cancel != nullptr && __atomic_load_n(cancel, __ATOMIC_RELAXED) != 0;
}

/// For builders, now and then.
inline void CheckCancel(const volatile int* cancel) {
  if (IsCancelled(cancel)) throw std::runtime_error("cancelled");
}

}  // namespace raybench
