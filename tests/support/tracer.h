// What the tracer's tests share: small scenes filled by hand, traced with `brute`.
#pragma once

#include <array>
#include <string>

#include "accel/base/random.h"
#include "accel/host/registry.h"
#include "datasets/scene/scene.h"
#include "tests/support/rays.h"
#include "tracer/rays/ray_set.h"
#include "tracer/tracer.h"

namespace raybench::testing {

inline constexpr Vec3f kBlack{0, 0, 0}, kWhite{1, 1, 1};

inline uint32_t AddMaterial(Scene& scene, const Material& material) {
  scene.materials.push_back(material);
  return uint32_t(scene.materials.size() - 1);
}

inline void AddTriangle(Scene& scene, Vec3f a, Vec3f b, Vec3f c, uint32_t material = 0) {
  const auto i = uint32_t(scene.positions.size());
  scene.positions.insert(scene.positions.end(), {a, b, c});
  scene.triangles.push_back({i, i + 1, i + 2});
  scene.triangle_material.push_back(material);
}

/// Corners counter-clockwise as seen from where the normal points.
inline void AddQuad(Scene& scene, Vec3f a, Vec3f b, Vec3f c, Vec3f d, uint32_t material = 0) {
  AddTriangle(scene, a, b, c, material);
  AddTriangle(scene, a, c, d, material);
}

/// Horizontal square of half side `half` around (x, y, z); normal up or down.
inline void AddFloor(Scene& scene, Vec3f center, float half, bool up = true, uint32_t material = 0) {
  const Vec3f a = center + Vec3f{-half, 0, half}, b = center + Vec3f{half, 0, half};
  const Vec3f c = center + Vec3f{half, 0, -half}, d = center + Vec3f{-half, 0, -half};
  up ? AddQuad(scene, a, b, c, d, material) : AddQuad(scene, a, d, c, b, material);
}

inline Tree BuildTree(const Scene& scene, const std::string& spec = "brute") {
  static const Registry registry;
  return Tree(ParseContestant(registry, spec), scene.Geometry(), DefaultBuildOptions());
}

inline const RaySet* FindSet(const TraceResult& result, const std::string& label) {
  for (const RaySet& set : result.ray_sets)
    if (set.Label() == label) return &set;
  return nullptr;
}

inline Vec3d Org(const rb_ray& ray) { return ToDouble(LoadVec3(ray.org)); }
inline Vec3d Dir(const rb_ray& ray) { return ToDouble(LoadVec3(ray.dir)); }

/// Empty, without light.
inline Scene DarkScene() {
  Scene scene;
  scene.ambient = scene.background = kBlack;
  return scene;
}

inline TraceResult TraceScene(const Scene& scene, TraceOptions options) {
  return Trace(scene, BuildTree(scene), options);
}

/// A bit of everything: random triangles and spheres that reflect and refract over a floor, two lights.
inline Scene MixedScene(uint64_t seed) {
  Scene scene;
  scene.name = "mixed";
  AddMaterial(scene, {.name = "matte", .diffuse = {0.6f, 0.5f, 0.4f}, .specular = {0.2f, 0.2f, 0.2f}});
  AddMaterial(scene, {.name = "mirror", .diffuse = {0.1f, 0.1f, 0.1f}, .reflect = {0.8f, 0.7f, 0.6f}});
  AddMaterial(scene, {.name = "glass",
                      .diffuse = {0, 0, 0},
                      .specular = {0.3f, 0.3f, 0.3f},
                      .reflect = {0.1f, 0.1f, 0.1f},
                      .transmit = {0.9f, 0.9f, 0.8f}});
  AddFloor(scene, {0, -1, 0}, 6);
  Random random(seed);
  auto point = [&] { return ToFloat(random.UnitVector() * (1.5 * random.NextDouble())); };
  for (uint32_t i = 0; i < 12; ++i) {
    const Vec3f a = point();
    AddTriangle(scene, a, a + point(), a + point(), i % 3);
  }
  for (uint32_t i = 0; i < 6; ++i) {
    scene.spheres.push_back({point(), 0.1f + 0.3f * random.NextFloat()});
    scene.sphere_material.push_back(i % 3);
  }
  scene.lights = {{.position = {3, 4, 2}, .intensity = {0.7f, 0.7f, 0.7f}},
                  {.position = {-3, 3, 3}, .intensity = {9, 8, 7}, .falloff = true}};
  scene.cameras = {{.eye = {0.3f, 0.8f, 4}, .at = {0, -0.1f, 0}, .tan_half_fov = 0.45f}};
  scene.Finish();
  return scene;
}

}  // namespace raybench::testing
