#include "tests/plugins/saboteurs/grid.h"

using namespace raybench;
using namespace raybench::saboteurs;

namespace {

struct Fault : HonestGrid {
  static constexpr const char* kName = "grid_mailbox";
  static constexpr const char* kDoc =
      "hits beyond the cell are left for later, but the mailbox knows that they were tested";
  static bool Keeps(const rb_hit& hit, float exit) { return hit.t <= exit; }
};

}  // namespace

RAYBENCH_PLUGIN(Grid<Fault>)
