#include "harness/plan/build_options.h"

#include <algorithm>

#include "accel/base/parallel.h"
#include "accel/host/registry.h"
#include "harness/terminal/interrupt.h"

namespace raybench {

uint32_t AllThreads() { return Processors(); }

rb_build_options BuildOptions(uint32_t threads, uint64_t seed, uint64_t needs) {
  rb_build_options build = DefaultBuildOptions();
  build.threads = threads != 0 ? threads : AllThreads();
  build.seed = seed;
  build.needs = needs;
  build.cancel = InterruptFlag();
  return build;
}

}  // namespace raybench
