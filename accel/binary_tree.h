// What BVH builders produce and what traversals are laid out from: a binary tree over ranges of primitives.
#pragma once

#include <cstdint>

#include "accel/huge_array.h"
#include "accel/raybench.h"
#include "accel/vec3.h"

namespace raybench {

/// A builder's node. The left child of an inner node is the next slot, the right child is `right`.
struct BuildNode {
  float lo[3], hi[3];
  uint32_t right;  ///< slot of the right child; 0 for a leaf
  uint32_t first;  ///< leaf: first entry of `order`; the count follows in `count`
  uint32_t count;  ///< leaf: number of primitives, > 0; inner: 0
};

/// The root has slot 0. A subtree over n primitives owns 2n-1 slots from its root's on: its left child's
/// subtree, then its right child's. So slots are known without counting, whatever thread builds what, and
/// stand in depth-first order (with gaps where leaves hold several primitives).
struct BinaryTree {
  HugeArray<BuildNode> nodes;
  HugeArray<uint32_t> order;  ///< primitive ids, permuted
};

}  // namespace raybench
