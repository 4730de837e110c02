// A pyramid of objects of six pentagonal rings each, which join the middles of a dodecahedron's edges.

#include <cmath>

#include "datasets/generators/spd.h"

namespace raybench {
namespace {

const rb_param kParams[] = {
    SpdSize("layers of the pyramid: 5 size (size+1) (2 size+1) each of spheres and cylinders before a square",
            1, 200, 7)};

uint64_t Count(const void* config) {
  const uint64_t n = uint64_t(SpdSizeOf(config));
  return 10 * n * (n + 1) * (2 * n + 1) + 1;
}

constexpr double kRadius = 0.07412;  // of the tubes: rings touch

/// The corners of the six rings, which with their tubes fit into a unit sphere.
std::array<Vec3d, 30> Corners() {
  std::array<Vec3d, 30> corners;
  for (int k = 0; k < 5; ++k) {
    const Angle a = Degrees(72 * k);
    corners[size_t(k)] = Vec3d{a.cosine, a.sine, 0} * (1 / (1 + kRadius));
  }
  // The other five lean by the angle between adjacent faces, of whose half the cosine is cos 60 / sin 36.
  const double half = 0.5 / Degrees(36).sine;
  const Angle lean{2 * half * std::sqrt(1 - half * half), 2 * half * half - 1};
  for (int ring = 1; ring < 6; ++ring)
    for (int k = 0; k < 5; ++k)
      corners[size_t(5 * ring + k)] =
          Turn(Turn(corners[size_t(k)], kXAxis, lean), kZAxis, Degrees(72 * (ring - 1) + 36));
  return corners;
}

Scene Generate(const void* config, const LoadOptions&) {
  const int64_t n = SpdSizeOf(config);
  const Angle view = Degrees(22.5);     // half of the camera's
  const double spread = 1 / view.sine;  // between layers, so that none hides another
  const Vec3d eye{-1, -spread, 0.5};
  Scene scene =
      SpdScene(eye, eye + Vec3d{0, 1, 0}, kZAxis, 45, {{3, -spread, 3}, {-4, -spread, 1}, {2, -spread, -4}});
  const size_t count = Count(config) / 2;
  scene.spheres.reserve(count);
  scene.sphere_material.reserve(count);
  scene.cones.reserve(count);
  scene.cone_material.reserve(count);

  // The wall fills the picture and 1 % more.
  const double y = spread * double(n + 1), half = 1.01 * (y - eye.y) * view.sine / view.cosine;
  const uint32_t corners[] = {
      AddVertex(scene, {eye.x + half, y, eye.z + half}), AddVertex(scene, {eye.x - half, y, eye.z + half}),
      AddVertex(scene, {eye.x - half, y, eye.z - half}), AddVertex(scene, {eye.x + half, y, eye.z - half})};
  AddPolygon(scene, corners, AddSurface(scene, {"wall", {1, 1, 1}}));

  const Vec3d colors[6] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 1, 1}, {1, 0, 1}, {1, 1, 0}};
  const char* const names[6] = {"red", "green", "blue", "cyan", "magenta", "yellow"};
  uint32_t first = 0;
  for (int ring = 0; ring < 6; ++ring) {
    const uint32_t material = AddSurface(scene, {names[ring], colors[ring], 0.5, 0.2, 37});
    if (ring == 0) first = material;
  }
  const std::array<Vec3d, 30> rings = Corners();
  for (int64_t layer = 0; layer < n; ++layer)
    for (int64_t z = 0; z <= layer; ++z)
      for (int64_t x = 0; x <= layer; ++x) {
        const Vec3d center{double(2 * x - layer), spread * double(layer + 1), double(2 * z - layer)};
        for (uint32_t i = 0; i < 30; ++i) {
          const uint32_t previous = i % 5 == 0 ? i + 4 : i - 1, material = first + i / 5;
          AddCone(scene, center + rings[i], kRadius, center + rings[previous], kRadius, material);
          AddSphere(scene, center + rings[i], kRadius, material);
        }
      }
  scene.Finish();
  return scene;
}

}  // namespace

const Generator kRingsGenerator = SpdGenerator(
    "rings",
    "SPD: a pyramid of pentagonal rings of cylinders and spheres before a wall; the seed changes nothing",
    kParams, Count, Generate);

}  // namespace raybench
