// kdtree_spatial_median: a kd-tree whose planes halve their cells.
//
// The idea: space is cut in the middle, whatever it holds (Kaplan 1985, who takes the axes in turn; here also
// across the cell's largest extent), so cells are as if of an octree of which each level is made in three
// steps. No plane is searched for: building is quick, and takes no notice of where the primitives are, but
// for ending where few are left. Empty space is cut off only as the halves happen to fall. Layout and
// traversal: accel/kd/tree.h. Recursion and bounds of its size: accel/kd/build.h.
//
// An axis on which the middle would cut every primitive is passed over for the next one. Invariants: as those
// of kdtree_sah.
#include "accel/kd/structure.h"

namespace raybench {
namespace {

class KdTreeSpatialMedian : public KdMedianStructure {
 public:
  static constexpr const char* kName = "kdtree_spatial_median";
  static constexpr const char* kDoc = "kd-tree, cells halved in space, four-wide leaves";
  static constexpr const char* kSource = "Kaplan 1985: Space-tracing, a constant time ray-tracer";
  KdTreeSpatialMedian(const rb_geometry& geometry, const rb_build_options& options, const Config& config)
      : KdMedianStructure(geometry, options, config, KdMethod::kSpatialMedian) {}
};

}  // namespace

RAYBENCH_STRUCTURE(kdtree_spatial_median, KdTreeSpatialMedian)

}  // namespace raybench
