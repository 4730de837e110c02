// null: answers "miss" to every ray. What it costs is the harness's own cost: reading rays and
// writing answers.
#include "accel/contract/structure.h"

namespace raybench {
namespace {

class Null {
 public:
  struct Config {};
  static constexpr const char* kName = "null";
  static constexpr const char* kDoc = "always misses: the cost of the harness itself";
  static constexpr const char* kSource = "raybench";
  static constexpr Kind kKind = {"no hierarchy", "none", "none"};
  static constexpr uint64_t kCapabilities =
      RB_CAN_COUNT | RB_CAN_PROCEDURAL | RB_CAN_AFTER | RB_CAN_SKIP | RB_DETERMINISTIC;
  static std::span<const rb_param> Params() { return {}; }

  Null(const rb_geometry&, const rb_build_options&, const Config&) {}

  template <class Counter>
  void Query(const rb_query& query) const {
    ForEachRay<Counter>(query, [](auto, const RayQuery&, rb_hit&, Counter&) {});
  }
  uint32_t Claims() const { return RB_CLAIM_NOTHING; }
  MemoryUse Memory() const { return {}; }
};

}  // namespace

RAYBENCH_STRUCTURE(null, Null)

}  // namespace raybench
