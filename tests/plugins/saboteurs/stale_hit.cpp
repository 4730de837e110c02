#include "tests/plugins/saboteurs/bvh.h"

using namespace raybench;
using namespace raybench::saboteurs;

namespace {

struct Fault : HonestBvh {
  static constexpr const char* kName = "stale_hit";
  static constexpr const char* kDoc =
      "a ray that misses leaves the hit of the ray before it in the batch in its place";
  static void Answered(const rb_query& query) {
    if (query.kind != RB_CLOSEST) return;
    for (size_t i = 1; i < query.n; ++i) {
      if (query.hits[i].prim == RAYBENCH_NONE) query.hits[i] = query.hits[i - 1];
    }
  }
};

}  // namespace

RAYBENCH_PLUGIN(Bvh<Fault>)
