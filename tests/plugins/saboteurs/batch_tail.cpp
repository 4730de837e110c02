#include "tests/plugins/saboteurs/bvh.h"

using namespace raybench;
using namespace raybench::saboteurs;

namespace {

struct Fault : HonestBvh {
  static constexpr const char* kName = "batch_tail";
  static constexpr const char* kDoc = "answers whole groups of four rays, and not those left over";
  static rb_query Asked(rb_query query) {
    query.n -= query.n % 4;
    return query;
  }
};

}  // namespace

RAYBENCH_PLUGIN(Bvh<Fault>)
