// What octree and quadtree have in common: parameters, leaves, answers. Each adds its nodes, laid out from a
// center tree, and the way of a ray through them.
#pragma once

#include <vector>

#include "accel/base/parallel.h"
#include "accel/contract/structure.h"
#include "accel/ray/primitive.h"
#include "accel/space/center_tree.h"
#include "accel/space/insertion.h"

namespace raybench {

/// Of an octree's or quadtree's configuration.
constexpr rb_param CenterDepthParam(size_t offset) {
  return IntParam("depth", "deepest level; the root has 0", offset, 0, kMaxCenterDepth, 16);
}
constexpr rb_param CenterLeafSizeParam(size_t offset) {
  return IntParam("leaf_size", "cells with more primitives are divided", offset, 1, 4096, 8);
}
constexpr rb_param CenterGrowthParam(size_t offset, double most, double by_default) {
  return FloatParam("growth",
                    "cells are not divided where their children would hold so many times their references",
                    offset, 1, most, by_default);
}
constexpr rb_param CenterReferencesParam(size_t offset) {
  return FloatParam("references", "most references per primitive, of the whole tree", offset, 1, 1024, 16,
                    RB_PARAM_LOG);
}

/// T offers, to this class, Trace<kProcedural, kAnyHit>(RayState, best, counter) and VisitBelow(child, box,
/// depth, node, prims).
template <class T>
class CenterStructure {
 public:
  static constexpr uint64_t kCapabilities =
      RB_CAN_COUNT | RB_CAN_PROCEDURAL | RB_CAN_AFTER | RB_CAN_SKIP | RB_DETERMINISTIC;

  template <class Counter>
  void Query(const rb_query& query) const {
    const T& self = static_cast<const T&>(*this);
    WithNumerics(numerics_, [&]<class Test>() {
      ForEachRay<Counter>(query, [&](auto any, const RayQuery& q, rb_hit& best, Counter& counter) {
        geometry_.procedural_count > 0
            ? self.template Trace<true, any.value>(RayState<Test>(q), best, counter)
            : self.template Trace<false, any.value>(RayState<Test>(q), best, counter);
      });
    });
  }
  uint32_t Claims() const { return claim_; }
  template <class Fn>
  int Visit(Fn&& node) const {
    std::vector<uint32_t> prims;
    return root_.count == CenterChild::kEmpty
               ? 0
               : static_cast<const T&>(*this).VisitBelow(root_, bounds_, 0, node, prims);
  }

 protected:
  template <class Config>
  CenterStructure(const rb_geometry& geometry, const Config& config)
      : numerics_(config.numerics), claim_(ClaimOf(config.numerics, geometry)), geometry_(geometry) {}

  /// Calls lay_out(center tree) with what `choose(insertion)` says of axes, on the threads that are allowed.
  template <class Config, class Choose, class LayOut>
  void Build(const rb_build_options& options, const Config& config, const Choose& choose,
             const LayOut& lay_out) {
    if (PrimCount(geometry_) == 0) return;
    Arena(options.threads).Run([&] {
      const Insertion insertion(geometry_, config.insertion != 0, IsConservative(config.numerics));
      CenterTreeOptions how = choose(insertion);
      how.depth = uint32_t(config.depth);
      how.leaf_size = uint32_t(config.leaf_size);
      how.growth = config.growth;
      how.references = config.references;
      const CenterTree tree = BuildCenterTree(insertion, how, options);
      leaves_ = CenterLeaves(geometry_, tree);
      root_ = leaves_.Child(0), bounds_ = tree.nodes[0].box;
      lay_out(tree);
    });
  }

  uint32_t numerics_, claim_;
  rb_geometry geometry_;
  CenterLeaves leaves_;
  CenterChild root_;
  Bounds3 bounds_;
};

}  // namespace raybench
