// The generated Standard Procedural Databases against the files that Haines' programs print: every primitive,
// material, light and camera, to the six digits that are printed; and without these files, counts, digests
// and a few printed primitives.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/datasets.h"
#include "tests/support/shared_data.h"

namespace raybench {
namespace {

struct Database {
  const char* name;
  uint64_t triangles, spheres, cones, polygons;
  const char* hash;
};
void PrintTo(const Database& d, std::ostream* out) { *out << d.name; }

// Primitives at the published sizes: Haines 1987, and the tables in the programs' sources.
constexpr Database kDatabases[] = {
    {"balls", 0, 7381, 0, 1, "aa070fe9c04e474c"},      {"gears", 0, 0, 0, 9345, "b376bc50a7ba51b7"},
    {"lattice", 0, 2197, 6084, 0, "b4b9bd14f5ded0d7"}, {"mount", 8192, 4, 0, 0, "0f34826a0ae12786"},
    {"rings", 0, 4200, 4200, 1, "fedb18175d47b1b8"},   {"teapot", 9120, 0, 0, 144, "0aba46bd68eab035"},
    {"tetra", 4096, 0, 0, 0, "84356fc1fc091b53"},      {"tree", 0, 4095, 4095, 1, "00453ae0a385943d"},
};

/// Half a unit in the sixth digit of x, and the error of a float; below 1e-12 both programs have only the
/// noise of sums that should be 0.
double HalfUnit(double x) {
  x = std::abs(x);
  return x < 1e-12 ? 1e-12 : 0.5 * std::pow(10, std::floor(std::log10(x)) - 5) + x * 0x1p-23;
}
bool IsPrintedAs(float value, float printed) {
  return std::abs(double(value) - printed) <= HalfUnit(std::max(std::abs(value), std::abs(printed)));
}
bool IsPrintedAs(Vec3f value, Vec3f printed) {
  return IsPrintedAs(value.x, printed.x) && IsPrintedAs(value.y, printed.y) &&
         IsPrintedAs(value.z, printed.z);
}
bool IsPrintedAs(const Sphere& value, const Sphere& printed) {
  return IsPrintedAs(value.center, printed.center) && IsPrintedAs(value.radius, printed.radius);
}
bool IsPrintedAs(const Cone& value, const Cone& printed) {
  return IsPrintedAs(value.base, printed.base) && IsPrintedAs(value.base_radius, printed.base_radius) &&
         IsPrintedAs(value.apex, printed.apex) && IsPrintedAs(value.apex_radius, printed.apex_radius);
}
/// Products of two printed numbers have twice their relative error.
bool IsProductOfPrinted(Vec3f value, Vec3f printed) {
  for (int k = 0; k < 3; ++k)
    if (std::abs(value[k] - printed[k]) > 1.1e-5f * printed[k]) return false;
  return true;
}

class Spd : public ::testing::TestWithParam<Database> {};

TEST_P(Spd, HasThePublishedPrimitives) {
  const Database& d = GetParam();
  const Scene scene = LoadScene(d.name);
  EXPECT_EQ(scene.triangles.size(), d.triangles);
  EXPECT_EQ(scene.spheres.size(), d.spheres);
  EXPECT_EQ(scene.cones.size(), d.cones);
  EXPECT_EQ(scene.polygons.size(), d.polygons);
  EXPECT_EQ(scene.hash(), d.hash);
  EXPECT_EQ(scene.stats.degenerate_triangles, 0u);
  EXPECT_TRUE(scene.stats.notes.empty());
  EXPECT_FALSE(scene.automatic_camera || scene.automatic_lights);
}

TEST_P(Spd, IsTheFileThatTheProgramPrints) {
  const std::filesystem::path file = testing::SharedData() / "spd" / (GetParam().name + std::string(".nff"));
  if (!std::filesystem::exists(file)) GTEST_SKIP() << testing::NotCompared(file);
  const Scene made = LoadScene(GetParam().name), printed = LoadScene(file);

  ASSERT_EQ(made.triangles.size(), printed.triangles.size());
  ASSERT_EQ(made.normals.empty(), printed.normals.empty());
  for (size_t i = 0; i < made.triangles.size(); ++i)
    for (size_t k = 0; k < 3; ++k) {
      const uint32_t a = made.triangles[i][k], b = printed.triangles[i][k];
      ASSERT_TRUE(IsPrintedAs(made.positions[a], printed.positions[b]))
          << "triangle " << i << ", corner " << k;
      if (made.normals.empty()) continue;
      ASSERT_TRUE(IsPrintedAs(made.normals[a], printed.normals[b])) << "triangle " << i << ", corner " << k;
    }
  ASSERT_EQ(made.spheres.size(), printed.spheres.size());
  for (size_t i = 0; i < made.spheres.size(); ++i)
    ASSERT_TRUE(IsPrintedAs(made.spheres[i], printed.spheres[i])) << "sphere " << i;
  ASSERT_EQ(made.cones.size(), printed.cones.size());
  for (size_t i = 0; i < made.cones.size(); ++i)
    ASSERT_TRUE(IsPrintedAs(made.cones[i], printed.cones[i])) << "cone " << i;
  ASSERT_EQ(made.polygons.size(), printed.polygons.size());
  for (size_t i = 0; i < made.polygons.size(); ++i) {
    const auto a = made.CornersOf(made.polygons[i]), b = printed.CornersOf(printed.polygons[i]);
    ASSERT_EQ(a.size(), b.size()) << "polygon " << i;
    for (size_t k = 0; k < a.size(); ++k)
      ASSERT_TRUE(IsPrintedAs(made.positions[a[k]], printed.positions[b[k]]))
          << "polygon " << i << ", corner " << k;
  }

  for (uint32_t i = 0; i < made.primitive_count(); ++i) {
    const Material &a = made.materials[made.MaterialOf(i)], &b = printed.materials[printed.MaterialOf(i)];
    ASSERT_TRUE(IsProductOfPrinted(a.diffuse, b.diffuse)) << "primitive " << i;
    ASSERT_EQ(a.specular, b.specular) << "primitive " << i;
    ASSERT_EQ(a.reflect, b.reflect) << "primitive " << i;
    ASSERT_EQ(a.transmit, b.transmit) << "primitive " << i;
    ASSERT_TRUE(IsPrintedAs(a.shininess, b.shininess)) << "primitive " << i;
    ASSERT_EQ(a.ior, b.ior) << "primitive " << i;
  }
  EXPECT_EQ(made.background, printed.background);
  EXPECT_EQ(made.ambient, printed.ambient);
  ASSERT_EQ(made.lights.size(), printed.lights.size());
  for (size_t i = 0; i < made.lights.size(); ++i) {
    EXPECT_TRUE(IsPrintedAs(made.lights[i].position, printed.lights[i].position)) << i;
    EXPECT_EQ(made.lights[i].intensity, printed.lights[i].intensity) << i;
    EXPECT_EQ(made.lights[i].kind, LightKind::kPoint);
    EXPECT_FALSE(made.lights[i].falloff);
  }
  ASSERT_EQ(made.cameras.size(), 1u);
  ASSERT_EQ(printed.cameras.size(), 1u);
  const Camera &a = made.cameras[0], &b = printed.cameras[0];
  EXPECT_TRUE(IsPrintedAs(a.eye, b.eye));
  EXPECT_TRUE(IsPrintedAs(a.at, b.at));
  EXPECT_TRUE(IsPrintedAs(a.up, b.up));
  EXPECT_EQ(a.tan_half_fov, b.tan_half_fov);
}

INSTANTIATE_TEST_SUITE_P(Databases, Spd, ::testing::ValuesIn(kDatabases),
                         [](const auto& info) { return std::string(info.param.name); });

// Three databases have no file beside the sources; these primitives are what the programs of SPD 3.15 print.
TEST(SpdTest, SpheresAreWhereTheProgramsPutThem) {
  const struct {
    const char* scene;
    size_t index;
    Sphere sphere;
  } expected[] = {
      {"lattice", 0, {{0, 0, 0}, 0.0208333f}},
      {"lattice", 731, {{0.333333f, 0.333333f, 0.25f}, 0.0208333f}},
      {"lattice", 2196, {{1, 1, 1}, 0.0208333f}},
      {"rings", 0, {{0.930995f, 2.61313f, 0}, 0.07412f}},
      {"rings", 1399, {{-2.28769f, 13.4616f, 1.20805f}, 0.07412f}},
      {"rings", 2799, {{-1.5345f, 18.1406f, -6.79195f}, 0.07412f}},
      {"rings", 4199, {{6, 17.8024f, 5.20805f}, 0.07412f}},
      {"tree", 0, {{0, 0, 1}, 0.1005f}},
      {"tree", 1364, {{0.775925f, -0.790863f, 2.17818f}, 0.00408098f}},
      {"tree", 2729, {{-1.22361f, 0.321279f, 2.10867f}, 0.00183195f}},
      {"tree", 4094, {{-0.306913f, 0.537715f, 3.13626f}, 0.00122741f}},
  };
  for (const auto& [name, index, sphere] : expected)
    EXPECT_TRUE(IsPrintedAs(LoadScene(name).spheres[index], sphere)) << name << " " << index;
}

TEST(SpdTest, ConesAreWhereTheProgramsPutThem) {
  const struct {
    const char* scene;
    size_t index;
    Cone cone;
  } expected[] = {
      {"lattice", 0, {{0.0103125f, 0, 0}, 0.00520833f, {0.0730208f, 0, 0}, 0.00520833f}},
      {"lattice",
       4055,
       {{0.666667f, 0.416667f, 0.426979f}, 0.00520833f, {0.666667f, 0.416667f, 0.489687f}, 0.00520833f}},
      {"lattice", 6083, {{1, 1, 0.926979f}, 0.00520833f, {1, 1, 0.989688f}, 0.00520833f}},
      {"rings", 0, {{0.930995f, 2.61313f, 0}, 0.07412f, {0.287693f, 1.7277f, 0}, 0.07412f}},
      {"rings", 2799, {{-1.5345f, 18.1406f, -6.79195f}, 0.07412f, {-2.4655f, 17.6512f, -6.48945f}, 0.07412f}},
      {"rings", 4199, {{6, 17.8024f, 5.20805f}, 0.07412f, {5.24681f, 18.5366f, 5.51055f}, 0.07412f}},
      {"tree", 0, {{0, 0, 0}, 0.15f, {0, 0, 1}, 0.1005f}},
      {"tree",
       1364,
       {{0.800928f, -0.761993f, 2.15873f}, 0.00609102f, {0.775925f, -0.790863f, 2.17818f}, 0.00408098f}},
      {"tree",
       4094,
       {{-0.306619f, 0.53784f, 3.11649f}, 0.00183195f, {-0.306913f, 0.537715f, 3.13626f}, 0.00122741f}},
  };
  for (const auto& [name, index, cone] : expected)
    EXPECT_TRUE(IsPrintedAs(LoadScene(name).cones[index], cone)) << name << " " << index;
}

// Sizes that are not published: as many as the sources' tables say.
TEST(SpdTest, OtherSizes) {
  EXPECT_EQ(LoadScene("balls(size=2)").spheres.size(), 91u);
  EXPECT_EQ(LoadScene("gears(size=2)").polygons.size(), 16u + 1152 + 1);
  EXPECT_EQ(LoadScene("lattice(size=3)").cones.size(), 144u);
  EXPECT_EQ(LoadScene("mount(size=3)").triangles.size(), 128u);
  EXPECT_EQ(LoadScene("mount(size=9)").triangles.size(), 524288u);
  EXPECT_EQ(LoadScene("rings(size=2)").cones.size(), 150u);
  EXPECT_EQ(LoadScene("teapot(size=3)").triangles.size(), 552u);
  EXPECT_EQ(LoadScene("teapot(size=50)").stats.degenerate_triangles, 0u);
  EXPECT_EQ(LoadScene("tetra(size=2)").triangles.size(), 16u);
  EXPECT_EQ(LoadScene("tree(size=3)").cones.size(), 15u);
}

TEST(SpdTest, BranchesGrowFromTheEndOfBranches) {
  const Scene scene = LoadScene("tree(size=6)");
  // Depth-first: a branch is followed by its two, each with its own.
  auto check = [&](auto&& self, size_t i, int generations) -> size_t {
    const Cone& parent = scene.cones[i];
    EXPECT_EQ(scene.spheres[i].center, parent.apex);
    EXPECT_EQ(scene.spheres[i].radius, parent.apex_radius);
    ++i;
    for (int k = 0; generations > 0 && k < 2; ++k) {
      EXPECT_EQ(scene.cones[i].base, parent.apex);
      EXPECT_EQ(scene.cones[i].base_radius, parent.apex_radius);
      i = self(self, i, generations - 1);
    }
    return i;
  };
  EXPECT_EQ(check(check, 0, 6), scene.cones.size());
}

// No triangle uses the last corner where a patch begins in a point. Every point on the seam between two
// patches of a round is, to the bit, on both.
TEST(SpdTest, TeapotPatchesShareTheirEdges) {
  constexpr uint32_t kSize = 7, kRow = kSize + 1, kGround = kRow * kRow;
  const Scene scene = LoadScene("teapot(size=7)");
  ASSERT_EQ(scene.positions.size(), kGround + 32 * kRow * kRow);
  auto edge = [&](uint32_t patch, bool last, uint32_t i) {
    return scene.positions[kGround + (patch * kRow + i) * kRow + (last ? kSize : 0)];
  };
  // Patches come in rounds of four, of the handle and the spout of two.
  for (uint32_t patch = 0; patch < 32; ++patch) {
    const bool is_tube = patch >= 12 && patch < 20;
    const uint32_t round = is_tube ? 2 : 4, next = patch / round * round + (patch + 1) % round;
    const bool begins_in_point = (patch >= 20 && patch < 24) || patch >= 28;
    for (uint32_t i = begins_in_point; i < kRow; ++i)
      EXPECT_EQ(edge(patch, true, i), edge(next, false, i)) << patch << " " << i;
  }
}

TEST(SpdTest, WhatCannotBeHeldIsRefused) {
  EXPECT_NE(LoadError("teapot(size=1)").find("2"), std::string::npos);
  EXPECT_NE(LoadError("balls(size=10)").find("9"), std::string::npos);
}

}  // namespace
}  // namespace raybench
