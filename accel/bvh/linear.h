// Linear builder for binary BVHs (LBVH), the fastest.
//
// Sort the primitives along Morton's space-filling curve and cut the order where its codes' highest bits
// change (Lauterbach et al. 2009). That halves space again and again, as an octree does, and asks for no cost
// at all: building is sorting. Karras (2012) finds all nodes at once from the sorted codes, for GPUs; on a few
// cores going down from the root gives the same tree and meets each node's codes in cache. Centres in the same
// cell are halved by id. Boxes come on the way up; there a subtree becomes one leaf where that costs less by
// SAH.
#pragma once

#include "accel/bvh/binary_tree.h"

namespace raybench {

/// `padded`: enclose PaddedPrimBounds, else PrimBounds. Runs inside the caller's task arena. Throws
/// std::runtime_error when cancelled. At least one primitive.
BinaryTree BuildLinear(const rb_geometry& geometry, const SahCosts& costs, bool padded,
                       const volatile int* cancel);

/// Bytes that building takes at its peak, the result included.
uint64_t LinearPeakBytes(uint64_t prims);

}  // namespace raybench
