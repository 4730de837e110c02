// A kd-tree, laid out for traversal: how it is stored and how rays walk it. Builders are apart (kd/build.h).
//
// Node, 8 bytes, eight to a cache line (Wald 2004):
//
//     inner:  split plane : float | offset of the right child : 30 | axis : 2
//     leaf:   first block : 32    | primitives : 30                | 3 : 2
//
// The left child is the next node, the right one lies `offset` nodes on, so subtrees can be moved as they
// are. A leaf's primitives are blocks of four triangles, 160 bytes, vertices copied lane by lane: leaves are
// small, and one run of memory beats a list of indices into another.
//
// Traversal is that of Havran (2000), TA_rec^B, with the interval of the ray in each cell; conservative where
// the test is. Plane and box are met by the same arithmetic, (s - o) / d with the near result scaled down and
// the far one up (ray/bounds.h), so that cells overlap by the error of t. Let a primitive lie in [lo, hi],
// not clipped, and be accepted at t, which RayState keeps in the interval of that box. Rounding is monotone:
// if hi <= s, t is not beyond the far result of s on the side below it; if lo >= s, not before the near one
// on the other; if neither, the primitive stands on both sides and t lies on one of them. So, from the root
// on, t lies in the interval of a child that holds the primitive, and a child is left out only if its
// interval is empty or begins behind the best t. A primitive that ends in the plane need stand on one side
// only. Where d = 0 and o = s, 0 * inf is NaN, which rules out neither side.
//
// Clipped primitives (perfect splits): an accepted ray passes the triangle's own points by as much as it may
// pass its box. The triangle is clipped to the cell enlarged by its padding, so the leaf where the ray passes
// it holds it. What is not promised then is the order of two hits whose t the test in float gets wrong by
// more than the slack: no hit is lost, but `brute` may name the other one.
//
// Every hit found in a leaf counts, also one beyond the cell.
#pragma once

#include <vector>

#include "accel/base/huge_array.h"
#include "accel/ray/leaf_blocks.h"
#include "accel/ray/primitive.h"

namespace raybench {

class Study;
enum class PlaneRule : uint32_t;
class StudyTest;

/// See above.
struct KdNode {
  static constexpr uint32_t kLeaf = 3;
  union {
    float split;
    uint32_t first;
  };
  uint32_t bits;

  static KdNode Inner(int axis, float split) {
    KdNode n;
    n.split = split, n.bits = uint32_t(axis);
    return n;
  }
  static KdNode Leaf(uint32_t first, uint32_t count) {
    KdNode n;
    n.first = first, n.bits = count << 2 | kLeaf;
    return n;
  }
  void SetRight(size_t offset) { bits |= uint32_t(offset) << 2; }
  bool IsLeaf() const { return (bits & 3) == kLeaf; }
  int axis() const { return int(bits & 3); }
  uint32_t count() const { return bits >> 2; }
  uint32_t right() const { return bits >> 2; }
};
static_assert(sizeof(KdNode) == 8);

/// What builders make: nodes in depth-first order, whose leaves' `first` counts in `prims`.
struct KdSubtree {
  std::vector<KdNode> nodes;
  std::vector<uint32_t> prims;

  uint64_t bytes() const { return nodes.size() * sizeof(KdNode) + prims.size() * sizeof(uint32_t); }
};

class KdTree {
 public:
  static constexpr uint32_t kMaxDepth = 64;  ///< builders stay below
  static constexpr size_t kMaxNodes = size_t{1} << 30;

  KdTree() = default;
  /// `cell`: the root's. Throws std::runtime_error if the tree is larger than nodes can tell, or this copy of
  /// it, together with `built`, than memory_limit (0: none) allows.
  KdTree(const rb_geometry& geometry, const Bounds3& cell, const KdSubtree& built, uint64_t memory_limit);

  template <class Test, class Counter>
  void Query(const rb_query& query) const {
    if (geometry_.procedural_count > 0) {
      QueryLeaves<Test, Counter, true>(query);
    } else {
      QueryLeaves<Test, Counter, false>(query);
    }
  }

  /// The same with the tests of a study that is on (ray/study.h); `rule` kAsNumerics: the traversal of `numerics`.
  template <class Counter>
  void QueryStudy(const Study& study, PlaneRule rule, uint32_t numerics, const rb_query& query) const;
  const auto& leaves() const { return blocks_; }

  MemoryUse Memory() const { return {nodes_.bytes(), blocks_.bytes(), geometry_.procedural_count > 0}; }

  /// node(const rb_node&) in pre-order until it returns non-zero.
  template <class Fn>
  int Visit(Fn&& node) const {
    return nodes_.size() == 0 ? 0 : VisitBelow(&nodes_[0], cell_, 0, node);
  }

