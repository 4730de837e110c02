// An open landscape: a height field of mountains and lakes. Its triangles lie in one thin layer and are about
// equally large, so that a flat grid does as well as a tree; seen from the side, rays graze along thousands
// of them. Real terrain models look like this, and a benchmark has it because it is the best case of the
// simple structures. Mountains are a ridged multifractal whose finest octave follows the cells, so that
// detail grows with the size while the mountains stay where they are; whatever lies below the water level is
// exactly flat.

#include <cstddef>
#include <span>

#include "datasets/generators/generators.h"

namespace raybench {
namespace {

struct Config {
  int64_t size;
  double relief;
};

const rb_param kParams[] = {
    IntParam("size", "triangles, taken to the nearest 2 n^2: 100,352 at 100000", offsetof(Config, size), 2,
             1e9, 100000, RB_PARAM_LOG),
    FloatParam("relief", "height of the highest mountains over half the side of the land",
               offsetof(Config, relief), 0.001, 2, 0.35, RB_PARAM_LOG),
};

uint64_t Cells(const Config& c) { return uint64_t(std::max(1.0, std::round(std::sqrt(double(c.size) / 2)))); }

uint64_t Count(const void* config) {
  const uint64_t n = Cells(*static_cast<const Config*>(config));
  return 2 * n * n;
}

/// Gradient noise over the plane (Perlin 1985, with the weights of Perlin 2002), about [-1, 1].
double Noise(uint64_t seed, double x, double z) {
  const double base_x = std::floor(x), base_z = std::floor(z), fx = x - base_x, fz = z - base_z;
  const auto smooth = [](double t) { return t * t * t * (t * (t * 6 - 15) + 10); };
  const auto corner = [&](int dx, int dz) {
    const uint64_t cell = uint64_t(int64_t(base_x) + dx) << 32 ^ uint64_t(uint32_t(int64_t(base_z) + dz));
    const uint64_t bits = Random(seed, cell).NextBits();
    const double gx = double(int32_t(bits)) * 0x1p-31, gz = double(int32_t(bits >> 32)) * 0x1p-31;
    return gx * (fx - dx) + gz * (fz - dz);
  };
  const double wx = smooth(fx), wz = smooth(fz);
  const double near = corner(0, 0) * (1 - wx) + corner(1, 0) * wx;
  const double far = corner(0, 1) * (1 - wx) + corner(1, 1) * wx;
  return 1.6 * (near * (1 - wz) + far * wz);
}

/// Musgrave's ridged multifractal: sharp crests where the noise crosses zero, and detail only on them. About
/// [0, 1].
double Ridges(std::span<const uint64_t> octaves, double x, double z) {
  double sum = 0, weight = 1, height = 0.5;
  for (uint64_t seed : octaves) {
    const double crest = 1 - std::abs(Noise(seed, x, z));
    const double signal = crest * crest * weight;
    sum += height * signal;
    height /= 2;
    weight = std::clamp(signal * 2, 0.0, 1.0);
    // Doubled and turned by a 3-4-5 angle, so that the octaves' lattices do not line up.
    const double turned = 1.6 * x - 1.2 * z + 0.37;
    z = 1.2 * x + 1.6 * z + 0.53;
    x = turned;
  }
  return sum;
}

/// Of what Ridges() gives: water below, no land above.
constexpr double kWater = 0.5, kTop = 0.98;

Scene Generate(const void* config, const LoadOptions& options) {
  const Config& c = *static_cast<const Config*>(config);
  const size_t n = Cells(c), row = n + 1;
  std::vector<uint64_t> octaves;  // each its own seed; the finest is at least two cells long
  do octaves.push_back(Random(options.seed, octaves.size()).NextBits());
  while (octaves.size() < 20 && (size_t{4} << octaves.size()) < n);

  Scene scene;
  scene.provenance.source = "terrain";
  const auto add = [&](const char* name, Vec3f diffuse, Vec3f reflect) {
    Material material;
    material.name = name;
    material.diffuse = diffuse;
    material.reflect = reflect;
    return AddMaterial(scene, material);
  };
  const uint32_t water = add("water", {0.1f, 0.2f, 0.28f}, {0.45f, 0.45f, 0.45f});
  const uint32_t meadow = add("meadow", {0.32f, 0.42f, 0.2f}, {0, 0, 0});
  const uint32_t rock = add("rock", {0.46f, 0.42f, 0.37f}, {0, 0, 0});
  const uint32_t snow = add("snow", {0.9f, 0.92f, 0.95f}, {0, 0, 0});

  scene.positions.resize(row * row);
  ForEachItem(row, options.progress, 0.7, [&](size_t z) {
    for (size_t x = 0; x < row; ++x) {
      const double px = 2.0 * double(x) / double(n) - 1, pz = 2.0 * double(z) / double(n) - 1;
      const double ridges = Ridges(octaves, 1.3 * px + 7, 1.3 * pz + 3);
      const double above = std::max(0.0, (ridges - kWater) / (kTop - kWater));
      scene.positions[z * row + x] = ToFloat({px, c.relief * above * above, pz});  // wide valleys
    }
  });
  scene.triangles.resize(2 * n * n);
  scene.triangle_material.resize(2 * n * n);
  ForEachItem(n, {}, 0, [&](size_t z) {
    for (size_t x = 0; x < n; ++x) {
      const uint32_t a = uint32_t(z * row + x), b = uint32_t(a + row);
      const size_t cell = 2 * (z * n + x);
      scene.triangles[cell] = {a, b, b + 1};
      scene.triangles[cell + 1] = {a, b + 1, a + 1};
      for (size_t i = cell; i < cell + 2; ++i) {
        const auto [p, q, r] = scene.triangles[i];
        const Vec3d origin = ToDouble(scene.positions[p]);
        const Vec3d normal =
            Cross(ToDouble(scene.positions[q]) - origin, ToDouble(scene.positions[r]) - origin);
        const double height = origin.y / c.relief, flat = normal.y * normal.y / Dot(normal, normal);
        const bool wet = origin.y == 0 && scene.positions[q].y == 0 && scene.positions[r].y == 0;
        // Steep places are bare whatever their height.
        scene.triangle_material[i] = wet             ? water
                                     : flat < 0.5    ? rock
                                     : height > 0.4  ? snow
                                     : height > 0.25 ? rock
                                                     : meadow;
      }
    }
  });

  const float relief = float(c.relief);
  scene.cameras.push_back({{0.25f, 0.35f + relief, 1.75f}, {0, 0.1f * relief, 0.1f}, {0, 1, 0}, 0.46f});
  scene.lights = {{{-6, 4, 1}, Vec3f{1, 0.95f, 0.85f} * 0.85f, false},
                  {{3, 8, 6}, Vec3f{0.8f, 0.9f, 1} * 0.15f, false}};
  scene.Finish();
  return scene;
}

}  // namespace

const Generator kTerrainGenerator = {
    "terrain",
    "open fractal height field, chosen by the seed: mountains and mirroring lakes in one thin layer",
    "ridged multifractal (Musgrave, in Ebert et al., Texturing and Modeling, 1994)",
    kParams,
    std::size(kParams),
    sizeof(Config),
    Count,
    Generate};

}  // namespace raybench
