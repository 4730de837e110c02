// How rays walk a kd-tree whose tests are studied.
#include "accel/ray/study.h"

#include "accel/kd/tree.h"

namespace raybench {

/// True if `best` changed.
template <class Ray, class Counter>
inline bool KdTree::StudyLeaf(const KdNode& leaf, const Ray& ray, bool any, rb_hit& best,
                              Counter& counter) const {
  const uint64_t bytes = LeafBlocks<>::BlocksOf(leaf.count()) * sizeof(LeafBlocks<>::Block);
  counter.Prims(leaf.count(), ray.study().BytesTested(leaf.count(), bytes));
  const size_t place = size_t{leaf.first} * LeafBlocks<>::kLanes;
  return ray.TakeLeaf(geometry_, blocks_.Address(leaf.first), place, leaf.count(), any, best);
}

template <class Counter>
void KdTree::QueryStudy(const Study& study, PlaneRule rule, uint32_t numerics, const rb_query& query) const {
  const Slack slack = rule == PlaneRule::kAsNumerics ? SlackOf(numerics) : Slack::kNone;
  // 2 gamma_4: the reciprocal, which is scaled here, rounds once more than t.
  const float pad = rule == PlaneRule::kPadded ? 0x1p-21f : 0;
  ForEachRay<Counter>(query, [&](auto any, const RayQuery& q, rb_hit& best, Counter& counter) {
    SlabRay slab = SlabRay(q.ray, slack).Widened(slack);
    slab.inv_near = slab.inv_near * (1 - pad), slab.inv_far = slab.inv_far * (1 + pad);
    Trace<StudyTest, Counter, false, any.value>(RayState<StudyTest>(study, q, slab), best, counter);
  });
}

template void KdTree::QueryStudy<NoCounting>(const Study&, PlaneRule, uint32_t, const rb_query&) const;
template void KdTree::QueryStudy<Counting>(const Study&, PlaneRule, uint32_t, const rb_query&) const;

}  // namespace raybench
