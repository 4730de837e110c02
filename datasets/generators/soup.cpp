// Long thin triangles in all directions, with nothing shared: the worst that boxes along the axes can get. A
// sliver along a diagonal fills almost nothing of its box, the boxes of neighbours overlap, and no way of
// sorting triangles into groups helps; splitting them does, or directed boxes. Benchmarks that want to see
// the difference have it. Lengths are in units of the mean distance between triangles, so that as many boxes
// overlap at any size and a sweep over the size measures the structure, not an ever denser scene.

#include <cstddef>

#include "datasets/generators/generators.h"

namespace raybench {
namespace {

struct Config {
  int64_t size;
  double length, aspect;
};

const rb_param kParams[] = {
    IntParam("size", "triangles to strew", offsetof(Config, size), 1, 1e9, 50000, RB_PARAM_LOG),
    FloatParam("length", "of a triangle, over the mean distance between triangles", offsetof(Config, length),
               0.1, 100, 8, RB_PARAM_LOG),
    FloatParam("aspect", "length over width of a triangle", offsetof(Config, aspect), 1, 1000, 40,
               RB_PARAM_LOG),
};

uint64_t Count(const void* config) { return uint64_t(static_cast<const Config*>(config)->size); }

/// Cube root of n >= 1 to full precision: Newton's steps from above, which fall until rounding stops them.
double CubeRoot(double n) {
  double root = n;
  for (;;) {
    const double next = (2 * root + n / (root * root)) / 3;
    if (!(next < root)) return root;
    root = next;
  }
}

Scene Generate(const void* config, const LoadOptions& options) {
  const Config& c = *static_cast<const Config*>(config);
  const size_t n = size_t(c.size);
  const double length = std::min(1.0, c.length * 2 / CubeRoot(double(n))), width = length / c.aspect;

  Scene scene;
  scene.provenance.source = "soup";
  const Vec3f colours[] = {{0.75f, 0.3f, 0.22f}, {0.3f, 0.55f, 0.35f}, {0.25f, 0.4f, 0.7f}};
  const char* const names[] = {"along x", "along y", "along z"};
  for (int axis = 0; axis < 3; ++axis) {
    Material material;
    material.name = names[axis];
    material.diffuse = colours[axis];
    material.specular = {0.2f, 0.2f, 0.2f};
    AddMaterial(scene, material);
  }
  scene.positions.resize(3 * n);
  scene.triangles.resize(n);
  scene.triangle_material.resize(n);
  ForEachItem(n, options.progress, 0.7, [&](size_t i) {
    Random random(options.seed, i);
    Vec3d center;
    for (int k = 0; k < 3; ++k) center[k] = 2 * random.NextDouble() - 1;
    const Frame frame = RandomFrame(random);
    const Vec3d along = frame.x * (length / 2), aside = frame.y * (width / 2);
    const uint32_t first = uint32_t(3 * i);
    scene.positions[first] = ToFloat(center - along - aside);
    scene.positions[first + 1] = ToFloat(center - along + aside);
    scene.positions[first + 2] = ToFloat(center + along);
    scene.triangles[i] = {first, first + 1, first + 2};
    const Vec3d d{std::abs(along.x), std::abs(along.y), std::abs(along.z)};
    scene.triangle_material[i] = d.x >= d.y && d.x >= d.z ? 0 : d.y >= d.z ? 1 : 2;
  });
  scene.Finish();
  return scene;
}

}  // namespace

const Generator kSoupGenerator = {
    "soup",
    "long thin triangles strewn by the seed through a cube, in all directions, sharing nothing",
    "the case for spatial splits (Stich, Friedrich, Dietrich, 2009)",
    kParams,
    std::size(kParams),
    sizeof(Config),
    Count,
    Generate};

}  // namespace raybench
