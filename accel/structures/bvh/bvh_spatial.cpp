// bvh_spatial: a bounding volume hierarchy that may cut primitives in two (SBVH): accel/bvh/spatial_sah.h.
// Layout and traversal: accel/bvh/bvh2.h.
#include "accel/bvh/spatial_sah.h"
#include "accel/bvh/structure.h"

namespace raybench {
namespace {

class BvhSpatial : public BvhStructure {
 public:
  struct Config {
    BvhConfig bvh;
    int64_t bins;
    double split_budget;
  };
  static constexpr const char* kName = "bvh_spatial";
  static constexpr const char* kDoc = "binary BVH, SAH with spatial splits (SBVH)";
  static constexpr const char* kSource =
      "Stich, Friedrich, Dietrich 2009: Spatial splits in bounding volume hierarchies";
  static std::span<const rb_param> Params() {
    static const rb_param params[] = {
        kBvhNumerics,
        IntParam("bins", "bins and slices per axis", offsetof(Config, bins), 2, 64, 16),
        FloatParam("split_budget", "most duplicate references, as a share of the primitives",
                   offsetof(Config, split_budget), 0, 10, 1),
        BvhLeafSize(16),
        kBvhTraversalCost,
        kBvhReinsertion};
    return params;
  }

  BvhSpatial(const rb_geometry& geometry, const rb_build_options& options, const Config& config)
      : BvhStructure(geometry, options, config.bvh,
                     SpatialSahPeakBytes(PrimCount(geometry), config.split_budget), [&] {
                       return BuildSpatialSah(geometry,
                                              {uint32_t(config.bins), config.split_budget, config.bvh.Costs(),
                                               config.bvh.Padded()},
                                              options.cancel);
                     }) {}
};

}  // namespace

RAYBENCH_STRUCTURE(bvh_spatial, BvhSpatial)

}  // namespace raybench
