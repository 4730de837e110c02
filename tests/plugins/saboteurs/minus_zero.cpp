#include "tests/plugins/saboteurs/bvh.h"

using namespace raybench;
using namespace raybench::saboteurs;

namespace {

struct SignBlindSlab : WideningSlab {
  SignBlindSlab(const rb_ray& ray, Slack slack) : WideningSlab(ray, slack) {
    signs = 0;
    for (int a = 0; a < 3; ++a) signs |= unsigned(ray.dir[a] < 0) << a;
  }
};

struct Fault : HonestBvh {
  static constexpr const char* kName = "minus_zero";
  static constexpr const char* kDoc =
      "a component of -0 counts as positive in the choice of the near plane, but 1/-0 is -inf";
  using Bound = BoxOf<SignBlindSlab>;
};

}  // namespace

RAYBENCH_PLUGIN(Bvh<Fault>)
