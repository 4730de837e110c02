#include "tests/plugins/saboteurs/bvh.h"

using namespace raybench;
using namespace raybench::saboteurs;

namespace {

struct ClampedSlab : WideningSlab {
  ClampedSlab(const rb_ray& ray, Slack slack) : WideningSlab(ray, slack) {
    for (int a = 0; a < 3; ++a) {
      inv_near[a] = std::clamp(inv_near[a], -1e30f, 1e30f);
      inv_far[a] = std::clamp(inv_far[a], -1e30f, 1e30f);
    }
  }
};

struct Fault : HonestBvh {
  static constexpr const char* kName = "reciprocal_clamped";
  static constexpr const char* kDoc =
      "1/dir is clamped to 1e30 to keep infinity away: wrong for parallel and for short directions";
  using Bound = BoxOf<ClampedSlab>;
};

}  // namespace

RAYBENCH_PLUGIN(Bvh<Fault>)
