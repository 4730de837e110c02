#include "tests/plugins/saboteurs/bvh.h"

using namespace raybench;
using namespace raybench::saboteurs;

namespace {

struct NaiveSlab : WideningSlab {
  Vec3f inv;

  NaiveSlab(const rb_ray& ray, Slack slack) : WideningSlab(ray, slack) {
    for (int a = 0; a < 3; ++a) inv[a] = 1 / ray.dir[a];
  }
  void Interval(const Bounds3& box, float& tnear, float& tfar) const {
    const Bounds3 wide = Widened(box);
    tnear = -std::numeric_limits<float>::infinity(), tfar = std::numeric_limits<float>::infinity();
    for (int a = 0; a < 3; ++a) {
      const float t0 = (wide.lo[a] - org[a]) * inv[a], t1 = (wide.hi[a] - org[a]) * inv[a];
      tnear = std::max(std::min(t0, t1), tnear);  // a NaN that comes first stays
      tfar = std::min(std::max(t0, t1) * (1 + 0x1p-19f), tfar);
    }
  }
};

struct Fault : HonestBvh {
  static constexpr const char* kName = "naive_slab";
  static constexpr const char* kDoc =
      "slab test by std::min and std::max: 0 x inf on the face of a box loses it";
  using Bound = BoxOf<NaiveSlab>;
};

}  // namespace

RAYBENCH_PLUGIN(Bvh<Fault>)
