// What octree and quadtree have in common: parameters, leaves, answers. Each adds its nodes, laid out from a
// center tree, and the way of a ray through them.
#pragma once

#include <type_traits>
#include <vector>

#include "accel/base/huge_array.h"
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

/// T offers, to this class, Trace<kProcedural, kAnyHit>(RayState, best, counter); ChildBox(node, k, box of the
/// node); LayOut(center tree, its inner node, node), which adds what Node has besides child[], count[].
template <class T, class Node>
class CenterStructure {
 public:
  static constexpr uint64_t kCapabilities =
      RB_CAN_COUNT | RB_CAN_PROCEDURAL | RB_CAN_AFTER | RB_CAN_SKIP | RB_DETERMINISTIC;

  template <class Counter>
  void Query(const rb_query& query) const {
    const T& self = Self();
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
    return root_.count == CenterChild::kEmpty ? 0 : VisitBelow(root_, bounds_, 0, node, prims);
  }
  MemoryUse Memory() const { return {nodes_.bytes(), leaves_.bytes(), geometry_.procedural_count > 0}; }

 protected:
  template <class Config>
  CenterStructure(const rb_geometry& geometry, const Config& config)
      : numerics_(config.numerics), claim_(ClaimOf(config.numerics, geometry)), geometry_(geometry) {}

  /// With what choose(insertion) says of axes, on the threads that are allowed.
  template <class Config, class Choose>
  void Build(const rb_build_options& options, const Config& config, const Choose& choose) {
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
      nodes_ = HugeArray<Node>(leaves_.inner().size());
      for (size_t i = 0; i < nodes_.size(); ++i) {
        const CenterTree::Node& from = tree.nodes[leaves_.inner()[i]];
        Node& node = nodes_[i];
        for (uint32_t k = 0; k < kChildren; ++k) {
          const CenterChild child = leaves_.Child(from.child + k);
          node.child[k] = child.index, node.count[k] = child.count;
        }
        Self().LayOut(tree, from, node);
      }
      leaves_.Forget();
    });
  }

  uint32_t numerics_, claim_;
  rb_geometry geometry_;
  CenterLeaves leaves_;
  HugeArray<Node> nodes_;
  CenterChild root_;
  Bounds3 bounds_;

 private:
  static constexpr uint32_t kChildren = std::extent_v<decltype(Node::child)>;

  const T& Self() const { return static_cast<const T&>(*this); }

  template <class Fn>
  int VisitBelow(CenterChild ref, const Bounds3& box, uint32_t depth, Fn& node,
                 std::vector<uint32_t>& prims) const {
    const float bounds[6] = {box.lo.x, box.lo.y, box.lo.z, box.hi.x, box.hi.y, box.hi.z};
    rb_node shown{depth, 0, 1, RB_SHAPE_BOX, bounds, 6, 0, nullptr};
    if (ref.count != CenterChild::kInner) {
      prims.clear();
      leaves_.Append(ref, prims);
      shown.is_leaf = 1, shown.prim_count = uint32_t(prims.size()), shown.prims = prims.data();
      return node(shown);
    }
    if (int stop = node(shown)) return stop;
    const Node& n = nodes_[ref.index];
    for (uint32_t k = 0; k < kChildren; ++k) {
      const Bounds3 child = Self().ChildBox(n, k, box);
      if (int stop = VisitBelow({n.child[k], n.count[k]}, child, depth + 1, node, prims)) return stop;
    }
    return 0;
  }
};

}  // namespace raybench
