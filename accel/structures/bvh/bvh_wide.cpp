// bvh_wide
#include <stdexcept>

#include "accel/bvh/binned_sah.h"
#include "accel/bvh/reinsertion.h"
#include "accel/bvh/structure.h"
#include "accel/bvh/wide/tree.h"

#ifndef WIDE_NAME
#define WIDE_NAME "bvh_wide"
#endif
#ifndef WIDE_WIDTH
#define WIDE_WIDTH 16
#endif

namespace raybench {
namespace {

class BvhWide {
 public:
  struct Config {
    int64_t leaf_size, binary_leaf, reinsertion, bins;
    double traversal_cost;
    uint32_t numerics;
  };
  static constexpr Kind kKind = {"BVH", "O(N log N)", "SIMD leaves"};
  static constexpr uint64_t kCapabilities =
      RB_CAN_COUNT | RB_CAN_PROCEDURAL | RB_CAN_AFTER | RB_CAN_SKIP | RB_DETERMINISTIC;
  static constexpr const char* kName = WIDE_NAME;
  static constexpr const char* kDoc = "wide BVH";
  static constexpr const char* kSource = "Wald, Benthin, Boulos 2008: Getting rid of packets - efficient SIMD single-ray traversal using multi-branching BVHs";
  static std::span<const rb_param> Params() {
    static const rb_param params[] = {
        NumericsParam(offsetof(Config, numerics)),
        IntParam("bins", "bins per axis", offsetof(Config, bins), 2, 64, 32),
        IntParam("leaf_size", "most primitives in a leaf", offsetof(Config, leaf_size), 1, 8, 8),
        IntParam("binary_leaf", "x", offsetof(Config, binary_leaf), 1, 8, 8),
        IntParam("reinsertion", "x", offsetof(Config, reinsertion), 0, 16, 0),
        FloatParam("traversal_cost", "cost of a node in units of one leaf block", offsetof(Config, traversal_cost), 0,
                   100, 1.0)};
    return params;
  }

  BvhWide(const rb_geometry& geometry, const rb_build_options& options, const Config& config)
      : numerics_(config.numerics), claim_(ClaimOf(config.numerics, geometry)) {
    if (PrimCount(geometry) == 0) return;
    const uint64_t prims = PrimCount(geometry);
    RequireWithinLimit(std::max(BinnedSahPeakBytes(prims), config.reinsertion > 0 ? ReinsertionPeakBytes(prims) : 0) +
                           32 * prims,
                       options);
    Arena arena(options.threads);
    arena.Run([&] {
      SahCosts binary{uint32_t(config.binary_leaf), uint32_t(config.binary_leaf), 1.5f};
      BinaryTree tree = BuildBinnedSah(geometry, {uint32_t(config.bins), binary, IsConservative(config.numerics)},
                                       options.cancel);
      if (config.reinsertion > 0) tree = Reinsert(std::move(tree), uint32_t(config.reinsertion), binary, options.cancel);
      SahCosts costs{uint32_t(config.leaf_size), (WIDE_WIDTH < 8 ? WIDE_WIDTH : 8), float(config.traversal_cost)};
      tree_ = WideTree<WIDE_WIDTH>(geometry, tree, Collapse(tree, WIDE_WIDTH, costs));
    });
    RequireWithinLimit(Memory().nodes + Memory().prims, options);
  }
  template <class Counter>
  void Query(const rb_query& query) const {
    tree_.Query<Counter>(numerics_, query);
  }
  uint32_t Claims() const { return claim_; }
  MemoryUse Memory() const { return tree_.Memory(); }
  template <class Fn>
  int Visit(Fn&& node) const {
    return tree_.Visit(node);
  }

 private:
  uint32_t numerics_, claim_;
  WideTree<WIDE_WIDTH> tree_;
};

}  // namespace

#ifdef WIDE_PLUGIN
}
RAYBENCH_PLUGIN(raybench::BvhWide)
#else
RAYBENCH_STRUCTURE(bvh_wide, BvhWide)
}  // namespace raybench
#endif
