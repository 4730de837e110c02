// The illumination model, term by term, against what can be worked out by hand. Colours are floats summed and
// multiplied a few times: where nothing else is said, tolerances are some units of 2^-24.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/support/tracer.h"
#include "tracer/shading.h"
#include "tracer/surface.h"

namespace raybench {
namespace {

using testing::AddFloor;
using testing::AddMaterial;
using testing::AddQuad;
using testing::AddTriangle;
using testing::BuildTree;
using testing::DarkScene;
using testing::Dir;
using testing::FindSet;
using testing::kBlack;
using testing::kInf;
using testing::kWhite;
using testing::Org;
using testing::TraceScene;

constexpr double kUlp = 0x1p-23;

void ExpectNear(Vec3f actual, Vec3d expected, double tolerance) {
  EXPECT_NEAR(actual.x, expected.x, tolerance);
  EXPECT_NEAR(actual.y, expected.y, tolerance);
  EXPECT_NEAR(actual.z, expected.z, tolerance);
}

/// A camera that looks straight down at (x, 0, z) from height y, through one pixel.
Camera LookingDown(float x, float y, float z) {
  return {.eye = {x, y, z}, .at = {x, 0, z}, .up = {0, 0, -1}, .tan_half_fov = 1e-3f};
}

TEST(TracerModel, AMirrorBoxSumsAGeometricSeries) {
  // Every wall shines with e and mirrors k: e (1 + k + ... + k^d), whatever the path.
  Scene scene = DarkScene();
  AddMaterial(scene,
              {.name = "m", .diffuse = kBlack, .emission = {1, 0.5f, 0.25f}, .reflect = {0.75f, 0.5f, 0.9f}});
  AddFloor(scene, {0, -1, 0}, 1), AddFloor(scene, {0, 1, 0}, 1, false);
  AddQuad(scene, {-1, -1, -1}, {1, -1, -1}, {1, 1, -1}, {-1, 1, -1});
  AddQuad(scene, {-1, -1, 1}, {1, -1, 1}, {1, 1, 1}, {-1, 1, 1});
  AddQuad(scene, {-1, -1, -1}, {-1, -1, 1}, {-1, 1, 1}, {-1, 1, -1});
  AddQuad(scene, {1, -1, -1}, {1, -1, 1}, {1, 1, 1}, {1, 1, -1});
  scene.lights = {{.position = {0, 0, 0}, .intensity = kBlack}};
  scene.cameras = {{.eye = {0.1f, 0.2f, 0.3f}, .at = {1, 0.4f, -0.3f}, .tan_half_fov = 0.9f}};
  scene.Finish();
  for (uint32_t depth : {0u, 1u, 20u}) {
    const TraceResult result = TraceScene(scene, {.width = 16, .height = 16, .max_depth = depth});
    const auto sum = [&](double k) { return (1 - std::pow(k, depth + 1.0)) / (1 - k); };
    const Vec3d expected{sum(0.75), 0.5 * sum(0.5), 0.25 * sum(double(0.9f))};
    for (const Vec3f& pixel : result.image.pixels) {
      // depth products and sums, each rounded by half a unit.
      ASSERT_NEAR(pixel.x, expected.x, expected.x * (2 * depth + 1) * 0x1p-24);
      ASSERT_NEAR(pixel.y, expected.y, expected.y * (2 * depth + 1) * 0x1p-24);
      ASSERT_NEAR(pixel.z, expected.z, expected.z * (2 * depth + 1) * 0x1p-24);
    }
  }
}

TEST(TracerModel, ABallLensHasItsFocusWhereItShould) {
  // Paraxial focal length of a ball of radius 1, from its middle: n / (2 (n - 1)); the image of a point at
  // distance s lies at 1 / (1/f - 1/s). Rays at height h meet the axis nearer by less than 4 h^2.
  const double ior = 1.5, focal = ior / (2 * (ior - 1)), s = 10, image = 1 / (1 / focal - 1 / s);
  Scene scene = DarkScene();
  AddMaterial(scene, {.name = "glass", .diffuse = kBlack, .transmit = kWhite, .ior = float(ior)});
  scene.spheres = {{{0, 0, 0}, 1}};
  scene.cameras = {{.eye = {0, 0, float(s)}, .at = {0, 0, 0}, .tan_half_fov = 0.006f}};
  scene.Finish();
  const TraceResult result = TraceScene(scene, {.width = 20, .height = 20, .max_depth = 2, .capture = true});
  const RaySet* out = FindSet(result, "refraction.2");
  ASSERT_NE(out, nullptr);
  ASSERT_EQ(out->rays.size(), 400u);
  EXPECT_EQ(result.reflection_rays, 0u);
  for (const rb_ray& ray : out->rays) {
    const Vec3d o = Org(ray), d = Dir(ray);
    const double t = -(o.x * d.x + o.y * d.y) / (d.x * d.x + d.y * d.y);  // nearest the axis
    const Vec3d focus = o + d * t;
    const double height = std::hypot(o.x, o.y);
    // Directions are rounded by 2^-24, which at slopes above 0.0003 moves the focus by 2^-24 / 0.0003.
    const double slope = std::hypot(d.x, d.y), rounding = 0x1p-23 * image / slope;
    EXPECT_LT(std::hypot(focus.x, focus.y), 1e-5);
    EXPECT_NEAR(-focus.z, image, 4 * 0.08 * 0.08 + rounding) << height;
  }
}

TEST(TracerModel, DispersionRefractsChannelsApart) {
  const double ior[] = {1.48, 1.5, 1.55};
  Scene scene = DarkScene();
  scene.background = {0.25f, 0.5f, 0.75f};
  AddMaterial(scene, {.name = "glass",
                      .diffuse = kBlack,
                      .transmit = kWhite,
                      .ior = 1.5f,
                      .dispersion = {-0.02f, 0, 0.05f}});
  AddFloor(scene, {0, 0, 0}, 100);
  scene.cameras = {{.eye = {0, 1, 0}, .at = {1, 0, 0}, .tan_half_fov = 0.1f}};
  scene.Finish();
  const TraceResult result = TraceScene(scene, {.width = 4, .height = 4, .max_depth = 1, .capture = true});
  const RaySet *camera = FindSet(result, "camera"), *refraction = FindSet(result, "refraction.1");
  ASSERT_NE(refraction, nullptr);
  ASSERT_EQ(refraction->rays.size(), 3 * camera->rays.size());
  for (size_t i = 0; i < refraction->rays.size(); ++i) {
    const Vec3d in = Dir(camera->rays[i / 3]), out = Dir(refraction->rays[i]);
    // Indices and directions are floats.
    EXPECT_NEAR(std::hypot(out.x, out.z), std::hypot(in.x, in.z) / ior[i % 3], 4 * kUlp);
  }
  // Together the channels make up the whole.
  for (const Vec3f& pixel : result.image.pixels) EXPECT_EQ(pixel, scene.background);

  // From within the glass each channel has its own critical angle; a channel once apart stays one path.
  Scene inside = DarkScene();
  inside.background = kWhite;
  inside.materials = scene.materials;
  AddFloor(inside, {0, 1, 0}, 1000), AddFloor(inside, {0, 2, 0}, 1000, false);
  const auto angle = float(std::tan(std::asin(1 / 1.52)));  // green passes, blue does not
  inside.cameras = {{.eye = {0, 0, 0}, .at = {angle, 1, 0}, .tan_half_fov = 1e-4f}};
  inside.Finish();
  const TraceResult apart = TraceScene(inside, {.width = 1, .height = 1, .max_depth = 1});
  EXPECT_EQ(apart.reflection_rays, 1u);
  EXPECT_EQ(apart.refraction_rays, 2u);
  const TraceResult deep = TraceScene(inside, {.width = 1, .height = 1, .max_depth = 2});
  EXPECT_EQ(deep.refraction_rays, 4u) << "one path each";
}

TEST(TracerModel, PowersOfIntegralExponentsAreThoseOfPow) {
  for (double base : {1.0, 0.999, 0.5, 1e-3})
    for (double exponent : {0.0, 1.0, 7.0, 32.0, 1000.0, 65535.0, 1e6, 2.5, 0.25}) {
      // Of n products the relative error is at most n units of 2^-53, squarings included.
      const double expected = std::pow(base, exponent);
      EXPECT_NEAR(Power(base, exponent), expected, expected * std::max(exponent, 1.0) * 0x1p-52);
    }
}

TEST(TracerModel, FresnelsEquationsAtKnownAngles) {
  for (double n : {1.1, 1.5, 2.4}) {
    const double normal = (n - 1) / (n + 1);
    EXPECT_NEAR(FresnelReflectance(1, 1 / n), normal * normal, 1e-15);
    EXPECT_NEAR(FresnelReflectance(1, n), normal * normal, 1e-15);
    // At Brewster's angle, tan = n, one polarisation is not mirrored, and the other by ((n^2-1)/(n^2+1))^2.
    const double across = (n * n - 1) / (n * n + 1);
    EXPECT_NEAR(FresnelReflectance(1 / std::sqrt(1 + n * n), 1 / n), across * across / 2, 1e-14);
    EXPECT_EQ(FresnelReflectance(0, 1 / n), 1);
    EXPECT_EQ(FresnelReflectance(std::sqrt(1 - 1 / (n * n)) - 1e-9, n), 1) << "total internal reflection";
    EXPECT_LT(FresnelReflectance(std::sqrt(1 - 1 / (n * n)) + 1e-3, n), 1);
  }
}

TEST(TracerModel, FresnelSharesBetweenMirrorAndRefraction) {
  // Straight down onto glass: above a red sky that shines, below a green one.
  Scene scene = DarkScene();
  const uint32_t glass = AddMaterial(
      scene, {.name = "glass", .diffuse = kBlack, .transmit = {0.5f, 1, 1}, .ior = 1.5f, .fresnel = true});
  const uint32_t red = AddMaterial(scene, {.name = "red", .diffuse = kBlack, .emission = {1, 0, 0}}),
                 green = AddMaterial(scene, {.name = "green", .diffuse = kBlack, .emission = {0, 1, 0}});
  AddFloor(scene, {0, 0, 0}, 1, true, glass);
  AddFloor(scene, {0, 5, 0}, 1, true, red), AddFloor(scene, {0, -5, 0}, 1, true, green);
  scene.cameras = {LookingDown(0.1f, 2, 0.2f)};
  scene.Finish();
  const auto pixel = [&](FresnelMode mode) {
    return TraceScene(scene, {.width = 1, .height = 1, .fresnel = mode, .max_depth = 1}).image.pixels[0];
  };
  ExpectNear(pixel(FresnelMode::kMaterial), {0.5 * 0.04, 0.96, 0}, kUlp);
  ExpectNear(pixel(FresnelMode::kOn), {0.5 * 0.04, 0.96, 0}, kUlp);
  ExpectNear(pixel(FresnelMode::kOff), {0, 1, 0}, 0);
  scene.materials[glass].fresnel = false;
  ExpectNear(pixel(FresnelMode::kMaterial), {0, 1, 0}, 0);
  ExpectNear(pixel(FresnelMode::kOn), {0.5 * 0.04, 0.96, 0}, kUlp);
  scene.materials[glass].reflect = {0.25f, 0, 0};
  ExpectNear(pixel(FresnelMode::kOn), {0.25 + 0.5 * 0.04, 0.96, 0}, kUlp);
}

TEST(TracerModel, GlassCreatesNoEnergy) {
  // In a white furnace nothing is brighter than white, up to the roundings of some ten paths; and what total
  // internal reflection and the depth limit hold back is little: F^2 is below 1 % but near the rim.
  Scene scene = DarkScene();
  scene.background = kWhite;
  AddMaterial(scene, {.name = "glass", .diffuse = kBlack, .transmit = kWhite, .ior = 1.5f, .fresnel = true});
  AddMaterial(scene, {.name = "tinted",
                      .diffuse = kBlack,
                      .reflect = {0.3f, 0.2f, 0.1f},
                      .transmit = {0.7f, 0.8f, 0.9f},
                      .ior = 1.3f,
                      .dispersion = {0.01f, 0, 0.03f}});
  scene.spheres = {{{-0.7f, 0, 0}, 1}, {{0.8f, 0.3f, -0.4f}, 0.9f}};
  scene.sphere_material = {0, 1};
  scene.lights = {{.position = {0, 9, 0}, .intensity = kBlack}};
  scene.cameras = {{.eye = {0, 0, 5}, .at = {0, 0, 0}, .tan_half_fov = 0.4f}};
  scene.Finish();
  const TraceResult result = TraceScene(scene, {.width = 64, .height = 64, .max_depth = 8});
  double sum = 0;
  for (const Vec3f& pixel : result.image.pixels)
    for (int c = 0; c < 3; ++c) {
      ASSERT_LE(pixel[c], 1 + 512 * 0x1p-24);
      sum += double(pixel[c]) / (3 * 64 * 64);
    }
  EXPECT_GT(sum, 0.98);
}

TEST(TracerModel, AThinPaneDoesNotBend) {
  Scene scene = DarkScene();
  scene.background = {0, 0, 1};
  AddMaterial(scene,
              {.name = "pane", .diffuse = kBlack, .transmit = {1, 1, 0.5f}, .ior = 1.5f, .thin = true});
  AddFloor(scene, {0, 0, 0}, 100);
  scene.cameras = {{.eye = {0, -1, 0}, .at = {3, 0, 0}, .tan_half_fov = 0.1f}};  // beyond the critical angle
  scene.Finish();
  const TraceResult result = TraceScene(scene, {.width = 4, .height = 4, .capture = true});
  EXPECT_EQ(result.reflection_rays, 0u);
  const RaySet *camera = FindSet(result, "camera"), *refraction = FindSet(result, "refraction.1");
  ASSERT_EQ(refraction->rays.size(), 16u);
  for (size_t i = 0; i < 16; ++i) EXPECT_LT(Length(Dir(camera->rays[i]) - Dir(refraction->rays[i])), kUlp);
  for (const Vec3f& pixel : result.image.pixels) EXPECT_EQ(pixel, (Vec3f{0, 0, 0.5f}));
}

/// A white floor under a light at height 4 in its own colour, with panes between that let `tints` through;
/// seen from below the panes.
struct Blockers {
  std::vector<Vec3f> tints;
  std::vector<float> heights;

