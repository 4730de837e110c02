// grid: the scene's box cut into equal cells, each with the primitives that lie in it.
//
// The idea: a ray walks from cell to cell, nearest first, and tests what it meets (Fujimoto, Tanaka, Iwata
// 1986; Amanatides and Woo 1987). Building is one counting sort, faster than any tree's; the price is that
// one size of cells must suit the whole scene, which it does not where detail is uneven ("teapot in a
// stadium").
//
// How fine: a rule gives about density x primitives cells (Cleary and Wyvill 1988; Woo 1992; Ize, Shirley,
// Parker 2007), lowered while primitives would stand in more than `references` cells on average; or
// resolution_x, _y, _z say it. What goes into a cell: primitives whose box meets it, or triangles that do
// (insertion.h). A mailbox keeps a ray from testing again what it met in a cell before (leaf_blocks.h).
// Layout and walk: accel/space/voxel_grid.h.
//
// Invariants: a primitive stands in every cell that it meets; the same grid at any thread count.

#include "accel/base/parallel.h"
#include "accel/space/voxel_grid.h"

namespace raybench {
namespace {

class Grid {
 public:
  struct Config {
    double density, references;
    int64_t resolution[3];
    uint32_t numerics, rule, insertion, mailbox;
  };
  static constexpr const char* kName = "grid";
  static constexpr const char* kDoc = "uniform grid, walked cell by cell";
  static constexpr const char* kSource =
      "Amanatides and Woo 1987: A fast voxel traversal algorithm for ray tracing";
  static constexpr uint64_t kCapabilities =
      RB_CAN_COUNT | RB_CAN_PROCEDURAL | RB_CAN_AFTER | RB_CAN_SKIP | RB_DETERMINISTIC;
  static std::span<const rb_param> Params() {
    constexpr auto kMax = double(VoxelGrid::kMaxResolution);
    static const rb_param params[] = {
        {"numerics", kNumericsDoc, RB_CHOICE, RB_PARAM_APPROXIMATE, offsetof(Config, numerics), 0, 0, 0,
         double(Numerics::kWatertight), kNumericsChoices},
        {"rule", kGridRuleDoc, RB_CHOICE, 0, offsetof(Config, rule), 0, 0, 0,
         double(GridRule::kHeterogeneous), kGridRuleChoices},
        {"density", "cells per primitive that the rule aims at", RB_FLOAT, RB_PARAM_LOG,
         offsetof(Config, density), 0, 0.001, 64, GridOptions{}.density, nullptr},
        {"references", "most references per primitive by the rule, which gives fewer cells otherwise",
         RB_FLOAT, RB_PARAM_LOG, offsetof(Config, references), 0, 1, 1024, GridOptions{}.references, nullptr},
        {"resolution_x", "cells along x; 0: by the rule", RB_INT, 0, offsetof(Config, resolution[0]), 0, 0,
         kMax, 0, nullptr},
        {"resolution_y", "cells along y; 0: by the rule", RB_INT, 0, offsetof(Config, resolution[1]), 0, 0,
         kMax, 0, nullptr},
        {"resolution_z", "cells along z; 0: by the rule", RB_INT, 0, offsetof(Config, resolution[2]), 0, 0,
         kMax, 0, nullptr},
        {"insertion", kInsertionDoc, RB_CHOICE, 0, offsetof(Config, insertion), 0, 0, 0, 0,
         kInsertionChoices},
        {"mailbox", "do not test again what the ray met before", RB_BOOL, 0, offsetof(Config, mailbox), 0, 0,
         1, 0, nullptr}};
    return params;
  }

  Grid(const rb_geometry& geometry, const rb_build_options& options, const Config& config)
      : numerics_(config.numerics),
        mailbox_(config.mailbox != 0),
        claim_(ClaimOf(config.numerics, geometry)) {
    if (PrimCount(geometry) == 0) return;
    GridOptions grid;
    grid.rule = GridRule(config.rule), grid.density = config.density, grid.references = config.references;
    for (int a = 0; a < 3; ++a) grid.resolution[a] = uint32_t(config.resolution[a]);
    grid.exact = config.insertion != 0, grid.padded = IsConservative(config.numerics);
    Arena arena(options.threads);
    arena.Run([&] { grid_ = VoxelGrid(geometry, options, grid); });
  }

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

 private:
  uint32_t numerics_;
  bool mailbox_;
  uint32_t claim_;
  VoxelGrid grid_;
};

}  // namespace

RAYBENCH_STRUCTURE(grid, Grid)

}  // namespace raybench
