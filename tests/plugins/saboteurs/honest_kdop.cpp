#include "tests/plugins/saboteurs/kdop.h"

using namespace raybench;
using namespace raybench::saboteurs;

namespace {

struct NoFault : HonestKdop {
  static constexpr const char* kName = "honest_kdop";
  static constexpr const char* kDoc = "14-DOPs halved at the median; no fault";
};

}  // namespace

RAYBENCH_PLUGIN(Bvh<NoFault>)
