// vulkan_rt on whatever Vulkan driver there is, by default under Khronos' validation layer, whose first message
// makes a build or a query throw. The conformance tests run over it, too (tests/CMakeLists.txt).
#include <dlfcn.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <set>
#include <tuple>

#include "harness/measure/build_info.h"
#include "harness/render/device_waves.h"
#include "tests/support/command.h"
#include "tests/support/conformance.h"
#include "tests/support/tracer.h"
#include "tracer/tracer.h"

namespace raybench::testing {
namespace {

constexpr const char* kPaths[] = {"query", "pipeline"};
const std::string kPlugin = std::string(kBinaryDirectory) + "/plugins/vulkan_rt.so";

const Registry& WithVulkan() {
  static const Registry registry = [] {
    setenv("RAYBENCH_VULKAN_VALIDATION", "1", 0);
    Registry all;
    all.LoadPlugin(kPlugin);
    return all;
  }();
  return registry;
}

/// Skipped where nothing can be built, which says why.
class VulkanRt : public ::testing::Test {
 protected:
  void SetUp() override {
    if (const std::string why = WhyUnavailable(WithVulkan().Find("vulkan_rt")); !why.empty())
      GTEST_SKIP() << why;
  }
  static Tree On(const std::string& spec, const rb_geometry& geometry, const rb_build_options& options) {
    return Tree(ParseContestant(WithVulkan(), spec), geometry, options);
  }
  static Tree On(const std::string& spec, const rb_geometry& geometry) {
    return On(spec, geometry, DefaultBuildOptions());
  }
};

std::vector<rb_hit> ClosestWith(const Tree& tree, const std::vector<rb_ray>& rays, const uint32_t* skip,
                                const uint32_t* after) {
  std::vector<rb_hit> hits(rays.size());
  rb_query q{};
  q.struct_size = sizeof q, q.kind = RB_CLOSEST, q.n = rays.size(), q.rays = rays.data();
  q.skip = skip, q.after = after, q.hits = hits.data();
  tree.Query(q);
  return hits;
}

/// Spheres, cones, cylinders and polygons among triangles.
Scene EveryKind() {
  Scene scene = MixedScene(5);
  Scene more;
  more.name = "every kind";
  more.positions = scene.positions, more.triangles = scene.triangles, more.materials = scene.materials;
  more.triangle_material = scene.triangle_material;
  more.spheres = scene.spheres, more.sphere_material = scene.sphere_material;
  more.lights = scene.lights, more.cameras = scene.cameras;
  more.spheres.push_back({{0.5f, 0.5f, 1}, -0.4f});  // seen from inside only
  more.sphere_material.push_back(0);
  more.cones = {{{-1, -1, 0}, 0.5f, {-1, 1, 0.2f}, 0}, {{1, -1, 0}, 0.3f, {1.2f, 1, 0}, 0.3f}};
  more.cone_material = {0, 1};
  const uint32_t first = uint32_t(more.positions.size());
  for (int i = 0; i < 5; ++i)
    more.positions.push_back({std::cos(1.2566f * float(i)), std::sin(1.2566f * float(i)), -1});
  for (uint32_t i = 0; i < 5; ++i) more.polygon_vertices.push_back(first + i);
  more.polygons = {{0, 5}};
  more.polygon_material = {0};
  more.Finish();
  return more;
}

/// From around the scenes here, whose size is about 1.
std::vector<rb_ray> SomeRays(int count, uint64_t seed) {
  Random random(seed);
  std::vector<rb_ray> rays;
  const auto point = [&](double reach) {
    return ToFloat(random.UnitVector() * (reach * random.NextDouble()));
  };
  while (int(rays.size()) < count) {
    const Vec3f from = point(4), to = point(1.5), d = to - from;
    rays.push_back({{from.x, from.y, from.z}, 0, {d.x, d.y, d.z}, INFINITY});
  }
  return rays;
}

TEST_F(VulkanRt, CallsAllFiveKindsOfShaders) {
  const Scene scene = EveryKind();
  const std::vector<rb_ray> rays = SomeRays(1000, 3);
  const Tree tree = On("vulkan_rt(path=pipeline,opaque=false)", scene.Geometry());
  void* const plugin = dlopen(kPlugin.c_str(), RTLD_NOW | RTLD_NOLOAD);
  ASSERT_NE(plugin, nullptr);
  const auto count_calls = reinterpret_cast<void (*)(const rb_tree*, uint64_t(*)[5])>(
      dlsym(plugin, "raybench_vulkan_count_calls"));
  ASSERT_NE(count_calls, nullptr);
  uint64_t calls[5] = {};
  count_calls(tree.get(), &calls);
  const std::vector<rb_hit> hits = Closest(tree, rays);
  const uint64_t hit = uint64_t(
      std::count_if(hits.begin(), hits.end(), [](const rb_hit& h) { return h.prim != RAYBENCH_NONE; }));
  const char* const kKinds[] = {"ray generation", "intersection", "any hit", "closest hit", "miss"};
  for (int k = 0; k < 5; ++k) EXPECT_GT(calls[k], 0u) << kKinds[k] << " shader";
  EXPECT_EQ(calls[0], rays.size());
  EXPECT_EQ(calls[3], hit);
  EXPECT_GE(calls[4], rays.size() - hit);
  EXPECT_GE(calls[2], hit);
}

/// What is hit is what the same arithmetic on the host hits, but for a few triangles that the driver's own test
/// decides.
TEST_F(VulkanRt, AnswersOfEveryKindOfPrimitiveAreThoseOfTheHost) {
  const Scene scene = EveryKind();
  const std::vector<rb_ray> rays = SomeRays(4000, 4);
  const std::vector<rb_hit> expected = Closest(BuildTree(scene, "brute(numerics=double)"), rays);
  const std::vector<uint8_t> blocked = Occluded(BuildTree(scene, "brute(numerics=double)"), rays);
  std::set<PrimKind> seen;
  for (const char* path : kPaths)
    for (const char* opaque : {"true", "false"}) {
      SCOPED_TRACE(fmt::format("{}, opaque={}", path, opaque));
      const Tree tree = On(fmt::format("vulkan_rt(path={},opaque={})", path, opaque), scene.Geometry());
      const std::vector<rb_hit> hits = Closest(tree, rays);
      const std::vector<uint8_t> any = Occluded(tree, rays);
      size_t different = 0;
      for (size_t i = 0; i < rays.size(); ++i) {
        if (hits[i].prim != expected[i].prim || any[i] != blocked[i]) {
          ++different;
          continue;
        }
        if (hits[i].prim == RAYBENCH_NONE) {
          EXPECT_EQ(hits[i].t, rays[i].tfar);
          continue;
        }
        const PrimKind kind = scene.Locate(hits[i].prim).kind;
        seen.insert(kind);
        if (kind == PrimKind::kTriangle) {
          EXPECT_NEAR(hits[i].t, expected[i].t, 1e-4f * expected[i].t);
          EXPECT_NEAR(hits[i].u, expected[i].u, 1e-4f);
          EXPECT_NEAR(hits[i].v, expected[i].v, 1e-4f);
        } else {
          EXPECT_EQ(hits[i].t, expected[i].t) << "ray " << i;
        }
      }
      EXPECT_LE(different, 2u);
    }
  EXPECT_EQ(seen.size(), 4u);
}

/// Ten triangles that are all the same, and spheres: every hit once, in (t, prim) order.
TEST_F(VulkanRt, AfterWalksThroughAllHitsOnce) {
  Scene scene = EveryKind();
  Scene copies;
  copies.name = "copies";
  copies.positions = scene.positions, copies.materials = scene.materials;
  copies.spheres = scene.spheres, copies.sphere_material = scene.sphere_material;
  for (int copy = 0; copy < 3; ++copy)
    for (const auto& t : scene.triangles) copies.triangles.push_back(t);
  copies.triangle_material.assign(copies.triangles.size(), 0);
  copies.Finish();
  const size_t n = copies.triangles.size() / 3;
  const std::vector<rb_ray> rays = SomeRays(300, 6);
  for (const char* path : kPaths) {
    SCOPED_TRACE(path);
    const Tree tree = On(fmt::format("vulkan_rt(path={})", path), copies.Geometry());
    std::vector<std::vector<rb_hit>> walks(rays.size());
    std::vector<rb_ray> rest = rays;
    std::vector<uint32_t> after(rays.size(), RAYBENCH_NONE);
    for (int step = 0; step < 60; ++step) {
      const std::vector<rb_hit> hits = ClosestWith(tree, rest, nullptr, after.data());
      for (size_t i = 0; i < rays.size(); ++i) {
        if (hits[i].prim == RAYBENCH_NONE) continue;
        walks[i].push_back(hits[i]);
        rest[i].tnear = hits[i].t, after[i] = hits[i].prim;
      }
    }
    size_t triangles = 0, spheres = 0;
    for (size_t i = 0; i < rays.size(); ++i) {
      std::set<uint32_t> seen;
      for (size_t k = 0; k < walks[i].size(); ++k) {
        const rb_hit& hit = walks[i][k];
        if (k > 0) {
          EXPECT_TRUE(std::pair(walks[i][k - 1].t, walks[i][k - 1].prim) < std::pair(hit.t, hit.prim))
              << "ray " << i << ", hit " << k;
        }
        if (hit.prim >= copies.triangles.size()) {
          ++spheres;
          continue;
        }
        EXPECT_TRUE(seen.insert(hit.prim).second)
            << "ray " << i << " meets triangle " << hit.prim << " twice";
        ++triangles;
      }
      // A copy is met where the others are.
      for (uint32_t prim : seen)
        for (size_t copy = 0; copy < 3; ++copy)
          EXPECT_TRUE(seen.contains(uint32_t(prim % n + copy * n))) << "ray " << i << ", triangle " << prim;
    }
    EXPECT_GT(triangles, 300u);
    EXPECT_GT(spheres, 100u);
  }
}

TEST_F(VulkanRt, SkipsOnePrimitiveOfARay) {
  const Scene scene = EveryKind();
  const std::vector<rb_ray> rays = SomeRays(1000, 7);
  const auto skip_of = [](const std::vector<rb_hit>& hits) {
    std::vector<uint32_t> skip;
    for (const rb_hit& hit : hits) skip.push_back(hit.prim);
    return skip;
  };
  for (const char* path : kPaths) {
    const Tree tree = On(fmt::format("vulkan_rt(path={})", path), scene.Geometry());
    const std::vector<uint32_t> skip = skip_of(Closest(tree, rays));
    const std::vector<rb_hit> hits = ClosestWith(tree, rays, skip.data(), nullptr),
                              expected = ClosestWith(BuildTree(scene, "brute(numerics=double)"), rays,
                                                     skip.data(), nullptr);
    size_t different = 0;
    for (size_t i = 0; i < rays.size(); ++i) {
      EXPECT_TRUE(skip[i] == RAYBENCH_NONE || hits[i].prim != skip[i]);
      different += hits[i].prim != expected[i].prim;
    }
    EXPECT_LE(different, 2u);
  }
}

/// Directions of any length, a closed end, an empty interval.
TEST_F(VulkanRt, KeepsTheIntervalAtAnyScaleOfTheDirection) {
  const Mesh mesh{"one", {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}};
  for (const char* path : kPaths)
    for (const char* opaque : {"true", "false"}) {
      SCOPED_TRACE(fmt::format("{}, opaque={}", path, opaque));
      const Tree tree = On(fmt::format("vulkan_rt(path={},opaque={})", path, opaque), mesh.Geometry());
      for (int e : {-120, -60, -20, 0, 20, 60, 120}) {
        const float d = std::ldexp(1.0f, e), t = std::ldexp(1.0f, -e);
        const std::vector<rb_ray> rays = {{{0.25f, 0.25f, 1}, 0, {0, 0, -d}, INFINITY},
                                          {{0.25f, 0.25f, 1}, 0, {0, 0, -d}, t},
                                          {{0.25f, 0.25f, 1}, t, {0, 0, -d}, INFINITY},
                                          {{0.25f, 0.25f, 1}, 0, {0, 0, -d}, std::nextafter(t, 0.0f)},
                                          {{0.25f, 0.25f, 1}, t, {0, 0, -d}, t / 2},
                                          {{0.25f, 0.25f, 1}, 0, {0, 0, d}, INFINITY}};
        const std::vector<rb_hit> hits = Closest(tree, rays);
        const std::vector<uint8_t> any = Occluded(tree, rays);
        for (size_t i = 0; i < rays.size(); ++i) {
          EXPECT_EQ(hits[i].prim, i < 2 ? 0 : RAYBENCH_NONE) << "ray " << i << ", 2^" << e;
          EXPECT_EQ(hits[i].t, i < 2 ? t : rays[i].tfar) << "ray " << i << ", 2^" << e;
          EXPECT_EQ(any[i], i < 2);
        }
      }
    }
}

TEST_F(VulkanRt, HasAClockAndSaysWhatItRunsOn) {
  const Mesh ball = Ball(3);
  const Tree tree = On("vulkan_rt", ball.Geometry());
  const rb_device built = tree.Device().value();
  EXPECT_GT(built.build, 0);
  EXPECT_EQ(built.query, 0);
  EXPECT_NE(std::string(built.name), "");
  Closest(tree, NastyRays(ball, 100, 1));
  const rb_device asked = tree.Device().value();
  EXPECT_GT(asked.query, 0);
  EXPECT_GT(asked.query_copies, 0);
  EXPECT_EQ(asked.build, built.build);
}

TEST_F(VulkanRt, RefusesInOneLine) {
  const Mesh ball = Ball(3);
  const auto why = [&](const std::string& spec, const rb_geometry& geometry,
                       const rb_build_options& options) {
    try {
      On(spec, geometry, options);
    } catch (const BuildError& error) {
      EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
      return std::string(error.what());
    }
    return std::string("built");
  };
  using ::testing::HasSubstr;
  rb_build_options options = DefaultBuildOptions();
  EXPECT_THAT(why("vulkan_rt(device=63)", ball.Geometry(), options),
              HasSubstr("there is no device 63; there are: 0 "));
  EXPECT_THAT(why("vulkan_rt", Balls(3, 1).Geometry(ball), options), HasSubstr("callbacks only"));
  options.memory_limit = 1000;
  EXPECT_THAT(why("vulkan_rt", ball.Geometry(), options), HasSubstr("over the memory limit"));
  options.memory_limit =
      ball.positions.size() * 12 + ball.triangles.size() * 12 + 100;  // the geometry, and no tree
  EXPECT_THAT(why("vulkan_rt", ball.Geometry(), options), HasSubstr("over the memory limit"));
  const volatile int cancel = 1;
  options = DefaultBuildOptions();
  options.cancel = &cancel;
  EXPECT_EQ(why("vulkan_rt", ball.Geometry(), options), "vulkan_rt: cancelled");
}

/// Those that differ by more than 1/255 in some channel.
size_t DifferentPixels(const Image& a, const Image& b) {
  size_t different = 0;
  for (size_t i = 0; i < a.pixels.size(); ++i) {
    const Vec3f d = a.pixels[i] - b.pixels[i];
    different += !(std::max({std::abs(d.x), std::abs(d.y), std::abs(d.z)}) <= 1.0f / 255);
  }
  return different;
}

/// Pictures through the device are those through a tree of the host's in float.
TEST_F(VulkanRt, RendersThePicturesOfTheHost) {
  for (const char* name : {"sphereflake(depth=3)", "rings(size=2)", "icosphere(level=3)"}) {
    const Scene scene = LoadScene(name);
    TraceOptions options;
    options.width = options.height = 96;
    const Image host = Trace(scene, BuildTree(scene, "bvh_sah(numerics=fast)"), options).image;
    for (const char* path : kPaths) {
      SCOPED_TRACE(fmt::format("{}, {}", name, path));
      rb_build_options build = DefaultBuildOptions();
      build.needs = RB_NEED_UV | RB_NEED_ANY | RB_NEED_AFTER | RB_NEED_SKIP;
      const Image device =
          Trace(scene, On(fmt::format("vulkan_rt(path={})", path), scene.Geometry(), build), options).image;
      EXPECT_LE(DifferentPixels(host, device), host.pixels.size() / 1000);
    }
  }
}

/// Of Haines' scenes, with all kinds of procedural primitives, the host and the device see the same pixels.
TEST_F(VulkanRt, CameraHitsOfProceduralScenesAreThoseOfTheHost) {
  constexpr uint32_t kSide = 128;
  for (const char* name : {"balls(size=2)", "gears(size=2)", "rings(size=2)", "teapot(size=4)",
                           "tree(size=4)", "tetra(size=4)", "mount(size=4)", "lattice(size=3)"}) {
    const Scene scene = LoadScene(name);
    std::vector<rb_ray> rays(size_t{kSide} * kSide);
    PixelRays(scene, kSide, kSide, 0, rays, 1);
    const std::vector<rb_hit> host = Closest(BuildTree(scene, "bvh_sah(numerics=double)"), rays);
    for (const char* path : kPaths) {
      const std::vector<rb_hit> device =
          Closest(On(fmt::format("vulkan_rt(path={})", path), scene.Geometry()), rays);
      std::string different;
      size_t count = 0;
      for (size_t i = 0; i < rays.size(); ++i) {
        if ((host[i].prim == RAYBENCH_NONE) == (device[i].prim == RAYBENCH_NONE)) continue;
        ++count;
        different += fmt::format("\n  pixel {}, {}: host {} at {}, device {} at {}", i % kSide, i / kSide,
                                 int(host[i].prim), host[i].t, int(device[i].prim), device[i].t);
      }
      EXPECT_LE(count, rays.size() / 10000) << name << ", " << path << different;
    }
  }
}

/// Rays of each wave, and pixels. The glass of gears lets light through.
TEST_F(VulkanRt, WavesOnTheDeviceAreThoseOfTheHost) {
  for (const char* name : {"sphereflake(depth=2)", "gears(size=1)", "icosphere(level=2)"}) {
    SCOPED_TRACE(name);
    const Scene scene = LoadScene(name);
    TraceOptions options;
    options.width = options.height = 64;
    const TraceResult host = Trace(scene, BuildTree(scene, "bvh_sah(numerics=fast)"), options);
    rb_build_options build = DefaultBuildOptions();
    build.needs = RB_NEED_UV | RB_NEED_ANY | RB_NEED_AFTER;
    const DevicePicture drawn =
        TraceOnDevice(WithVulkan(), scene, On("vulkan_rt", scene.Geometry(), build), options);
    EXPECT_GT(drawn.seconds, 0);
    ASSERT_EQ(drawn.result.waves.size(), host.waves.size());
    const auto near = [](uint64_t a, uint64_t b) { EXPECT_LE(a > b ? a - b : b - a, 1 + b / 1000); };
    for (size_t w = 0; w < host.waves.size(); ++w) {
      const WaveCounts &a = drawn.result.waves[w], &b = host.waves[w];
      near(a.rays, b.rays), near(a.hits, b.hits), near(a.shadow, b.shadow), near(a.blocked, b.blocked);
    }
    EXPECT_LE(DifferentPixels(host.image, drawn.result.image), host.image.pixels.size() / 1000);
  }
}

class VulkanRtCommand : public HarnessCommand {};

TEST_F(VulkanRtCommand, WavesOnTheDeviceRefuseWhatTheyDoNotDo) {
  if (const std::string why = WhyUnavailable(WithVulkan().Find("vulkan_rt")); !why.empty())
    GTEST_SKIP() << why;
  const std::string out = (folder_ / "out.png").string();
  for (const auto& [structure, more, says] :
       std::vector<std::tuple<std::string, std::vector<std::string>, std::string>>{
           {"bvh_sah", {}, "'bvh_sah' does not draw; vulkan_rt does"},
           {"vulkan_rt", {"--samples", "4"}, "one ray through the middle of each pixel"},
           {"vulkan_rt", {"--rules", "spd"}, "rules whitted only"},
           {"vulkan_rt(path=pipeline)", {}, "path=query"}}) {
    std::vector<std::string> words = {
        "render", "icosphere(level=1)", "-o",     out, "--size", "8x8", "--waves",
        "device", "--structure",        structure};
    words.insert(words.end(), more.begin(), more.end());
    const Outcome outcome = Call(words);
    EXPECT_NE(outcome.exit_code, 0);
    EXPECT_THAT(outcome.err, ::testing::HasSubstr(says));
    EXPECT_THAT(outcome.err, ::testing::HasSubstr("raybench: "));
    EXPECT_FALSE(fs::exists(out));
  }
}

TEST_F(VulkanRtCommand, RunsOnRequestWithADeviceClockAndALabel) {
  if (const std::string why = WhyUnavailable(WithVulkan().Find("vulkan_rt")); !why.empty())
    GTEST_SKIP() << why;
  const Outcome listed = Call({"list", "structures"});
  EXPECT_EQ(listed.exit_code, 0);
  EXPECT_THAT(listed.out, ::testing::HasSubstr("vulkan_rt"));
  const Outcome ran = Call(TinyRun("r", {"--structures", "vulkan_rt,bvh_sah"}));
  ASSERT_EQ(ran.exit_code, 0) << ran.err;
  size_t rows = 0;
  for (const auto& row : ReadCsv(folder_ / "r" / "cases.csv")) {
    const bool is_device = row.at("structure") == "vulkan_rt";
    EXPECT_EQ(row.at("status"), "timed");
    for (const char* column : {"device", "device_ns", "copies_ns"})
      EXPECT_EQ(row.at(column) != "", is_device) << column << " of " << row.at("query");
    if (is_device && row.at("device").find("llvmpipe") != std::string::npos) {
      EXPECT_TRUE(row.at("device").starts_with("software: "));
    }
    rows += is_device;
  }
  EXPECT_GT(rows, 3u);
}

TEST_F(VulkanRtCommand, SaysWhyItIsNotHere) {
  const char* const drivers = std::getenv("VK_DRIVER_FILES");
  const std::string before = drivers != nullptr ? drivers : "";
  setenv("VK_DRIVER_FILES", "/none", 1);
  const Outcome listed = Call({"list", "structures"});
  EXPECT_EQ(listed.exit_code, 0);
  EXPECT_THAT(listed.out, ::testing::HasSubstr("not here: "));
  const Outcome ran = Call(TinyRun("r", {"--structures", "vulkan_rt"}));
  EXPECT_NE(ran.exit_code, 0);
  EXPECT_THAT(ran.err, ::testing::HasSubstr("Vulkan"));
  drivers != nullptr ? setenv("VK_DRIVER_FILES", before.c_str(), 1) : unsetenv("VK_DRIVER_FILES");
}

}  // namespace
}  // namespace raybench::testing
