// The modifiers decimate and scale: what is left, what follows the faces, what they refuse.

#include <gmock/gmock.h>

#include <set>

#include "accel/base/parallel.h"
#include "datasets/scene/facts.h"
#include "tests/support/datasets.h"

namespace raybench {
namespace {

using ::testing::HasSubstr;

std::string Decimate(const std::string& scene, const std::string& keep) {
  return "decimate(" + scene + ",keep=" + keep + ")";
}

TEST(DecimateTest, KeepsTheShareAskedForAndClosedStaysClosed) {
  for (const char* name :
       {"icosphere(level=3)", "terrain_box(n=12)", "menger(depth=2)", "shells(size=3000)"}) {
    const Scene before = LoadScene(name);
    ASSERT_TRUE(Examine(before).closed()) << name;
    for (const double keep : {0.5, 0.2}) {
      if (keep < 0.5 && std::string(name) == "menger(depth=2)")
        continue;  // tunnels need 770 of its 2112 triangles
      const Scene after = LoadScene(Decimate(name, std::to_string(keep)));
      const double wanted = keep * double(before.triangles.size());
      EXPECT_LE(double(after.triangles.size()), wanted + 1) << name;
      EXPECT_GE(double(after.triangles.size()), wanted - 2) << name;
      EXPECT_TRUE(Examine(after).closed()) << name << " " << keep;
      EXPECT_EQ(after.stats.degenerate_triangles, 0u) << name;
    }
  }
}

TEST(DecimateTest, VerticesAreTheScenes) {
  const Scene before = LoadScene("terrain(size=2000)"),
              after = LoadScene(Decimate("terrain(size=2000)", "0.1"));
  std::set<std::array<float, 3>> there;
  for (Vec3f p : before.positions) there.insert({p.x, p.y, p.z});
  for (Vec3f p : after.positions) EXPECT_TRUE(there.contains({p.x, p.y, p.z}));
  EXPECT_LT(after.positions.size(), before.positions.size() / 5);
  EXPECT_EQ(LoadScene(Decimate("terrain(size=2000)", "1")).triangles.size(), before.triangles.size());
  EXPECT_EQ(LoadScene("decimate(icosphere(level=3),triangles=100)").triangles.size(), 100u);
}

TEST(DecimateTest, FlatFacesGoFirst) {
  // A box of 6 x 2 x 64 triangles is 12 triangles; its corners must be left.
  const Scene box = LoadScene("decimate(menger(depth=0),triangles=12)");
  EXPECT_EQ(box.triangles.size(), 12u);
  const Scene sponge = LoadScene("menger(depth=2)"), less = LoadScene(Decimate("menger(depth=2)", "0.7"));
  EXPECT_EQ(less.bounds().lo, sponge.bounds().lo);
  EXPECT_EQ(less.bounds().hi, sponge.bounds().hi);
}

TEST(DecimateTest, MaterialsAndFacesFollow) {
  const Scene before = LoadScene("shells(size=2000)"),
              after = LoadScene(Decimate("shells(size=2000)", "0.3"));
  ASSERT_EQ(after.materials.size(), before.materials.size());
  for (size_t i = 0; i < after.triangles.size(); ++i) {
    EXPECT_EQ(after.triangle_material[i], before.triangle_material[after.triangle_face[i]]);
    // Each shell is of one material.
    const double r = Length(ToDouble(after.positions[after.triangles[i][0]]));
    EXPECT_EQ(after.materials[after.triangle_material[i]].name,
              "shell " + std::to_string(std::lround(r * 4)));
  }
  EXPECT_EQ(after.name, "decimate(shells(size=2000),keep=0.3)");
  EXPECT_THAT(after.provenance.source, HasSubstr(") of generator shells"));
}

TEST(DecimateTest, RefusesWhatHalfEdgesCannotHold) {
  const ScratchDirectory files;
  const std::string book = files.Write(
      "book.obj",
      "v 0 0 0\nv 0 0 1\nv 1 0 0\nv -1 0 0\nv 0 1 0\nf 1 2 3\nf 2 1 4\nf 1 2 5\n");  // three pages
  const std::string error = LoadError("decimate(" + book + ")");
  EXPECT_THAT(error, HasSubstr("decimate: book.obj: 1 of 3 faces are not manifold"));
  EXPECT_THAT(error, HasSubstr("--drop-bad"));
  EXPECT_THAT(LoadError("decimate(sphereflake(depth=1,tessellation=0))"),
              HasSubstr("only triangles can be decimated"));
  EXPECT_THAT(LoadError("decimate(icosphere,keep=2)"), HasSubstr("keep"));
  // A tetrahedron has nothing to give.
  const std::string four =
      files.Write("four.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n");
  const Scene scene = LoadScene(Decimate(four, "0.25"));
  EXPECT_EQ(scene.triangles.size(), 4u);
  ASSERT_EQ(scene.stats.notes.size(), 1u);
  EXPECT_THAT(scene.stats.notes[0], HasSubstr("stops at 4 of 1 triangles"));
}

TEST(DecimateTest, SameAtAnyNumberOfThreads) {
  const std::string name = Decimate("stadium(size=500)", "0.3"), hash = LoadScene(name).hash();
  const ThreadLimit one(1);
  EXPECT_EQ(LoadScene(name).hash(), hash);
}

TEST(ScaleTest, MultipliesAllThatHasALength) {
  const Scene before = LoadScene("sphereflake(depth=1,tessellation=0)"),
              after = LoadScene("scale(sphereflake(depth=1,tessellation=0),factor=1e3)");
  ASSERT_EQ(after.spheres.size(), before.spheres.size());
  for (size_t i = 0; i < after.spheres.size(); ++i) {
    EXPECT_EQ(after.spheres[i].radius, float(before.spheres[i].radius * 1e3));
    EXPECT_EQ(after.spheres[i].center.x, float(before.spheres[i].center.x * 1e3));
  }
  EXPECT_EQ(after.cameras[0].eye.z, float(before.cameras[0].eye.z * 1e3));
  const Scene ball = LoadScene("icosphere(level=1)"),
              small = LoadScene("scale(icosphere(level=1),factor=1e-6)");
  for (size_t i = 0; i < ball.positions.size(); ++i)
    EXPECT_EQ(small.positions[i].y, float(double(ball.positions[i].y) * 1e-6));
  EXPECT_EQ(small.triangles, ball.triangles);
  EXPECT_EQ(LoadScene("scale(icosphere(level=1))").hash(), ball.hash());
}

}  // namespace
}  // namespace raybench
