// How rays walk a Bvh2 whose tests are studied. Apart from bvh2_query.cpp, so that the compiler decides there as if this
// were not here.
#include "accel/bvh/bvh2_walk.h"
#include "accel/ray/study.h"

namespace raybench {
namespace {

/// The slab test of textbooks: t of both planes, whichever is met first, by std::min and std::max. Where one is NaN
/// these return their first operand.
class NaiveNodeTest {
 public:
  explicit NaiveNodeTest(const rb_ray& ray) {
    for (int a = 0; a < 3; ++a) inv_[a] = Splat<Float4>(1 / ray.dir[a]), org_[a] = Splat<Float4>(ray.org[a]);
  }

  Float4 Intervals(const float (&bounds)[3][4], Float4 limits) const {
    for (int a = 0; a < 3; ++a) {
      const Float4 t = (Load<Float4>(bounds[a]) - org_[a]) * inv_[a];  // lower planes, upper planes
      const Float4 other = __builtin_shufflevector(t, t, 2, 3, 0, 1);
      const Float4 near = Smaller<4>(other, t),
                   far = -Larger<4>(t, other);  // in lanes 0, 1 and in lanes 2, 3
      limits = Larger<4>(__builtin_shufflevector(near, far, 0, 1, 6, 7), limits);
    }
    return limits;
  }

 private:
  Float4 inv_[3], org_[3];
};

}  // namespace

template <class Counter>
void Bvh2::QueryStudy(const Study& study, SlabRule rule, uint32_t numerics, const rb_query& query) const {
  if (root_ == kEmpty) return ForEachRay<Counter>(query, [](auto, const RayQuery&, rb_hit&, Counter&) {});
  const Slack slack = rule == SlabRule::kAsNumerics ? SlackOf(numerics) : Slack::kNone;
  // Ize scales t; the reciprocal, which is scaled here, rounds once more: 1 + 2 gamma_4.
  const float far = rule == SlabRule::kPadded ? 1 + 0x1p-21f : 1;
  ForEachRay<Counter>(query, [&](auto any, const RayQuery& q, rb_hit& best, Counter& counter) {
    SlabRay slab(q.ray, slack);
    slab.inv_far = slab.inv_far * far;
    const RayState<StudyTest> ray(study, q, slab);
    if (rule == SlabRule::kNaive) {
      Walk<NaiveNodeTest, StudyTest, Counter, false, any.value>(NaiveNodeTest(q.ray), ray, best, counter);
    } else {
      const float widening = clipped_ ? SlabRay::Widening(slack) : 1;
      Walk<NodeTest<false>, StudyTest, Counter, false, any.value>({slab, widening}, ray, best, counter);
    }
  });
}

template void Bvh2::QueryStudy<NoCounting>(const Study&, SlabRule, uint32_t, const rb_query&) const;
template void Bvh2::QueryStudy<Counting>(const Study&, SlabRule, uint32_t, const rb_query&) const;

}  // namespace raybench
