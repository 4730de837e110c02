// grid_recursive: a uniform grid whose crowded cells have grids of their own.
//
// The idea: a grid's one size of cells fits no scene of uneven detail, so a cell with more than `leaf_size`
// primitives gets a grid inside, and so on for `levels` levels (Jevans and Wyvill 1989, "Adaptive voxel
// subdivision for ray tracing"; the first to nest grids: Snyder and Barr 1987). A ray that comes to such a
// cell walks the grid inside it, then goes on.
//
// How fine each grid is: about density x its primitives cells, as near to cubes as its box allows; fewer
// while its primitives would stand in more than `references` cells on average. A cell gets no grid that would
// not halve what a line through it has to test. So many primitives that cover each other cost no more than a
// long list. Layout and walk: accel/space/voxel_grid.h.
//
// Invariants: a primitive stands in every lowest cell that it meets; the same grids at any thread count.

#include "accel/base/parallel.h"
#include "accel/space/voxel_grid.h"

namespace raybench {
namespace {

class GridRecursive {
 public:
  struct Config {
    double density, references;
    int64_t levels, leaf_size;
    uint32_t numerics, insertion, mailbox;
  };
  static constexpr const char* kName = "grid_recursive";
  static constexpr const char* kDoc = "uniform grid, crowded cells with grids of their own";
  static constexpr const char* kSource = "Jevans and Wyvill 1989: Adaptive voxel subdivision for ray tracing";
  static constexpr uint64_t kCapabilities =
      RB_CAN_COUNT | RB_CAN_PROCEDURAL | RB_CAN_AFTER | RB_CAN_SKIP | RB_DETERMINISTIC;
  static std::span<const rb_param> Params() {
    static const rb_param params[] = {
        {"numerics", kNumericsDoc, RB_CHOICE, RB_PARAM_APPROXIMATE, offsetof(Config, numerics), 0, 0, 0,
         double(Numerics::kWatertight), kNumericsChoices},
        {"density", "cells per primitive, of each grid", RB_FLOAT, RB_PARAM_LOG, offsetof(Config, density), 0,
         0.001, 64, 0.5, nullptr},
        {"references", "most references per primitive, of each grid, which has fewer cells otherwise",
         RB_FLOAT, RB_PARAM_LOG, offsetof(Config, references), 0, 1, 1024, 16, nullptr},
        {"levels", "grids inside each other", RB_INT, 0, offsetof(Config, levels), 0, 1,
         double(VoxelGrid::kMaxLevels), 4, nullptr},
        {"leaf_size", "cells with more primitives get a grid", RB_INT, 0, offsetof(Config, leaf_size), 0, 1,
         4096, 8, nullptr},
        {"insertion", kInsertionDoc, RB_CHOICE, 0, offsetof(Config, insertion), 0, 0, 0, 0,
         kInsertionChoices},
        {"mailbox", "do not test again what the ray met before", RB_BOOL, 0, offsetof(Config, mailbox), 0, 0,
         1, 0, nullptr}};
    return params;
  }

  GridRecursive(const rb_geometry& geometry, const rb_build_options& options, const Config& config)
      : numerics_(config.numerics),
        mailbox_(config.mailbox != 0),
        claim_(ClaimOf(config.numerics, geometry)) {
    if (PrimCount(geometry) == 0) return;
    GridOptions grid;
    grid.density = config.density, grid.references = config.references;
    grid.levels = uint32_t(config.levels), grid.leaf_size = uint32_t(config.leaf_size);
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

RAYBENCH_STRUCTURE(grid_recursive, GridRecursive)

}  // namespace raybench
