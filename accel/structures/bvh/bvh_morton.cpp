// bvh_morton: a linear bounding volume hierarchy (LBVH), for the fastest build: accel/bvh/linear.h. Layout and
// traversal: accel/bvh/bvh2.h.
//
// Invariants: every primitive stands in exactly one leaf, whose bounds enclose it; 63 levels at most split by
// codes, below them 32 halve; sorting is stable, so the tree is the same at any thread count.
#include "accel/bvh/linear.h"
#include "accel/bvh/structure.h"

namespace raybench {
namespace {

class BvhMorton : public BvhStructure {
 public:
  struct Config {
    BvhConfig bvh;
  };
  static constexpr const char* kName = "bvh_morton";
  static constexpr const char* kDoc = "binary BVH along a space-filling curve (LBVH), the fastest to build";
  static constexpr const char* kSource = "Lauterbach et al. 2009: Fast BVH construction on GPUs";
  static constexpr Kind kKind = {"BVH", "O(N)", "SIMD leaves"};
  static std::span<const rb_param> Params() {
    static const rb_param params[] = {kBvhNumerics, BvhLeafSize(16), kBvhTraversalCost, kBvhReinsertion};
    return params;
  }

  BvhMorton(const rb_geometry& geometry, const rb_build_options& options, const Config& config)
      : BvhStructure(geometry, options, config.bvh, LinearPeakBytes(PrimCount(geometry)), [&] {
          return BuildLinear(geometry, config.bvh.Costs(), config.bvh.Padded(), options.cancel);
        }) {}
};

}  // namespace

RAYBENCH_STRUCTURE(bvh_morton, BvhMorton)

}  // namespace raybench
