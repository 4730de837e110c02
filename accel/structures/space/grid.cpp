// grid: the scene's box cut into equal cells, each with the primitives that lie in it.
//
// The idea: a ray walks from cell to cell, nearest first, and tests what it meets (Fujimoto, Tanaka,
// Iwata 1986; Amanatides and Woo 1987). Building is one counting sort, faster than any tree's; the price
// is that one size of cells must suit the whole scene, which it does not where detail is uneven ("teapot
// in a stadium").
//
// How fine: a rule gives about density x primitives cells (Cleary and Wyvill 1988; Woo 1992; Ize, Shirley,
// Parker 2007), lowered while primitives would stand in more than `references` cells on average; or
// resolution_x, _y, _z say it. What goes into a cell: primitives whose box meets it, or triangles that do
// (insertion.h). A mailbox keeps a ray from testing again what it met in a cell before (leaf_blocks.h).
// Layout and walk: accel/space/voxel_grid.h.
//
// Invariants: a primitive stands in every cell that it meets; the same grid at any thread count.

#include "accel/space/grid_structure.h"

namespace raybench {
namespace {

class Grid : public GridStructure {
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
  static std::span<const rb_param> Params() {
    constexpr auto kMax = double(VoxelGrid::kMaxResolution);
    static const rb_param params[] = {
        NumericsParam(offsetof(Config, numerics)),
        ChoiceParam("rule", kGridRuleDoc, offsetof(Config, rule), kGridRuleChoices,
                    uint32_t(GridRule::kHeterogeneous)),
        FloatParam("density", "cells per primitive that the rule aims at", offsetof(Config, density), 0.001,
                   64, GridOptions{}.density, RB_PARAM_LOG),
        FloatParam("references",
                   "most references per primitive by the rule, which gives fewer cells otherwise",
                   offsetof(Config, references), 1, 1024, GridOptions{}.references, RB_PARAM_LOG),
        IntParam("resolution_x", "cells along x; 0: by the rule", offsetof(Config, resolution[0]), 0, kMax,
                 0),
        IntParam("resolution_y", "cells along y; 0: by the rule", offsetof(Config, resolution[1]), 0, kMax,
                 0),
        IntParam("resolution_z", "cells along z; 0: by the rule", offsetof(Config, resolution[2]), 0, kMax,
                 0),
        InsertionParam(offsetof(Config, insertion)),
        MailboxParam(offsetof(Config, mailbox))};
    return params;
  }

  Grid(const rb_geometry& geometry, const rb_build_options& options, const Config& config)
      : GridStructure(geometry, options, config.numerics, config.mailbox != 0, How(config)) {}

 private:
  static GridOptions How(const Config& config) {
    GridOptions grid;
    grid.rule = GridRule(config.rule);
    grid.density = config.density;
    grid.references = config.references;
    for (int a = 0; a < 3; ++a) grid.resolution[a] = uint32_t(config.resolution[a]);
    grid.exact = config.insertion != 0;
    return grid;
  }
};

}  // namespace

RAYBENCH_STRUCTURE(grid, Grid)

}  // namespace raybench
