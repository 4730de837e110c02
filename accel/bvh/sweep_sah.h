// SAH builder for binary BVHs that looks at every plane.
//
// Sweep over the primitives in the order of their centres, on all three axes, and find the least cost of all
// n-1 ways to cut each order in two (MacDonald and Booth 1990). Sorting at every node makes that O(N log^2
// N); sorting once and splitting all three orders without disturbing them makes it O(N log N) (Wald and
// Havran 2006 for kd-trees; Wald, Boulos, Shirley 2007 for BVHs).
#pragma once

#include "accel/bvh/binary_tree.h"

namespace raybench {

/// `padded`: enclose PaddedPrimBounds, else PrimBounds. Runs inside the caller's task arena. Throws
/// std::runtime_error when cancelled. At least one primitive.
BinaryTree BuildSweepSah(const rb_geometry& geometry, const SahCosts& costs, bool padded,
                         const volatile int* cancel);

/// Bytes that building takes at its peak, the result included.
uint64_t SweepSahPeakBytes(uint64_t prims);

}  // namespace raybench
