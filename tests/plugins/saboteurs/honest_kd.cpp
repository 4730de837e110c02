#include "tests/plugins/saboteurs/space_tree.h"

using namespace raybench;
using namespace raybench::saboteurs;

namespace {

struct NoFault : HonestKd {
  static constexpr const char* kName = "honest_kd";
  static constexpr const char* kDoc = "kd-tree through the median of ends; no fault";
};

}  // namespace

RAYBENCH_PLUGIN(SpaceTree<NoFault>)
