#include "tests/plugins/saboteurs/bvh.h"

using namespace raybench;
using namespace raybench::saboteurs;

namespace {

struct Fault : HonestBvh {
  static constexpr const char* kName = "quantised_nearest";
  static constexpr const char* kDoc =
      "boxes in 8 bits of their parent, rounded to nearest instead of outward";
  static Box Stored(const Box& bound, const Box& parent) {
    Box coarse = parent;
    for (int a = 0; a < 3; ++a) {
      const float lo = parent.box.lo[a], step = (parent.box.hi[a] - lo) / 255;
      auto nearest = [&](float x) {
        return lo + step * std::clamp(std::nearbyint((x - lo) / step), 0.0f, 255.0f);
      };
      if (step > 0) coarse.box.lo[a] = nearest(bound.box.lo[a]), coarse.box.hi[a] = nearest(bound.box.hi[a]);
    }
    return coarse;
  }
};

}  // namespace

RAYBENCH_PLUGIN(Bvh<Fault>)
