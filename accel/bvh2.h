// A binary BVH, laid out for traversal: how it is stored and how rays walk it. Builders are apart
// (binned_sah.h).
//
// Node, 64 bytes, one cache line; holds the bounds of its two children:
//
//     x: lo0 lo1 hi0 hi1 | y: lo0 lo1 hi0 hi1 | z: lo0 lo1 hi0 hi1 | child0 child1 - -
//
// so that three four-lane operations an axis test both children, with the planes met first in lanes 0 and 1.
// Leaves are one or more blocks of four triangles, 160 bytes, vertices copied lane by lane, and are told
// apart in the child reference: bit 31 set, then (primitives - 1) in 4 bits and the first block in 27.
//
// Traversal is conservative when the test is (ray_bounds.h): nothing that the primitive test accepts is
// culled, a node whose entry equals the best t is still visited, so that the lowest id wins ties, and the
// answer is that of `brute`.
#pragma once

#include "accel/binary_tree.h"
#include "accel/ray_primitive.h"
#include "accel/simd.h"

namespace raybench {

class Bvh2 {
 public:
  static constexpr uint32_t kMaxLeaf = 16;
  static constexpr uint32_t kMaxDepth = 80;  ///< builders stay below

  Bvh2() = default;
  /// Lays out what a builder made. Runs inside the caller's task arena. An empty scene has no builder's tree:
  /// use the default constructor. Throws std::runtime_error if the tree is deeper or larger than references
  /// can tell.
  Bvh2(const rb_geometry& geometry, const BinaryTree& tree);

  template <class Test, class Counter>
  void Query(const rb_query& query) const {
    if (geometry_.procedural_count > 0) {
      QueryLeaves<Test, Counter, true>(query);
    } else {
      QueryLeaves<Test, Counter, false>(query);
    }
  }

  MemoryUse Memory() const { return {nodes_.bytes(), blocks_.bytes(), geometry_.procedural_count > 0}; }

  /// node(const rb_node&) in pre-order until it returns non-zero.
  template <class Fn>
  int Visit(Fn&& node) const {
    return root_ == kEmpty ? 0 : VisitBelow(root_, bounds_, 0, node);
  }

 private:
  static constexpr uint32_t kLeaf = 0x80000000u, kEmpty = 0xFFFFFFFFu, kBlockBits = 27;
  static constexpr uint32_t kLanes = 4;

  struct alignas(64) Node {
    float bounds[3][4];
    uint32_t child[2], unused[2];
  };
  static_assert(sizeof(Node) == 64);

  struct alignas(16) Block {
    float v[3][3][kLanes];  // corner, axis, lane
    uint32_t prim[kLanes];
  };
  static_assert(sizeof(Block) == 160);

  /// Where a child lies: asked for when it is pushed, since large trees are bound by memory.
  const void* Address(uint32_t ref) const {
    return (ref & kLeaf) != 0 ? static_cast<const void*>(&blocks_[FirstBlock(ref)]) : &nodes_[ref];
  }
  static uint32_t LeafSize(uint32_t ref) { return ((ref >> kBlockBits) & 15u) + 1; }
  static uint32_t FirstBlock(uint32_t ref) { return ref & ((1u << kBlockBits) - 1); }

  template <class Test, class Counter, bool kProcedural>
  void QueryLeaves(const rb_query& query) const {
    ForEachRay<Counter>(query, [&](auto any, const RayQuery& q, rb_hit& best, Counter& counter) {
      Trace<Test, Counter, kProcedural, any.value>(RayState<Test>(q), best, counter);
    });
  }

  template <class Test, class Counter, bool kProcedural, bool kAnyHit>
  void Trace(const RayState<Test>& ray, rb_hit& best, Counter& counter) const;

  template <class Test, class Counter, bool kProcedural, bool kAnyHit>
  bool Leaf(uint32_t ref, const RayState<Test>& ray, rb_hit& best, Counter& counter) const;

  template <class Fn>
  int VisitBelow(uint32_t ref, const Bounds3& box, uint32_t depth, Fn& node) const;

