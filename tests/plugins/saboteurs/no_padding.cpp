#include "tests/plugins/saboteurs/bvh.h"

using namespace raybench;
using namespace raybench::saboteurs;

namespace {

/// Nothing is added to boxes as they are, nor to the far end.
struct TightSlab : SlabRay {
  TightSlab(const rb_ray& ray, Slack) : SlabRay(ray, Slack::kNone) {}
};

struct Fault : HonestBvh {
  static constexpr const char* kName = "no_padding";
  static constexpr const char* kDoc = "slab test without room for rounding: rays that graze a box are lost";
  using Bound = BoxOf<TightSlab>;
};

}  // namespace

RAYBENCH_PLUGIN(Bvh<Fault>)
