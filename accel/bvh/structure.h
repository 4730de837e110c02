// What structures that are a Bvh2 share: parameters, limits, answers. A structure adds its builder and the
// parameters of that.
#pragma once

#include <algorithm>
#include <cstddef>
#include <stdexcept>
#include <utility>

#include "accel/base/parallel.h"
#include "accel/bvh/bvh2.h"
#include "accel/bvh/reinsertion.h"

namespace raybench {

/// First member of the Config of such a structure.
struct BvhConfig {
  int64_t leaf_size, reinsertion;
  double traversal_cost;
  uint32_t numerics;

  /// Smaller leaves than a block do not fill it.
  SahCosts Costs() const {
    return {uint32_t(leaf_size), uint32_t(std::min<int64_t>(leaf_size, 8)), float(traversal_cost)};
  }
  bool Padded() const { return IsConservative(numerics); }
};

// Their descriptions, for Params(); BvhConfig stands at offset 0.
inline constexpr rb_param kBvhNumerics = NumericsParam(offsetof(BvhConfig, numerics));
constexpr rb_param BvhLeafSize(double by_default) {
  return IntParam("leaf_size", "most primitives in a leaf", offsetof(BvhConfig, leaf_size), 1,
                  double(Bvh2::kMaxLeaf), by_default);
}
inline constexpr rb_param kBvhTraversalCost =
    FloatParam("traversal_cost", "cost of a node in units of one leaf block of eight primitives",
               offsetof(BvhConfig, traversal_cost), 0, 100, 1.5);
inline constexpr rb_param kBvhReinsertion =
    IntParam("reinsertion", "passes that move subtrees to where they cost less",
             offsetof(BvhConfig, reinsertion), 0, 100, 0);

class BvhStructure {
 public:
  static constexpr Kind kKind = {"BVH", "O(N log N)", "SIMD leaves"};
  static constexpr uint64_t kCapabilities =
      RB_CAN_COUNT | RB_CAN_PROCEDURAL | RB_CAN_AFTER | RB_CAN_SKIP | RB_DETERMINISTIC;

  template <class Counter>
  void Query(const rb_query& query) const {
    bvh_.Query<Counter>(numerics_, query);
  }
  uint32_t Claims() const { return claim_; }
  MemoryUse Memory() const { return bvh_.Memory(); }
  template <class Fn>
  int Visit(Fn&& node) const {
    return bvh_.Visit(node);
  }

 protected:
  /// build() returns the BinaryTree over at least one primitive; it is called inside an arena of
  /// options.threads and takes `peak_bytes`, its result included.
  template <class Build>
  BvhStructure(const rb_geometry& geometry, const rb_build_options& options, const BvhConfig& config,
               uint64_t peak_bytes, Build&& build)
      : numerics_(config.numerics), claim_(ClaimOf(config.numerics, geometry)) {
    const uint64_t prims = PrimCount(geometry);
    if (prims == 0) return;
    RequireWithinLimit(
        std::max(peak_bytes, config.reinsertion > 0 ? ReinsertionPeakBytes(prims) : uint64_t{0}), options);
    Arena arena(options.threads);
    arena.Run([&] {
      BinaryTree tree = build();
      if (config.reinsertion > 0)
        tree = Reinsert(std::move(tree), uint32_t(config.reinsertion), config.Costs(), options.cancel);
      bvh_ = Bvh2(geometry, tree);
    });
    // Leaves of fewer primitives than a block has lanes take more than was estimated.
    RequireWithinLimit(Memory().nodes + Memory().prims, options);
  }
  const Bvh2& bvh() const { return bvh_; }
  void StandIn(uint32_t depth) { bvh_.StandIn(depth); }

 private:
  uint32_t numerics_, claim_;
  Bvh2 bvh_;
};

}  // namespace raybench
