// Builders that look harder for good splits make cheaper trees.
#include <gtest/gtest.h>

#include "datasets/scene/scene.h"
#include "harness/judge/tree_statistics.h"
#include "tests/support/meshes.h"

namespace raybench::testing {
namespace {

double SahCost(const std::string& spec, const rb_geometry& geometry) {
  const auto statistics = ReadTree(Build(spec, geometry), geometry);
  EXPECT_EQ(statistics->flaw, "") << spec;
  return statistics->sah_cost.value();
}

TEST(SahCost, FallsFromMedianToBinnedToSweep) {
  for (const char* name :
       {"icosphere(level=5)", "stadium(size=20000)", "soup(size=10000)", "sphereflake(depth=2)",
        "terrain(size=20000)", "city(size=20000)", "fibres(size=20000)"}) {
    const Scene scene = LoadScene(name);
    const rb_geometry geometry = scene.Geometry();
    const double median = SahCost("bvh_median(leaf_size=1)", geometry),
                 binned = SahCost("bvh_sah(leaf_size=1)", geometry),
                 sweep = SahCost("bvh_sweep(leaf_size=1)", geometry),
                 moved = SahCost("bvh_sweep(leaf_size=1,reinsertion=2)", geometry),
                 morton = SahCost("bvh_morton(leaf_size=1)", geometry),
                 ploc = SahCost("bvh_ploc(leaf_size=1)", geometry);
    EXPECT_LE(binned, median) << name;
    // Both are greedy: the better split here is not always the better one for what is below.
    EXPECT_LE(sweep, binned * 1.002) << name;
    EXPECT_LE(moved, sweep) << name;
    EXPECT_LE(ploc, morton) << name;
  }
}

TEST(SahCost, SpatialSplitsPayWhereBoxesOverlap) {
  for (const char* name : {"soup(size=50000)", "soup(size=20000,length=4)", "stadium(size=20000)"}) {
    const Scene scene = LoadScene(name);
    const rb_geometry geometry = scene.Geometry();
    const double sweep = SahCost("bvh_sweep", geometry), spatial = SahCost("bvh_spatial", geometry),
                 uncut = SahCost("bvh_spatial(split_budget=0)", geometry);
    EXPECT_LE(spatial, sweep) << name;
    EXPECT_LT(spatial, 0.98 * uncut) << name;
  }
}

}  // namespace
}  // namespace raybench::testing
