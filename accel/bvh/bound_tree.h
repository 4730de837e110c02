// A binary hierarchy over any kind of bound.
//
// A bound offers: kShape and kFloats for the visitor; Around(geometry, prims, count, padded); CopyTo(floats);
// and a class Ray(SlabRay, rb_ray, Slack) with Meets(bound, tfar, entry): whether the ray may meet in (tnear,
// tfar] what the bound holds, and from which t on; never false where the primitive test accepts, and never an
// entry behind what it answers.
//
// A bound that also offers Extend(bound) is the same whether made from primitives or from the bounds of their
// parts; without it (a sphere around spheres is looser) it is made around the primitives of every subtree.
// The topology comes from a builder (binned_sah.h). Nodes stand in depth-first order: the left child of an
// inner node is the next one.
#pragma once

#include <stdexcept>
#include <vector>

#include "accel/base/branch.h"
#include "accel/base/parallel.h"
#include "accel/bvh/binary_tree.h"
#include "accel/contract/cancel.h"
#include "accel/ray/leaf_blocks.h"

namespace raybench {

template <class Bound>
class BoundTree {
 public:
  static constexpr uint32_t kMaxLeaf = 16;
  static constexpr uint32_t kMaxDepth = kMaxTreeDepth;  ///< builders stay below

  BoundTree() = default;
  /// Runs inside the caller's task arena. Throws std::runtime_error if the tree is too deep or cancelled.
  BoundTree(const rb_geometry& geometry, const BinaryTree& tree, bool padded, const volatile int* cancel) {
    struct Pending {
      uint32_t slot, parent, depth;
    };
    struct Source {
      uint32_t slot, first, count;  // of the builder's tree, and the primitives of the subtree
    };
    std::vector<Source> sources;
    std::vector<Pending> stack{{0, kNone, 0}};
    std::vector<uint32_t> right, leaf_size;
    uint32_t blocks = 0;
    while (!stack.empty()) {
      const Pending p = stack.back();
      stack.pop_back();
      if (p.depth >= kMaxDepth) throw std::runtime_error("the tree is deeper than the traversal stack");
      const BuildNode& from = tree.nodes[p.slot];
      const uint32_t place = uint32_t(sources.size());
      if (p.parent != kNone) right[p.parent] = place;
      sources.push_back({p.slot, from.first, from.count});
      leaf_size.push_back(from.count);
      right.push_back(from.count > 0 ? blocks : kNone);
      if (from.count > 0) {
        if (from.count > kMaxLeaf) throw std::runtime_error("a leaf has too many primitives");
        blocks += uint32_t(LeafBlocks<>::BlocksOf(from.count));
      } else {
        stack.push_back({from.right, place, p.depth + 1});
        stack.push_back({p.slot + 1, kNone, p.depth + 1});
      }
    }
    // A subtree's primitives are one run of the builder's order: from its first leaf to its last.
    for (size_t i = sources.size(); i-- > 0;) {
      if (leaf_size[i] > 0) continue;
      const Source &l = sources[i + 1], &r = sources[right[i]];
      sources[i].first = l.first, sources[i].count = l.count + r.count;
    }
    nodes_ = HugeArray<Node>(sources.size());
    leaves_ = LeafBlocks<>(geometry, blocks);
    // Where the bound of a union is the union of bounds, leaves are enough and the rest follows.
    constexpr bool kMerges = requires(Bound & a, const Bound& b) { a.Extend(b); };
    ParallelFor(Range<size_t>(0, sources.size(), 64), [&](const auto& range) {
      if (IsCancelled(cancel)) return;
      for (size_t i = range.begin(); i < range.end(); ++i) {
        const uint32_t* prims = &tree.order[sources[i].first];
        const bool is_leaf = leaf_size[i] > 0;
        nodes_[i].next = right[i], nodes_[i].count = leaf_size[i];
        if (is_leaf || !kMerges) nodes_[i].bound = Bound::Around(geometry, prims, sources[i].count, padded);
        if (is_leaf) leaves_.Fill(right[i], {prims, leaf_size[i]});
      }
    });
    if constexpr (kMerges) {
      for (size_t i = sources.size(); i-- > 0;) {
        if (leaf_size[i] > 0) continue;
        nodes_[i].bound = nodes_[i + 1].bound;
        nodes_[i].bound.Extend(nodes_[right[i]].bound);
      }
    }
    CheckCancel(cancel);
  }

