// brute: every ray against every primitive, in the order of their ids. No tree, nothing to lose: the in-tree
// reference for every structure at the same `numerics`.
#include "accel/ray/primitive.h"

namespace raybench {
namespace {

class Brute {
 public:
  struct Config {
    uint32_t numerics;
  };
  static constexpr const char* kName = "brute";
  static constexpr const char* kDoc = "every ray against every primitive: the reference, linear in both";
  static constexpr const char* kSource = "raybench";
  static constexpr Kind kKind = {"no hierarchy", "none", "scalar"};
  static constexpr uint64_t kCapabilities =
      RB_CAN_COUNT | RB_CAN_PROCEDURAL | RB_CAN_AFTER | RB_CAN_SKIP | RB_DETERMINISTIC | RB_LINEAR;
  static std::span<const rb_param> Params() {
    static const rb_param params[] = {NumericsParam(offsetof(Config, numerics))};
    return params;
  }

  Brute(const rb_geometry& geometry, const rb_build_options&, const Config& config)
      : geometry_(geometry), config_(config) {}

  template <class Counter>
  void Query(const rb_query& query) const {
    WithNumerics(config_.numerics, [&]<class Test>() {
      ForEachRay<Counter>(query, [&](auto any, const RayQuery& q, rb_hit& best, Counter& counter) {
        const RayState<Test> ray(q);
        const uint64_t n = PrimCount(geometry_);
        for (uint64_t i = 0; i < n; ++i) {
          counter.Prims(1, sizeof(uint32_t[3]) + sizeof(float[3][3]));
          if (ray.Primitive(geometry_, uint32_t(i), best) && any.value) return;
        }
      });
    });
  }
  uint32_t Claims() const { return ClaimOf(config_.numerics, geometry_); }
  MemoryUse Memory() const { return {0, 0, true}; }

 private:
  rb_geometry geometry_;
  Config config_;
};

}  // namespace

RAYBENCH_STRUCTURE(brute, Brute)

}  // namespace raybench
