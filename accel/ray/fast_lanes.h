// RayState<FastTest>::Triangle for some triangles at once, to the same bits: t of all lanes, inside or not, so that one
// branch decides.
#pragma once

#include "accel/base/lanes.h"
#include "accel/contract/structure.h"
#include "accel/ray/bounds.h"
#include "accel/ray/triangle.h"

namespace raybench {

/// What WatertightLanes is to WatertightTest.
class FastLanes {
 public:
  [[gnu::always_inline]] explicit FastLanes(const FastTest& test) : test_(test) {}

  /// As WatertightLanes::Take().
  template <bool kAnyHit, class Block>
  [[gnu::always_inline]] bool Take(const Block& block, unsigned asked, const RayQuery& query, const SlabRay&,
                                   bool needs_uv, rb_hit& best) const {
    constexpr int kLanes = int(std::extent_v<decltype(Block::prim)>);
    using F = FloatN<kLanes>;
    const auto terms = test_.Compute<F>(Lanes<kLanes>{block.v});
    unsigned candidates = asked & Mask(FastTest::Inside(terms));
    if (!kAnyHit && candidates == 0) return false;
    const F t = test_.T(terms);
    candidates &= LessEqual<kLanes>(t, Splat<F>(best.t)) & LessEqual<kLanes>(Splat<F>(query.ray.tnear), t);
    bool changed = false;
    for (; candidates != 0; candidates &= candidates - 1) {
      const int i = __builtin_ctz(candidates);
      if (!query.Accepts(t[i], block.prim[i], best)) continue;
      best = {t[i], 0, 0, block.prim[i]};
      if (needs_uv) best.u = terms.u[i] / terms.det[i], best.v = terms.v[i] / terms.det[i];
      if (kAnyHit) return true;
      changed = true;
    }
    return changed;
  }

 private:
  FastTest test_;
};

}  // namespace raybench
