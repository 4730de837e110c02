// The Standard Procedural Databases (Haines 1987) at their default sizes: as many primitives and as many
// camera rays that hit as published for them (Havran and Sixta 1999), through every structure that takes
// them; and all rays of a picture by the databases' rules, as many as an independent check in double counted.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <iostream>

#include "tests/support/shared_data.h"
#include "tests/support/tracer.h"

namespace raybench::testing {
namespace {

struct Database {
  const char* name;
  uint64_t primitives, polygons, spheres, hits;
  uint64_t shadow, blocked, secondary, secondary_hits;  ///< by the check
};
void PrintTo(const Database& d, std::ostream* out) { *out << d.name; }

class Spd : public ::testing::TestWithParam<Database> {};

/// Rays through the corners of 512 x 512 pixels that span the camera's angle both ways.
std::vector<rb_ray> CornerRays(const Camera& camera) {
  constexpr int kSide = 512;
  const Vec3d forward = Normalize(ToDouble(camera.at) - ToDouble(camera.eye));
  const Vec3d right = Normalize(Cross(forward, ToDouble(camera.up))), up = Cross(right, forward);
  std::vector<rb_ray> rays;
  for (int y = 0; y <= kSide; ++y)
    for (int x = 0; x <= kSide; ++x) {
      const double u = (2.0 * x / kSide - 1) * camera.tan_half_fov,
                   v = (1 - 2.0 * y / kSide) * camera.tan_half_fov;
      const Vec3f d = ToFloat(forward + right * u + up * v);
      rays.push_back({{camera.eye.x, camera.eye.y, camera.eye.z}, 1e-6f, {d.x, d.y, d.z}, INFINITY});
    }
  return rays;
}

TEST_P(Spd, HasThePublishedCounts) {
  const std::filesystem::path file = SharedData() / "spd" / (std::string(GetParam().name) + ".nff");
  if (!std::filesystem::exists(file)) GTEST_SKIP() << testing::NotCompared(file);
  const Scene scene = LoadScene(file);
  EXPECT_EQ(scene.primitive_count(), GetParam().primitives);
  EXPECT_EQ(scene.polygons.size(), GetParam().polygons);
  EXPECT_EQ(scene.spheres.size(), GetParam().spheres);
  EXPECT_EQ(scene.stats.degenerate_triangles, 0u);
  ASSERT_EQ(scene.cameras.size(), 1u);
  EXPECT_FALSE(scene.automatic_lights);

  const std::vector<rb_ray> rays = CornerRays(scene.cameras[0]);
  for (const char* structure : {"bvh_sah", "embree"}) {
    std::vector<rb_hit> hits(rays.size());
    rb_query query{};
    query.struct_size = sizeof query, query.n = rays.size(), query.rays = rays.data(),
    query.hits = hits.data();
    const Registry registry;
    if (std::none_of(registry.structures().begin(), registry.structures().end(),
                     [&](const rb_structure* s) { return std::string_view(s->name) == structure; }))
      continue;  // a build without Embree
    QueryParallel(BuildTree(scene, structure), query, 0);
    const auto count =
        std::count_if(hits.begin(), hits.end(), [](const rb_hit& hit) { return hit.prim != RAYBENCH_NONE; });
    EXPECT_NEAR(double(count), double(GetParam().hits), 3) << structure;
  }
}

TEST_P(Spd, SendsAsManyRaysAsTheCheck) {
  const Database& expected = GetParam();
  const std::filesystem::path file = SharedData() / "spd" / (std::string(expected.name) + ".nff");
  if (!std::filesystem::exists(file)) GTEST_SKIP() << testing::NotCompared(file);
  const Scene scene = LoadScene(file);
  const TraceResult result =
      Trace(scene, BuildTree(scene, "bvh_sah(numerics=double)"),
            {.sampling = {.pattern = SamplePattern::kCorners}, .rules = TraceRules::kSpd});
  EXPECT_EQ(result.camera_rays, 513u * 513);
  EXPECT_NEAR(double(result.camera_hits), double(expected.hits), 3);
  const auto expect = [](const char* what, uint64_t actual, uint64_t check) {
    std::cout << "  " << what << ": " << actual << ", check " << check << "\n";
    EXPECT_NEAR(double(actual), double(check), 0.005 * double(check)) << what;
  };
  expect("shadow rays", result.shadow_rays, expected.shadow);
  expect("blocked", result.shadow_blocked, expected.blocked);
  expect("secondary rays", result.reflection_rays + result.refraction_rays, expected.secondary);
  expect("secondary rays that hit", result.reflection_hits + result.refraction_hits, expected.secondary_hits);
}

INSTANTIATE_TEST_SUITE_P(
    Databases, Spd,
    ::testing::Values(Database{"balls", 7382, 1, 7381, 263169, 954980, 287616, 175932, 126792},
                      Database{"gears", 9345, 9345, 0, 245332, 2126702, 840010, 506382, 384049},
                      Database{"mount", 8196, 0, 4, 173686, 363349, 77116, 712356, 476908},
                      Database{"teapot", 9264, 144, 0, 161546, 406401, 35156, 226182, 67616},
                      Database{"tetra", 4096, 0, 0, 49950, 46261, 5557, 0, 0}),
    [](const auto& info) { return std::string(info.param.name); });

}  // namespace
}  // namespace raybench::testing
