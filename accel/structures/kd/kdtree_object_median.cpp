// kdtree_object_median: a kd-tree whose planes halve what cells hold.
//
// The idea: the plane lies at the median of the primitives' centres (Bentley 1975, for points), so that the
// tree is balanced, about log2 N deep; what straddles the plane stands on both sides. That makes the
// expected cost of finding a point least, but not that of a ray: large empty cells are never cut off. It is
// here as the reference that SAH is measured against (Havran 2000, 4.4).
// Layout and traversal: accel/kd/tree.h. Recursion and bounds of its size: accel/kd/build.h.
//
// An axis on which the median would cut every primitive is passed over for the next one. Invariants: as those
// of kdtree_sah.
#include "accel/kd/structure.h"

namespace raybench {
namespace {

class KdTreeObjectMedian : public KdMedianStructure {
 public:
  static constexpr const char* kName = "kdtree_object_median";
  static constexpr const char* kDoc =
      "kd-tree, primitives halved at the median of their centres, four-wide leaves";
  static constexpr const char* kSource =
      "Bentley 1975: Multidimensional binary search trees used for associative searching";
  KdTreeObjectMedian(const rb_geometry& geometry, const rb_build_options& options, const Config& config)
      : KdMedianStructure(geometry, options, config, KdMethod::kObjectMedian) {}
};

}  // namespace

RAYBENCH_STRUCTURE(kdtree_object_median, KdTreeObjectMedian)

}  // namespace raybench
