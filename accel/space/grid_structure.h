// What the grids that are registered have in common: everything but their parameters.
#pragma once

#include <span>

#include "accel/base/parallel.h"
#include "accel/contract/structure.h"
#include "accel/ray/triangle.h"
#include "accel/space/voxel_grid.h"

namespace raybench {

class GridStructure {
 public:
  static constexpr Kind kKind = {"grid", "O(N)", "SIMD leaves"};
  static constexpr uint64_t kCapabilities =
      RB_CAN_COUNT | RB_CAN_PROCEDURAL | RB_CAN_AFTER | RB_CAN_SKIP | RB_DETERMINISTIC;

  template <class Counter>
  void Query(const rb_query& query) const {
    WithNumerics(numerics_, [&]<class Test>() { grid_.Query<Test, Counter>(query, mailbox_); });
  }
  uint32_t Claims() const { return claim_; }
  MemoryUse Memory() const { return grid_.Memory(); }
  template <class Fn>
  int Visit(Fn&& node) const {
    return grid_.Visit(node);
  }

 protected:
  /// `grid`: how it is built, but for `padded`, which the numerics decide.
  GridStructure(const rb_geometry& geometry, const rb_build_options& options, uint32_t numerics, bool mailbox,
                GridOptions grid)
      : numerics_(numerics), mailbox_(mailbox), claim_(ClaimOf(numerics, geometry)) {
    if (PrimCount(geometry) == 0) return;
    grid.padded = IsConservative(numerics);
    Arena(options.threads).Run([&] { grid_ = VoxelGrid(geometry, options, grid); });
  }

  static constexpr rb_param MailboxParam(size_t offset) {
    return BoolParam("mailbox", "do not test again what the ray met before", offset, false,
                     RB_PARAM_SPEED_ONLY);
  }

 private:
  uint32_t numerics_;
  bool mailbox_;
  uint32_t claim_;
  VoxelGrid grid_;
};

}  // namespace raybench
