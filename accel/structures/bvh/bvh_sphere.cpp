// bvh_sphere: a binary hierarchy of bounding spheres.
//
// The idea is the oldest of all (Whitted 1980; Rubin and Whitted 1980): a sphere is four numbers and one
// short test. It is loose around anything flat or long, triangles first, so that many more spheres than boxes
// are entered for nothing; it is here to show by how much.
//
// Node, depth-first order, 24 bytes: centre and radius, right child or leaf block, count. Topology: binned
// SAH over boxes (binned_sah.h). Traversal: bound_tree.h. Robustness: bounds/sphere.h.
//
// Invariants: every primitive stands in exactly one leaf, whose sphere encloses its box; the same tree at any
// thread count; depth stays below the traversal stack's.
#include "accel/bvh/bounds/binned_bound_tree.h"
#include "accel/bvh/bounds/sphere.h"

namespace raybench {
namespace {

class BvhSphere {
 public:
  struct Config {
    uint32_t numerics;
    int64_t leaf_size;
  };
  static constexpr const char* kName = "bvh_sphere";
  static constexpr const char* kDoc = "binary hierarchy of bounding spheres";
  static constexpr const char* kSource =
      "Rubin, Whitted 1980: A 3-dimensional representation for fast rendering";
  static constexpr Kind kKind = {"other bounds", "O(N log N)", "SIMD leaves"};
  static constexpr uint64_t kCapabilities =
      RB_CAN_COUNT | RB_CAN_PROCEDURAL | RB_CAN_AFTER | RB_CAN_SKIP | RB_DETERMINISTIC;
  static std::span<const rb_param> Params() {
    static const rb_param params[] = {
        NumericsParam(offsetof(Config, numerics)),
        IntParam("leaf_size", "most primitives in a leaf", offsetof(Config, leaf_size), 1, 16, 8)};
    return params;
  }

  BvhSphere(const rb_geometry& geometry, const rb_build_options& options, const Config& config)
      : numerics_(config.numerics),
        claim_(ClaimOf(config.numerics, geometry)),
        tree_(BuildBinnedBoundTree<SphereBound>(geometry, options, uint32_t(config.leaf_size),
                                                IsConservative(config.numerics))) {}

  template <class Counter>
  void Query(const rb_query& query) const {
    WithNumerics(numerics_, [&]<class Test>() { tree_.Query<Test, Counter>(query); });
  }
  uint32_t Claims() const { return claim_; }
  MemoryUse Memory() const { return tree_.Memory(); }
  template <class Fn>
  int Visit(Fn&& node) const {
    return tree_.Visit(node);
  }

 private:
  uint32_t numerics_, claim_;
  BoundTree<SphereBound> tree_;
};

}  // namespace

RAYBENCH_STRUCTURE(bvh_sphere, BvhSphere)

}  // namespace raybench
