#include "tests/plugins/saboteurs/bvh.h"

using namespace raybench;
using namespace raybench::saboteurs;

namespace {

struct Fault : HonestBvh {
  static constexpr const char* kName = "wrong_tie";
  static constexpr const char* kDoc = "of hits at the same t the one that is found last wins";
  template <bool kAny, class Ray>
  static bool Take(const Ray& ray, const rb_geometry& geometry, uint32_t prim, rb_hit& best) {
    rb_hit hit = best;
    hit.prim = RAYBENCH_NONE;  // any primitive comes before it
    if (!ray.Primitive(geometry, prim, hit)) return false;
    best = hit;
    return true;
  }
};

}  // namespace

RAYBENCH_PLUGIN(Bvh<Fault>)
