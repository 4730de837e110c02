// One ray against one primitive, to the last decision: test, interval, order. All structures end here, so
// that the answer does not depend on the structure.
//
// A computed t can fall outside the primitive's own padded box (1.7e-4 of edge-aimed rays). Under
// conservative numerics it is clamped to the primitive's slab interval: rounding is monotone, so no
// node above can then cull it, and the winner does not depend on the order of traversal. An exact t
// needs no clamp.
#pragma once

#include <algorithm>

#include "accel/contract/structure.h"
#include "accel/ray/bounds.h"
#include "accel/ray/fast_lanes.h"
#include "accel/ray/triangle.h"
#include "accel/ray/watertight_lanes.h"

namespace raybench {

/// What decides some triangles at once, where a test has that.
template <class Test>
struct LanesOfTest {
  LanesOfTest(const RayQuery&, const SlabRay&, const Test&) {}
};
template <>
struct LanesOfTest<FastTest> : FastLanes {
  LanesOfTest(const RayQuery&, const SlabRay&, const FastTest& test) : FastLanes(test) {}
};
template <>
struct LanesOfTest<WatertightTest> : WatertightLanes {
  LanesOfTest(const RayQuery& query, const SlabRay& slab, const WatertightTest& test)
      : WatertightLanes(query, slab, test.shear()) {}
};

template <class Test>
struct RayState {
  RayQuery query;
  SlabRay slab;
  Test test;
  static constexpr bool kInLanes = !std::is_empty_v<LanesOfTest<Test>>;
  [[no_unique_address]] LanesOfTest<Test> lanes;

  explicit RayState(const RayQuery& q)
      : query(q), slab(q.ray, Test::kSlack), test(q.ray), lanes(query, slab, test) {}

  /// What traversal asks where boxes hold parts of primitives (ray/bounds.h).
  SlabRay SlabOfParts() const { return slab.Widened(Test::kSlack); }

  /// Takes triangle `prim` into `best` if it is hit and comes before it.
  bool Triangle(Vec3f p0, Vec3f p1, Vec3f p2, uint32_t prim, rb_hit& best) const {
    PrimHit hit;
    if (!test.Intersect(p0, p1, p2, hit)) return false;
    return Take(PaddedBounds(p0, p1, p2), hit, prim, best);
  }

  /// The same for any primitive of the geometry.
  bool Primitive(const rb_geometry& g, uint32_t prim, rb_hit& best) const {
    if (prim < g.triangle_count)
      return Triangle(Vertex(g, prim, 0), Vertex(g, prim, 1), Vertex(g, prim, 2), prim, best);
    // The callback takes t > tnear; where a hit at t == tnear would count it must get through to Take(), and be it
    // that it comes there only when its t is clamped. If it does not count, then it must not hide what lies behind: a
    // curved primitive is met twice.
    if (query.after != RAYBENCH_NONE && prim > query.after) {
      rb_ray before = query.ray;
      before.tnear = std::nextafter(before.tnear * (1 - 0x1p-20f), -1.0f);
      if (Procedural(g, prim, before, best)) return true;
    }
    return Procedural(g, prim, query.ray, best);
  }

 private:
  bool Procedural(const rb_geometry& g, uint32_t prim, const rb_ray& ray, rb_hit& best) const {
    rb_hit found{};
    return g.procedural_intersect(g.procedural_user, prim - g.triangle_count, uint32_t(Test::kNumerics), &ray,
                                  &found) != 0 &&
           Take(PrimBounds(g, prim), {found.t, found.u, found.v}, prim, best);
  }
  bool Take(const Bounds3& box, PrimHit hit, uint32_t prim, rb_hit& best) const {
    if constexpr (Test::kNumerics == Numerics::kExact) {
      // The interval holds for the exact t; but a ray that resumes at a hit goes on from its rounded t.
      if (hit.beyond > 0 && hit.t >= std::min(query.ray.tfar, std::numeric_limits<float>::max()))
        return false;
      if (hit.beyond > 0 && hit.t == query.ray.tnear && query.after == RAYBENCH_NONE)
        hit.t = std::nextafter(hit.t, std::numeric_limits<float>::infinity());
    } else if constexpr (Test::kSlack != Slack::kNone) {
      float tnear, tfar;
      slab.Interval(box, tnear, tfar);
      if (tnear > tfar) return false;
      hit.t = std::min(std::max(hit.t, tnear), tfar);
    }
    if (!query.Accepts(hit.t, prim, best)) return false;
    best = {hit.t, hit.u, hit.v, prim};
    return true;
  }
};

}  // namespace raybench
