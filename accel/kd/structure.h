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
    build.padded = IsConservative(numerics);
    Arena arena(options.threads);
    arena.Run([&] { tree_ = BuildKdTree(geometry, build, options.memory_limit, options.cancel); });
  }

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
        {"numerics", kNumericsDoc, RB_CHOICE, RB_PARAM_APPROXIMATE, offsetof(Config, numerics), 0, 0, 0,
         double(Numerics::kWatertight), kNumericsChoices},
        {"axis", "axis of the plane: in turn, or of the cell's largest extent", RB_CHOICE, 0,
         offsetof(Config, axis), 0, 0, 0, double(KdAxisRule::kLargest), axes},
        {"clip", kKdClipDoc, RB_BOOL, 0, offsetof(Config, clip), 0, 0, 1, 1, nullptr},
        {"leaf_size", kKdLeafSizeDoc, RB_INT, 0, offsetof(Config, leaf_size), 0, 1, 1024, 16, nullptr},
        {"max_depth", kKdMaxDepthDoc, RB_INT, 0, offsetof(Config, max_depth), 0, 0,
         double(KdTree::kMaxDepth - 1), 0, nullptr},
        {"duplication", kKdDuplicationDoc, RB_FLOAT, 0, offsetof(Config, duplication), 0, 0, 100, 8,
         nullptr}};
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
