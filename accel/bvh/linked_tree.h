// A binary tree whose nodes stand anywhere: what builders work on that do not go from the root down.
#pragma once

#include "accel/bvh/binary_tree.h"
#include "accel/bvh/build_records.h"

namespace raybench {

struct alignas(32) LinkedNode {
  float lo[3];
  uint32_t left;  ///< leaf: first entry of `order`
  float hi[3];
  uint32_t right;  ///< kLeaf: it is one

  static constexpr uint32_t kLeaf = 0xFFFFFFFFu;
  bool is_leaf() const { return right == kLeaf; }
  Box4 box() const { return {Float4{lo[0], lo[1], lo[2], 0}, Float4{hi[0], hi[1], hi[2], 0}}; }
  void SetBox(const Box4& b) {
    for (int a = 0; a < 3; ++a) lo[a] = b.lo[a], hi[a] = b.hi[a];
  }
};

struct LinkedTree {
  HugeArray<LinkedNode> nodes;
  HugeArray<uint32_t> counts;   ///< entries of `order` below each node
  HugeArray<uint32_t> order;    ///< primitive ids
  uint32_t root = 0, size = 0;  ///< `size`: nodes in use
  bool clipped = false;         ///< as BinaryTree
};

/// The same tree, its nodes numbered in depth-first order.
LinkedTree Link(BinaryTree&& tree);

/// Brings a tree into depth-first order and makes a leaf of what costs less as one. What stands deeper than
/// kDecideDepth is put in balance. Parallel.
BinaryTree Flatten(const LinkedTree& tree, const SahCosts& costs);

}  // namespace raybench
