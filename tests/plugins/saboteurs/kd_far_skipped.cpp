#include "tests/plugins/saboteurs/space_tree.h"

using namespace raybench;
using namespace raybench::saboteurs;

namespace {

struct Fault : HonestKd {
  static constexpr const char* kName = "kd_far_skipped";
  static constexpr const char* kDoc =
      "a ray from the split plane itself counts as one that leaves it: the side it goes to is skipped";
  static Crossing Cross(const SlabRay& ray, const Plane& plane, float tnear, float tfar) {
    const int a = plane.axis;
    Crossing c = HonestKd::Cross(ray, plane, tnear, tfar);
    // The child with the origin is the near one. Behind a plane at t <= 0 there is nothing, they say.
    const float t = (plane.split - ray.org[a]) * ray.inv_far[a];
    if (t <= 0) c = {ray.org[a] > plane.split, true, false, tfar, tnear};
    return c;
  }
};

}  // namespace

RAYBENCH_PLUGIN(SpaceTree<Fault>)
