// The procedural scenes: exact counts, closed meshes, the same on every run and at any thread count.

#include <gmock/gmock.h>
#include <tbb/global_control.h>

#include <map>

#include "datasets_testing.h"

namespace raybench {
namespace {

using testing::HasSubstr;

/// True if each edge is used once in each direction and every vertex is used.
bool IsClosed(const Scene& scene) {
  std::map<std::pair<uint32_t, uint32_t>, int> edges;
  std::vector<bool> used(scene.positions.size());
  for (const std::array<uint32_t, 3>& t : scene.triangles)
    for (int k = 0; k < 3; ++k) {
      uint32_t a = t[size_t(k)], b = t[size_t((k + 1) % 3)];
      used[a] = true;
      if (++edges[{a, b}] != 1) return false;
    }
  for (const auto& [edge, count] : edges)
    if (!edges.count({edge.second, edge.first})) return false;
  return std::count(used.begin(), used.end(), false) == 0;
}

/// Volume by the divergence theorem: positive if triangles are counter-clockwise seen from outside.
double Volume(const Scene& scene) {
  double sum = 0;
  for (size_t i = 0; i < scene.triangles.size(); ++i) {
    auto [a, b, c] = Corners(scene, i);
    sum += Dot(ToDouble(a), Cross(ToDouble(b), ToDouble(c))) / 6;
  }
  return sum;
}

TEST(IcosphereTest, IsAClosedUnitSphere) {
  for (int level : {0, 1, 2, 3, 5}) {
    Scene scene = LoadScene("icosphere(level=" + std::to_string(level) + ")");
    EXPECT_EQ(scene.triangles.size(), 20u << (2 * level));
    EXPECT_EQ(scene.positions.size(), (10u << (2 * level)) + 2);
    EXPECT_EQ(scene.stats.degenerate_triangles, 0u);
    EXPECT_TRUE(IsClosed(scene)) << level;
    EXPECT_GT(Volume(scene), 2.5);
    EXPECT_LT(Volume(scene), 4.1888);
    for (Vec3f p : scene.positions) {
      EXPECT_NEAR(Length(ToDouble(p)), 1, 2e-7);
      EXPECT_TRUE(p.x != 0 && p.y != 0 && p.z != 0);
    }
  }
}

TEST(TerrainBoxTest, IsClosed) {
  for (int n : {1, 2, 3, 40}) {
    Scene scene = LoadScene("terrain_box(n=" + std::to_string(n) + ")");
    EXPECT_EQ(scene.triangles.size(), size_t(2 * n * n + 12 * n));
    EXPECT_EQ(scene.stats.degenerate_triangles, 0u);
    EXPECT_TRUE(IsClosed(scene)) << n;
    EXPECT_NEAR(Volume(scene), 3.2, 0.8);
  }
}

TEST(SphereflakeTest, Counts) {
  EXPECT_EQ(LoadScene("sphereflake").triangles.size(), 100882u);
  EXPECT_EQ(LoadScene("sphereflake(depth=0,tessellation=1)").triangles.size(), 82u);
  EXPECT_EQ(LoadScene("sphereflake(depth=2,tessellation=2)").triangles.size(), 2 + 320u + 9 * 80 + 81 * 20);
  for (int depth = 0; depth <= 4; ++depth) {
    Scene scene = LoadScene("sphereflake(tessellation=0,depth=" + std::to_string(depth) + ")");
    size_t spheres = 0, power = 1;
    for (int g = 0; g <= depth; ++g, power *= 9) spheres += power;
    EXPECT_EQ(scene.spheres.size(), spheres);
    EXPECT_EQ(scene.triangles.size(), 2u);
    EXPECT_EQ(scene.primitive_count(), spheres + 2);
  }
  EXPECT_THAT(LoadError("sphereflake(depth=8,tessellation=8)"), HasSubstr("at most 200000000"));
}

TEST(SphereflakeTest, ChildrenTouchTheirParents) {
  Scene scene = LoadScene("sphereflake(tessellation=0,depth=3)");
  // Depth-first: a sphere is followed by its children, each with its own subtree.
  auto check = [&](auto&& self, size_t i, int generation) -> size_t {
    const Sphere& parent = scene.spheres[i++];
    for (int k = 0; generation < 3 && k < 9; ++k) {
      const Sphere& child = scene.spheres[i];
      EXPECT_NEAR(child.radius, parent.radius / 3, 1e-7);
      EXPECT_NEAR(Length(ToDouble(child.center) - ToDouble(parent.center)), child.radius + parent.radius,
                  1e-6);
      i = self(self, i, generation + 1);
    }
    return i;
  };
  EXPECT_EQ(check(check, 0, 0), scene.spheres.size());
}

TEST(StadiumTest, CountsAndSizes) {
  Scene scene = LoadScene("stadium");
  EXPECT_EQ(scene.triangles.size(), 69620u + 9504);
  EXPECT_EQ(scene.stats.degenerate_triangles, 0u);
  scene = LoadScene("stadium(size=500,ratio=1000)");
  EXPECT_EQ(scene.triangles.size(), 500u + 9504);
  Bounds3 object;
  for (size_t i = 9504; i < scene.triangles.size(); ++i)
    for (Vec3f p : Corners(scene, i)) object.Extend(p);
  EXPECT_EQ(object.hi.y, 1);
  EXPECT_EQ(object.lo.y, 0);
  EXPECT_NEAR(scene.bounds().Extent().x, 1000, 1e-3);
}

TEST(StadiumTest, ObjectIsClosedAndFillsThePicture) {
  Scene scene = LoadScene("stadium(size=20000)");
  const Camera& c = scene.cameras.front();
  Vec3d forward = Normalize(ToDouble(c.at) - ToDouble(c.eye)),
        right = Normalize(Cross(forward, ToDouble(c.up)));
  Vec3d up = Cross(right, forward);
  double lo = 1, hi = -1, left = 1, rightmost = -1;
  Scene object;
  object.positions = scene.positions;
  for (size_t i = 9504; i < scene.triangles.size(); ++i) {
    object.triangles.push_back(scene.triangles[i]);
    for (Vec3f q : Corners(scene, i)) {
      Vec3d p = ToDouble(q) - ToDouble(c.eye);
      double y = Dot(p, up) / (Dot(p, forward) * c.tan_half_fov),
             x = Dot(p, right) / (Dot(p, forward) * c.tan_half_fov);
      lo = std::min(lo, y), hi = std::max(hi, y), left = std::min(left, x),
      rightmost = std::max(rightmost, x);
    }
  }
  EXPECT_GT(lo, -1);
  EXPECT_LT(hi, 1);
  EXPECT_GT(left, -1);
  EXPECT_LT(rightmost, 1);
  EXPECT_GT(hi - lo, 1.5);
  EXPECT_GT(Volume(object), 0.05);
}

TEST(GeneratorsTest, MillionTriangleScenes) {
  EXPECT_EQ(LoadScene("icosphere(level=8)").triangles.size(), 1310720u);
  EXPECT_EQ(LoadScene("sphereflake(depth=5)").triangles.size(), 1413082u);
  EXPECT_EQ(LoadScene("stadium(size=1000000)").triangles.size(), 1003520u + 9504);
  EXPECT_EQ(LoadScene("terrain_box(n=707)").triangles.size(), 1008182u);
}

TEST(GeneratorsTest, SameAtAnyThreadCountAndBySeed) {
  for (const char* name :
       {"icosphere(level=4)", "sphereflake", "stadium(size=20000)", "terrain_box(n=100)"}) {
    LoadOptions options;
    options.seed = 5;
    std::string hash = LoadScene(name, options).hash();
    {
      tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
      EXPECT_EQ(LoadScene(name, options).hash(), hash) << name;
    }
    options.seed = 6;
    EXPECT_EQ(LoadScene(name, options).hash() == hash, std::string(name) == "sphereflake") << name;
  }
}

TEST(GeneratorsTest, SameOnEveryMachine) {
  EXPECT_EQ(LoadScene("icosphere").hash(), "d84c4332ea49dd02");
  EXPECT_EQ(LoadScene("sphereflake").hash(), "1dbf80c66ec9efd0");
  EXPECT_EQ(LoadScene("stadium").hash(), "29c13a022af217fd");
  EXPECT_EQ(LoadScene("terrain_box").hash(), "837addb17ff43b36");
}

TEST(GeneratorsTest, DescribeThemselves) {
  for (const Generator* g : Generators()) {
    Scene scene = LoadScene(g->name);
    EXPECT_EQ(scene.name, g->name);
    EXPECT_THAT(scene.provenance.source, HasSubstr(std::string("generator ") + g->name + "("));
    EXPECT_THAT(scene.provenance.source, HasSubstr("seed 1"));
    EXPECT_GT(std::string(g->doc).size(), 10u);
    for (uint32_t i = 0; i < g->param_count; ++i) EXPECT_GT(std::string(g->params[i].doc).size(), 10u);
  }
}

}  // namespace
}  // namespace raybench
