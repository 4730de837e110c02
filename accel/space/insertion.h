// Which cells of a space partition a primitive goes into; shared by grids, octree and quadtree.
//
// By bounds: into every cell that its box meets. By exact overlap: into those of them that the triangle
// itself meets, by the separating axis test of Akenine-Moeller (2001), "Fast 3D Triangle-Box Overlap
// Testing". Procedural primitives tell nothing but their bounds.
//
// Conservative insertion takes padded boxes (ray/bounds.h), and cells enlarged by the same padding: an
// accepted ray passes the triangle itself within 6 u |p-o| + 6 u E on each axis, by the same derivation as
// its box. What remains, 6 u |p-o|, is the traversal's.
#pragma once

#include "accel/base/huge_array.h"
#include "accel/base/vec3.h"
#include "accel/contract/raybench.h"
#include "accel/ray/bounds.h"

namespace raybench {

inline constexpr const char* kInsertionChoices[] = {"bounds", "exact", nullptr};
inline constexpr const char* kInsertionDoc =
    "what goes into a cell: bounds (primitives whose box meets it), exact (triangles that meet it)";
constexpr rb_param InsertionParam(size_t offset) {
  return ChoiceParam("insertion", kInsertionDoc, offset, kInsertionChoices, 0);
}

class Insertion {
 public:
  /// Computes all boxes, in the caller's task arena. `exact`: by overlap, else by bounds. `padded`: for
  /// conservative traversal. At least one primitive.
  Insertion(const rb_geometry& geometry, bool exact, bool padded);

  size_t size() const { return boxes_.size(); }
  const Bounds3& Box(uint32_t prim) const { return boxes_[prim]; }
  const Bounds3& Scene() const { return scene_; }  ///< around all boxes
  bool IsPadded() const { return padded_; }
  bool IsExact(uint32_t prim) const { return exact_ && prim < geometry_.triangle_count; }

  /// A length that covers the rounding, in double, of where cells begin: 2^-44 of the largest coordinate. 0
  /// if not padded.
  double slack() const { return padded_ ? rounding_ : 0; }

  /// Whether triangle `prim`, whose box meets the cell, meets it itself. Errs on the side of yes:
  /// a triangle in a wall is in both cells.
  bool TriangleMeets(uint32_t prim, Vec3d lo, Vec3d hi) const;

  uint64_t bytes() const { return boxes_.bytes(); }

 private:
  rb_geometry geometry_;
  bool exact_, padded_;
  HugeArray<Bounds3> boxes_;
  Bounds3 scene_;
  double rounding_ = 0;
};

}  // namespace raybench
