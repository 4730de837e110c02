// The procedural scenes: exact counts, closed meshes, the same on every run and at any thread count.

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <cmath>
#include <map>
#include <span>

#include "accel/base/memory.h"
#include "accel/base/parallel.h"
#include "accel/host/parameters.h"
#include "tests/support/datasets.h"

namespace raybench {
namespace {

using ::testing::HasSubstr;

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
    auto [a, b, c] = CornersOf(scene, i);
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
    for (Vec3f p : CornersOf(scene, i)) object.Extend(p);
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
    for (Vec3f q : CornersOf(scene, i)) {
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

/// `name` with a parameter; the count that the generator states must be the count that it makes.
Scene LoadCounted(const std::string& name) {
  Scene scene = LoadScene(name);
  const Spec spec = ParseSpec(name);
  for (const Generator* g : Generators()) {
    if (spec.name != g->name) continue;
    const auto config = Configure(g->name, {g->params, g->param_count}, g->config_size, spec.values);
    EXPECT_EQ(g->count(config.data()), scene.primitive_count()) << name;
  }
  EXPECT_EQ(scene.stats.degenerate_triangles, 0u) << name;
  return scene;
}

TEST(GeneratorsTest, CountsAreKnownBefore) {
  for (const char* name : {"balls(size=3)",
                           "city(size=70)",
                           "city(size=5000,strips=1)",
                           "city(size=40000,strips=7)",
                           "fibres(size=60)",
                           "fibres(size=7000,segments=1)",
                           "fibres(size=7000,segments=1,shape=tube)",
                           "fibres(size=30000,segments=5,on=plane,curl=0)",
                           "fibres(size=30000,on=plane,shape=tube,curl=64)",
                           "gears(size=3)",
                           "icosphere(level=0)",
                           "icosphere(level=5)",
                           "lattice(size=5)",
                           "menger(depth=0)",
                           "menger(depth=1)",
                           "menger(depth=2)",
                           "menger(depth=4)",
                           "mount(size=8)",
                           "rings(size=4)",
                           "shells(size=20,count=1)",
                           "shells(size=20,count=30)",
                           "shells(size=54321,count=7)",
                           "soup(size=1)",
                           "soup(size=777)",
                           "soup(size=3000,aspect=1000,length=100)",
                           "soup(size=100000,length=0.1)",
                           "sphereflake(depth=2,tessellation=1)",
                           "sphereflake(depth=4,tessellation=0)",
                           "stadium(size=20)",
                           "stadium(size=12345)",
                           "teapot(size=5)",
                           "terrain(size=2)",
                           "terrain(size=50000,relief=2)",
                           "terrain(size=400,relief=0.001)",
                           "terrain_box(n=1)",
                           "terrain_box(n=77)",
                           "tetra(size=4)",
                           "tree(size=7)"})
    LoadCounted(name);
  EXPECT_EQ(LoadCounted("menger(depth=3)").triangles.size(), 36096u);
}

TEST(GeneratorsTest, SizeIsHonoured) {
  for (const char* name : {"city", "fibres", "shells", "soup", "terrain"})
    for (double size : {300.0, 1000.0, 30000.0, 1e6}) {
      const auto primitives =
          double(LoadCounted(name + ("(size=" + std::to_string(int(size)) + ")")).primitive_count());
      EXPECT_GT(primitives, 0.8 * size) << name;
      EXPECT_LT(primitives, 1.2 * size) << name;
    }
}

// Each parameter at the ends of its range. What is too large for a test is refused by another (below) or is a
// matter of patience.
TEST(GeneratorsTest, EndsOfEveryRangeGiveWhatWasCounted) {
  int loaded = 0;
  for (const Generator* g : Generators()) {
    const std::span params(g->params, g->param_count);
    for (const rb_param& p : params) {
      if (p.type == RB_CHOICE) continue;
      for (double value : {p.lo, p.hi}) {
        std::vector<std::pair<std::string, std::string>> values = {
            {p.name, p.type == RB_BOOL ? (value != 0 ? "true" : "false") : fmt::format("{}", value)}};
        for (const rb_param& other : params)
          if (other.name == std::string_view("size") && &other != &p) values.emplace_back("size", "2000");
        if (g->count(Configure(g->name, params, g->config_size, values).data()) > 300000) continue;
        std::string name = g->name;
        for (size_t i = 0; i < values.size(); ++i)
          name += (i == 0 ? "(" : ",") + values[i].first + "=" + values[i].second;
        SCOPED_TRACE(name += ")");
        const Scene scene = LoadCounted(name);
        for (Vec3f v : scene.positions) ASSERT_TRUE(std::isfinite(v.x + v.y + v.z));
        ++loaded;
      }
    }
  }
  EXPECT_GT(loaded, 20);
}

TEST(GeneratorsTest, WhatCannotBeHeldIsRefusedBefore) {
  EXPECT_THAT(LoadError("menger(depth=7)"),
              HasSubstr("would have 5136777216 primitives; fewer than 4294967295"));
  // No machine of today has 64 bytes for each of these and to spare; with fewer than 2^32, memory decides.
  if (AvailableMemory().value_or(UINT64_MAX) < uint64_t{64} * 1000000000) {
    EXPECT_THAT(LoadError("soup(size=1000000000)"), HasSubstr("64.0 GB of memory"));
  } else {
    GTEST_SKIP() << "not tested: refusal by memory; this machine has enough of it or does not tell";
  }
}

TEST(MengerTest, IsClosedAndHasTheVolume) {
  double volume = 8;
  for (int depth = 0; depth <= 3; ++depth, volume *= 20.0 / 27) {
    const Scene scene = LoadCounted("menger(depth=" + std::to_string(depth) + ")");
    EXPECT_TRUE(IsClosed(scene)) << depth;
    EXPECT_NEAR(Volume(scene), volume, 1e-4);
  }
}

TEST(ShellsTest, AreClosedAndLieInsideOneAnother) {
  for (const char* name :
       {"shells(size=20,count=60)", "shells(size=5000,count=6)", "shells(size=100,count=2)"}) {
    const Scene scene = LoadCounted(name);
    EXPECT_TRUE(IsClosed(scene)) << name;
    double reached = 0, farthest = 0;  // of the shell before
    for (size_t i = 0; i < scene.triangles.size(); ++i) {
      if (i > 0 && scene.triangle_material[i] != scene.triangle_material[i - 1]) reached = farthest;
      const auto [a, b, c] = CornersOf(scene, i);
      const Vec3d normal = Cross(ToDouble(b) - ToDouble(a), ToDouble(c) - ToDouble(a));
      ASSERT_GT(Dot(normal, ToDouble(a)) / Length(normal), reached) << name << " triangle " << i;
      for (Vec3f p : {a, b, c}) farthest = std::max(farthest, Length(ToDouble(p)));
    }
    EXPECT_NEAR(farthest, 1, 1e-6);
  }
}

TEST(FibresTest, TubesAreClosedAndRibbonsThin) {
  const Scene tubes = LoadCounted("fibres(size=20000,shape=tube)");
  EXPECT_TRUE(IsClosed(tubes));
  EXPECT_GT(Volume(tubes), 4);  // the ball alone has 4.1; strands have a positive volume of their own
  Scene strands;
  strands.positions = tubes.positions;
  for (size_t i = 0; i < tubes.triangles.size(); ++i)
    if (tubes.triangle_material[i] != 0) strands.triangles.push_back(tubes.triangles[i]);
  EXPECT_GT(Volume(strands), 0);
  for (const char* name : {"fibres(size=20000)", "fibres(size=20000,on=plane,curl=10)"}) {
    const Scene ribbons = LoadCounted(name);
    for (size_t i = 0; i < ribbons.triangles.size(); ++i) {
      if (ribbons.triangle_material[i] == 0) continue;
      const auto [a, b, c] = CornersOf(ribbons, i);
      const double area = Length(Cross(ToDouble(b) - ToDouble(a), ToDouble(c) - ToDouble(a))) / 2;
      const double longest = std::max({Length(ToDouble(b) - ToDouble(a)), Length(ToDouble(c) - ToDouble(a)),
                                       Length(ToDouble(c) - ToDouble(b))});
      ASSERT_LT(2 * area / longest, 0.031) << name;
    }
  }
}

TEST(SoupTest, TrianglesAreAsLongAndThinAsAsked) {
  const Scene scene = LoadCounted("soup(size=1000,length=5,aspect=20)");
  for (size_t i = 0; i < scene.triangles.size(); ++i) {
    const auto [a, b, c] = CornersOf(scene, i);
    const double width = Length(ToDouble(b) - ToDouble(a));
    const double length = Length((ToDouble(a) + ToDouble(b)) * 0.5 - ToDouble(c));
    ASSERT_NEAR(length, 5 * 2 / 10.0, 1e-6);
    ASSERT_NEAR(length / width, 20, 1e-3);
  }
}

TEST(CityTest, StandsOnItsGroundAndFacesOutwards) {
  const Scene scene = LoadCounted("city(size=20000)");
  EXPECT_EQ(scene.bounds().lo.y, 0);
  EXPECT_GT(scene.bounds().hi.y, 50);
  // Houses are open below: walls face away from the middle of their house, roofs and the ground up.
  size_t up = 0, thin = 0;
  for (size_t i = 0; i < scene.triangles.size(); ++i) {
    const auto [a, b, c] = CornersOf(scene, i);
    const Vec3d u = ToDouble(b) - ToDouble(a), v = ToDouble(c) - ToDouble(a), normal = Cross(u, v);
    ASSERT_GE(normal.y, 0) << i;
    up += normal.y > 0;
    const double longest = std::max(Dot(u, u), Dot(v, v));
    thin += Length(normal) < 0.2 * longest;
  }
  EXPECT_EQ(up, 2 + (scene.triangles.size() - 2) / 68 * 20);  // 2 + 2 + 16 of a house of 68
  EXPECT_GT(thin, scene.triangles.size() / 5);
}

TEST(TerrainTest, IsOneLayerWithFlatWater) {
  const Scene scene = LoadCounted("terrain(size=20000)");
  size_t wet = 0;
  for (size_t i = 0; i < scene.triangles.size(); ++i) {
    const auto [a, b, c] = CornersOf(scene, i);
    ASSERT_GT(Cross(ToDouble(b) - ToDouble(a), ToDouble(c) - ToDouble(a)).y, 0);
    if (scene.materials[scene.triangle_material[i]].name == "water") {
      ++wet;
      ASSERT_TRUE(a.y == 0 && b.y == 0 && c.y == 0);
    }
  }
  EXPECT_GT(wet, scene.triangles.size() / 50);
  EXPECT_LT(wet, scene.triangles.size() / 2);
  EXPECT_GT(scene.bounds().hi.y, 0.15f);
}

TEST(GeneratorsTest, ProgressRisesAndEndsAtOne) {
  for (const Generator* g : Generators()) {
    double last = 0;
    LoadOptions options;
    options.progress = [&](double fraction) {
      EXPECT_GE(fraction, last) << g->name;
      last = fraction;
    };
    LoadScene(g->name, options);
    EXPECT_EQ(last, 1) << g->name;
  }
}

TEST(GeneratorsTest, MillionTriangleScenes) {
  EXPECT_EQ(LoadScene("icosphere(level=8)").triangles.size(), 1310720u);
  EXPECT_EQ(LoadScene("sphereflake(depth=5)").triangles.size(), 1413082u);
  EXPECT_EQ(LoadScene("stadium(size=1000000)").triangles.size(), 1003520u + 9504);
  EXPECT_EQ(LoadScene("terrain_box(n=707)").triangles.size(), 1008182u);
}

TEST(GeneratorsTest, SameAtAnyThreadCountAndBySeed) {
  for (const char* name : {"city(size=20000)", "fibres(size=20000)", "icosphere(level=4)", "menger(depth=2)",
                           "shells(size=5000)", "soup(size=20000)", "sphereflake", "stadium(size=20000)",
                           "terrain(size=20000)", "terrain_box(n=100)"}) {
    LoadOptions options;
    options.seed = 5;
    std::string hash = LoadScene(name, options).hash();
    {
      const ThreadLimit one(1);
      EXPECT_EQ(LoadScene(name, options).hash(), hash) << name;
    }
    options.seed = 6;
    const bool seedless = std::string(name) == "sphereflake" || std::string(name) == "menger(depth=2)";
    EXPECT_EQ(LoadScene(name, options).hash() == hash, seedless) << name;
  }
}

TEST(GeneratorsTest, SameOnEveryMachine) {
  EXPECT_EQ(LoadScene("city").hash(), "062b4caeb439bfa1");
  EXPECT_EQ(LoadScene("fibres").hash(), "9b56580802adf259");
  EXPECT_EQ(LoadScene("fibres(on=plane,shape=tube)").hash(), "cefaee6070dfcfec");
  EXPECT_EQ(LoadScene("menger").hash(), "f530c8131c0fb902");
  EXPECT_EQ(LoadScene("shells").hash(), "fab017bf932f9dd7");
  EXPECT_EQ(LoadScene("soup").hash(), "77f1ab066b540bf5");
  EXPECT_EQ(LoadScene("terrain").hash(), "63c0197a629486aa");
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
