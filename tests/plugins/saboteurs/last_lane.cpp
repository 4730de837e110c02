#include "tests/plugins/saboteurs/bvh.h"

using namespace raybench;
using namespace raybench::saboteurs;

namespace {

struct Fault : HonestBvh {
  static constexpr const char* kName = "last_lane";
  static constexpr const char* kDoc = "never tests the fourth primitive of a block";
  static constexpr int64_t kLeafSize = 4;
  static constexpr uint32_t kLanes = 3;
};

}  // namespace

RAYBENCH_PLUGIN(Bvh<Fault>)