 private:
  template <class Test, class Counter, bool kProcedural>
  void QueryLeaves(const rb_query& query) const {
    ForEachRay<Counter>(query, [&](auto any, const RayQuery& q, rb_hit& best, Counter& counter) {
      Trace<Test, Counter, kProcedural, any.value>(RayState<Test>(q), best, counter);
    });
  }

  template <class Test, class Counter, bool kProcedural, bool kAnyHit>
  void Trace(const RayState<Test>& ray, rb_hit& best, Counter& counter) const;

  template <class Ray, class Counter>
  bool StudyLeaf(const KdNode& leaf, const Ray& ray, bool any, rb_hit& best, Counter& counter) const;

  template <class Fn>
  int VisitBelow(const KdNode* at, const Bounds3& cell, uint32_t depth, Fn& node) const;

  rb_geometry geometry_{};
  HugeArray<KdNode> nodes_;
  LeafBlocks<> blocks_;
  Bounds3 cell_;
};

template <class Test, class Counter, bool kProcedural, bool kAnyHit>
inline void KdTree::Trace(const RayState<Test>& ray, rb_hit& best, Counter& counter) const {
  if (nodes_.size() == 0) return;
  struct Entry {
    const KdNode* node;
    float tnear, tfar;
  };
  Entry stack[kMaxDepth];
  int top = 0;

  struct Axis {
    float org, inv_near, inv_far;
    uint32_t negative;
  } axes[3];
  const SlabRay slab = ray.SlabOfParts();
  for (int a = 0; a < 3; ++a) axes[a] = {slab.org[a], slab.inv_near[a], slab.inv_far[a], slab.negative(a)};

  float tnear, tfar;
  slab.Interval(cell_, tnear, tfar);
  counter.Bounds(1);
  tnear = std::max(tnear, ray.query.ray.tnear), tfar = std::min(tfar, best.t);
  if (!(tnear <= tfar)) return;
  const KdNode* node = &nodes_[0];
  for (;;) {
    while (!node->IsLeaf()) {
      counter.Step(sizeof(KdNode));
      counter.Bounds(1);
      const Axis& axis = axes[node->axis()];
      const float distance = node->split - axis.org;
      const float t0 = distance * axis.inv_near, t1 = distance * axis.inv_far;
      const KdNode* children[2] = {node + 1, node + node->right()};
      const KdNode *near = children[axis.negative], *far = children[axis.negative ^ 1];
      if (tnear > t1) {
        node = far;
      } else if (tfar < t0) {
        node = near;
      } else {
        stack[top++] = {far, t0 > tnear ? t0 : tnear, tfar};
        node = near;
        tfar = t1 < tfar ? t1 : tfar;
      }
    }
    const uint32_t count = node->count();
    counter.Step(sizeof(KdNode));
    counter.Leaf(count == 0);
    if constexpr (std::is_same_v<Test, StudyTest>) {
      if (count > 0 && StudyLeaf(*node, ray, kAnyHit, best, counter) && kAnyHit) return;
    } else if (count > 0 &&
               blocks_.Intersect<kProcedural, kAnyHit>(node->first, count, ray, best, counter, NoMailbox()) &&
               kAnyHit) {
      return;
    }
    do {
      if (top == 0) return;
      --top;
    } while (stack[top].tnear > best.t);
    node = stack[top].node, tnear = stack[top].tnear, tfar = std::min(stack[top].tfar, best.t);
  }
}

template <class Fn>
int KdTree::VisitBelow(const KdNode* at, const Bounds3& cell, uint32_t depth, Fn& node) const {
  const float bounds[6] = {cell.lo.x, cell.lo.y, cell.lo.z, cell.hi.x, cell.hi.y, cell.hi.z};
  rb_node shown{depth, 0, 1, RB_SHAPE_BOX, bounds, 6, 0, nullptr};
  if (at->IsLeaf()) {
    std::vector<uint32_t> prims(at->count());
    for (size_t i = 0; i < prims.size(); ++i) prims[i] = blocks_.prim(at->first, uint32_t(i));
    shown.is_leaf = 1, shown.prim_count = uint32_t(prims.size()), shown.prims = prims.data();
    return node(shown);
  }
  if (int stop = node(shown)) return stop;
  Bounds3 left = cell, right = cell;
  left.hi[at->axis()] = right.lo[at->axis()] = at->split;
  if (int stop = VisitBelow(at + 1, left, depth + 1, node)) return stop;
  return VisitBelow(at + at->right(), right, depth + 1, node);
}

}  // namespace raybench
