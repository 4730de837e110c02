// Builders of kd-trees: one recursion, and four ways to choose the plane that splits a cell.
//
//   sweep           the cheapest plane by SAH of all that bound a primitive, in O(N log N) (kd/events.h)
//   binned          the cheapest of evenly spaced ones (Shevtsov, Soupikov, Kapustin 2007: two bins a primitive,
//                   by where it starts and where it ends); small cells are swept
//   spatial median  the middle of the cell (Kaplan 1985)
//   object median   the median of the primitives' centres
//
// A cell becomes a leaf when it holds few primitives, when no plane pays, at the greatest depth, or when its
// share of the allowed duplicates is used up: each split takes those it makes from the cell's share, and what
// remains is shared among the children in proportion to their primitives. So the tree's size is bounded
// whatever the scene, and does not depend on the order in which subtrees are built.
#pragma once

#include <cstdint>

#include "accel/kd/split.h"
#include "accel/kd/tree.h"

namespace raybench {

enum class KdMethod : uint32_t { kSweep, kBinned, kSpatialMedian, kObjectMedian };
/// Which axis is tried first; the others follow if it has no plane that will do. kBest: SAH compares all.
enum class KdAxisRule : uint32_t { kCyclic, kLargest, kBest };

struct KdOptions {
  KdMethod method = KdMethod::kSweep;
  KdAxisRule axis = KdAxisRule::kBest;
  KdCosts costs = {};
  uint32_t bins = 32;      ///< binned: planes an axis, 2..kMaxKdBins
  uint32_t leaf_size = 1;  ///< cells with no more primitives are not split, >= 0
  uint32_t max_depth = 0;  ///< of the deepest leaf; 0: 8 + 1.3 log2 of the primitives (Havran 2000)
  double duplication = 8;  ///< leaves hold this many references a primitive more than one, at most
  bool clip = true;        ///< what lies on a side is decided by the triangle, not by its box
  bool padded = true;      ///< enclose PaddedPrimBounds (for conservative traversal), else PrimBounds
};

inline constexpr uint32_t kMaxKdBins = 256;

/// Deepest leaf for n primitives where the options name none.
uint32_t DefaultKdDepth(uint64_t n);

/// Builds inside the caller's task arena; the same tree at any number of threads. Throws std::runtime_error
/// when cancelled, over the memory limit, or when there are 2^30 primitives or more.
KdTree BuildKdTree(const rb_geometry& geometry, const KdOptions& options, uint64_t memory_limit,
                   const volatile int* cancel);

}  // namespace raybench
