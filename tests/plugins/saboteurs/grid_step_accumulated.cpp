#include "tests/plugins/saboteurs/grid.h"

using namespace raybench;
using namespace raybench::saboteurs;

namespace {

struct Fault : HonestGrid {
  static constexpr const char* kName = "grid_step_accumulated";
  static constexpr const char* kDoc = "t of the walls by repeated addition: errors grow from cell to cell";
  static void Meet(const SlabRay& ray, int axis, const std::vector<float>& walls, WallTimes& times) {
    HonestGrid::Meet(ray, axis, walls, times);
    const int n = int(walls.size()), first = ray.negative(axis) ? n - 1 : 0, way = first == 0 ? 1 : -1;
    const float step = times.earliest[first + way] - times.earliest[first];
    float t = times.earliest[first];
    if (!(std::fabs(step) <= std::numeric_limits<float>::max())) return;  // parallel: no wall is crossed
    for (int i = first; i >= 0 && i < n; i += way, t += step)
      times.earliest[i] = t, times.latest[i] = t * (1 + 0x1p-19f);
  }
};

}  // namespace

RAYBENCH_PLUGIN(Grid<Fault>)
