#include "tests/plugins/saboteurs/bvh.h"

using namespace raybench;
using namespace raybench::saboteurs;

namespace {

struct Fault : HonestBvh {
  static constexpr const char* kName = "ignores_memory_limit";
  static constexpr const char* kDoc = "takes a kilobyte a primitive whatever the memory limit is";
  static constexpr bool kKeepsMemoryLimit = false;
  static constexpr uint64_t kWastePerPrim = 1024;
};

}  // namespace

RAYBENCH_PLUGIN(Bvh<Fault>)
