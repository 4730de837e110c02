// A cube of meshing gears, some of glass. A gear's two faces are concave polygons of 144 corners.

#include <cmath>

#include "datasets/generators/spd.h"

namespace raybench {
namespace {

const rb_param kParams[] = {SpdSize("gears along each side: 146 size^3 polygons on a square", 1, 100, 4)};

constexpr uint32_t kTeeth = 36, kCorners = 4 * kTeeth;
constexpr double kToothAngle = 360.0 / kTeeth;
/// Of the radius: where teeth end, a little short of the next gear, and where they begin.
constexpr double kOuter = 0.995, kInner = 0.9;

uint64_t Count(const void* config) {
  const uint64_t n = uint64_t(SpdSizeOf(config));
  return n * n * n * (kCorners + 2) + 1;
}

void AddGear(Scene& scene, Vec3d center, double start, double radius, double thickness, uint32_t material) {
  // Each tooth has two corners outside and two inside; the same ring again at the bottom.
  const struct {
    double angle, radius;
  } tooth[4] = {{-0.19, kOuter}, {0.19, kOuter}, {0.3, kInner}, {0.7, kInner}};
  uint32_t top[kCorners], bottom[kCorners], reversed[kCorners];
  for (uint32_t* ring : {top, bottom}) {
    const double z = ring == top ? center.z : center.z - thickness;
    for (uint32_t i = 0; i < kCorners; ++i) {
      const auto [angle, reach] = tooth[i % 4];
      const Angle a = Degrees(start + kToothAngle * (i / 4 + angle));
      const double r = radius * reach;
      ring[i] = AddVertex(scene, {center.x + r * a.cosine, center.y + r * a.sine, z});
    }
  }
  // The bottom is seen from below: it runs the other way, from the first tooth's second corner.
  for (uint32_t i = 0; i < kCorners; ++i) reversed[i] = bottom[(kCorners + 1 - i) % kCorners];

  AddPolygon(scene, top, material);
  for (uint32_t i = 0; i < kCorners; ++i) {
    const uint32_t next = (i + 1) % kCorners;
    const uint32_t side[] = {top[i], bottom[i], bottom[next], top[next]};
    AddPolygon(scene, side, material);
  }
  AddPolygon(scene, reversed, material);
}

/// One of many colours, by the remainders of three products; its largest component is 1.
Vec3d GearColor(int64_t x, int64_t y, int64_t z) {
  auto part = [](int64_t k, int factor) { return 0.01 + double(k * factor % 7) / 7; };
  const Vec3d color{part(3 * x + 2 * y + z + 1, 5), part(3 * y + 2 * z + x + 1, 3),
                    part(3 * z + 2 * x + y + 1, 2)};
  return color * (1 / std::max({color.x, color.y, color.z}));
}

Scene Generate(const void* config, const LoadOptions&) {
  const int64_t n = SpdSizeOf(config);
  Scene scene = SpdScene({-1.1, -2.1, 2.6}, {0, 0, 0}, kZAxis, 45,
                         {{2, 4, 4}, {-2, 4, 3}, {2, -2.5, 2.5}, {-1, -4, 2}, {-1.111, -2.121, 2.626}});
  const size_t gears = size_t(n * n * n);
  scene.positions.reserve(gears * 2 * kCorners + 4);
  scene.polygons.reserve(Count(config));
  scene.polygon_material.reserve(Count(config));
  scene.polygon_vertices.reserve(gears * 6 * kCorners + 4);
  AddGround(scene, 2, 0, AddSurface(scene, {"ground", {1, 0.85, 0.7}, 0.3, 0.6, 37, 0, 0}));

  // Teeth reach into the gaps of the next gear: neighbours are nearer than two radii.
  const double radius = 1 / (n - (n - 1) * (1 - kInner) / 2), step = radius * (1 + kInner);
  const double thickness = std::min(0.1, 0.5 / n);
  for (int64_t z = 0; z < n; ++z)
    for (int64_t y = 0; y < n; ++y)
      for (int64_t x = 0; x < n; ++x) {
        const Vec3d color = GearColor(x, y, z);
        const bool glass = (4 * x + 2 * y + z) % 5 == 0;
        const uint32_t material = AddSurface(
            scene, glass ? SpdSurface{"glass gear", color, 0.2, 0, 0, 0.8, 1.1} : SpdSurface{"gear", color});
        const Vec3d center{radius - 1 + x * step, radius - 1 + y * step, 1 - double(z) / n};
        // Every other gear is turned by half a tooth.
        AddGear(scene, center, (x + y + z) % 2 * kToothAngle / 2, radius, thickness, material);
      }
  scene.Finish();
  return scene;
}

}  // namespace

const Generator kGearsGenerator = SpdGenerator(
    "gears",
    "SPD: a cube of gears, some of glass, whose faces are concave polygons; the seed changes nothing",
    kParams, Count, Generate);

}  // namespace raybench
