// bvh_sah: a binary bounding volume hierarchy by the surface area heuristic, binned.
//
// The idea: enclose groups of primitives in boxes, boxes in larger boxes, and skip what lies in a box that
// the ray misses (Kay and Kajiya 1986). How to group is decided greedily by the expected cost of tracing a
// random line (Goldsmith and Salmon 1987; MacDonald and Booth 1990), estimated at the planes between bins
// (Wald 2007): accel/bvh/binned_sah.h. Layout and traversal: accel/bvh/bvh2.h;
// what was tried: accel/bvh/LOG.md. Robustness: accel/ray/bounds.h
// and accel/ray/triangle.h.
//
// Invariants: every primitive stands in exactly one leaf, whose bounds enclose it; depth stays below the
// traversal stack's; the same tree at any thread count.
//
// Parameters: more bins find better planes and take longer; `reinsertion` improves the tree after it is
// built (accel/bvh/reinsertion.h).
#include "accel/bvh/binned_sah.h"
#include "accel/bvh/structure.h"

namespace raybench {
namespace {

class BvhSah : public BvhStructure {
 public:
  struct Config {
    BvhConfig bvh;
    int64_t bins;
  };
  static constexpr const char* kName = "bvh_sah";
  static constexpr const char* kDoc = "binary BVH, binned SAH builder, eight-wide leaves";
  static constexpr const char* kSource =
      "Wald 2007: On fast construction of SAH-based bounding volume hierarchies";
  static std::span<const rb_param> Params() {
    static const rb_param params[] = {kBvhNumerics,
                                      IntParam("bins", "bins per axis", offsetof(Config, bins), 2, 64, 16),
                                      BvhLeafSize(16), kBvhTraversalCost, kBvhReinsertion};
    return params;
  }

  BvhSah(const rb_geometry& geometry, const rb_build_options& options, const Config& config)
      : BvhStructure(geometry, options, config.bvh, BinnedSahPeakBytes(PrimCount(geometry)), [&] {
          return BuildBinnedSah(geometry, {uint32_t(config.bins), config.bvh.Costs(), config.bvh.Padded()},
                                options.cancel);
        }) {}
};

}  // namespace

RAYBENCH_STRUCTURE(bvh_sah, BvhSah)

}  // namespace raybench
