#include "tests/plugins/saboteurs/bvh.h"

using namespace raybench;
using namespace raybench::saboteurs;

namespace {

struct Fault : HonestBvh {
  static constexpr const char* kName = "any_ignores_tfar";
  static constexpr const char* kDoc = "any-hit queries count blockers behind tfar";
  static RayQuery Heard(RayQuery q, bool any) {
    if (any) q.ray.tfar = std::numeric_limits<float>::infinity();
    return q;
  }
};

}  // namespace

RAYBENCH_PLUGIN(Bvh<Fault>)
