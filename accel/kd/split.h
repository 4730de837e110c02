// What kd-tree builders decide about one cell: what a plane costs, and what of a primitive lies on either
// side of it.
#pragma once

#include <array>
#include <cstdint>
#include <limits>

#include "accel/base/vec3.h"
#include "accel/contract/raybench.h"

namespace raybench {

/// A primitive in a cell: the box around its part there, padding included.
struct KdRef {
  Bounds3 box;
  uint32_t prim;
};

/// A plane that splits a cell. Primitives that end in it stay on their side; those that lie in it go left or
/// right, whichever is cheaper.
struct KdPlane {
  float cost = std::numeric_limits<float>::infinity();  ///< times the cell's half area
  int axis = -1;
  float pos = 0;
  bool planar_left = true;

  /// The cheaper one; of equal ones, the first.
  void Take(const KdPlane& p) {
    if (p.cost < cost) *this = p;
  }
  bool GoesLeft(const KdRef& r) const { return r.box.lo[axis] < pos || (InPlane(r) && planar_left); }
  bool GoesRight(const KdRef& r) const { return r.box.hi[axis] > pos || (InPlane(r) && !planar_left); }

 private:
  bool InPlane(const KdRef& r) const { return r.box.lo[axis] == pos && r.box.hi[axis] == pos; }
};

/// The surface area heuristic (MacDonald and Booth 1990) with a bonus for cutting off empty space (Hurley,
/// Kapustin, Reshetov, Soupikov 2002).
struct KdCosts {
  float traversal = 1;     ///< of an inner node
  float intersection = 1;  ///< of a block of primitives in a leaf
  float empty_bonus = 0;   ///< share of the cost that is forgiven when one side is empty, 0..1
  uint32_t block = 4;      ///< primitives that a leaf tests for the price of one

  float Blocks(uint32_t n) const { return float((n + block - 1) / block); }
};

/// The cost of planes across one axis of one cell.
class KdAxisCost {
 public:
  KdAxisCost(const KdCosts& costs, const Bounds3& cell, int axis)
      : costs_(costs), axis_(axis), lo_(cell.lo[axis]), hi_(cell.hi[axis]) {
    const Vec3f e = cell.Extent();
    const float b = e[(axis + 1) % 3], c = e[(axis + 2) % 3];
    cap_ = b * c, side_ = b + c;
    traversal_ = costs.traversal * cell.HalfArea();
  }

  /// Whether the plane has space on both of its sides.
  bool Splits(float pos) const { return lo_ < pos && pos < hi_; }

  KdPlane operator()(float pos, uint32_t left, uint32_t right, bool planar_left = true) const {
    const float areas = (cap_ + side_ * (pos - lo_)) * costs_.Blocks(left) +
                        (cap_ + side_ * (hi_ - pos)) * costs_.Blocks(right);
    const float forgiven = left == 0 || right == 0 ? 1 - costs_.empty_bonus : 1;
    return {forgiven * (traversal_ + costs_.intersection * areas), axis_, pos, planar_left};
  }

 private:
  KdCosts costs_;
  int axis_;
  float lo_, hi_, cap_, side_, traversal_;
};

/// Cost of a cell as a leaf, times its half area.
inline float KdLeafCost(const KdCosts& costs, const Bounds3& cell, uint32_t n) {
  return costs.intersection * costs.Blocks(n) * cell.HalfArea();
}

/// The part of `ref` on either side of the plane, in cells `left` and `right`; a box is empty where there is
/// nothing. With `clip` that of the triangle itself (Wald and Havran 2006, "perfect splits"), else that of
/// its box. `padded`: cells are enlarged by what PaddedBounds adds to the triangle, and so is the result.
struct KdParts {
  Bounds3 left, right;
};
KdParts SplitRef(const rb_geometry& geometry, const KdRef& ref, int axis, const Bounds3& left,
                 const Bounds3& right, bool clip, bool padded);

}  // namespace raybench
