#include "tests/plugins/saboteurs/bvh.h"

using namespace raybench;
using namespace raybench::saboteurs;

namespace {

struct Fault : HonestBvh {
  static constexpr const char* kName = "ignores_tnear";
  static constexpr const char* kDoc = "takes hits from t = 0 on, whatever tnear is";
  static RayQuery Heard(RayQuery q, bool) {
    q.ray.tnear = 0;
    return q;
  }
};

}  // namespace

RAYBENCH_PLUGIN(Bvh<Fault>)
