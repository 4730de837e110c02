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

uint32_t Bvh2::LargestBelow(uint32_t ref) const {
  uint32_t largest = RAYBENCH_NONE;
  float area = -1;
  const auto take = [&](uint32_t prim) {
    const float its = PrimBounds(geometry_, prim).HalfArea();
    if (its > area || (its == area && prim < largest)) largest = prim, area = its;
  };
  if ((ref & kLeaf) != 0) {
    for (uint32_t i = 0; i < LeafSize(ref); ++i) take(leaves_.prim(FirstBlock(ref), i));
  } else {
    for (const uint32_t child : nodes_[ref].child) take(LargestBelow(child));
  }
  return largest;
}

void Bvh2::StandInBelow(uint32_t ref, uint32_t levels) {
  if ((ref & kLeaf) != 0) return;
  for (int c = 0; c < 2; ++c) {
    const uint32_t child = nodes_[ref].child[c];
    if (levels > 1) {
      StandInBelow(child, levels - 1);
    } else if ((child & kLeaf) == 0) {
      nodes_[ref].stand_in[c] = 1 + LargestBelow(child);
    }
  }
}

void Bvh2::StandIn(uint32_t depth) {
  stands_in_ = true;
  if (root_ != kEmpty) StandInBelow(root_, depth);
}

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
