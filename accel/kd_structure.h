// What the kd-trees that are registered have in common: everything but their builder's parameters.
#pragma once

#include <tbb/task_arena.h>

#include "accel/kd_build.h"

namespace raybench {

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
    tbb::task_arena arena(int(options.threads));
    arena.execute([&] { tree_ = BuildKdTree(geometry, build, options.memory_limit, options.cancel); });
  }

 private:
  uint32_t numerics_, claim_;
  KdTree tree_;
};

}  // namespace raybench
