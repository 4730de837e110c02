#include "tests/plugins/saboteurs/bvh.h"

using namespace raybench;
using namespace raybench::saboteurs;

namespace {

struct Fault : HonestBvh {
  static constexpr const char* kName = "default_out_of_range";
  static constexpr const char* kDoc = "a leaf size of 100 by default, where 64 is the most";
  static constexpr int64_t kLeafSize = 100;
};

}  // namespace

RAYBENCH_PLUGIN(Bvh<Fault>)
