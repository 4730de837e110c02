// Rays beyond those of the camera: a level of detail that they alone meet, and what shadow rays ask.
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/support/tracer.h"

namespace raybench {
namespace {

using testing::AddFloor;
using testing::AddMaterial;
using testing::BuildTree;
using testing::DarkScene;
using testing::kBlack;
using testing::kWhite;
using testing::MixedScene;
using testing::TraceScene;

bool Same(const Image& a, const Image& b) {
  return std::equal(a.pixels.begin(), a.pixels.end(), b.pixels.begin(), b.pixels.end(),
                    [](Vec3f p, Vec3f q) { return p.x == q.x && p.y == q.y && p.z == q.z; });
}

/// A white floor at height 0, seen from (.1, .5, .2) by one pixel, under a light at height 4.
Scene LitFloor(const Material& floor) {
  Scene scene = DarkScene();
  AddMaterial(scene, floor);
  AddFloor(scene, {0, 0, 0}, 10);
  scene.lights = {{.position = {0.1f, 4, 0.2f}}};
  scene.cameras = {
      {.eye = {0.1f, 0.5f, 0.2f}, .at = {0.1f, 0, 0.2f}, .up = {0, 0, -1}, .tan_half_fov = 1e-3f}};
  return scene;
}

TraceResult TraceWith(const Scene& scene, const Scene& secondary, TraceOptions options) {
  const Tree tree = BuildTree(scene), other = BuildTree(secondary);
  const SecondaryScene coarse{secondary, other};
  return Trace(scene, tree, options, &coarse);
}

TEST(TracerSecondaryScene, TheSceneItselfAsItsLevelOfDetailChangesNothing) {
  const Scene scene = MixedScene(3);
  const TraceOptions options = {.width = 40,
                                .height = 30,
                                .sampling = {.pattern = SamplePattern::kJittered, .grid = 2},
                                .max_depth = 3};
  const TraceResult one = TraceScene(scene, options), two = TraceWith(scene, MixedScene(3), options);
  EXPECT_TRUE(Same(one.image, two.image));
  EXPECT_EQ(one.shadow_blocked, two.shadow_blocked);
  EXPECT_EQ(one.shadow_resumed, two.shadow_resumed);
  EXPECT_GT(two.reflection_hits, 0u);
}

TEST(TracerSecondaryScene, ShadowAndMirrorRaysMeetItAndThoseOfTheCameraDoNot) {
  Scene floor = LitFloor({.name = "floor", .diffuse = kWhite, .reflect = {0.5f, 0.5f, 0.5f}});
  Scene roofed = LitFloor({.name = "floor", .diffuse = kBlack});
  AddMaterial(roofed, {.name = "roof", .diffuse = kBlack, .emission = {0.25f, 0.5f, 1}});
  AddFloor(roofed, {0, 1, 0}, 10, false, 1);
  floor.Finish(), roofed.Finish();
  const TraceOptions options = {.width = 1, .height = 1};
  const Vec3f alone = TraceScene(floor, options).image.pixels[0];
  EXPECT_GT(alone.x, 0.9f);
  EXPECT_EQ(alone.x, alone.z);
  const TraceResult result = TraceWith(floor, roofed, options);
  EXPECT_EQ(result.shadow_blocked, 1u);
  EXPECT_EQ(result.image.pixels[0].x, 0.125f);  // half of the roof's emission, and no light
  EXPECT_EQ(result.image.pixels[0].z, 0.5f);
}

TEST(TracerSecondaryScene, ACoarserSurfaceInFrontShadowsUnlessRaysStartBeyondIt) {
  Scene floor = LitFloor({.name = "floor", .diffuse = kWhite}), raised = DarkScene();
  AddMaterial(raised, {.name = "floor", .diffuse = kWhite});
  AddFloor(raised, {0, 0.125f, 0}, 10);
  floor.Finish(), raised.Finish();
  TakeLights(floor, raised);
  TraceOptions options = {.width = 1, .height = 1};
  EXPECT_EQ(TraceWith(floor, raised, options).shadow_blocked, 1u);
  options.self_intersection = SelfIntersection::kNormalOffset;
  options.self_intersection_size = 0.1f;
  EXPECT_EQ(TraceWith(floor, raised, options).shadow_blocked, 1u);
  options.self_intersection_size = 0.15f;
  EXPECT_EQ(TraceWith(floor, raised, options).shadow_blocked, 0u);
}

TEST(TracerSecondaryScene, AnotherScaleIsRefused) {
  Scene floor = LitFloor({.name = "floor", .diffuse = kWhite}), huge = DarkScene();
  AddFloor(huge, {0, 0, 0}, 1e20f);
  floor.Finish(), huge.Finish();
  ASSERT_NE(floor.scale_exponent, huge.scale_exponent);
  EXPECT_THROW(TraceWith(floor, huge, {.width = 1, .height = 1}), InputError);
}

TEST(TracerShadows, TheNearestBlockerMakesTheSamePictureAsAny) {
  Scene scene = MixedScene(5);
  for (uint32_t m = 0; m < scene.materials.size(); ++m) scene.materials[m].transmit = kBlack;  // all block
  for (const char* structure : {"brute", "bvh_wide", "bvh_sah", "embree"}) {
    if (std::string_view(structure) == "embree" && std::ranges::none_of(Registry().structures(), [](auto* s) {
          return std::string_view(s->name) == "embree";
        }))
      continue;
    const Tree tree = BuildTree(scene, structure);
    const TraceOptions any = {
        .width = 48, .height = 36, .sampling = {.pattern = SamplePattern::kJittered, .grid = 2}};
    TraceOptions closest = any;
    closest.shadows = ShadowQuery::kClosest;
    const TraceResult one = Trace(scene, tree, any), other = Trace(scene, tree, closest);
    EXPECT_TRUE(Same(one.image, other.image)) << structure;
    EXPECT_EQ(one.shadow_blocked, other.shadow_blocked) << structure;
    EXPECT_GT(one.shadow_blocked, 0u);
    EXPECT_EQ(one.shadow_resumed, 0u);
  }
}

}  // namespace
}  // namespace raybench
