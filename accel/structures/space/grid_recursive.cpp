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

#include "accel/space/grid_structure.h"

namespace raybench {
namespace {

class GridRecursive : public GridStructure {
 public:
  struct Config {
    double density, references;
    int64_t levels, leaf_size;
    uint32_t numerics, insertion, mailbox;
  };
  static constexpr const char* kName = "grid_recursive";
  static constexpr const char* kDoc = "uniform grid, crowded cells with grids of their own";
  static constexpr const char* kSource = "Jevans and Wyvill 1989: Adaptive voxel subdivision for ray tracing";
  static std::span<const rb_param> Params() {
    static const rb_param params[] = {
        NumericsParam(offsetof(Config, numerics)),
        FloatParam("density", "cells per primitive, of each grid", offsetof(Config, density), 0.001, 64, 0.5,
                   RB_PARAM_LOG),
        FloatParam("references",
                   "most references per primitive, of each grid, which has fewer cells otherwise",
                   offsetof(Config, references), 1, 1024, 16, RB_PARAM_LOG),
        IntParam("levels", "grids inside each other", offsetof(Config, levels), 1,
                 double(VoxelGrid::kMaxLevels), 4),
        IntParam("leaf_size", "cells with more primitives get a grid", offsetof(Config, leaf_size), 1, 4096,
                 8),
        InsertionParam(offsetof(Config, insertion)),
        MailboxParam(offsetof(Config, mailbox))};
    return params;
  }

  GridRecursive(const rb_geometry& geometry, const rb_build_options& options, const Config& config)
      : GridStructure(geometry, options, config.numerics, config.mailbox != 0, How(config)) {}

 private:
  static GridOptions How(const Config& config) {
    GridOptions grid;
    grid.density = config.density;
    grid.references = config.references;
    grid.levels = uint32_t(config.levels);
    grid.leaf_size = uint32_t(config.leaf_size);
    grid.exact = config.insertion != 0;
    return grid;
  }
};

}  // namespace

RAYBENCH_STRUCTURE(grid_recursive, GridRecursive)

}  // namespace raybench
