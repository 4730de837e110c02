// Binned SAH builder for binary BVHs.
//
// Wald (2007), "On fast construction of SAH-based bounding volume hierarchies": primitives are sorted
// into bins by their centroid, on all three axes; of the planes between bins the one of least expected
// cost is taken:
//   cost = traversal + (area_l blocks_l + area_r blocks_r) / area,  in units of the test of one block of
//   primitives (SahCosts).
// Large ranges are binned and partitioned in parallel, subtrees run as tasks. Counting, minimum and maximum
// are exact, and what is done in parallel depends on the size of a range alone, so the tree is the same at
// any thread count.
#pragma once

#include "accel/bvh/binary_tree.h"
#include "accel/contract/raybench.h"

namespace raybench {

struct BinnedSahOptions {
  uint32_t bins = 16;  ///< per axis, 2..64
  SahCosts costs;
  bool padded = true;  ///< enclose PaddedPrimBounds (for conservative traversal), else PrimBounds
};

/// Runs inside the caller's task arena. Throws std::runtime_error when cancelled. At least one primitive.
BinaryTree BuildBinnedSah(const rb_geometry& geometry, const BinnedSahOptions& options,
                          const volatile int* cancel);

/// Bytes that building takes at its peak, the result included.
uint64_t BinnedSahPeakBytes(uint64_t prims);

}  // namespace raybench
