#include "tests/plugins/saboteurs/bvh.h"

using namespace raybench;
using namespace raybench::saboteurs;

namespace {

struct Fault : HonestBvh {
  static constexpr const char* kName = "after_off_by_one";
  static constexpr const char* kDoc = "a ray that resumes goes on behind primitive after + 1, not after";
  static RayQuery Heard(RayQuery q, bool) {
    if (q.after < RAYBENCH_NONE - 1) ++q.after;
    return q;
  }
};

}  // namespace

RAYBENCH_PLUGIN(Bvh<Fault>)
