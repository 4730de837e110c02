#include "tests/plugins/saboteurs/bvh.h"

using namespace raybench;
using namespace raybench::saboteurs;

namespace {

struct ContractedTest : WatertightTest {
  RayShear shear;

  explicit ContractedTest(const rb_ray& ray) : WatertightTest(ray), shear(ray) {}
  /// One product is rounded, the other is not: which one depends on the direction of the edge.
  static float Edge(Vec3f a, Vec3f b) { return std::fma(a.x, b.y, -(a.y * b.x)); }
  bool Intersect(Vec3f p0, Vec3f p1, Vec3f p2, PrimHit& hit) const {
    if (!std::isnan(shear.sx)) {
      const Vec3f a = ToFloat(shear.Point(p0)), b = ToFloat(shear.Point(p1)), c = ToFloat(shear.Point(p2));
      const float u = Edge(c, b), v = Edge(a, c), w = Edge(b, a);
      if ((u < 0 || v < 0 || w < 0) && (u > 0 || v > 0 || w > 0)) return false;
    }
    return WatertightTest::Intersect(p0, p1, p2, hit);
  }
};

struct Fault : HonestBvh {
  static constexpr const char* kName = "fma_contracted";
  static constexpr const char* kDoc =
      "edge functions contracted to fused multiply-add: two triangles disagree about the edge between them";
  using Test = ContractedTest;
};

}  // namespace

RAYBENCH_PLUGIN(Bvh<Fault>)
