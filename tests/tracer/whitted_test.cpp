#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <cstring>
#include <limits>
#include <set>

#include "accel/base/parallel.h"
#include "datasets/scene/needs.h"
#include "tests/support/tracer.h"

namespace raybench {
namespace {

using testing::AddFloor;
using testing::AddMaterial;
using testing::AddQuad;
using testing::BuildTree;
using testing::DarkScene;
using testing::Dir;
using testing::FindSet;
using testing::kBlack;
using testing::kInf;
using testing::MixedScene;
using testing::Org;
using testing::TraceScene;

/// The camera's float directions, computed the plain way.
Vec3d PixelDirection(const Camera& camera, uint32_t width, uint32_t height, uint32_t x, uint32_t y) {
  const Vec3d forward = Normalize(ToDouble(camera.at) - ToDouble(camera.eye));
  const Vec3d right = Normalize(Cross(forward, ToDouble(camera.up))), up = Cross(right, forward);
  const double tan = camera.tan_half_fov, aspect = double(width) / height;
  return Normalize(forward + right * ((2 * (x + 0.5) / width - 1) * tan * aspect) +
                   up * ((1 - 2 * (y + 0.5) / height) * tan));
}

TEST(TracerCamera, CornersAndCentreLookWhereTheyShould) {
  Scene scene = DarkScene();
  scene.cameras = {{.eye = {1, 2, 3}, .at = {1, 2, -7}, .up = {0, 2, 0}, .tan_half_fov = 0.5f}};
  scene.Finish();
  const TraceResult result = TraceScene(scene, {.width = 7, .height = 5, .capture = true});
  const RaySet* camera = FindSet(result, "camera");
  ASSERT_NE(camera, nullptr);
  ASSERT_EQ(camera->rays.size(), 35u);  // a single tile: row by row
  auto expect = [&](size_t slot, Vec3d direction) {
    const Vec3d d = Dir(camera->rays[slot]), e = Normalize(direction);
    EXPECT_LT(Length(d - e), 1e-7) << slot;
    EXPECT_EQ(Org(camera->rays[slot]), (Vec3d{1, 2, 3}));
    EXPECT_EQ(camera->rays[slot].tnear, 0);
    EXPECT_EQ(camera->rays[slot].tfar, kInf);
  };
  const double x = 0.5 * 7 / 5 * (6.0 / 7), y = 0.5 * (4.0 / 5);  // pixel centres
  expect(0, {-x, y, -1});
  expect(6, {x, y, -1});
  expect(28, {-x, -y, -1});
  expect(34, {x, -y, -1});
  expect(17, {0, 0, -1});
}

TEST(TracerCamera, RaysComeInTilesAndEveryPixelOnce) {
  for (auto [width, height] : {std::pair{20u, 13u}, {8u, 8u}, {1u, 1u}, {64u, 3u}, {3u, 40u}}) {
    Scene scene = DarkScene();
    scene.cameras = {{.eye = {1, 2, 3}, .at = {0, 0, 0}, .up = {0.3f, 1, 0}, .tan_half_fov = 0.7f}};
    scene.Finish();
    const TraceResult result =
        TraceScene(scene, {.width = width, .height = height, .capture = true, .band_rays = 50});
    const std::vector<rb_ray>& rays = FindSet(result, "camera")->rays;
    ASSERT_EQ(rays.size(), size_t{width} * height);
    size_t slot = 0;
    for (uint32_t y0 = 0; y0 < height; y0 += 8)
      for (uint32_t x0 = 0; x0 < width; x0 += 8)
        for (uint32_t y = y0; y < std::min(height, y0 + 8); ++y)
          for (uint32_t x = x0; x < std::min(width, x0 + 8); ++x) {
            const Vec3d expected = PixelDirection(scene.cameras[0], width, height, x, y);
            ASSERT_LT(Length(Dir(rays[slot++]) - expected), 1e-6) << x << " " << y;
          }
  }
}

TEST(TracerShading, ABlockerShadowsTheFloorWhereGeometrySays) {
  Scene scene = DarkScene();
  AddMaterial(scene, {.name = "m", .diffuse = {0.5f, 0.25f, 1}});
  AddFloor(scene, {0, 0, 0}, 10);
  AddFloor(scene, {1, 1, 0}, 0.5f);  // throws its shadow on 1 < x < 3, |z| < 1
  scene.lights = {{.position = {0, 2, 0}, .intensity = {1, 1, 0.5f}}};
  scene.cameras = {{.eye = {2, 0.9f, 0}, .at = {2, 0, 0}, .up = {0, 0, -1}, .tan_half_fov = 2}};
  scene.Finish();
  const uint32_t n = 96;
  const TraceResult result = TraceScene(scene, {.width = n, .height = n});
  size_t shadowed = 0, lit = 0;
  for (uint32_t y = 0; y < n; ++y)
    for (uint32_t x = 0; x < n; ++x) {
      const Vec3d d = PixelDirection(scene.cameras[0], n, n, x, y);
      const Vec3d p = Vec3d{2, 0.9, 0} + d * (0.9 / -d.y);
      const double inside = std::min(1 - std::abs(p.x - 2), 1 - std::abs(p.z));  // > 0 in the shadow
      if (std::abs(inside) < 1e-4) continue;
      const Vec3f pixel = result.image.pixels[y * n + x];
      if (inside > 0) {
        ASSERT_EQ(pixel, kBlack) << p.x << " " << p.z;
        ++shadowed;
      } else {
        const double cosine = 2 / std::sqrt(p.x * p.x + 4 + p.z * p.z);
        ASSERT_NEAR(pixel.x, 0.5 * cosine, 1e-5);
        ASSERT_NEAR(pixel.y, 0.25 * cosine, 1e-5);
        ASSERT_NEAR(pixel.z, 0.5 * cosine, 1e-5);
        ++lit;
      }
    }
  EXPECT_GT(shadowed, 1000u);
  EXPECT_GT(lit, 1000u);
}

TEST(TracerShading, WhatLiesBehindTheLightOrCarriesItBlocksNothing) {
  for (float height : {2.0f, 2.5f}) {  // a ceiling in which the light lies, and one behind it
    Scene scene = DarkScene();
    AddMaterial(scene, {.name = "m", .diffuse = {1, 1, 1}});
    AddFloor(scene, {0, 0, 0}, 10);
    AddFloor(scene, {0, height, 0}, 10, false);
    scene.lights = {{.position = {0.1f, 2, 0.2f}}};
    scene.cameras = {{.eye = {0, 1, 0}, .at = {0, 0, 0.5f}, .tan_half_fov = 1}};
    scene.Finish();
    const TraceResult result = TraceScene(scene, {.width = 64, .height = 64});
    for (const Vec3f& pixel : result.image.pixels) ASSERT_GT(pixel.x, 0) << height;
  }
}

TEST(TracerShading, BothSidesOfASurfaceAreLit) {
  for (bool up : {true, false}) {
    Scene scene = DarkScene();
    AddMaterial(scene, {.name = "m", .diffuse = {1, 1, 1}});
    AddFloor(scene, {0, 0, 0}, 10, up);
    scene.lights = {{.position = {0, 3, 0}}, {.position = {0, -3, 0}}};  // the second is behind
    scene.cameras = {{.eye = {0, 1, 0}, .at = {0, 0, 0}, .up = {0, 0, -1}, .tan_half_fov = 0.01f}};
    scene.Finish();
    const TraceResult result = TraceScene(scene, {.width = 1, .height = 1});
    EXPECT_NEAR(result.image.pixels[0].x, 1, 1e-6);
    EXPECT_EQ(result.shadow_rays, 1u);
  }
}

TEST(TracerShading, PhongEmissionAmbientAndBackgroundAddUp) {
  Scene scene = DarkScene();
  scene.ambient = {0.5f, 0.25f, 0};
  scene.background = {0.125f, 0.25f, 0.5f};
  AddMaterial(scene, {.name = "m",
                      .diffuse = {0.2f, 0.4f, 0.6f},
                      .specular = {1, 0.5f, 0.25f},
                      .shininess = 10,
                      .emission = {0, 0, 0.375f}});
  AddFloor(scene, {0, 0, 0}, 1);
  // The eye looks straight down, so the mirrored direction is up; the light stands at 60 degrees from it.
  const double cosine = 0.5;
  scene.lights = {{.position = {float(std::sqrt(3.0)), 1, 0}, .intensity = {2, 2, 2}}};
  scene.cameras = {{.eye = {0, 1, 0}, .at = {0, 0, 0}, .up = {0, 0, -1}, .tan_half_fov = 3}};
  scene.Finish();
  const uint32_t n = 33;
  const Image image = TraceScene(scene, {.width = n, .height = n}).image;
  const Vec3f centre = image.pixels[n / 2 * n + n / 2];
  const double phong = std::pow(cosine, 10) * 2;
  EXPECT_NEAR(centre.x, 0.5 * 0.2 + 2 * cosine * 0.2 + phong, 1e-5);
  EXPECT_NEAR(centre.y, 0.25 * 0.4 + 2 * cosine * 0.4 + phong * 0.5, 1e-5);
  EXPECT_NEAR(centre.z, 0.375 + 2 * cosine * 0.6 + phong * 0.25, 1e-5);
  EXPECT_EQ(image.pixels[0], scene.background);
}

TEST(TracerShading, FalloffIsInverseSquare) {
  auto brightness = [](float height, bool falloff) {
    Scene scene = DarkScene();
    AddMaterial(scene, {.name = "m", .diffuse = {1, 1, 1}});
    AddFloor(scene, {0, 0, 0}, 10);
    scene.lights = {{.position = {0, height, 0}, .intensity = {3, 3, 3}, .falloff = falloff}};
    scene.cameras = {{.eye = {0, 0.5f, 0}, .at = {0, 0, 0}, .up = {0, 0, -1}, .tan_half_fov = 0.01f}};
    scene.Finish();
    return TraceScene(scene, {.width = 1, .height = 1}).image.pixels[0].x;
  };
  EXPECT_NEAR(brightness(1, true), 3, 1e-5);
  EXPECT_NEAR(brightness(2, true), 0.75, 1e-5);
  EXPECT_NEAR(brightness(5, true), 0.12, 1e-5);
  EXPECT_NEAR(brightness(5, false), 3, 1e-5);
}

TEST(TracerSecondary, AMirrorShowsTheWallAtTheMirroredPlace) {
  Scene scene = DarkScene();
  const uint32_t mirror = AddMaterial(scene, {.name = "m", .diffuse = kBlack, .reflect = {0.5f, 1, 1}});
  const uint32_t red = AddMaterial(scene, {.name = "m", .diffuse = kBlack, .emission = {1, 0, 0}});
  const uint32_t green = AddMaterial(scene, {.name = "m", .diffuse = kBlack, .emission = {0, 1, 0}});
  AddFloor(scene, {0, 0, 0}, 5, true, mirror);
  AddQuad(scene, {-50, 0, -5}, {50, 0, -5}, {50, 1, -5}, {-50, 1, -5}, red);      // wall below y = 1
  AddQuad(scene, {-50, 1, -5}, {50, 1, -5}, {50, 90, -5}, {-50, 90, -5}, green);  // and above
  scene.cameras = {{.eye = {0, 1, 0}, .at = {0, 0, -1}, .tan_half_fov = 0.7f}};
  scene.Finish();
  const uint32_t n = 64;
  const TraceResult result = TraceScene(scene, {.width = n, .height = n, .max_depth = 1});
  size_t reds = 0, greens = 0;
  for (uint32_t y = 0; y < n; ++y)
    for (uint32_t x = 0; x < n; ++x) {
      const Vec3d d = PixelDirection(scene.cameras[0], n, n, x, y);
      const Vec3d floor = Vec3d{0, 1, 0} + d * (1 / -d.y), wall = Vec3d{0, 1, 0} + d * (5 / -d.z);
      if (d.y >= -1e-3 || d.z >= -1e-3 || floor.z < -4.999 || std::abs(floor.x) > 4.999) continue;
      const double mirrored = -wall.y;  // the wall's virtual image lies under the floor
      if (mirrored < 1e-4 || std::abs(mirrored - 1) < 1e-4 || std::abs(wall.x) > 49) continue;
      const Vec3f pixel = result.image.pixels[y * n + x];
      if (mirrored < 1) {
        ASSERT_EQ(pixel, (Vec3f{0.5f, 0, 0}));
        ++reds;
      } else if (mirrored < 89) {
        ASSERT_EQ(pixel, (Vec3f{0, 1, 0}));
        ++greens;
      }
    }
  EXPECT_GT(reds, 100u);
  EXPECT_GT(greens, 100u);
}

TEST(TracerSecondary, AGlassSlabShiftsRaysAsSnellSays) {
  const double ior = 1.5, thickness = 0.25;
  Scene scene = DarkScene();
  const uint32_t glass =
      AddMaterial(scene, {.name = "m", .diffuse = kBlack, .transmit = {1, 1, 1}, .ior = float(ior)});
  AddFloor(scene, {0, 0, 0}, 20, true, glass);
  AddFloor(scene, {0, float(-thickness), 0}, 20, false, glass);
  scene.background = {0.25f, 0.5f, 0.75f};
  scene.cameras = {{.eye = {0, 1, 0}, .at = {0.8f, 0, 0.3f}, .tan_half_fov = 0.8f}};
  scene.Finish();
  const TraceResult result = TraceScene(scene, {.width = 24, .height = 24, .max_depth = 2, .capture = true});
  const RaySet *camera = FindSet(result, "camera"), *inside = FindSet(result, "refraction.1"),
               *outside = FindSet(result, "refraction.2");
  ASSERT_TRUE(camera && inside && outside);
  size_t downward = 0;
  for (const rb_ray& ray : camera->rays) {
    const Vec3d d = Dir(ray);
    if (d.y * 18 > -1) continue;  // passes the horizon or the slab's rim
    const Vec3d in = Dir(inside->rays[downward]), out = Dir(outside->rays[downward]);
    const double sin_i = std::hypot(d.x, d.z), sin_t = sin_i / ior;
    ASSERT_NEAR(std::hypot(in.x, in.z), sin_t, 1e-6);
    ASSERT_NEAR(Length(in), 1, 1e-6);
    ASSERT_LT(Length(out - d), 2e-6) << "parallel faces";
    const Vec3d entry = Org(ray) + d * (1 / -d.y), exit = Org(outside->rays[downward]);
    const double path = thickness * sin_t / std::sqrt(1 - sin_t * sin_t);
    ASSERT_NEAR(exit.x, entry.x + d.x / sin_i * path, 2e-4);
    ASSERT_NEAR(exit.z, entry.z + d.z / sin_i * path, 2e-4);
    ASSERT_NEAR(exit.y, -thickness, 2e-5);
    ++downward;
  }
  EXPECT_GT(downward, 300u);
  ASSERT_EQ(inside->rays.size(), downward);
  ASSERT_EQ(outside->rays.size(), downward);
  EXPECT_EQ(result.reflection_rays, 0u);
  for (const Vec3f& pixel : result.image.pixels) ASSERT_EQ(pixel, scene.background);
}

TEST(TracerSecondary, BeyondTheCriticalAngleReflectionIsTotal) {
  const double ior = 1.5;
  Scene scene = DarkScene();
  const uint32_t glass =
      AddMaterial(scene, {.name = "m", .diffuse = kBlack, .transmit = {1, 0.5f, 1}, .ior = float(ior)});
  AddFloor(scene, {0, 1, 0}, 1000, true, glass);  // the eye is in the glass and looks up
  scene.background = {1, 1, 1};
  scene.cameras = {{.eye = {0, 0, 0}, .at = {1, 1, 0}, .tan_half_fov = 0.6f}};
  scene.Finish();
  const TraceResult result = TraceScene(scene, {.width = 32, .height = 32, .max_depth = 1, .capture = true});
  std::vector<Vec3d> reflected, refracted;
  for (const rb_ray& ray : FindSet(result, "camera")->rays) {
    const Vec3d d = Dir(ray);
    if (d.y < 2e-3) continue;
    const double sin_t = ior * std::hypot(d.x, d.z);
    ASSERT_GT(std::abs(sin_t - 1), 1e-5) << "choose another camera";
    if (sin_t > 1)
      reflected.push_back({d.x, -d.y, d.z});
    else
      refracted.push_back({d.x * ior, std::sqrt(1 - sin_t * sin_t), d.z * ior});
  }
  ASSERT_GT(reflected.size(), 100u);
  ASSERT_GT(refracted.size(), 100u);
  const RaySet *reflections = FindSet(result, "reflection.1"), *refractions = FindSet(result, "refraction.1");
  ASSERT_TRUE(reflections && refractions);
  ASSERT_EQ(reflections->rays.size(), reflected.size());
  ASSERT_EQ(refractions->rays.size(), refracted.size());
  for (size_t i = 0; i < reflected.size(); ++i)
    ASSERT_LT(Length(Dir(reflections->rays[i]) - reflected[i]), 1e-6);
  for (size_t i = 0; i < refracted.size(); ++i)
    ASSERT_LT(Length(Dir(refractions->rays[i]) - refracted[i]), 1e-5);
  // Nothing is lost: the mirror ray carries the transmitted weight.
  for (const Vec3f& pixel : result.image.pixels)
    ASSERT_TRUE(pixel == (Vec3f{1, 0.5f, 1}) || pixel == (Vec3f{1, 1, 1}));
}

TEST(TracerSecondary, TheDepthLimitCountsBounces) {
  Scene scene = DarkScene();
  const uint32_t mirror = AddMaterial(
      scene, {.name = "m", .diffuse = {0, 0, 1}, .emission = {1, 1, 1}, .reflect = {0.5f, 0.5f, 0.5f}});
  AddFloor(scene, {0, 0, 0}, 1000, true, mirror);
  AddFloor(scene, {0, 1, 0}, 1000, false, mirror);
  scene.lights = {{.position = {0, 0.5f, 0}, .intensity = {0, 0, 1}}};  // red is the mirrors' alone
  scene.cameras = {{.eye = {0, 0.5f, 0}, .at = {0.3f, 0, 0}, .tan_half_fov = 0.2f}};
  scene.Finish();
  for (uint32_t depth = 0; depth <= 6; ++depth) {
    const TraceResult result =
        TraceScene(scene, {.width = 10, .height = 10, .max_depth = depth, .capture = true});
    EXPECT_EQ(result.camera_rays, 100u);
    EXPECT_EQ(result.reflection_rays, 100u * depth);
    EXPECT_EQ(result.refraction_rays, 0u);
    EXPECT_EQ(result.shadow_rays, 100u * (depth + 1));
    EXPECT_EQ(FindSet(result, "reflection." + std::to_string(depth + 1)), nullptr);
    EXPECT_NE(FindSet(result, "shadow." + std::to_string(depth)), nullptr);
    for (const Vec3f& pixel : result.image.pixels) ASSERT_EQ(pixel.x, 2 - std::ldexp(1.0f, -int(depth)));
  }
}

TEST(TracerDeterminism, PictureAndRaySetsDependOnNeitherThreadsNorBands) {
  const ThreadLimit four_threads(4);  // on any machine
  const Scene scene = MixedScene(11);
  const Tree tree = BuildTree(scene);
  const TraceOptions options{.width = 123, .height = 75, .max_depth = 4, .threads = 1, .capture = true};
  const TraceResult reference = Trace(scene, tree, options);
  ASSERT_NE(FindSet(reference, "refraction.4"), nullptr);  // there is enough to get wrong
  ASSERT_NE(FindSet(reference, "reflection.4"), nullptr);
  for (uint32_t threads : {1, 2, 3, 0})
    for (uint32_t band : {1u << 20, 5000u, 777u}) {
      TraceOptions other = options;
      other.threads = threads, other.band_rays = band;
      const TraceResult result = Trace(scene, tree, other);
      ASSERT_EQ(std::memcmp(result.image.pixels.data(), reference.image.pixels.data(),
                            reference.image.pixels.size() * sizeof(Vec3f)),
                0)
          << threads << " threads, bands of " << band;
      ASSERT_EQ(result.ray_sets.size(), reference.ray_sets.size());
      for (size_t i = 0; i < result.ray_sets.size(); ++i) {
        ASSERT_EQ(result.ray_sets[i].Label(), reference.ray_sets[i].Label());
        ASSERT_EQ(result.ray_sets[i].hash, reference.ray_sets[i].hash) << reference.ray_sets[i].Label();
      }
    }
}

TEST(TracerCapture, SetsHoldExactlyTheRaysThatWereTraced) {
  const Scene scene = MixedScene(12);
  const Tree tree = BuildTree(scene);
  TraceOptions options{.width = 100, .height = 60, .max_depth = 3, .capture = true};
  const TraceResult result = Trace(scene, tree, options);
  uint64_t camera = 0, shadow = 0, reflection = 0, refraction = 0;
  std::vector<std::string> labels;
  for (const RaySet& set : result.ray_sets) {
    labels.push_back(set.Label());
    EXPECT_FALSE(set.rays.empty());
    EXPECT_EQ(set.order, "traced");
    EXPECT_EQ(set.invalid_rays, 0u);
    EXPECT_EQ(set.query, uint32_t(set.kind == "shadow" ? RB_ANY : RB_CLOSEST));
    EXPECT_EQ(set.hash.size(), 16u);
    (set.kind == "camera"       ? camera
     : set.kind == "shadow"     ? shadow
     : set.kind == "reflection" ? reflection
                                : refraction) += set.rays.size();
  }
  EXPECT_EQ(camera, result.camera_rays);
  EXPECT_EQ(shadow, result.shadow_rays);
  EXPECT_EQ(reflection, result.reflection_rays);
  EXPECT_EQ(refraction, result.refraction_rays);
  EXPECT_EQ(labels, (std::vector<std::string>{"camera", "shadow.0", "reflection.1", "refraction.1",
                                              "shadow.1", "reflection.2", "refraction.2", "shadow.2",
                                              "reflection.3", "refraction.3", "shadow.3"}));
  options.capture = false;
  const TraceResult plain = Trace(scene, tree, options);
  EXPECT_TRUE(plain.ray_sets.empty());
  EXPECT_EQ(plain.image.pixels, result.image.pixels);
  EXPECT_EQ(plain.shadow_rays, result.shadow_rays);
}

TEST(TracerCapture, ShadowRaysReachTheirLightAtOne) {
  const Scene scene = MixedScene(12);
  const TraceResult result = TraceScene(scene, {.width = 64, .height = 64, .capture = true});
  for (const rb_ray& ray : FindSet(result, "shadow.0")->rays) {
    const Vec3d end = Org(ray) + Dir(ray);
    double nearest = 1;
    for (const Light& light : scene.lights)
      nearest = std::min(nearest, Length(end - ToDouble(light.position)));
    ASSERT_LT(nearest, 1e-6);
    ASSERT_LT(ray.tfar, 1);
    ASSERT_GT(ray.tfar, 0.99999f);
  }
}

TEST(TracerProgress, RisesToOneAndComesFromOneThreadAtATime) {
  const Scene scene = MixedScene(12);
  std::vector<double> seen;
  std::atomic<int> inside{0};
  TraceOptions options{.width = 50, .height = 50, .band_rays = 600};
  options.progress = [&](double fraction) {
    ASSERT_EQ(inside.fetch_add(1), 0);
    seen.push_back(fraction);
    inside.fetch_sub(1);
  };
  TraceScene(scene, options);
  ASSERT_GT(seen.size(), 5u);
  EXPECT_TRUE(std::is_sorted(seen.begin(), seen.end()));
  EXPECT_GE(seen.front(), 0);
  EXPECT_EQ(seen.back(), 1);
}

TEST(TracerErrors, BadOptionsAreRefused) {
  const Scene scene = MixedScene(12);
  EXPECT_THROW(TraceScene(scene, {.width = 0, .height = 5}), InputError);
  EXPECT_THROW(TraceScene(scene, {.width = 5, .height = 0}), InputError);
  EXPECT_THROW(TraceScene(scene, {.width = 100000, .height = 100000}), InputError);
  EXPECT_THROW(TraceScene(scene, {.width = 5, .height = 5, .band_rays = 0}), InputError);
}

TEST(TracerErrors, AnInventedPrimitiveIsNotShaded) {
  const Scene scene = MixedScene(12);
  Scene smaller = MixedScene(12);
  smaller.triangles.resize(1), smaller.triangle_material.resize(1), smaller.triangle_face.resize(1);
  smaller.spheres.clear(), smaller.sphere_material.clear();
  smaller.Finish();
  // The tree knows more primitives than the scene that is shaded.
  EXPECT_THROW(Trace(smaller, BuildTree(scene), {.width = 40, .height = 40}), std::runtime_error);
}

TEST(TracerEmptyScene, IsBackground) {
  Scene scene;
  scene.Finish();
  const TraceResult result = TraceScene(scene, {.width = 9, .height = 9, .capture = true});
  for (const Vec3f& pixel : result.image.pixels) ASSERT_EQ(pixel, scene.background);
  ASSERT_EQ(result.ray_sets.size(), 1u);
  EXPECT_EQ(result.ray_sets[0].outside_rays, 81u);
}

TEST(TracerQueryParallel, AnswersAsOneCallDoes) {
  const Scene scene = MixedScene(12);
  const Tree tree = BuildTree(scene);
  const RaySet set = RandomRays(scene, 20000, 3);
  const size_t n = set.rays.size();
  std::vector<uint32_t> skip(n), after(n);
  for (size_t i = 0; i < n; ++i) {
    skip[i] = i % 3 ? RAYBENCH_NONE : uint32_t(i % scene.triangles.size());
    after[i] = RAYBENCH_NONE;
  }
  struct Answer {
    std::vector<rb_hit> hits;
    std::vector<uint8_t> occluded;
    std::vector<rb_counts> counts;
  };
  auto ask = [&](uint32_t kind, bool counted, auto run) {
    Answer answer{std::vector<rb_hit>(n), std::vector<uint8_t>(n), std::vector<rb_counts>(n)};
    rb_query query{};
    query.struct_size = sizeof query, query.kind = kind, query.n = n, query.rays = set.rays.data();
    query.skip = skip.data(), query.after = after.data();
    if (kind == RB_CLOSEST) query.hits = answer.hits.data();
    if (kind == RB_ANY) query.occluded = answer.occluded.data();
    if (counted) query.counts = answer.counts.data();
    run(query);
    return answer;
  };
  auto same = [](const auto& a, const auto& b) {
    return std::memcmp(a.data(), b.data(), a.size() * sizeof a[0]) == 0;
  };
  for (uint32_t kind : {RB_CLOSEST, RB_ANY})
    for (bool counted : {false, true}) {
      const Answer once =
          ask(kind, counted, [&](const rb_query& q) { counted ? tree.QueryCounted(q) : tree.Query(q); });
      for (uint32_t threads : {0, 1, 2, 3}) {
        const Answer parallel =
            ask(kind, counted, [&](const rb_query& q) { QueryParallel(tree, q, threads); });
        EXPECT_TRUE(same(once.hits, parallel.hits)) << kind << counted << threads;
        EXPECT_TRUE(same(once.occluded, parallel.occluded)) << kind << counted << threads;
        EXPECT_TRUE(same(once.counts, parallel.counts)) << kind << counted << threads;
      }
      EXPECT_EQ(once.counts.back().prims > 0, counted);
    }
}

TEST(TracerInvalidRays, ReachNoStructureAndAreCounted) {
  Scene scene = DarkScene();
  scene.background = {1, 1, 1};
  AddMaterial(scene, {.name = "m", .diffuse = kBlack, .transmit = {1, 1, 1}, .ior = std::nanf("")});
  AddFloor(scene, {0, 0, 0}, 10);
  scene.cameras = {{.eye = {0, 1, 0}, .at = {0, 0, 0}, .up = {0, 0, -1}, .tan_half_fov = 0.5f}};
  scene.Finish();
  const TraceResult result = TraceScene(scene, {.width = 8, .height = 8, .max_depth = 1, .capture = true});
  const RaySet* refraction = FindSet(result, "refraction.1");
  ASSERT_NE(refraction, nullptr);
  EXPECT_EQ(refraction->rays.size(), 64u);
  EXPECT_EQ(refraction->invalid_rays, 64u);
  for (const rb_ray& ray : refraction->rays) ASSERT_TRUE(IsValidRay(ray));
  for (const Vec3f& pixel : result.image.pixels) ASSERT_EQ(pixel, scene.background);  // a defined miss
}

TEST(TracerShading, DoingAllThatAnySceneMayNeedMakesTheSamePicture) {
  Scene mixed = MixedScene(11), opaque = MixedScene(11);
  for (Material& m : opaque.materials) m.transmit = kBlack;
  ASSERT_TRUE(NeedsOf(mixed).transmittance);
  ASSERT_FALSE(NeedsOf(opaque).transmittance);
  for (const Scene* scene : {&mixed, &opaque}) {
    TraceOptions options{.width = 40, .height = 30, .max_depth = 3};
    const TraceResult needed = TraceScene(*scene, options);
    options.all_needs = true;
    const TraceResult all = TraceScene(*scene, options);
    EXPECT_EQ(all.image.pixels, needed.image.pixels);
    EXPECT_EQ(all.shadow_rays, needed.shadow_rays);
    EXPECT_EQ(all.shadow_blocked, needed.shadow_blocked);
  }
}

}  // namespace
}  // namespace raybench
