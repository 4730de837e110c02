// What BVH builders produce and what traversals are laid out from: a binary tree over ranges of primitives.
#pragma once

#include <cstdint>

#include "accel/base/huge_array.h"
#include "accel/base/vec3.h"
#include "accel/contract/raybench.h"

namespace raybench {

/// Nodes of a tree stand on levels 0 .. kMaxTreeDepth - 1: the size of the traversal stack. Builders decide
/// freely above kDecideDepth; below it they halve what is left, which takes 32 levels at most.
inline constexpr uint32_t kMaxTreeDepth = 128;
inline constexpr uint32_t kDecideDepth = kMaxTreeDepth - 33;

/// What the surface area heuristic weighs, in units of the test of one block of primitives.
struct SahCosts {
  uint32_t leaf_size = 8;   ///< most primitives a leaf may hold, >= 1
  uint32_t block_size = 4;  ///< primitives that a leaf tests for the price of one
  float traversal = 1.5f;   ///< of an inner node

  float Blocks(size_t prims) const { return float((prims + block_size - 1) / block_size); }
  /// Whether an inner node over `prims` primitives costs less than a leaf. `below`: the cost of its children
  /// times their areas; `area`: its own.
  bool Pays(float below, size_t prims, float area) const {
    return below + traversal * area < Blocks(prims) * area;
  }
  /// Whether it certainly does not, whatever its children cost.
  bool NeverPays(size_t prims) const { return prims <= leaf_size && Blocks(prims) <= traversal; }
};

/// Deepest level at which SAH decides: deeper trees come from coincident primitives, and do not pay.
inline constexpr uint32_t kSahDepth = 40;

/// A builder's node. The left child of an inner node is the next slot, the right child is `right`.
struct BuildNode {
  float lo[3], hi[3];
  uint32_t right;  ///< slot of the right child; 0 for a leaf
  uint32_t first;  ///< leaf: first entry of `order`; the count follows in `count`
  uint32_t count;  ///< leaf: number of primitives, > 0; inner: 0
};

/// The root has slot 0. Nodes stand in depth-first order: a left child follows its parent, the right child's subtree the
/// left one's. There may be slots between subtrees that are not in use: then a subtree over n entries of `order` owns
/// 2n - 1 slots from its root's on, so that they are known without counting.
struct BinaryTree {
  HugeArray<BuildNode> nodes;
  HugeArray<uint32_t> order;  ///< primitive ids, permuted; with repeats if `clipped`
  bool clipped = false;       ///< leaves enclose parts of primitives, which together cover them
};

}  // namespace raybench
