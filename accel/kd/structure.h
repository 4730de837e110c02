// What the kd-trees that are registered have in common: everything but their builder's parameters.
#pragma once

#include "accel/base/parallel.h"
#include "accel/kd/build.h"

namespace raybench {

inline constexpr const char* kKdClipDoc =
    "perfect splits: a triangle stands where it lies itself, not where its box does";
inline constexpr const char* kKdLeafSizeDoc = "cells with no more primitives are not split";
inline constexpr const char* kKdMaxDepthDoc =
    "depth of the deepest leaf; 0: 8 + 1.3 log2 of the number of primitives";
inline constexpr const char* kKdDuplicationDoc =
    "references that leaves may hold, a primitive, beyond the one that it needs";

class KdStructure {
 public:
  static constexpr Kind kKind = {"kd-tree", "O(N log N)", "SIMD leaves"};
  static constexpr uint64_t kCapabilities =
      RB_CAN_COUNT | RB_CAN_PROCEDURAL | RB_CAN_AFTER | RB_CAN_SKIP | RB_DETERMINISTIC;

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

 protected:
  KdStructure(const rb_geometry& geometry, const rb_build_options& options, KdOptions build,
              uint32_t numerics)
      : numerics_(numerics), claim_(ClaimOf(numerics, geometry)) {
    build.padded = build.padded && IsConservative(numerics);
    Arena arena(options.threads);
    arena.Run([&] { tree_ = BuildKdTree(geometry, build, options.memory_limit, options.cancel); });
  }
  const KdTree& tree() const { return tree_; }

 private:
  uint32_t numerics_, claim_;
  KdTree tree_;
};

/// The two that split at a median: the same parameters.
class KdMedianStructure : public KdStructure {
 public:
  struct Config {
    uint32_t numerics, axis, clip;
    double duplication;
    int64_t leaf_size, max_depth;
  };
  static std::span<const rb_param> Params() {
    static const char* const axes[] = {"cyclic", "largest", nullptr};
    static const rb_param params[] = {
        NumericsParam(offsetof(Config, numerics)),
        ChoiceParam("axis", "axis of the plane: in turn, or of the cell's largest extent",
                    offsetof(Config, axis), axes, uint32_t(KdAxisRule::kLargest)),
        BoolParam("clip", kKdClipDoc, offsetof(Config, clip), true),
        IntParam("leaf_size", kKdLeafSizeDoc, offsetof(Config, leaf_size), 1, 1024, 16),
        IntParam("max_depth", kKdMaxDepthDoc, offsetof(Config, max_depth), 0, double(KdTree::kMaxDepth - 1),
                 0),
        FloatParam("duplication", kKdDuplicationDoc, offsetof(Config, duplication), 0, 100, 8)};
    return params;
  }

 protected:
  KdMedianStructure(const rb_geometry& geometry, const rb_build_options& options, const Config& config,
                    KdMethod method)
      : KdStructure(geometry, options,
                    {.method = method,
                     .axis = KdAxisRule(config.axis),
                     .leaf_size = uint32_t(config.leaf_size),
                     .max_depth = uint32_t(config.max_depth),
                     .duplication = config.duplication,
                     .clip = config.clip != 0},
                    config.numerics) {}
};

}  // namespace raybench
