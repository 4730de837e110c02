#include "tests/plugins/saboteurs/bvh.h"

using namespace raybench;
using namespace raybench::saboteurs;

namespace {

struct EpsilonTest : WatertightTest {
  Vec3f dir;

  explicit EpsilonTest(const rb_ray& ray) : WatertightTest(ray), dir(LoadVec3(ray.dir)) {}
  bool Intersect(Vec3f p0, Vec3f p1, Vec3f p2, PrimHit& hit) const {
    const float det = Dot(p1 - p0, Cross(dir, p2 - p0));
    return std::fabs(det) >= 1e-8f && WatertightTest::Intersect(p0, p1, p2, hit);
  }
};

struct Fault : HonestBvh {
  static constexpr const char* kName = "det_epsilon";
  static constexpr const char* kDoc =
      "rejects triangles whose determinant is below 1e-8: small ones, grazing ones, short directions";
  using Test = EpsilonTest;
};

}  // namespace

RAYBENCH_PLUGIN(Bvh<Fault>)
