// bvh_wide: a bounding volume hierarchy whose nodes have 4, 8 or 16 children, tested at once.
//
// The idea: a ray that looks at many boxes by one instruction goes down fewer levels, and waits for memory less
// often (Wald, Benthin, Boulos 2008; Ernst and Greiner 2008; Dammertz, Hanika, Keller 2008). A binary tree by any of
// four builders is made wide by dynamic programming over the SAH (Ylitie, Karras, Laine 2017): accel/bvh/wide/
// collapse.h. Layout and traversal: accel/bvh/wide/wide_bvh.h. What was tried, with its ratio: accel/bvh/wide/LOG.md.
//
// Invariants: every primitive stands in a leaf (with `spatial`, leaves together cover it), whose bounds enclose it;
// answers are those of `brute`; the same tree at any thread count.
#include <algorithm>
#include <cstddef>
#include <memory>
#include <stdexcept>
#include <string>

#include "accel/base/parallel.h"
#include "accel/bvh/binned_sah.h"
#include "accel/bvh/linear.h"
#include "accel/bvh/reinsertion.h"
#include "accel/bvh/spatial_sah.h"
#include "accel/bvh/sweep_sah.h"
#include "accel/bvh/wide/wide_bvh.h"
#include "accel/ray/triangle.h"

namespace raybench {
namespace {

constexpr const char* kWidths[] = {"4", "8", "16", nullptr};

enum class Builder : uint32_t { kBinned, kSweep, kSpatial, kMorton };
constexpr const char* kBuilders[] = {"binned", "sweep", "spatial", "morton", nullptr};

class BvhWide {
 public:
  struct Config {
    uint32_t numerics, width, nodes, leaves, builder, batch;
    int64_t bins, leaf_size, reinsertion;
    double split_budget, traversal_cost;
  };
  static constexpr Kind kKind = {"BVH", "O(N log N)", "SIMD nodes and leaves"};
  static constexpr uint64_t kCapabilities =
      RB_CAN_COUNT | RB_CAN_PROCEDURAL | RB_CAN_AFTER | RB_CAN_SKIP | RB_NATIVE_BATCH | RB_DETERMINISTIC;
  static constexpr const char* kName = "bvh_wide";
  static constexpr const char* kDoc = "BVH with 4, 8 or 16 children a node, traced by SIMD";
  static constexpr const char* kSource =
      "Wald, Benthin, Boulos 2008: Getting rid of packets; Ylitie, Karras, Laine 2017: Efficient incoherent "
      "ray "
      "traversal on GPUs through compressed wide BVHs";
  static std::span<const rb_param> Params() {
    static const rb_param params[] = {
        NumericsParam(offsetof(Config, numerics)),
        ChoiceParam("width", "children of a node", offsetof(Config, width), kWidths, 2),
        ChoiceParam(
            "nodes",
            "boxes in nodes: full (floats), quantized16 or quantized8 (integers of so many bits on a grid, "
            "rounded outward: less memory, the same answers)",
            offsetof(Config, nodes), kNodeFormats, uint32_t(NodeFormat::kFull)),
        ChoiceParam(
            "leaves",
            "triangles in leaves: copied, indexed (ids alone, vertices read from the scene: the same "
            "answers), quantized16 or quantized8 (vertices moved to a grid of the leaf, offsets of so many "
            "bits: less memory, claims nothing, cracks), snapped16 or snapped8 (one step for all leaves: "
            "no cracks, but the largest triangles decide the step)",
            offsetof(Config, leaves), kLeafForms, uint32_t(Leaves::kCopied), RB_PARAM_APPROXIMATE),
        ChoiceParam("builder",
                    "of the binary tree: binned (SAH between bins), sweep (SAH at every plane), spatial "
                    "(SAH, may cut "
                    "primitives in two), morton (space-filling curve, fast)",
                    offsetof(Config, builder), kBuilders, uint32_t(Builder::kBinned)),
        IntParam("bins", "bins per axis of binned and spatial", offsetof(Config, bins), 2, 64, 32),
        FloatParam("split_budget", "most duplicate references of spatial, as a share of the primitives",
                   offsetof(Config, split_budget), 0, 10, 1),
        IntParam("leaf_size", "most primitives in a leaf; with width 4 no more than 4",
                 offsetof(Config, leaf_size), 1, 8, 8),
        FloatParam("traversal_cost", "cost of a node in units of one leaf", offsetof(Config, traversal_cost),
                   0, 100, 1),
        IntParam("reinsertion", "passes that move subtrees to where they cost less",
                 offsetof(Config, reinsertion), 0, 100, 0),
        ChoiceParam("batch",
                    "native batches: rays of a call that a thread traces at a time, with numerics=watertight "
                    "and leaves=copied on triangles (else singly): single, interleaved (16 in flight, which "
                    "hides memory "
                    "latency), packet (consecutive ones of like directions together, the others interleaved)",
                    offsetof(Config, batch), kBatches, uint32_t(Batch::kSingle), RB_PARAM_SPEED_ONLY)};
    return params;
  }

