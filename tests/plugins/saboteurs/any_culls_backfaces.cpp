#include "tests/plugins/saboteurs/bvh.h"

using namespace raybench;
using namespace raybench::saboteurs;

namespace {

struct Fault : HonestBvh {
  static constexpr const char* kName = "any_culls_backfaces";
  static constexpr const char* kDoc = "any-hit queries leave out triangles seen from behind";
  template <bool kAny, class Ray>
  static bool Take(const Ray& ray, const rb_geometry& geometry, uint32_t prim, rb_hit& best) {
    if (kAny && prim < geometry.triangle_count) {
      const Vec3d p0 = ToDouble(Vertex(geometry, prim, 0)), e1 = ToDouble(Vertex(geometry, prim, 1)) - p0,
                  e2 = ToDouble(Vertex(geometry, prim, 2)) - p0;
      if (Dot(Cross(e1, e2), ToDouble(LoadVec3(ray.query.ray.dir))) > 0) return false;
    }
    return ray.Primitive(geometry, prim, best);
  }
};

}  // namespace

RAYBENCH_PLUGIN(Bvh<Fault>)
