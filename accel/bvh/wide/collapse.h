// From a binary tree to a wide one.
//
// Which binary nodes become nodes, which leaves: by dynamic programming over the SAH (Ylitie, Karras, Laine
// 2017, "Efficient incoherent ray traversal on GPUs through compressed wide BVHs"). The least cost C(n, i) of
// the subtree of n as a forest of at most i trees is
//   C(n, 1) = min(leaf: blocks(n) area(n),  node: traversal area(n) + D(n, width))
//   C(n, i) = min(C(n, i - 1), D(n, i)),  D(n, i) = min over k of C(left, k) + C(right, i - k).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "accel/bvh/binary_tree.h"

namespace raybench {

/// The wide tree's shape, nodes in depth-first order.
struct WideTopology {
  struct Child {
    uint32_t slot;   ///< of the binary tree: its bounds
    uint32_t first;  ///< leaf: first entry of `order`; inner: the node's number
    uint32_t count;  ///< leaf: primitives; inner: 0
  };
  std::vector<Child> children;  ///< of all nodes, one after the other
  std::vector<uint32_t> begin;  ///< node -> its first child; one more entry at the end

  std::span<const Child> ChildrenOf(uint32_t node) const {
    return std::span(children).subspan(begin[node], begin[node + 1] - begin[node]);
  }
  uint32_t nodes() const { return uint32_t(begin.size()) - 1; }
};

/// `costs.leaf_size`: most primitives of a leaf. Children are in the order of falling area, leaves first.
/// A tree that is one leaf has no
/// node and that one child. Runs inside the caller's task arena.
WideTopology Collapse(const BinaryTree& tree, uint32_t width, const SahCosts& costs);

/// Bytes that it takes at its peak, with the binary tree over so many entries.
uint64_t CollapsePeakBytes(uint64_t entries, uint32_t width);

}  // namespace raybench
