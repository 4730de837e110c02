// How rays walk a Bvh2. Compiled once for all structures that are one.
#include "accel/base/simd.h"
#include "accel/bvh/bvh2.h"

namespace raybench {
namespace {

/// The ray's constants as the four lanes of a node need them: entry of both children, then minus their exit,
/// so that one running maximum serves both.
class NodeTest {
 public:
  explicit NodeTest(const SlabRay& slab) {
    for (int a = 0; a < 3; ++a) {
      org_[a] = Splat<Float4>(slab.org[a]);
      inv_[a] = Float4{slab.inv_near[a], slab.inv_near[a], -slab.inv_far[a], -slab.inv_far[a]};
      near_first_[a] = LaneXor<4>(slab.negative[a] ? 2 : 0);
    }
  }

  /// Lanes 0, 1: entry; lanes 2, 3: minus exit. `limits`: tnear, tnear, -tfar, -tfar.
  Float4 Intervals(const float (&bounds)[3][4], Float4 limits) const {
    Float4 m = limits;
    for (int a = 0; a < 3; ++a) {
      m = MaxOrSecond((near_first_[a](Load<Float4>(bounds[a])) - org_[a]) * inv_[a], m);
    }
    return m;
  }

 private:
  Float4 org_[3], inv_[3];
  LaneXor<4> near_first_[3];
};

}  // namespace

/// True if `best` changed.
template <class Test, class Counter, bool kProcedural, bool kAnyHit>
inline bool Bvh2::Leaf(uint32_t ref, const RayState<Test>& ray, rb_hit& best, Counter& counter) const {
  const uint32_t first = FirstBlock(ref), count = LeafSize(ref);
  counter.Step(0);
  counter.Leaf(false);
  // As a whole, also where a hit ends the search in it.
  counter.Prims(count, LeafBlocks<>::BlocksOf(count) * sizeof(LeafBlocks<>::Block));
  NoCounting counted;
  return leaves_.Intersect<kProcedural, kAnyHit>(first, count, ray, best, counted, NoMailbox{});
}

template <class Test, class Counter, bool kProcedural, bool kAnyHit>
inline void Bvh2::Trace(const RayState<Test>& ray, rb_hit& best, Counter& counter) const {
  struct Entry {
    uint32_t ref;
    float tnear;
  };
  Entry stack[kMaxTreeDepth];
  int top = 0;
  uint32_t ref = root_;
  if (ref == kEmpty) return;
  const NodeTest test(clipped_ ? ray.SlabOfParts() : ray.slab);
  const float tnear = ray.query.ray.tnear;
  Float4 limits{tnear, tnear, -best.t, -best.t};
  for (;;) {
    while ((ref & kLeaf) == 0) {
      const Node& node = nodes_[ref];
      counter.Step(sizeof(Node));
      counter.Bounds(2);
      const Float4 m = test.Intervals(node.bounds, limits);
      const Float4 gap = m + __builtin_shufflevector(m, m, 2, 3, 0, 1);  // entry - exit
      const unsigned hit = Mask(gap <= Float4{}) & 3u;
      if (hit == 3) {
        const unsigned far = m[0] <= m[1];
        __builtin_prefetch(Address(node.child[far]));
        stack[top++] = {node.child[far], far ? m[1] : m[0]};
        ref = node.child[far ^ 1];
      } else if (hit != 0) {
        ref = node.child[hit >> 1];
      } else {
        ref = kEmpty;
        break;
      }
    }
    if (ref != kEmpty && Leaf<Test, Counter, kProcedural, kAnyHit>(ref, ray, best, counter)) {
      if constexpr (kAnyHit) return;
      limits = Float4{tnear, tnear, -best.t, -best.t};
    }
    do {
      if (top == 0) return;
      --top;
    } while (stack[top].tnear > best.t);
    ref = stack[top].ref;
  }
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
