#include "tests/plugins/saboteurs/bvh.h"

using namespace raybench;
using namespace raybench::saboteurs;

namespace {

struct NoFault : HonestBvh {
  static constexpr const char* kName = "honest_bvh";
  static constexpr const char* kDoc = "halved at the median; no fault";
};

}  // namespace

RAYBENCH_PLUGIN(Bvh<NoFault>)
