#include "tests/plugins/saboteurs/grid.h"

using namespace raybench;
using namespace raybench::saboteurs;

namespace {

struct NoFault : HonestGrid {
  static constexpr const char* kName = "honest_grid";
  static constexpr const char* kDoc = "uniform grid with a mailbox; no fault";
};

}  // namespace

RAYBENCH_PLUGIN(Grid<NoFault>)
