#include "harness/plan/build_options.h"

#include <tbb/info.h>

#include <algorithm>

#include "accel/host/registry.h"
#include "harness/terminal/interrupt.h"

namespace raybench {

uint32_t AllThreads() { return uint32_t(std::max(1, tbb::info::default_concurrency())); }

rb_build_options BuildOptions(uint32_t threads, uint64_t seed, uint64_t needs) {
  rb_build_options build = DefaultBuildOptions();
  build.threads = threads != 0 ? threads : AllThreads();
  build.seed = seed;
  build.needs = needs;
  build.cancel = InterruptFlag();
  return build;
}

}  // namespace raybench
