#include "tests/plugins/saboteurs/space_tree.h"

using namespace raybench;
using namespace raybench::saboteurs;

namespace {

struct Fault : HonestOctree {
  static constexpr const char* kName = "octree_parallel";
  static constexpr const char* kDoc =
      "the middle of a cell is met at (t0 + t1) / 2, which is NaN for a parallel ray: it sees one side only";
  static Crossing Cross(const SlabRay& ray, const Plane& plane, float tnear, float tfar) {
    const int a = plane.axis;
    Crossing c = HonestOctree::Cross(ray, plane, tnear, tfar);
    const float t0 = (plane.lo - ray.org[a]) * ray.inv_far[a], t1 = (plane.hi - ray.org[a]) * ray.inv_far[a];
    if (std::isnan(0.5f * (t0 + t1))) c.near = true, c.far = false;
    return c;
  }
};

}  // namespace

RAYBENCH_PLUGIN(SpaceTree<Fault>)
