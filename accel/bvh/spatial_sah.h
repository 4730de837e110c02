// SAH builder for binary BVHs that may cut primitives in two (SBVH).
//
// The idea: where large or slanted primitives overlap, no grouping of whole boxes is good. Allow, beside the
// object split, a spatial split: a plane cuts the node's box, primitives on both sides are referenced by
// both, each with the box of its own part alone (Stich, Friedrich, Dietrich 2009; Popov et al. 2009). SAH
// decides between the two. Spatial splits are looked for where the halves of the object split overlap by more
// than 1e-5 of the scene's area; a reference that would cost less on one side only is not cut
// ("unsplitting").
//
// References stand in one array with room for the duplicates that `split_budget` allows. A node owns a
// segment of it, and hands the room that is left on to its children by their number of references; so the
// tree is the same at any thread count.
//
// Robustness. The test accepts rays that pass close to a point q of a triangle (ray/bounds.h). q lies in one of the
// parts, so each part's box is padded as much as the whole triangle's, after rounding outward; then that part's
// leaf is visited, and nothing is lost. Traversal widens the intervals of parts at both ends (ray/bounds.h). A ray
// that all but lies in the triangle's plane may get a t further off than that: then another hit may come first that
// brute force finds to lie behind it, and under
// `watertight` ids may differ from those of other structures, within the test's own error; under `double` and
// `exact`, whose t is right, they do not.
//
// Invariants: the leaves that reference a primitive cover it together; no leaf references one twice;
// references number at most (1 + split_budget) times the primitives; depth stays below the traversal stack's.
#pragma once

#include "accel/bvh/binary_tree.h"

namespace raybench {

struct SpatialSahOptions {
  uint32_t bins = 16;  ///< and slices, per axis, 2..64
  double budget = 1;   ///< most duplicate references, as a share of the primitives
  SahCosts costs;
  bool padded = true;  ///< enclose what conservative traversal must find
};

/// References that a tree may have at most.
inline uint64_t SpatialSahCapacity(uint64_t prims, double budget) {
  return prims + uint64_t(double(prims) * budget);
}

/// Runs inside the caller's task arena. Throws std::runtime_error when cancelled. At least one primitive.
BinaryTree BuildSpatialSah(const rb_geometry& geometry, const SpatialSahOptions& options,
                           const volatile int* cancel);

/// Bytes that building takes at its peak, the result included.
uint64_t SpatialSahPeakBytes(uint64_t prims, double budget);

}  // namespace raybench
