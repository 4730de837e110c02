#include "tracer/heat_map.h"

#include <gtest/gtest.h>

#include <cstring>
#include <limits>

#include "tests/support/tracer.h"

namespace raybench {
namespace {

using testing::BuildTree;
using testing::FindSet;
using testing::MixedScene;

struct Size {
  uint32_t width, height;
};

/// Where the slots of the tracer's tiles of 8 x 8 pixels lie in the picture.
std::vector<size_t> TiledPixels(Size size) {
  std::vector<size_t> pixels;
  for (uint32_t y0 = 0; y0 < size.height; y0 += 8)
    for (uint32_t x0 = 0; x0 < size.width; x0 += 8)
      for (uint32_t y = y0; y < std::min(size.height, y0 + 8); ++y)
        for (uint32_t x = x0; x < std::min(size.width, x0 + 8); ++x)
          pixels.push_back(size_t{y} * size.width + x);
  return pixels;
}

TEST(TracerHeatMap, PixelRaysAreTheRecordedCameraRaysRowByRow) {
  const Scene scene = MixedScene(3);
  const Tree tree = BuildTree(scene);
  for (Size size : {Size{20, 13}, {64, 3}, {1, 1}, {9, 40}}) {
    const TraceResult result =
        Trace(scene, tree, {.width = size.width, .height = size.height, .max_depth = 0, .capture = true});
    const std::vector<rb_ray>& recorded = FindSet(result, "camera")->rays;
    std::vector<rb_ray> rays(recorded.size());
    PixelRays(scene, size.width, size.height, 0, rays, 2);
    const std::vector<size_t> pixels = TiledPixels(size);
    for (size_t slot = 0; slot < recorded.size(); ++slot)
      ASSERT_EQ(std::memcmp(&recorded[slot], &rays[pixels[slot]], sizeof(rb_ray)), 0) << slot;
    std::vector<rb_ray> last(1);
    PixelRays(scene, size.width, size.height, rays.size() - 1, last, 1);
    EXPECT_EQ(std::memcmp(&last[0], &rays.back(), sizeof(rb_ray)), 0);
    EXPECT_THROW(PixelRays(scene, size.width, size.height, rays.size(), last, 1), std::out_of_range);
  }
}

TEST(TracerHeatMap, CountsAreThoseOfTheRecordedCameraSet) {
  const Scene scene = MixedScene(4);
  const Size size{75, 41};
  for (const char* spec : {"brute", "bvh_sah"}) {
    const Tree tree = BuildTree(scene, spec);
    const TraceResult result =
        Trace(scene, tree, {.width = size.width, .height = size.height, .max_depth = 0, .capture = true});
    const std::vector<rb_ray>& rays = FindSet(result, "camera")->rays;
    std::vector<rb_hit> hits(rays.size());
    std::vector<rb_counts> counts(rays.size());
    rb_query query{};
    query.struct_size = sizeof query;
    query.kind = RB_CLOSEST;
    query.n = rays.size(), query.rays = rays.data(), query.hits = hits.data(), query.counts = counts.data();
    tree.QueryCounted(query);
    const HeatMap map = CountPerPixel(scene, tree, {.width = size.width, .height = size.height});
    ASSERT_EQ(map.width, size.width);
    ASSERT_EQ(map.height, size.height);
    ASSERT_EQ(map.steps.size(), rays.size());
    const std::vector<size_t> pixels = TiledPixels(size);
    uint64_t steps = 0, prims = 0;
    for (size_t slot = 0; slot < rays.size(); ++slot) {
      ASSERT_EQ(map.steps[pixels[slot]], counts[slot].steps) << spec << " " << slot;
      ASSERT_EQ(map.prims[pixels[slot]], counts[slot].prims) << spec << " " << slot;
      steps += counts[slot].steps, prims += counts[slot].prims;
    }
    EXPECT_EQ(Summarize(map.steps).sum, steps);
    EXPECT_EQ(Summarize(map.prims).sum, prims);
    EXPECT_GT(prims, 0u);
    EXPECT_GE(Summarize(map.prims).max, prims / rays.size());
  }
}

TEST(TracerHeatMap, DependsOnNeitherThreadsNorBands) {
  const Scene scene = MixedScene(5);
  const Tree tree = BuildTree(scene, "bvh_sah");
  const HeatMap whole = CountPerPixel(scene, tree, {.width = 60, .height = 33, .threads = 1});
  EXPECT_GT(Summarize(whole.steps).max, 1u);
  for (uint32_t threads : {1u, 2u, 0u})
    for (uint32_t band : {1u, 59u, 61u, 1980u, 100000u}) {
      const HeatMap map =
          CountPerPixel(scene, tree, {.width = 60, .height = 33, .threads = threads, .band_rays = band});
      ASSERT_EQ(map.steps, whole.steps) << threads << " " << band;
      ASSERT_EQ(map.prims, whole.prims) << threads << " " << band;
    }
}

TEST(TracerHeatMap, ProgressRisesToOneAndMayEndTheCounting) {
  const Scene scene = MixedScene(5);
  const Tree tree = BuildTree(scene, "bvh_sah");
  std::vector<double> seen;
  HeatOptions options{.width = 60, .height = 33, .band_rays = 500};
  options.progress = [&](double fraction) { seen.push_back(fraction); };
  CountPerPixel(scene, tree, options);
  EXPECT_EQ(seen.size(), 4u);
  EXPECT_TRUE(std::is_sorted(seen.begin(), seen.end()));
  EXPECT_EQ(seen.back(), 1);
  struct Enough {};
  options.progress = [](double) { throw Enough(); };
  EXPECT_THROW(CountPerPixel(scene, tree, options), Enough);
}

TEST(TracerHeatMap, SumsDoNotOverflow) {
  const uint32_t most = std::numeric_limits<uint32_t>::max();
  const HeatSummary summary = Summarize({most, most, 1});
  EXPECT_EQ(summary.sum, 2 * uint64_t{most} + 1);
  EXPECT_EQ(summary.max, most);
  EXPECT_EQ(Summarize({}).sum, 0u);
}

TEST(TracerHeatMap, ImpossiblePicturesAndStructuresThatCannotCountAreRefused) {
  const Scene scene = MixedScene(5);
  const Tree tree = BuildTree(scene);
  EXPECT_THROW(CountPerPixel(scene, tree, {.width = 0, .height = 5}), InputError);
  EXPECT_THROW(CountPerPixel(scene, tree, {.width = 100000, .height = 100000}), InputError);
  const Registry registry;
  for (const rb_structure* structure : registry.structures()) {
    if (structure->query_counted != nullptr || (structure->capabilities & RB_CAN_PROCEDURAL) == 0) continue;
    const Tree silent = BuildTree(scene, structure->name);
    EXPECT_THROW(CountPerPixel(scene, silent, {.width = 4, .height = 4}), InputError) << structure->name;
  }
}

}  // namespace
}  // namespace raybench