  rb_geometry geometry_{};
  HugeArray<Node> nodes_;
  HugeArray<Block> blocks_;
  uint32_t root_ = kEmpty;
  Bounds3 bounds_;
};

/// The ray's constants as the four lanes of a node need them: entry of both children, then minus their exit,
/// so that one running maximum serves both.
class NodeTest {
 public:
  explicit NodeTest(const SlabRay& slab) {
    for (int a = 0; a < 3; ++a) {
      org_[a] = Splat4(slab.org[a]);
      inv_[a] = Float4{slab.inv_near[a], slab.inv_near[a], -slab.inv_far[a], -slab.inv_far[a]};
      // Which lanes hold the planes met first.
      order_[a] = slab.negative[a] ? Int4{2, 3, 0, 1} : Int4{0, 1, 2, 3};
    }
  }

  /// Lanes 0, 1: entry; lanes 2, 3: minus exit. `limits`: tnear, tnear, -tfar, -tfar.
  Float4 Intervals(const float (&bounds)[3][4], Float4 limits) const {
    Float4 m = limits;
    for (int a = 0; a < 3; ++a) {
      m = MaxOrSecond((Permute(Load4(bounds[a]), order_[a]) - org_[a]) * inv_[a], m);
    }
    return m;
  }

 private:
  Float4 org_[3], inv_[3];
  Int4 order_[3];
};

template <class Test, class Counter, bool kProcedural, bool kAnyHit>
inline void Bvh2::Trace(const RayState<Test>& ray, rb_hit& best, Counter& counter) const {
  struct Entry {
    uint32_t ref;
    float tnear;
  };
  Entry stack[kMaxDepth];
  int top = 0;
  uint32_t ref = root_;
  if (ref == kEmpty) return;
  const NodeTest test(ray.slab);
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

/// True if `best` changed.
template <class Test, class Counter, bool kProcedural, bool kAnyHit>
inline bool Bvh2::Leaf(uint32_t ref, const RayState<Test>& ray, rb_hit& best, Counter& counter) const {
  const uint32_t count = LeafSize(ref);
  counter.Step(0);
  counter.Leaf(false);
  counter.Prims(count, (count + kLanes - 1) / kLanes * sizeof(Block));
  bool changed = false;
  const Block* block = &blocks_[FirstBlock(ref)];
  for (uint32_t left = count;; ++block) {
    const uint32_t lanes = left < kLanes ? left : kLanes;
    unsigned candidates = ray.test.MayHit(Lanes{block->v}) & ((1u << lanes) - 1);
    if constexpr (kProcedural)
      candidates = (1u << lanes) - 1;  // lanes of procedural primitives hold no vertices
    for (; candidates != 0; candidates &= candidates - 1) {
      const int i = __builtin_ctz(candidates);
      if constexpr (kProcedural) {
        changed |= ray.Primitive(geometry_, block->prim[i], best);
      } else {
        auto corner = [&](int c) { return Vec3f{block->v[c][0][i], block->v[c][1][i], block->v[c][2][i]}; };
        changed |= ray.Triangle(corner(0), corner(1), corner(2), block->prim[i], best);
      }
      if (kAnyHit && changed) return true;
    }
    if (left <= kLanes) return changed;
    left -= kLanes;
  }
}

template <class Fn>
int Bvh2::VisitBelow(uint32_t ref, const Bounds3& box, uint32_t depth, Fn& node) const {
  const float bounds[6] = {box.lo.x, box.lo.y, box.lo.z, box.hi.x, box.hi.y, box.hi.z};
  rb_node shown{depth, 0, 0, RB_SHAPE_BOX, bounds, 6, 0, nullptr};
  if ((ref & kLeaf) != 0) {
    uint32_t prims[kMaxLeaf];
    shown.is_leaf = 1, shown.prim_count = LeafSize(ref), shown.prims = prims;
    for (uint32_t i = 0; i < shown.prim_count; ++i)
      prims[i] = blocks_[FirstBlock(ref) + i / kLanes].prim[i % kLanes];
    return node(shown);
  }
  if (int stop = node(shown)) return stop;
  const Node& n = nodes_[ref];
  for (int c = 0; c < 2; ++c) {
    const auto& b = n.bounds;
    const Bounds3 child{{b[0][c], b[1][c], b[2][c]}, {b[0][c + 2], b[1][c + 2], b[2][c + 2]}};
    if (int stop = VisitBelow(n.child[c], child, depth + 1, node)) return stop;
  }
  return 0;
}

}  // namespace raybench