  template <class Test, class Counter>
  void Query(const rb_query& query) const {
    ForEachRay<Counter>(query, [&](auto any, const RayQuery& q, rb_hit& best, Counter& counter) {
      const RayState<Test> ray(q);
      if (leaves_.needs_geometry()) {
        Trace<true, any.value>(ray, best, counter);
      } else {
        Trace<false, any.value>(ray, best, counter);
      }
    });
  }

  MemoryUse Memory() const { return {nodes_.bytes(), leaves_.bytes(), leaves_.needs_geometry()}; }

  /// node(const rb_node&) in pre-order until it returns non-zero.
  template <class Fn>
  int Visit(Fn&& node) const {
    uint32_t depth[2 * kMaxDepth];  // of nodes to come
    int top = 0;
    if (nodes_.size() > 0) depth[top++] = 0;
    for (size_t i = 0; i < nodes_.size(); ++i) {
      const Node& n = nodes_[i];
      float bounds[Bound::kFloats];
      n.bound.CopyTo(bounds);
      uint32_t prims[kMaxLeaf];
      for (uint32_t k = 0; k < n.count; ++k) prims[k] = leaves_.prim(n.next, k);
      const uint32_t d = depth[--top];
      const rb_node shown{d, n.count > 0, 0, Bound::kShape, bounds, Bound::kFloats, n.count, prims};
      if (int stop = node(shown)) return stop;
      if (n.count == 0) depth[top++] = d + 1, depth[top++] = d + 1;
    }
    return 0;
  }

 private:
  static constexpr uint32_t kNone = 0xFFFFFFFFu;

  struct Node {
    Bound bound;
    uint32_t next;   // inner: the right child; leaf: its first block
    uint32_t count;  // leaf: primitives; inner: 0
  };

  template <bool kProcedural, bool kAnyHit, class Test, class Counter>
  void Trace(const RayState<Test>& state, rb_hit& best, Counter& counter) const {
    if (nodes_.size() == 0) return;
    const typename Bound::Ray ray(state.slab, state.query.ray, Test::kSlack);
    struct Entry {
      uint32_t node;
      float tnear;
    };
    Entry stack[kMaxDepth];
    int top = 0;
    Entry at{0, 0};
    counter.Bounds(1);
    if (!ray.Meets(nodes_[0].bound, best.t, at.tnear)) return;
    for (;;) {
      const Node& node = nodes_[at.node];
      counter.Step(sizeof(Node));
      if (node.count > 0) {
        counter.Leaf(false);
        if (leaves_.Intersect<kProcedural, kAnyHit>(node.next, node.count, state, best, counter,
                                                    NoMailbox{}) &&
            kAnyHit)
          return;
      } else {
        Entry left{at.node + 1, 0}, right{node.next, 0};
        counter.Bounds(2);
        const bool meets_left = ray.Meets(nodes_[left.node].bound, best.t, left.tnear);
        const bool meets_right = ray.Meets(nodes_[right.node].bound, best.t, right.tnear);
        if (meets_left && meets_right) {
          if (kAnyHit || left.tnear <= right.tnear) {
            StayBranch();
            stack[top++] = right;
            at = left;
          } else {
            StayBranch();
            stack[top++] = left;
            at = right;
          }
          continue;
        }
        if (meets_left) {
          StayBranch();
          at = left;
          continue;
        }
        if (meets_right) {
          StayBranch();
          at = right;
          continue;
        }
      }
      do {
        if (top == 0) return;
        at = stack[--top];
      } while (at.tnear > best.t);
    }
  }

  HugeArray<Node> nodes_;
  LeafBlocks<> leaves_;
};

}  // namespace raybench
