// kdop: a binary hierarchy of discrete oriented polytopes.
//
// The idea: a box is loose around what lies askew in it. Slabs in a few more fixed directions cut its corners
// or edges off (Kay and Kajiya 1986), so that fewer rays enter for nothing; each costs an interval more to
// test and to store. Which k pays depends on the scene: that is what the parameter is there to measure. k = 6
// is a box, by the same traversal, to compare with.
//
// Node, depth-first order: k/2 lower and upper ends (padded to whole vectors), right child or leaf block,
// count. Topology: binned SAH over boxes (binned_sah.h). Traversal: bound_tree.h. The slab test and why it
// loses no hit: bounds/kdop.h.
//
// Invariants: every primitive stands in exactly one leaf, whose polytope encloses it; the same tree at any
// thread count; depth stays below the traversal stack's.
#include "accel/bvh/bounds/kdop.h"

#include <variant>

#include "accel/bvh/bounds/binned_bound_tree.h"

namespace raybench {
namespace {

class Kdop {
 public:
  struct Config {
    uint32_t k, numerics;
    int64_t leaf_size;
  };
  static constexpr const char* kName = "kdop";
  static constexpr const char* kDoc = "binary hierarchy of k-DOPs: boxes with corners or edges cut off";
  static constexpr const char* kSource =
      "Kay, Kajiya 1986: Ray tracing complex scenes; Klosowski et al. 1998";
  static constexpr Kind kKind = {"other bounds", "O(N log N)", "SIMD leaves"};
  static constexpr uint64_t kCapabilities =
      RB_CAN_COUNT | RB_CAN_PROCEDURAL | RB_CAN_AFTER | RB_CAN_SKIP | RB_DETERMINISTIC;
  static std::span<const rb_param> Params() {
    static const char* const kChoices[] = {"6", "14", "18", "26", nullptr};
    static const rb_param params[] = {
        ChoiceParam("k", "planes of a bound: 6 is a box, 14 cuts its corners, 18 its edges, 26 both",
                    offsetof(Config, k), kChoices, 1),
        NumericsParam(offsetof(Config, numerics)),
        IntParam("leaf_size", "most primitives in a leaf", offsetof(Config, leaf_size), 1, 16, 8)};
    return params;
  }

  Kdop(const rb_geometry& geometry, const rb_build_options& options, const Config& config)
      : numerics_(config.numerics), claim_(ClaimOf(config.numerics, geometry)) {
    const auto build = [&]<int K>() {
      tree_ = BuildBinnedBoundTree<KdopBound<K>>(geometry, options, uint32_t(config.leaf_size),
                                                 IsConservative(config.numerics));
    };
    if (config.k == 0) build.operator()<6>();
    if (config.k == 1) build.operator()<14>();
    if (config.k == 2) build.operator()<18>();
    if (config.k == 3) build.operator()<26>();
  }

  template <class Counter>
  void Query(const rb_query& query) const {
    std::visit(
        [&](const auto& tree) {
          WithNumerics(numerics_, [&]<class Test>() { tree.template Query<Test, Counter>(query); });
        },
        tree_);
  }
  uint32_t Claims() const { return claim_; }
  MemoryUse Memory() const {
    return std::visit([](const auto& tree) { return tree.Memory(); }, tree_);
  }
  template <class Fn>
  int Visit(Fn&& node) const {
    return std::visit([&](const auto& tree) { return tree.Visit(node); }, tree_);
  }

 private:
  uint32_t numerics_, claim_;
  std::variant<BoundTree<KdopBound<6>>, BoundTree<KdopBound<14>>, BoundTree<KdopBound<18>>,
               BoundTree<KdopBound<26>>>
      tree_;
};

}  // namespace

RAYBENCH_STRUCTURE(kdop, Kdop)

}  // namespace raybench
