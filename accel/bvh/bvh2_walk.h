// The loop in which a ray walks a Bvh2, for the files that compile it: bvh2_query.cpp and bvh2_study.cpp.
#pragma once

#include "accel/base/branch.h"
#include "accel/base/lanes.h"
#include "accel/bvh/bvh2.h"

namespace raybench {
namespace {  // each file that includes this compiles its own

/// The ray's constants as the four lanes of a node need them: entry of both children, then minus their exit, so that one
/// running maximum serves both. kMoved: as MovedSlab has it.
template <bool kMoved>
class NodeTest {
 public:
  [[gnu::always_inline]] NodeTest(const SlabRay& slab, float widening) {
    Float4 near = slab.inv_near * widening, exit = -slab.inv_far, near_move = slab.org, exit_move = slab.org;
    if constexpr (kMoved) {
      const MovedSlab moved(slab);
      near = moved.near_scale, exit = -moved.far_scale, near_move = moved.near_move,
      exit_move = -moved.far_move;
    }
    for (int a = 0; a < 3; ++a) {
      scale_[a] = Float4{near[a], near[a], exit[a], exit[a]};
      move_[a] = Float4{near_move[a], near_move[a], exit_move[a], exit_move[a]};
      near_first_[a] = LaneXor<4>(slab.negative(a) ? 2 : 0);
    }
  }

  /// Lanes 0, 1: entry; lanes 2, 3: minus exit. `limits`: tnear, tnear, -tfar, -tfar.
  [[gnu::always_inline]] Float4 Intervals(const float (&bounds)[3][4], Float4 limits) const {
    const auto t = [&](int a) {
      const Float4 planes = near_first_[a](Load<Float4>(bounds[a]));
      if constexpr (kMoved) return MultiplyAdd<4>(planes, scale_[a], move_[a]);
      return (planes - move_[a]) * scale_[a];
    };
    if constexpr (kMoved) return Larger<4>(Larger<4>(t(0), t(1)), Larger<4>(t(2), limits));
    return Larger<4>(t(2), Larger<4>(t(1), Larger<4>(t(0), limits)));
  }

 private:
  Float4 scale_[3], move_[3];
  LaneXor<4> near_first_[3];
};

/// No hit behind this matters any more.
template <class Test>
[[gnu::always_inline]] inline float Reach(const RayState<Test>& ray, const rb_hit& best) {
  if constexpr (std::is_same_v<Test, StudyTest>) return ray.Reach(best);
  return best.t;
}

}  // namespace

/// True if `best` changed.
template <class Test, class Counter, bool kProcedural, bool kAnyHit>
[[gnu::always_inline]] inline bool Bvh2::Leaf(uint32_t ref, const RayState<Test>& ray, rb_hit& best,
                                              Counter& counter) const {
  const uint32_t first = FirstBlock(ref), count = LeafSize(ref);
  counter.Step(0);
  counter.Leaf(false);
  // As a whole, also where a hit ends the search in it.
  uint64_t bytes = Blocks::BlocksOf(count) * sizeof(Blocks::Block);
  if constexpr (std::is_same_v<Test, StudyTest>) bytes = ray.study().BytesTested(count, bytes);
  counter.Prims(count, bytes);
  if constexpr (std::is_same_v<Test, StudyTest>) {
    return ray.TakeLeaf(geometry_, leaves_.Address(first), size_t{first} * Blocks::kLanes, count, kAnyHit,
                        best);
  } else {
    NoCounting counted;
    return leaves_.Intersect<kProcedural, kAnyHit>(first, count, ray, best, counted, NoMailbox{});
  }
}

/// Boxes that stand for their content, taken as leaves of one primitive, out of `hit`. True if `best` changed.
template <class Ray, class Counter>
inline bool Bvh2::StandsIn(const Node& node, const Ray& ray, Float4 m, unsigned& hit, Float4 limits,
                           rb_hit& best, Counter& counter) {
  const unsigned before = hit;
  const bool changed = ray.TakeBoxes(node.stand_in, m, limits, hit, best);
  for (unsigned left = before ^ hit; left != 0; left &= left - 1) {
    counter.Step(0);
    counter.Leaf(false);
    counter.Prims(1, 0);
  }
  return changed;
}

/// The nearer child first; any-hit, which need not know, the left one.
template <class NodeTest, class Test, class Counter, bool kProcedural, bool kAnyHit>
[[gnu::noinline]] void Bvh2::Walk(const NodeTest& test, const RayState<Test>& ray, rb_hit& best,
                                  Counter& counter) const {
  struct Entry {
    uint32_t ref;
    float tnear;
  };
  Entry stack[kMaxTreeDepth];
  Entry* top = stack;
  const float tnear = ray.query.ray.tnear;
  Float4 limits{tnear, tnear, -best.t, -best.t};
  for (uint32_t ref = root_;;) {
    bool is_missed = false;
    while ((ref & kLeaf) == 0) {
      const Node& node = nodes_[ref];
      counter.Step(sizeof(Node));
      counter.Bounds(2);
      const Float4 m = test.Intervals(node.bounds, limits);
      const Float4 gap = m + __builtin_shufflevector(m, m, 2, 3, 0, 1);  // entry - exit
      unsigned hit = Mask(gap <= Float4{}) & 3u;
      if constexpr (std::is_same_v<Test, StudyTest>) {
        if (stands_in_ && StandsIn(node, ray, m, hit, limits, best, counter)) {
          if constexpr (kAnyHit) return;
          limits = Float4{tnear, tnear, -Reach(ray, best), -Reach(ray, best)};
        }
      }
      const auto both = [&](uint32_t first, uint32_t second, float entry) {
        StayBranch();
        __builtin_prefetch(Address(second));
        *top++ = {second, entry};
        ref = first;
      };
      if (hit == 3) {
        if (kAnyHit || m[0] <= m[1]) {
          both(node.child[0], node.child[1], m[1]);
        } else {
          both(node.child[1], node.child[0], m[0]);
        }
      } else if (hit == 1) {
        StayBranch();
        ref = node.child[0];
      } else if (hit == 2) {
        StayBranch();
        ref = node.child[1];
      } else {
        is_missed = true;
        break;
      }
    }
    if (!is_missed && Leaf<Test, Counter, kProcedural, kAnyHit>(ref, ray, best, counter)) {
      if constexpr (kAnyHit) return;
      const float tfar = Reach(ray, best);
      limits = Float4{tnear, tnear, -tfar, -tfar};
    }
    do {
      if (top == stack) return;
      --top;
    } while (!kAnyHit && top->tnear > Reach(ray, best));
    ref = top->ref;
  }
}

}  // namespace raybench
