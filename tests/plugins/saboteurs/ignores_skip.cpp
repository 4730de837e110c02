#include "tests/plugins/saboteurs/bvh.h"

using namespace raybench;
using namespace raybench::saboteurs;

namespace {

struct Fault : HonestBvh {
  static constexpr const char* kName = "ignores_skip";
  static constexpr const char* kDoc = "hits the primitive that the ray shall skip";
  static RayQuery Heard(RayQuery q, bool) {
    q.skip = RAYBENCH_NONE;
    return q;
  }
};

}  // namespace

RAYBENCH_PLUGIN(Bvh<Fault>)
