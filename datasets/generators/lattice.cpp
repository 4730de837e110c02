// A cubic lattice of mirroring spheres joined by matte cylinders (Costa, in SPD since 3.1).

#include <cmath>

#include "datasets/generators/spd.h"

namespace raybench {
namespace {

const rb_param kParams[] = {
    SpdSize("cells along each side: (size+1)^3 spheres and 3 size (size+1)^2 cylinders", 1, 400, 12)};

uint64_t Count(const void* config) {
  const uint64_t n = uint64_t(SpdSizeOf(config));
  return (n + 1) * (n + 1) * (n + 1) + 3 * n * (n + 1) * (n + 1);
}

Scene Generate(const void* config, const LoadOptions&) {
  const int64_t n = SpdSizeOf(config);
  const double cell = 1.0 / double(n), middle = (double(n / 2) + 0.5) * cell;
  Scene scene =
      SpdScene({middle, 1, 1 - cell / 2}, {middle, -1, -1 - cell / 2}, {0.2, 1, 0}, 60,
               {{2, 0.5, 0.5}, {-1, 0.5, 0.5}, {0.5, 2, 0.5}, {0.5, -1, 0.5}, {0.5, 0.5, 2}, {0.5, 0.5, -1}});
  const size_t spheres = size_t((n + 1) * (n + 1) * (n + 1)), cylinders = Count(config) - spheres;
  scene.spheres.reserve(spheres);
  scene.sphere_material.reserve(spheres);
  scene.cones.reserve(cylinders);
  scene.cone_material.reserve(cylinders);
  const uint32_t ball = AddSurface(scene, {"sphere", {0.9, 0.9, 0.9}, 0.5, 0.5, 37});
  const uint32_t rod[3] = {AddSurface(scene, {"along x", {0.9, 0.1, 0.1}, 0.99}),
                           AddSurface(scene, {"along y", {0.1, 0.9, 0.1}, 0.99}),
                           AddSurface(scene, {"along z", {0.1, 0.1, 0.9}, 0.99})};

  const double ball_radius = cell / 4, rod_radius = cell / 16;
  const double inset =
      ball_radius * (1 - std::sqrt(rod_radius / ball_radius)) * 0.99;  // rods begin inside balls
  int64_t at[3];
  for (at[0] = 0; at[0] <= n; ++at[0])
    for (at[1] = 0; at[1] <= n; ++at[1])
      for (at[2] = 0; at[2] <= n; ++at[2]) {
        const Vec3d center{double(at[0]) / double(n), double(at[1]) / double(n), double(at[2]) / double(n)};
        AddSphere(scene, center, ball_radius, ball);
        for (int k = 0; k < 3; ++k) {
          if (at[k] == n) continue;
          Vec3d base = center, apex = center;
          base[k] += inset;
          apex[k] += cell - inset;
          AddCone(scene, base, rod_radius, apex, rod_radius, rod[k]);
        }
      }
  scene.Finish();
  return scene;
}

}  // namespace

const Generator kLatticeGenerator = SpdGenerator(
    "lattice", "SPD: mirroring spheres joined by cylinders in a cubic lattice; the seed changes nothing",
    kParams, Count, Generate);

}  // namespace raybench
