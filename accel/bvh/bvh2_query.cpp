// How rays walk a Bvh2. Compiled once for all structures that are one.
#include "accel/bvh/bvh2_walk.h"

namespace raybench {

template <class Test, class Counter, bool kProcedural, bool kAnyHit>
inline void Bvh2::Trace(const RayState<Test>& ray, rb_hit& best, Counter& counter) const {
  if (root_ == kEmpty) return;
  const float widening = clipped_ ? SlabRay::Widening(Test::kSlack) : 1;
  // Moved products find more than the shared test does, which the tests of `fast` notice; and counts shall not depend
  // on the machine.
  if constexpr (!Counter::kCounts && Test::kSlack != Slack::kNone) {
    if (MovedSlab::Fits(ray.slab)) [[likely]] {
      Walk<NodeTest<true>, Test, Counter, kProcedural, kAnyHit>({ray.slab, widening}, ray, best, counter);
      return;
    }
  }
  Walk<NodeTest<false>, Test, Counter, kProcedural, kAnyHit>({ray.slab, widening}, ray, best, counter);
}

template <class Test, class Counter, bool kProcedural>
void Bvh2::QueryLeaves(const rb_query& query) const {
  ForEachRay<Counter>(query, [&](auto any, const RayQuery& q, rb_hit& best, Counter& counter) {
    Trace<Test, Counter, kProcedural, any.value>(RayState<Test>(q), best, counter);
  });
}

template <class Counter>
void Bvh2::Query(uint32_t numerics, const rb_query& query) const {
  WithNumerics(numerics, [&]<class Test>() {
    if (leaves_.needs_geometry()) {
      QueryLeaves<Test, Counter, true>(query);
    } else {
      QueryLeaves<Test, Counter, false>(query);
    }
  });
}

template void Bvh2::Query<NoCounting>(uint32_t, const rb_query&) const;
template void Bvh2::Query<Counting>(uint32_t, const rb_query&) const;

}  // namespace raybench
