// All structures give the same answers, to the bit, on every dataset: under `exact` each of ours, under
// `watertight` and `double` those that insert by bounds. Where triangles are clipped into cells, a float test
// may name another primitive at the same t, and only `exact` promises more.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstring>

#include "harness/rays/aim.h"
#include "harness/truth/mesh_edges.h"
#include "tests/support/conformance.h"
#include "tests/support/effort.h"
#include "tracer/tracer.h"

namespace raybench::testing {
namespace {

constexpr const char* kDatasets[] = {
    "icosphere(level=4)",
    "sphereflake(depth=2,tessellation=2)",
    "sphereflake(depth=2,tessellation=0)",
    "stadium(size=2000)",
    "terrain_box(n=32)",
    "terrain(size=4000)",
    "soup(size=3000)",
    "fibres(size=4000)",
    "fibres(size=4000,shape=tube,on=plane)",
    "city(size=1500)",
    "shells(size=3000)",
    "menger(depth=2)",
    "gears(size=2)",
    "rings(size=2)",
    "tree(size=7)",
    "subdivide(icosphere(level=2),levels=2)",
};

class Dataset : public ::testing::TestWithParam<const char*> {};

bool HasParameter(const rb_structure& s, std::string_view name) {
  for (uint32_t i = 0; i < s.param_count; ++i)
    if (s.params[i].name == name) return true;
  return false;
}

/// The spec at these numerics, by bounds if `by_bounds`; empty if it does not come so.
std::string SpecOf(const rb_structure& s, const std::string& numerics, bool by_bounds) {
  if (!HasParameter(s, "numerics")) return {};
  if (!by_bounds) return fmt::format("{}(numerics={})", s.name, numerics);
  if (HasParameter(s, "split_budget")) return {};  // spatial splits clip
  return fmt::format("{}(numerics={}{})", s.name, numerics, HasParameter(s, "clip") ? ",clip=false" : "");
}

TEST_P(Dataset, EveryStructureAnswersAsBruteDoes) {
  LoadOptions load;
  load.seed = 5;
  const Scene scene = LoadScene(GetParam(), load);
  const rb_geometry geometry = scene.Geometry();
  const std::vector<MeshEdge> edges = MeshEdges(scene);
  std::vector<rb_ray> rays;
  constexpr uint64_t kRays = Effort(192);
  for (const AimedSet& set : SharedSets(scene, edges, kRays, 3)) {
    if (!set.absent.empty()) continue;
    rays.resize(rays.size() + kRays);
    set.fill(0, std::span(rays).last(kRays), 1);
  }
  ASSERT_GE(rays.size(), 4 * kRays);
  const Registry registry;
  for (const char* numerics : {"exact", "double", "watertight"}) {
    const Tree brute = Build(fmt::format("brute(numerics={})", numerics), geometry);
    const std::vector<rb_hit> expected = Closest(brute, rays);
    const std::vector<uint8_t> expected_any = Occluded(brute, rays);
    size_t structures = 0;
    for (const rb_structure* s : registry.structures()) {
      const std::string spec = SpecOf(*s, numerics, std::string_view(numerics) != "exact");
      if (spec.empty()) continue;
      SCOPED_TRACE(spec);
      ++structures;
      const Tree tree = Build(spec, geometry);
      const std::vector<rb_hit> hits = Closest(tree, rays);
      EXPECT_EQ(Occluded(tree, rays), expected_any);
      for (size_t i = 0; i < rays.size(); ++i) {
        ASSERT_EQ(hits[i].prim, expected[i].prim) << "ray " << i;
        ASSERT_EQ(std::memcmp(&hits[i], &expected[i], hits[i].prim == RAYBENCH_NONE ? 4 : sizeof(rb_hit)), 0)
            << "ray " << i << ": t " << hits[i].t << " and " << expected[i].t;
      }
    }
    EXPECT_GE(structures, 15u);
  }
}

class Picture : public ::testing::TestWithParam<const char*> {};

TEST_P(Picture, IsTheSameToTheBitWithEveryStructure) {
  LoadOptions load;
  load.seed = 5;
  const Scene scene = LoadScene(GetParam(), load);
  const rb_geometry geometry = scene.Geometry();
  TraceOptions options;
  options.width = kSanitized ? 20 : 40, options.height = kSanitized ? 15 : 30, options.max_depth = 3;
  const Registry registry;
  for (const char* numerics : {"exact", "double", "watertight"}) {
    const TraceResult expected =
        Trace(scene, Build(fmt::format("brute(numerics={})", numerics), geometry), options);
    ASSERT_GT(expected.camera_hits, options.width * options.height / 12);
    for (const rb_structure* s : registry.structures()) {
      const std::string spec = SpecOf(*s, numerics, std::string_view(numerics) != "exact");
      if (spec.empty()) continue;
      const TraceResult picture = Trace(scene, Build(spec, geometry), options);
      EXPECT_EQ(picture.image.pixels, expected.image.pixels) << spec;
    }
  }
}

// Mirrors, glass, light through shells, procedural primitives, interpolated normals.
INSTANTIATE_TEST_SUITE_P(Every, Picture,
                         ::testing::Values("sphereflake(depth=1,tessellation=2)", "shells(size=1500)",
                                           "balls(size=1)", "gears(size=1)", "teapot(size=3)"),
                         [](const auto& info) { return TestName(info.param); });

INSTANTIATE_TEST_SUITE_P(Every, Dataset, ::testing::ValuesIn(kDatasets),
                         [](const auto& info) { return TestName(info.param); });

}  // namespace
}  // namespace raybench::testing
