// Stands for your renderer's structure: boxes around groups of consecutive primitives, as in raybench's README.
#include <algorithm>
#include <vector>

#include "accel/ray/primitive.h"

namespace raybench {
namespace {

class Mine {
 public:
  struct Config {
    int64_t size;
    uint32_t numerics;
  };
  static constexpr const char* kName = "mine";
  static constexpr const char* kDoc = "boxes around groups of consecutive primitives";
  static constexpr const char* kSource = "an example";
  static constexpr Kind kKind = {"no hierarchy", "O(N)", "scalar"};  // for `raybench list`, once built in
  static constexpr uint64_t kCapabilities =
      RB_CAN_COUNT | RB_CAN_PROCEDURAL | RB_CAN_AFTER | RB_CAN_SKIP | RB_DETERMINISTIC;
  static std::span<const rb_param> Params() {
    static const rb_param params[] = {
        IntParam("size", "primitives in a group", offsetof(Config, size), 1, 4096, 64),
        NumericsParam(offsetof(Config, numerics))};
    return params;
  }

  Mine(const rb_geometry& geometry, const rb_build_options& options, const Config& config)
      : geometry_(geometry), config_(config), boxes_((PrimCount(geometry) + config.size - 1) / config.size) {
    RequireWithinLimit(boxes_.size() * sizeof(Bounds3), options);
    for (uint64_t i = 0; i < PrimCount(geometry); ++i)
      boxes_[i / config.size].Extend(PaddedPrimBounds(geometry, uint32_t(i)));
  }

  template <class Counter>
  void Query(const rb_query& query) const {
    WithNumerics(config_.numerics, [&]<class Test>() {
      ForEachRay<Counter>(query, [&](auto any, const RayQuery& q, rb_hit& best, Counter& counter) {
        const RayState<Test> ray(q);
        for (uint64_t group = 0; group < boxes_.size(); ++group) {
          counter.Step(sizeof(Bounds3));
          counter.Bounds(1);
          float tnear, tfar;
          ray.slab.Interval(boxes_[group], tnear, tfar);
          if (!(std::max(tnear, q.ray.tnear) <= std::min(tfar, best.t))) continue;
          counter.Leaf(false);
          const uint64_t end = std::min<uint64_t>((group + 1) * config_.size, PrimCount(geometry_));
          for (uint64_t i = group * config_.size; i < end; ++i) {
            counter.Prims(1, sizeof(uint32_t[3]) + sizeof(float[3][3]));
            if (ray.Primitive(geometry_, uint32_t(i), best) && any.value) return;
          }
        }
      });
    });
  }
  uint32_t Claims() const { return ClaimOf(config_.numerics, geometry_); }
  MemoryUse Memory() const { return {boxes_.size() * sizeof(Bounds3), 0, true}; }

 private:
  rb_geometry geometry_;
  Config config_;
  std::vector<Bounds3> boxes_;
};

}  // namespace
}  // namespace raybench

RAYBENCH_PLUGIN(raybench::Mine)
