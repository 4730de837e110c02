// NFF: every entity, errors that name the line, damaged files. The SPD's files stand
// in tests/tracer/spd_test.cpp.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/datasets.h"

namespace raybench {
namespace {

using ::testing::EndsWith;
using ::testing::HasSubstr;

constexpr char kAll[] =
    "# a comment\n"
    "b 0.1 0.2 0.3\n"
    "v\nfrom 0 -8 0\nat 0 0 0 # the middle\nup 0 0 1\nangle 90\nhither 0.1\nresolution 512 512\n"
    "l 1 2 3\n"
    "l 4 5 6 0.25 0.5 0.75\n"
    "s 9 9 9 1\n"
    "f 1 0.5 0.25 0.5 0.2 17 0.3 1.4\n"
    "s 1 2 3 -0.5\n"
    "c\n0 0 0 1\n0 0 2 0.5\n"
    "p 3\n0 0 0\n1 0 0\n0 1 0\n"
    "f 0 0 1 1 0 0 0 0\n"
    "p 4\n0 0 0\n1 0 0\n1 -1 0\n0 -1 0\n"
    "pp 5\n0 0 1 0 0 1\n1 0 1 0 0 1\n1 1 1 0 0 1\n.5 1.5 1 0 0 1\n0 1 1 0 0 2\n"
    "pp 3\n0 0 1 0 0 1\n1 0 1 0 0 1\n+0 -1e0 1 0 0 1\n";

TEST(NffTest, ReadsEveryEntity) {
  ScratchDirectory files;
  const Scene s = LoadScene(files.Write("all.NFF", kAll));
  EXPECT_EQ(s.background, (Vec3f{0.1f, 0.2f, 0.3f}));
  ASSERT_EQ(s.cameras.size(), 1u);
  EXPECT_EQ(s.cameras[0].eye, (Vec3f{0, -8, 0}));
  EXPECT_FLOAT_EQ(s.cameras[0].tan_half_fov, 1);
  ASSERT_EQ(s.lights.size(), 2u);
  EXPECT_FLOAT_EQ(s.lights[0].intensity.x, 0.70710678f);
  EXPECT_EQ(s.lights[1].intensity, (Vec3f{0.25f, 0.5f, 0.75f}));
  EXPECT_EQ(s.lights[1].position, (Vec3f{4, 5, 6}));
  ASSERT_EQ(s.spheres.size(), 2u);
  EXPECT_EQ(s.spheres[1].radius, -0.5f);
  ASSERT_EQ(s.cones.size(), 1u);
  EXPECT_EQ(s.cones[0].apex, (Vec3f{0, 0, 2}));
  EXPECT_EQ(s.cones[0].apex_radius, 0.5f);
  ASSERT_EQ(s.triangles.size(), 2u);
  EXPECT_EQ(s.triangle_face, (std::vector<uint32_t>{0, 3}));
  ASSERT_EQ(s.polygons.size(), 2u);
  EXPECT_EQ(s.polygons[1].count, 5u);
  EXPECT_EQ(s.stats.faces, 4u);
  EXPECT_EQ(s.primitive_count(), 7u);

  ASSERT_EQ(s.materials.size(), 3u);
  const Material& glass = s.materials[s.MaterialOf(3)];
  EXPECT_EQ(glass.diffuse, (Vec3f{0.5f, 0.25f, 0.125f}));
  EXPECT_EQ(glass.specular, (Vec3f{0.2f, 0.2f, 0.2f}));
  EXPECT_EQ(glass.reflect, (Vec3f{0.2f, 0.2f, 0.2f}));
  EXPECT_EQ(glass.transmit, (Vec3f{0.3f, 0.3f, 0.3f}));
  EXPECT_EQ(glass.shininess, 17);
  EXPECT_EQ(glass.ior, 1.4f);
  EXPECT_EQ(s.materials[s.MaterialOf(2)].name, "default") << "before the first f";
  EXPECT_EQ(s.materials[s.MaterialOf(6)].diffuse, (Vec3f{0, 0, 1}));
  EXPECT_EQ(s.materials[s.MaterialOf(0)].name, glass.name);

  // Neighbours share what is equal: 2 of the first polygon with the triangle, 2 of the second patch with the
  // first. Another normal makes another vertex.
  EXPECT_EQ(s.positions.size(), 3u + 2 + 5 + 1);
  ASSERT_EQ(s.normals.size(), s.positions.size());
  EXPECT_EQ(s.triangles[0][1], s.polygon_vertices[1]);
  EXPECT_EQ(s.triangles[1][0], s.polygon_vertices[4]);
  EXPECT_EQ(s.normals[s.triangles[0][0]], (Vec3f{0, 0, 0}));
  EXPECT_EQ(s.normals[s.polygon_vertices[8]], (Vec3f{0, 0, 2}));
}

TEST(NffTest, FilesWithoutPatchesHaveNoNormals) {
  ScratchDirectory files;
  const Scene s = LoadScene(files.Write("a.nff", "p 3 0 0 0 1 0 0 0 1 0\np 3 0 0 0 1 0 0 0 0 1"));
  EXPECT_TRUE(s.normals.empty());
  EXPECT_EQ(s.positions.size(), 4u);
  EXPECT_TRUE(s.automatic_camera);
  EXPECT_TRUE(s.automatic_lights);
}

TEST(NffTest, ErrorsNameTheLine) {
  ScratchDirectory files;
  const std::pair<const char*, const char*> cases[] = {
      {"q 1\n", "line 1: unknown entity 'q'; allowed are v (camera), b (background)"},
      {"s 0 0 0 1\n\n# x\ntt 1", "line 4: unknown entity 'tt'"},
      {"s 0 0 0\n", "line 2: the file ends where the radius of the sphere should stand"},
      {"s 0 0\nzero 1\n", "line 2: the z of the sphere is 'zero'; a number is needed"},
      {"s 0 0 0 0\n", "line 1: the sphere has centre (0, 0, 0) and radius 0"},
      {"s 0 0 nan 1\n", "line 1: the z of the sphere is not finite"},
      {"s 0 0 1e39 1\n", "line 1: the z of the sphere is not finite, or too large for a float"},
      {"c 0 0 0 1\n0 0 0 1\n", "line 2: the cone goes from (0, 0, 0) with radius 1 to (0, 0, 0)"},
      {"p 2\n", "line 1: the polygon p has '2' corners; a number of at least 3 is needed"},
      {"p -3\n", "the polygon p has '-3' corners"},
      {"p 3.5\n", "the polygon p has '3.5' corners"},
      {"pp\n", "line 2: the file ends where the number of corners of the patch pp should stand"},
      {"p 4000000000\n0 0 0\n",
       "line 1: the polygon p has 4000000000 corners, more than the rest of the file"},
      {"p 99999999999999999999\n", "the polygon p has '99999999999999999999' corners"},
      {"p 3\n0 0 0\n1 0 0\n0 1 x\n", "line 4: the z of the corner is 'x'"},
      {"f 1 1 1 -1 0 0 0 0\n", "line 1: the Kd of the material is -1; at least 0 is needed"},
      {"b 1 -1 0\n", "the colour of the background is negative"},
      {"l 1 2\n", "line 2: the file ends where the z of the light should stand"},
      {"l 1 2 3 4\n", "the green of the light"},
      {"v\nfrom 0 0 1\nup 0 0 1\n", "line 3: a camera needs 'at' here, not 'up'"},
      {"v from 0 0 1 at 0 0 0 up 0 0 1 angle 45 hither 1 resolution 8 8", "the camera looks nowhere"},
      {"v from 0 0 1 at 0 0 0 up 0 1 0 angle 180 hither 1 resolution 8 8", "the angle of the camera is 180"},
      {"v from 0 0 1 at 0 0 0 up 0 1 0 angle 45 hither 1 resolution 0 8",
       "the width of the picture is below 1"},
      {"v from 0 0 1 at 0 0 0", "the file ends within a camera, where 'up' should stand"},
      {"# nothing\n", "has no primitives"},
      {"b 0 0 0\n", "has no primitives"},
  };
  for (const auto& [text, expected] : cases)
    EXPECT_THAT(LoadError(files.Write("bad.nff", text)), HasSubstr(expected)) << text;
  EXPECT_THAT(LoadError(files.Write("empty.nff", "")), EndsWith("is empty"));
  EXPECT_THAT(LoadError(files.path() / "none.nff"), EndsWith("no such file"));
}

TEST(NffTest, DropsWhatIsBadWhenAsked) {
  ScratchDirectory files;
  LoadOptions options;
  options.drop_bad = true;
  const Scene s =
      LoadScene(files.Write("bad.nff",
                            "s 0 0 nan 1\ns 0 0 0 1\nc 0 0 0 1 0 0 0 1\np 4 0 0 0 1 0 0 1 1 inf 0 1 0\n"
                            "p 3 0 0 0 1 0 0 1 1e99 0\np 3 0 0 0 1 0 0 0 1 0\n"),
                options);
  EXPECT_EQ(s.spheres.size(), 1u);
  EXPECT_EQ(s.triangles.size(), 1u);
  EXPECT_EQ(s.procedural_count(), 1u);
  EXPECT_EQ(s.stats.dropped_triangles, 4u);
}

TEST(NffTest, SurvivesDamage) {
  ScratchDirectory files;
  EXPECT_GT(CountRefusedMutations(files, "damaged.nff", kAll, 1000), 200);
  for (size_t length = 0; length < sizeof kAll - 1; length += 3) {
    const std::string path = files.Write("short.nff", std::string(kAll, length));
    try {
      LoadScene(path);
    } catch (const InputError& e) {
      EXPECT_TRUE(std::string(e.what()).starts_with(path + ": ")) << e.what();
    }
  }
}

TEST(NffTest, ManyVerticesAreMerged) {
  // A lattice of quads: each inner vertex belongs to four.
  constexpr int kSide = 200;
  std::string text;
  for (int y = 0; y < kSide; ++y)
    for (int x = 0; x < kSide; ++x) {
      text += "p 4\n";
      for (const auto& [dx, dy] : {std::pair{0, 0}, {1, 0}, {1, 1}, {0, 1}})
        text += std::to_string(x + dx) + " " + std::to_string(y + dy) + " 0\n";
    }
  ScratchDirectory files;
  double last = 0;
  LoadOptions options;
  options.progress = [&](double fraction) {
    EXPECT_GE(fraction, last);
    last = fraction;
  };
  const Scene s = LoadScene(files.Write("lattice.nff", text), options);
  EXPECT_EQ(last, 1);
  EXPECT_EQ(s.polygons.size(), size_t(kSide * kSide));
  EXPECT_EQ(s.positions.size(), size_t((kSide + 1) * (kSide + 1)));
}

}  // namespace
}  // namespace raybench
