// Makes a built BVH better by moving subtrees: Bittner, Hapala, Havran (2013), "Fast insertion-based
// optimization of bounding volume hierarchies", in the parallel form of Meister and Bittner (2018), "Parallel
// reinsertion for bounding volume hierarchy optimization".
//
// A pass asks for every node, with the tree as it stands and in parallel: if this subtree were taken out, its
// parent removed with it, where could it go in so that the sum of the areas of all inner nodes shrinks most?
// A branch-and-bound search goes up from the node to the root and from each ancestor down the other side.
// Then moves are carried out, best first, unless an earlier one of the pass changed a node that they change,
// or would make a circle; then boxes are computed anew. Nothing depends on the order in which threads finish.
#pragma once

#include <cstdint>

#include "accel/bvh/binary_tree.h"

namespace raybench {

/// Runs inside the caller's task arena; ends early when a pass moves nothing. Throws std::runtime_error
/// when cancelled.
BinaryTree Reinsert(BinaryTree&& tree, uint32_t passes, const SahCosts& costs, const volatile int* cancel);

/// Bytes that it takes at its peak, tree and result included, at most.
uint64_t ReinsertionPeakBytes(uint64_t prims);

}  // namespace raybench
