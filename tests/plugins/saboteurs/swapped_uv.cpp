#include "tests/plugins/saboteurs/bvh.h"

using namespace raybench;
using namespace raybench::saboteurs;

namespace {

struct Fault : HonestBvh {
  static constexpr const char* kName = "swapped_uv";
  static constexpr const char* kDoc = "gives u for v and v for u";
  static void Answer(const RayQuery&, rb_hit& best) { std::swap(best.u, best.v); }
};

}  // namespace

RAYBENCH_PLUGIN(Bvh<Fault>)