  TraceResult Render() const {
    Scene scene = DarkScene();
    const uint32_t white = AddMaterial(scene, {.name = "white", .diffuse = kWhite});
    AddFloor(scene, {0, 0, 0}, 10, true, white);
    for (size_t i = 0; i < tints.size(); ++i) {
      const uint32_t pane = AddMaterial(scene, {.name = "pane", .diffuse = kBlack, .transmit = tints[i]});
      AddFloor(scene, {0, heights[i], 0}, 2, i % 2 == 0, pane);
    }
    scene.lights = {{.position = {0.1f, 4, 0.2f}}};
    scene.cameras = {LookingDown(0.1f, 0.5f, 0.2f)};
    scene.Finish();
    return Trace(scene, BuildTree(scene), {.width = 1, .height = 1});
  }
};

TEST(TracerModel, LightIsTintedOncePerSurface) {
  const Vec3f a{0.5f, 0.25f, 1}, b{0.5f, 0.75f, 0.125f}, half{0.5f, 0.5f, 0.5f};
  const auto expect = [](const Blockers& blockers, Vec3f color, uint64_t resumed) {
    const TraceResult result = blockers.Render();
    ExpectNear(result.image.pixels[0], ToDouble(color), kUlp);
    EXPECT_EQ(result.shadow_resumed, resumed);
    EXPECT_EQ(result.shadow_rays, 1u);
    EXPECT_EQ(result.shadow_blocked, uint64_t(color == kBlack));
  };
  expect({{}, {}}, kWhite, 0);
  expect({{a}, {1}}, a, 1);
  expect({{a, b}, {1, 2}}, a * b, 2);
  expect({{b, a}, {1, 2}}, a * b, 2);
  expect({{a, b}, {1, 1}}, a * b, 2);  // at the same t: by (t, prim)
  expect({{half, half, half, half}, {1, 1, 2, 2}}, half * half * half * half, 4);
  expect({{a, kBlack}, {1, 2}}, kBlack, 1);                   // opaque behind glass
  expect({{kBlack, a}, {1, 2}}, kBlack, 0);                   // and before it
  expect({{{1, 0, 0}, {0, 1, 0}, a}, {1, 2, 3}}, kBlack, 1);  // nothing is left after two
  expect({{a, b}, {5, 6}}, kWhite, 0);                        // behind the light
}

TEST(TracerModel, OpaqueScenesAskForTheFirstBlockerOnly) {
  // A glass material that no primitive uses changes nothing.
  Scene scene = DarkScene();
  AddMaterial(scene, {.name = "white", .diffuse = kWhite});
  AddMaterial(scene, {.name = "unused", .transmit = kWhite});
  AddFloor(scene, {0, 0, 0}, 10), AddFloor(scene, {0, 1, 0}, 10);
  scene.lights = {{.position = {0.1f, 4, 0.2f}}};
  scene.cameras = {LookingDown(0.1f, 0.5f, 0.2f)};
  scene.Finish();
  // One that cannot resume would be refused otherwise: here the very table says so.
  rb_structure cannot_resume = BuildTree(scene).structure();
  cannot_resume.capabilities &= ~uint64_t{RB_CAN_AFTER};
  const Tree tree({&cannot_resume, ParseContestant(Registry(), "brute").config}, scene.Geometry(),
                  DefaultBuildOptions());
  const TraceResult result = Trace(scene, tree, {.width = 1, .height = 1});
  EXPECT_EQ(result.shadow_blocked, 1u);
  EXPECT_EQ(result.shadow_resumed, 0u);
  scene.triangle_material[0] = 1;
  EXPECT_THROW(Trace(scene, tree, {.width = 1, .height = 1}), InputError);
}

TEST(TracerModel, ASpotShinesInItsCone) {
  const double inner = std::cos(0.2), outer = std::cos(0.4);
  Light spot{.position = {0, 1, 0},
             .kind = LightKind::kSpot,
             .direction = {0, -1, 0},
             .cos_inner = float(inner),
             .cos_outer = float(outer)};
  const auto share = [&](double angle) { return LightAt(spot, {std::tan(angle), 0, 0}).share; };
  EXPECT_EQ(share(0), 1);
  EXPECT_EQ(share(0.199), 1);
  EXPECT_EQ(share(0.401), 0);
  EXPECT_EQ(share(1.5), 0);
  // Half way in the cosine the ramp is 1/2, squared; cosines of floats differ by 2^-24 over a width of 0.06.
  EXPECT_NEAR(share(std::acos((inner + outer) / 2)), 0.25, 2 * 0x1p-24 / (inner - outer));
  EXPECT_EQ(LightAt(spot, {0, 2, 0}).share, 0) << "behind it";
  spot.cos_inner = spot.cos_outer = float(outer);  // an edge without a ramp
  EXPECT_EQ(share(0.399), 1);
  EXPECT_EQ(share(0.401), 0);

  // In a picture: no shadow rays outside the cone.
  Scene scene = DarkScene();
  AddMaterial(scene, {.name = "white", .diffuse = kWhite});
  AddFloor(scene, {0, 0, 0}, 10);
  scene.lights = {spot};
  for (const float x : {0.1f, 0.6f}) {
    scene.cameras = {LookingDown(x, 0.5f, 0)};
    scene.Finish();
    const TraceResult result = TraceScene(scene, {.width = 1, .height = 1});
    EXPECT_EQ(result.shadow_rays, x < 0.4f ? 1u : 0u);
    const double cosine = x < 0.4f ? 1 / std::sqrt(1.0 + double(x) * double(x)) : 0;
    EXPECT_NEAR(result.image.pixels[0].x, cosine, 1e-6);  // the point is seen to 1e-7
  }
}

TEST(TracerModel, RangeFadesLightToNothing) {
  const Light light{.position = {0, 0, 0}, .falloff = true, .range = 2};
  EXPECT_NEAR(LightAt(light, {1, 0, 0}).share, 1 - 1 / 16.0, 1e-15);
  EXPECT_NEAR(LightAt(light, {0.5, 0, 0}).share, 4 * (1 - 1 / 256.0), 1e-14);
  EXPECT_EQ(LightAt(light, {2, 0, 0}).share, 0);
  EXPECT_EQ(LightAt(light, {3, 0, 0}).share, 0);
}

TEST(TracerModel, ADirectionalLightIsEverywhereTheSame) {
  for (const float blocker : {0.0f, 1000.0f}) {
    Scene scene = DarkScene();
    AddMaterial(scene, {.name = "white", .diffuse = kWhite});
    AddFloor(scene, {0, 0, 0}, 10);
    if (blocker > 0) AddFloor(scene, {blocker * 0.75f, blocker, 0}, 100);
    scene.lights = {
        {.intensity = {2, 1, 0.5f}, .kind = LightKind::kDirectional, .direction = {-0.6f, -0.8f, 0}}};
    scene.cameras = {LookingDown(3, 0.5f, 4)};
    scene.Finish();
    const TraceResult result = TraceScene(scene, {.width = 1, .height = 1, .capture = true});
    const rb_ray& ray = FindSet(result, "shadow.0")->rays[0];
    ExpectNear(LoadVec3(ray.dir), {0.6, 0.8, 0}, kUlp);
    EXPECT_EQ(ray.tfar, kInf);
    EXPECT_EQ(result.shadow_blocked, uint64_t(blocker > 0)) << "however far";
    if (blocker == 0) ExpectNear(result.image.pixels[0], {1.6, 0.8, 0.4}, 2 * kUlp);
  }
}

TEST(TracerModel, VertexNormalsShadeAndFlatOnesDecideSides) {
  for (const float up : {1.0f, -1.0f}) {  // stored normals that point away are turned to the eye's side
    Scene scene = DarkScene();
    AddMaterial(scene, {.name = "m", .diffuse = kWhite, .reflect = kWhite});
    AddTriangle(scene, {-1, 0, 1}, {1, 0, 1}, {0, 0, -2});
    const Vec3f left{-0.6f * up, 0.8f * up, 0}, right{0.6f * up, 0.8f * up, 0};
    scene.normals = {left * 3.0f, right * 0.5f, {0, 0, 0}};  // of any length; 0: none
    scene.lights = {{.kind = LightKind::kDirectional, .direction = {0, -1, 0}},
                    // Before the vertex normal's plane, behind the triangle's.
                    {.kind = LightKind::kDirectional, .direction = {0.8f, 0.1f, 0}}};
    scene.cameras = {LookingDown(-0.5f, 0.5f, 1 - 1e-3f)};
    scene.Finish();
    const TraceResult result = TraceScene(scene, {.width = 1, .height = 1, .max_depth = 1, .capture = true});
    // Three quarters left, one right: (-0.3, 0.8); the third corner's share is below 0.001.
    const Vec3d normal = Normalize(Vec3d{-0.3, 0.8, 0});
    EXPECT_NEAR(result.image.pixels[0].x, normal.y, 1e-3);
    EXPECT_EQ(result.shadow_rays, 1u);
    const Vec3d mirrored = Dir(FindSet(result, "reflection.1")->rays[0]);
    EXPECT_LT(Length(mirrored - Vec3d{2 * normal.y * normal.x, 2 * normal.y * normal.y - 1, 0}), 2e-3);
  }
}

TEST(TracerModel, MirrorRaysStayOnTheirSideWhateverVertexNormalsSay) {
  Scene scene = DarkScene();
  AddMaterial(
      scene,
      {.name = "m", .diffuse = kBlack, .reflect = kWhite, .transmit = kWhite, .ior = 1.5f, .fresnel = true});
  AddTriangle(scene, {-5, 0, 5}, {5, 0, 5}, {0, 0, -9});
  scene.normals.assign(3, Normalize(Vec3f{2, 1, 0.3f}));
  for (const Vec3f eye : {Vec3f{3, 0.3f, 0}, Vec3f{-3, 0.3f, 0}, Vec3f{3, -0.3f, 0}, Vec3f{-3, -0.3f, 0}}) {
    scene.cameras = {{.eye = eye, .at = {0, 0, 0}, .tan_half_fov = 0.05f}};
    scene.Finish();
    const TraceResult result = TraceScene(scene, {.width = 8, .height = 8, .max_depth = 1, .capture = true});
    for (const char* label : {"reflection.1", "refraction.1"}) {
      const RaySet* set = FindSet(result, label);
      const double side = (eye.y > 0) == (label[3] == 'l') ? 1 : -1;
      if (set == nullptr) continue;
      for (const rb_ray& ray : set->rays) ASSERT_GE(Dir(ray).y * side, 0) << label << " " << eye.x;
    }
    ASSERT_NE(FindSet(result, "reflection.1"), nullptr);
    EXPECT_EQ(result.reflection_hits + result.refraction_hits, 0u);
  }
}

TEST(TracerModel, PathsOfLittleWeightEndWhereAsked) {
  Scene scene = DarkScene();
  AddMaterial(scene, {.name = "m", .diffuse = kBlack, .emission = kWhite, .reflect = {0.5f, 0.1f, 0}});
  AddFloor(scene, {0, 0, 0}, 1000), AddFloor(scene, {0, 1, 0}, 1000, false);
  scene.cameras = {{.eye = {0, 0.5f, 0}, .at = {0.3f, 0, 0}, .tan_half_fov = 0.2f}};
  scene.Finish();
  TraceOptions options{.width = 1, .height = 1, .max_depth = 9};
  EXPECT_EQ(TraceScene(scene, options).reflection_rays, 9u);
  options.min_contribution = 0.125f;  // 1/2, 1/4, 1/8
  EXPECT_EQ(TraceScene(scene, options).reflection_rays, 3u);
  options.min_contribution = 0.126f;
  EXPECT_EQ(TraceScene(scene, options).reflection_rays, 2u);
  options.min_contribution = -1;
  EXPECT_THROW(TraceScene(scene, options), InputError);
}

TEST(TracerRules, SpdSendsWhatItsRulesSay) {
  // A glass triangle whose stored normal looks away from the eye, and an opaque floor below.
  Scene scene = DarkScene();
  const uint32_t glass = AddMaterial(
      scene, {.name = "glass", .diffuse = kBlack, .transmit = {0.5f, 0.5f, 0.5f}, .fresnel = true});
  const uint32_t mirror =
      AddMaterial(scene, {.name = "mirror", .diffuse = kWhite, .reflect = {0.1f, 0.1f, 0.1f}});
  AddFloor(scene, {0, 1, 0}, 10, false, glass);
  AddFloor(scene, {0, 0, 0}, 10, true, mirror);
  scene.lights = {{.position = {0, 5, 0}}};
  scene.cameras = {LookingDown(0.1f, 3, 0.2f)};
  scene.Finish();
  TraceOptions options{.width = 1, .height = 1, .rules = TraceRules::kSpd, .capture = true};
  const TraceResult result = TraceScene(scene, options);
  EXPECT_EQ(FindSet(result, "camera")->rays[0].tnear, 1e-6f);
  // From above the glass: no light shines on its front, which looks down; both rays go on.
  EXPECT_EQ(FindSet(result, "shadow.0"), nullptr);
  EXPECT_EQ(FindSet(result, "reflection.1")->rays.size(), 1u);
  EXPECT_EQ(FindSet(result, "refraction.1")->rays.size(), 1u);
  // On the floor: one shadow ray, which the glass blocks.
  ASSERT_NE(FindSet(result, "shadow.1"), nullptr);
  EXPECT_EQ(FindSet(result, "shadow.1")->rays.size(), 1u);
  EXPECT_GE(result.shadow_blocked, 1u);
  EXPECT_EQ(result.shadow_resumed, 0u);
  // The camera ray has depth 1, the last depth 5.
  EXPECT_EQ(FindSet(result, "reflection.5"), nullptr);
  EXPECT_EQ(FindSet(result, "refraction.5"), nullptr);
  ASSERT_NE(FindSet(result, "reflection.4"), nullptr);
  EXPECT_EQ(FindSet(result, "reflection.4")->rays[0].tnear, 1e-6f);
}

/// One large tilted triangle, lit from both sides, seen from a distance: any shadow ray that is blocked found
/// the triangle it started on.
double SelfHits(SelfIntersection cure, float size, double scale) {
  Scene scene = DarkScene();
  AddMaterial(scene, {.name = "m", .diffuse = kWhite});
  const auto s = float(scale);
  AddTriangle(scene, {-3 * s, 0.1f * s, 2.9f * s}, {3.1f * s, -0.3f * s, 2 * s},
              {0.2f * s, 0.4f * s, -4 * s});
  scene.lights = {{.position = {2 * s, 3 * s, s}}, {.position = {-7 * s, 0.9f * s, 0}}};
  scene.cameras = {{.eye = {0, 4 * s, 0.5f * s}, .at = {0, 0, 0}, .tan_half_fov = 0.3f}};
  scene.Finish();
  const TraceResult result = Trace(
      scene, BuildTree(scene),
      {.width = 64, .height = 64, .self_intersection = cure, .self_intersection_size = size, .max_depth = 0});
  EXPECT_GT(result.shadow_rays, 4000u);
  return double(result.shadow_blocked) / double(result.shadow_rays);
}

TEST(TracerSelfIntersection, EachCureDoesWhatItIsKnownFor) {
  for (double scale : {1e-3, 1.0, 1e3, 1e6}) {
    EXPECT_EQ(SelfHits(SelfIntersection::kErrorBound, 0, scale), 0) << scale;
    EXPECT_GT(SelfHits(SelfIntersection::kNone, 0, scale), 0.2) << scale;  // about half
    EXPECT_EQ(SelfHits(SelfIntersection::kSkip, 0, scale), 0) << scale;
    EXPECT_EQ(SelfHits(SelfIntersection::kIntegerOffset, 0, scale), 0) << scale;
  }
  for (SelfIntersection cure : {SelfIntersection::kFixedTnear, SelfIntersection::kNormalOffset}) {
    EXPECT_EQ(SelfHits(cure, 1e-4f, 1), 0);
    EXPECT_GT(SelfHits(cure, 1e-4f, 1e6), 0.05) << "a fixed length fits one scale only";
    EXPECT_EQ(SelfHits(cure, 100, 1e6), 0);
  }
  EXPECT_THROW(SelfHits(SelfIntersection::kNormalOffset, -1, 1), InputError);
}

TEST(TracerSelfIntersection, LengthsAreThoseOfTheFileAndOfTheRay) {
  // A scene far too large is rescaled by a power of two; a shadow ray's direction is as long as its way.
  Scene scene = DarkScene();
  AddMaterial(scene, {.name = "m", .diffuse = kWhite});
  const float size = 0x1p40f;
  AddFloor(scene, {0, 0, 0}, size);
  scene.lights = {{.position = {0, size, 0}}};
  scene.cameras = {{.eye = {0, size / 2, 0}, .at = {0, 0, 0}, .up = {0, 0, -1}, .tan_half_fov = 1e-3f}};
  scene.Finish();
  ASSERT_NE(scene.scale_exponent, 0);
  const auto shadow = [&](SelfIntersection cure) {
    return FindSet(TraceScene(scene, {.width = 1,
                                      .height = 1,
                                      .self_intersection = cure,
                                      .self_intersection_size = size / 8,
                                      .capture = true}),
                   "shadow.0")
        ->rays[0];
  };
  // The way is `size` long.
  EXPECT_NEAR(shadow(SelfIntersection::kFixedTnear).tnear, 0.125f, 1e-6);
  EXPECT_NEAR(shadow(SelfIntersection::kNormalOffset).org[1], std::ldexp(size / 8, scene.scale_exponent),
              1e-6 * std::ldexp(double(size), scene.scale_exponent));
}

TEST(TracerSelfIntersection, SkipNamesTheTriangleAlone) {
  // A second triangle in the same place is hit: t is 0 but for rounding, so about half of the rays find it.
  Scene scene = DarkScene();
  AddMaterial(scene, {.name = "m", .diffuse = kWhite});
  for (int i = 0; i < 2; ++i) AddTriangle(scene, {-3, 0.1f, 2.9f}, {3.1f, -0.3f, 2}, {0.2f, 0.4f, -4});
  scene.lights = {{.position = {2, 3, 1}}};
  scene.cameras = {{.eye = {0, 4, 0.5f}, .at = {0, 0, 0}, .tan_half_fov = 0.3f}};
  scene.Finish();
  const TraceResult result = TraceScene(
      scene, {.width = 64, .height = 64, .self_intersection = SelfIntersection::kSkip, .max_depth = 0});
  EXPECT_GT(result.shadow_blocked, result.shadow_rays / 5);
}

TEST(TracerModel, WithoutAnythingThatScattersLightThereAreNoShadowRays) {
  Scene scene = DarkScene();
  AddMaterial(scene, {.name = "m", .diffuse = kBlack, .emission = kWhite});
  AddFloor(scene, {0, 0, 0}, 1);
  scene.lights = {{.position = {0, 2, 0}}};
  scene.cameras = {LookingDown(0, 1, 0)};
  scene.Finish();
  const TraceResult dark = TraceScene(scene, {.width = 4, .height = 4});
  EXPECT_EQ(dark.camera_hits, 16u);
  EXPECT_EQ(dark.shadow_rays, 0u);
  scene.materials[0].specular = {0.1f, 0.1f, 0.1f};
  EXPECT_EQ(TraceScene(scene, {.width = 4, .height = 4}).shadow_rays, 16u);
}

TEST(TracerModel, NormalsAreInterpolatedOverPolygons) {
  // An L: its corner at (1, 0, 1) points inwards. Stored normals lean along x and z as the corners lie.
  Scene scene;
  scene.positions = {{0, 0, 0}, {0, 0, 2}, {1, 0, 2}, {1, 0, 1}, {2, 0, 1}, {2, 0, 0}};
  scene.polygon_vertices = {0, 1, 2, 3, 4, 5};
  scene.polygons = {{0, 6}};
  for (const Vec3f& p : scene.positions) scene.normals.push_back({p.x - 1, 4, p.z - 1});
  scene.Finish();
  const SurfacePoint flat{{0, 0, 0}, Normalize(scene.PlaneOfPolygon(0).normal), 0};
  EXPECT_NEAR(flat.normal.y, 1, 1e-15);
  const auto at = [&](double x, double z) {
    SurfacePoint surface = flat;
    surface.point = {x, 0, z};
    return ShadingNormal(scene, {1, 0, 0, 0}, surface);
  };
  const auto stored = [&](size_t corner) { return Normalize(ToDouble(scene.normals[corner])); };
  const auto expect = [](Vec3d actual, Vec3d expected, double tolerance) {
    EXPECT_LT(Length(actual - expected), tolerance);
  };
  for (size_t i = 0; i < 6; ++i) {
    const Vec3f p = scene.positions[i], q = scene.positions[(i + 1) % 6];
    const Vec3d next = stored((i + 1) % 6);
    expect(at(p.x, p.z), stored(i), 1e-15);
    // A quarter along the edge, on it and just off it, inside.
    const Vec3d quarter = Normalize(stored(i) * 0.75 + next * 0.25);
    const double x = 0.75 * p.x + 0.25 * q.x, z = 0.75 * p.z + 0.25 * q.z;
    expect(at(x, z), quarter, 1e-15);
    const Vec3d inwards = Normalize(Cross(ToDouble(q) - ToDouble(p), flat.normal)) * -1e-6;
    expect(at(x + inwards.x, z + inwards.z), quarter, 1e-5);
  }
  // By symmetry about the diagonal; and between the corners' normals, not the plane's.
  const Vec3d inside = at(0.5, 0.5);
  EXPECT_NEAR(inside.x, inside.z, 1e-15);
  EXPECT_LT(inside.x, -0.05);
  EXPECT_GT(inside.y, 0.9);
}

}  // namespace
}  // namespace raybench
