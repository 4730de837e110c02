// bvh_sweep: a binary bounding volume hierarchy by the surface area heuristic, every plane looked at.
//
// The idea: where bvh_sah estimates the cost at a few planes between bins, look at all n-1 cuts:
// accel/bvh/sweep_sah.h. Layout and traversal: accel/bvh/bvh2.h.
//
// Invariants: every primitive stands in exactly one leaf, whose bounds enclose it; centres are ordered
// together with ids, so the tree is the same at any thread count; of equal costs the most even cut is taken,
// so coincident primitives make a balanced tree.
#include "accel/bvh/structure.h"
#include "accel/bvh/sweep_sah.h"

namespace raybench {
namespace {

class BvhSweep : public BvhStructure {
 public:
  struct Config {
    BvhConfig bvh;
  };
  static constexpr const char* kName = "bvh_sweep";
  static constexpr const char* kDoc = "binary BVH, full sweep SAH builder, sorted once";
  static constexpr const char* kSource =
      "Wald, Boulos, Shirley 2007: Ray tracing deformable scenes using dynamic bounding volume hierarchies";
  static std::span<const rb_param> Params() {
    static const rb_param params[] = {kBvhNumerics, BvhLeafSize(16), kBvhTraversalCost, kBvhReinsertion};
    return params;
  }

  BvhSweep(const rb_geometry& geometry, const rb_build_options& options, const Config& config)
      : BvhStructure(geometry, options, config.bvh, SweepSahPeakBytes(PrimCount(geometry)), [&] {
          return BuildSweepSah(geometry, config.bvh.Costs(), config.bvh.Padded(), options.cancel);
        }) {}
};

}  // namespace

RAYBENCH_STRUCTURE(bvh_sweep, BvhSweep)

}  // namespace raybench