  BvhWide(const rb_geometry& geometry, const rb_build_options& options, const Config& config)
      : numerics_(config.numerics), claim_(ClaimOf(config.numerics, geometry)) {
    const Leaves leaves{config.leaves};
    if (IsQuantized(leaves)) {
      RequireQuantizable(geometry, config);
      claim_ = RB_CLAIM_INEXACT;
    }
    if (PrimCount(geometry) == 0) return;
    const uint32_t width = 4u << config.width;
    RequireWithinLimit(PeakBytes(config, PrimCount(geometry), width), options);
    const uint32_t leaf_size = std::min(uint32_t(config.leaf_size), WideBvh::LeafLanes(width));
    SahCosts costs{leaf_size, leaf_size, 1.5f};
    Arena arena(options.threads);
    arena.Run([&] {
      BinaryTree binary = Build(geometry, options, config, costs);
      if (config.reinsertion > 0)
        binary = Reinsert(std::move(binary), uint32_t(config.reinsertion), costs, options.cancel);
      costs.traversal = float(config.traversal_cost);
      const WideTopology topology = Collapse(binary, width, costs);
      GridSteps steps;
      if (IsQuantized(leaves)) steps = ChooseGrids(geometry, topology, leaves, binary);
      tree_ = MakeWideBvh(geometry, binary, topology,
                          {width, NodeFormat(config.nodes), Batch(config.batch),
                           (options.needs & RB_NEED_UV) != 0, leaves, steps});
    });
    // Leaves that are not full take more than was estimated.
    RequireWithinLimit(Memory().nodes + Memory().prims, options);
  }

  template <class Counter>
  void Query(const rb_query& query) const {
    if (tree_ != nullptr) return tree_->Query(numerics_, query, Counter::kCounts);
    ForEachRay<Counter>(query, [](auto, const RayQuery&, rb_hit&, Counter&) {});
  }
  uint32_t Claims() const { return claim_; }
  MemoryUse Memory() const { return tree_ != nullptr ? tree_->Memory() : MemoryUse{}; }
  template <class Fn>
  int Visit(Fn&& node) const {
    return tree_ != nullptr ? tree_->Visit(node) : 0;
  }

 private:
  static void RequireQuantizable(const rb_geometry& geometry, const Config& config) {
    const std::string form = std::string("leaves=") + kLeafForms[config.leaves];
    if (geometry.procedural_count > 0)
      throw std::runtime_error(form + ": holds triangles alone, and the scene has " +
                               std::to_string(geometry.procedural_count) +
                               " procedural primitives; allowed: copied, indexed");
    if (Builder(config.builder) == Builder::kSpatial)
      throw std::runtime_error(form +
                               ": leaves of builder=spatial enclose parts of triangles, and moved vertices "
                               "leave them; allowed: binned, sweep, morton");
  }

  static BinaryTree Build(const rb_geometry& geometry, const rb_build_options& options, const Config& config,
                          const SahCosts& costs) {
    const bool padded = IsConservative(config.numerics);
    switch (Builder(config.builder)) {
      case Builder::kSweep:
        return BuildSweepSah(geometry, costs, padded, options.cancel);
      case Builder::kSpatial:
        return BuildSpatialSah(geometry, {uint32_t(config.bins), config.split_budget, costs, padded},
                               options.cancel);
      case Builder::kMorton:
        return BuildLinear(geometry, costs, padded, options.cancel);
      default:
        return BuildBinnedSah(geometry, {uint32_t(config.bins), costs, padded}, options.cancel);
    }
  }

  static uint64_t PeakBytes(const Config& config, uint64_t prims, uint32_t width) {
    uint64_t binary = 0, entries = prims;
    switch (Builder(config.builder)) {
      case Builder::kSweep:
        binary = SweepSahPeakBytes(prims);
        break;
      case Builder::kSpatial:
        binary = SpatialSahPeakBytes(prims, config.split_budget);
        entries = SpatialSahCapacity(prims, config.split_budget);
        break;
      case Builder::kMorton:
        binary = LinearPeakBytes(prims);
        break;
      default:
        binary = BinnedSahPeakBytes(prims);
    }
    return std::max({binary, config.reinsertion > 0 ? ReinsertionPeakBytes(entries) : uint64_t{0},
                     CollapsePeakBytes(entries, width)});
  }

  uint32_t numerics_, claim_;
  std::unique_ptr<WideBvh> tree_;
};

}  // namespace

RAYBENCH_STRUCTURE(bvh_wide, BvhWide)

}  // namespace raybench
