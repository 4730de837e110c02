// How rays walk a kd-tree whose tests are studied.
#include "accel/ray/study.h"

#include "accel/kd/tree.h"

namespace raybench {

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
