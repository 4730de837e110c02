// Far away and out of scale: what float loses when a number carries a large common part, or leaves its range.
#include <fmt/format.h>

#include "harness/extremes/make.h"

namespace raybench::extremes {
namespace {

constexpr const char *kUnit = "directions of length 1", *kScaled = "directions as long as the scene",
                     *kMixed = "with a second ball of size 2^-k inside";

Mesh SmallBall(uint64_t seed) {
  Mesh mesh = Ball(8, seed);
  for (Vec3d& p : mesh.positions) p = p * 0.5;  // size 1
  return mesh;
}

/// The whole scene is moved, and its vertices are rounded there.
Workload MakeFarScene(const Point& point, uint64_t rays, uint64_t seed) {
  Mesh mesh = SmallBall(seed);
  Random random(seed, 1);
  const Vec3d offset = random.UnitVector() * point.magnitude;
  for (Vec3d& p : mesh.positions) p = p + offset;
  Workload work;
  work.scene = ToScene(mesh, kFarScene, point);
  work.rays = MakeRays(rays, seed, [&](uint64_t i, Random& r) {
    if (i % 2 != 0) return MakeRay(ToFloat(offset + InBall(r) * 0.75), ToFloat(r.UnitVector()));
    return Towards(ToFloat(offset + InBall(r) * 0.05), EdgeTarget(work.scene, i / 2, r));
  });
  work.second = OtherPrimitive;
  work.second_on_odd_rays = true;
  return work;
}

/// Only the rays come from far away. What is aimed at edges misses them by the rounding of its origin.
Workload MakeFarOrigin(const Point& point, uint64_t rays, uint64_t seed) {
  Workload work;
  work.scene = ToScene(SmallBall(seed), kFarOrigin, point);
  work.rays = MakeRays(rays, seed, [&](uint64_t i, Random& r) {
    const Vec3f target = i % 2 != 0 ? ToFloat(InBall(r) * 0.5) : EdgeTarget(work.scene, i / 2, r);
    const Vec3f dir = ToFloat(r.UnitVector());
    return MakeRay(ToFloat(ToDouble(target) - ToDouble(dir) * point.magnitude), dir);
  });
  work.second = OtherPrimitive;
  work.second_on_odd_rays = true;
  return work;
}

Workload MakeScale(const Point& point, uint64_t rays, uint64_t seed) {
  Mesh mesh = Ball(8, seed);
  double largest = 0;
  for (Vec3d p : mesh.positions)
    for (int k = 0; k < 3; ++k) largest = std::max(largest, std::fabs(p[k]));
  // Exactly 2^k at most, so that -30 and 30 are the very ends of the contract's range.
  const int k = int(point.magnitude);
  for (Vec3d& p : mesh.positions)
    for (int a = 0; a < 3; ++a) p[a] = std::ldexp(p[a] / largest, k);
  if (point.variant == kMixed) {
    Mesh second = Ball(1, seed + 1);
    const uint32_t first = uint32_t(mesh.positions.size());
    for (Vec3d p : second.positions) mesh.Add(p * std::ldexp(1.0, -k));
    for (auto [a, b, c] : second.triangles) mesh.triangles.push_back({first + a, first + b, first + c});
  }
  Workload work;
  work.scene = ToScene(mesh, kScale, point);
  const int exponent = work.scene.scale_exponent;
  const double size = std::ldexp(1.0, k + exponent);
  if (exponent != 0) work.note = fmt::format("rescaled by 2^{} at load", exponent);
  work.rays = MakeRays(rays, seed, [&](uint64_t i, Random& r) {
    const Vec3f org = ToFloat(InBall(r) * (0.05 * size)), target = EdgeTarget(work.scene, i, r);
    return point.variant == kUnit ? Towards(org, target) : MakeRay(org, target - org);
  });
  return work;
}

std::vector<Point> ScalePoints() {
  std::vector<Point> points;
  for (const char* variant : {kUnit, kScaled})
    for (int k : {-140, -120, -90, -60, -31, -30, -15, 0, 15, 30, 31, 60, 90, 120, 127, 128})
      points.push_back({double(k), variant, std::abs(k) <= 120});
  for (int k : {0, 15, 30, 31, 60, 75, 90, 120}) points.push_back({double(k), kMixed, true});
  return points;
}

}  // namespace

const Suite kFarScene = {
    "far_scene",
    "a ball far from the coordinate origin; aimed and random rays that start in or near it",
    "distance of the scene from the coordinate origin, in sizes of the scene",
    Axis::kLogarithmic,
    "leak or plain error",
    "another primitive than the exact one is named (random rays)",
    "up to 1e6; at 1e7 a float step is as long as the scene",
    [] { return Decades(0, 7, 1e6); },
    MakeFarScene};

const Suite kFarOrigin = {"far_origin",
                          "a ball at the coordinate origin, rays that start far away",
                          "distance of the ray's start, in sizes of the scene",
                          Axis::kLogarithmic,
                          "leak or plain error",
                          "another primitive than the exact one is named (random rays)",
                          "up to 1e6",
                          [] { return Decades(0, 7, 1e6); },
                          MakeFarOrigin};

const Suite kScale = {"scale",
                      "a ball times 2^k, rays as in edge_aim; from -30 to 30 structures see these very "
                      "numbers, beyond that the scene model rescales or refuses",
                      "k: largest coordinate is 2^k",
                      Axis::kLinear,
                      "leak or plain error",
                      nullptr,
                      "-120 to 120 (below, vertices are subnormal floats)",
                      ScalePoints,
                      MakeScale};

}  // namespace raybench::extremes
