#include "tests/plugins/saboteurs/space_tree.h"

using namespace raybench;
using namespace raybench::saboteurs;

namespace {

struct Fault : HonestKd {
  static constexpr const char* kName = "kd_early_exit";
  static constexpr const char* kDoc = "stops at the first hit, though it may lie beyond the cell";
  static bool IsBehind(float, const rb_hit& best) { return best.prim != RAYBENCH_NONE; }
};

}  // namespace

RAYBENCH_PLUGIN(SpaceTree<Fault>)
