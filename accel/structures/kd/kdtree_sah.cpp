// kdtree_sah: a kd-tree by the surface area heuristic.
//
// The idea: split space, not objects (Bentley 1975; for rays Kaplan 1985): each node cuts its cell by a plane
// across an axis, and a ray walks the cells it passes in order, so that it may stop at the first hit. Where
// to cut is decided greedily by the expected cost of a random line (MacDonald and Booth 1990), among all
// planes that bound a primitive's part in the cell (Havran 2000), found by one sweep over sorted events in
// O(N log N) (Wald and Havran 2006), or among evenly spaced ones (Shevtsov, Soupikov, Kapustin 2007).
// Layout and traversal: accel/kd/tree.h. Builders: accel/kd/build.h, kd/events.h, kd/split.h.
//
// Invariants: the leaves of a primitive cover it, padding included; depth stays below the traversal stack's;
// leaves hold at most 1 + duplication references a primitive; the same tree at any thread count.
#include "accel/kd/structure.h"
#include "accel/ray/study.h"

namespace raybench {
namespace {

class KdTreeSah : public KdStructure {
 public:
  struct Config {
    uint32_t numerics, builder, axis, clip;
    double traversal_cost, empty_bonus, duplication;
    int64_t leaf_size, max_depth, bins;
    uint32_t triangle, planes, fma;
  };
  static constexpr const char* kName = "kdtree_sah";
  static constexpr const char* kDoc =
      "kd-tree, SAH over all planes in O(N log N), perfect splits, four-wide leaves";
  static constexpr const char* kSource =
      "Wald, Havran 2006: On building fast kd-trees for ray tracing, and on doing that in O(N log N)";
  static std::span<const rb_param> Params() {
    static const char* const builders[] = {"sweep", "binned", nullptr};
    static const char* const axes[] = {"cyclic", "largest", "best", nullptr};
    static const char* const rules[] = {"as_numerics", "textbook", "padded", nullptr};
    static const rb_param params[] = {
        NumericsParam(offsetof(Config, numerics)),
        ChoiceParam("builder",
                    "planes compared: all that bound a primitive (sweep), or evenly spaced ones (binned)",
                    offsetof(Config, builder), builders, 0),
        ChoiceParam("axis", "axis of the plane: in turn, of the cell's largest extent, or the best of all",
                    offsetof(Config, axis), axes, uint32_t(KdAxisRule::kBest)),
        BoolParam("clip", kKdClipDoc, offsetof(Config, clip), true),
        FloatParam("traversal_cost", "cost of a node in units of one leaf block of four primitives",
                   offsetof(Config, traversal_cost), 0, 100, 1.5),
        FloatParam("empty_bonus", "share of the cost forgiven to a plane that cuts off empty space",
                   offsetof(Config, empty_bonus), 0, 1, 0.1),
        IntParam("leaf_size", kKdLeafSizeDoc, offsetof(Config, leaf_size), 0, 1024, 1),
        IntParam("max_depth", kKdMaxDepthDoc, offsetof(Config, max_depth), 0, double(KdTree::kMaxDepth - 1),
                 0),
        IntParam("bins", "binned: planes compared on each axis", offsetof(Config, bins), 2,
                 double(kMaxKdBins), 32),
        FloatParam("duplication", kKdDuplicationDoc, offsetof(Config, duplication), 0, 100, 8),
        TriangleParam(offsetof(Config, triangle)),
        ChoiceParam(
            "planes",
            "distance to a splitting plane: with the slack of `numerics`, or over boxes without padding, "
            "claiming nothing: as computed (textbook), or padded by its own error",
            offsetof(Config, planes), rules, uint32_t(PlaneRule::kAsNumerics), RB_PARAM_APPROXIMATE),
        FmaParam(offsetof(Config, fma))};
    return params;
  }

  KdTreeSah(const rb_geometry& geometry, const rb_build_options& options, const Config& config)
      : KdStructure(geometry, options,
                    {.method = config.builder == 0 ? KdMethod::kSweep : KdMethod::kBinned,
                     .axis = KdAxisRule(config.axis),
                     .costs = {.traversal = float(config.traversal_cost),
                               .empty_bonus = float(config.empty_bonus),
                               .block = LeafBlocks<>::kLanes},
                     .bins = uint32_t(config.bins),
                     .leaf_size = uint32_t(config.leaf_size),
                     .max_depth = uint32_t(config.max_depth),
                     .duplication = config.duplication,
                     .clip = config.clip != 0,
                     .padded = PlaneRule(config.planes) == PlaneRule::kAsNumerics},
                    config.numerics),
        geometry_(geometry),
        numerics_(config.numerics),
        planes_{config.planes},
        study_(numerics_, config.triangle, config.fma != 0, planes_ != PlaneRule::kAsNumerics) {
    const MemoryUse use = KdStructure::Memory();
    study_.Precompute(geometry, tree().leaves(), use.nodes + use.prims, options);
  }

  template <class Counter>
  void Query(const rb_query& query) const {
    if (!study_.on()) return KdStructure::Query<Counter>(query);
    tree().QueryStudy<Counter>(study_, planes_, numerics_, query);
  }
  uint32_t Claims() const { return study_.on() ? study_.Claim(geometry_) : KdStructure::Claims(); }
  MemoryUse Memory() const {
    MemoryUse use = KdStructure::Memory();
    use.prims += study_.bytes();
    return use;
  }

 private:
  rb_geometry geometry_;
  uint32_t numerics_;
  PlaneRule planes_;
  Study study_;
};

}  // namespace

RAYBENCH_STRUCTURE(kdtree_sah, KdTreeSah)

}  // namespace raybench
