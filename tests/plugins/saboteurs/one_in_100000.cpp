#include "accel/base/hash.h"
#include "tests/plugins/saboteurs/bvh.h"

using namespace raybench;
using namespace raybench::saboteurs;

namespace {

struct Fault : HonestBvh {
  static constexpr const char* kName = "one_in_100000";
  static constexpr const char* kDoc = "loses the hit of one ray in 100,000, chosen by a hash of its bits";
  static void Answer(const RayQuery& q, rb_hit& best) {
    Hash64 hash;
    hash.AddValue(q.ray);
    if (hash.value() % 100000 == 0) best = {q.ray.tfar, 0, 0, RAYBENCH_NONE};
  }
};

}  // namespace

RAYBENCH_PLUGIN(Bvh<Fault>)
