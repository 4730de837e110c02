// A fractal mountain by midpoint displacement (Carpenter 1982) on a square grid, behind four glass spheres.

#include <cmath>

#include "datasets/generators/spd.h"

namespace raybench {
namespace {

const rb_param kParams[] = {
    SpdSize("subdivisions of the square: 2 * 4^size triangles and 4 spheres", 1, 12, 6)};

uint64_t Count(const void* config) { return (uint64_t{2} << (2 * SpdSizeOf(config))) + 4; }

/// The databases' seed of a grid point. Its bits are poorly mixed, so the mountain repeats itself; pictures
/// and counts have been published with it. Past size 7 its last shift goes the other way.
uint32_t Seed(uint32_t x, uint32_t y, int size) {
  constexpr uint32_t kMountain = 21;
  const uint32_t high = size <= 7 ? x << (7 - size) : x >> (size - 7);
  return kMountain + (((x << (23 - size)) + (y << (15 - size)) + high) & 0xFFFF);
}

/// Normal deviate of variance 1 by Marsaglia's polar method, on a congruential generator of
/// Numerical Recipes.
double Gauss(uint32_t seed) {
  constexpr uint64_t kModulus = 134456, kFactor = 8121, kIncrement = 28411;
  uint64_t second = seed;
  for (;;) {
    const uint64_t first = (kIncrement + second * kFactor) % kModulus;
    second = (kIncrement + first * kFactor) % kModulus;
    const double u = 2.0 * double(first) / kModulus - 1, v = 2.0 * double(second) / kModulus - 1;
    if (const double square = u * u + v * v; square < 1)
      return u * std::sqrt(-2 * NaturalLog(square) / square);
  }
}

class Mountain {
 public:
  Mountain(Scene& scene, int size, uint32_t material) : scene_(scene), size_(size), material_(material) {
    heights_.resize((size_t{width()} + 1) * (width() + 1));
    Raise(0, 0, width());
    for (uint32_t y = 0; y <= width(); ++y)
      for (uint32_t x = 0; x <= width(); ++x)
        AddVertex(scene_, {2.0 * x / width() - 1, 2.0 * y / width() - 1, Height(x, y)});
    AddTriangles(0, 0, width());
  }

 private:
  uint32_t width() const { return 1u << size_; }
  uint32_t Index(uint32_t x, uint32_t y) const { return y * (width() + 1) + x; }
  double& Height(uint32_t x, uint32_t y) { return heights_[Index(x, y)]; }

  /// Gives the square's five midpoints a height, and those of its quarters. Neighbours work out the midpoint
  /// that they share alike.
  void Raise(uint32_t x, uint32_t y, uint32_t w) {
    if (w == 1) return;
    const uint32_t h = w / 2;
    const double a = Height(x, y), b = Height(x + w, y), c = Height(x + w, y + w), d = Height(x, y + w);
    // Fractal dimension 2.2: heights vary by the 1 / 1.2-th power of the width.
    const double roughness = std::sqrt(kCubeRootOf2 - 1), rise = 2.0 * h / width() * roughness;
    auto raise = [&](uint32_t at_x, uint32_t at_y, double mean, double scale) {
      Height(at_x, at_y) = mean + scale * Gauss(Seed(at_x, at_y, size_));
    };
    raise(x + h, y, (a + b) / 2, rise);
    raise(x + w, y + h, (b + c) / 2, rise);
    raise(x + h, y + w, (c + d) / 2, rise);
    raise(x, y + h, (d + a) / 2, rise);
    raise(x + h, y + h, (a + b + c + d) / 4, 1.4142136 * rise);
    Raise(x, y, h);
    Raise(x + h, y, h);
    Raise(x + h, y + h, h);
    Raise(x, y + h, h);
  }

  void AddTriangles(uint32_t x, uint32_t y, uint32_t w) {
    if (w == 1) {
      const uint32_t a = Index(x, y), b = Index(x + 1, y), c = Index(x + 1, y + 1), d = Index(x, y + 1);
      AddTriangle(scene_, {a, b, c}, material_);
      AddTriangle(scene_, {c, d, a}, material_);
      return;
    }
    const uint32_t h = w / 2;
    AddTriangles(x, y, h);
    AddTriangles(x + h, y, h);
    AddTriangles(x + h, y + h, h);
    AddTriangles(x, y + h, h);
  }

  static constexpr double kCubeRootOf2 = 1.2599210498948732;  // (2 / 2^(1 / 1.2))^2
  Scene& scene_;
  int size_;
  uint32_t material_;
  std::vector<double> heights_;
};

Scene Generate(const void* config, const LoadOptions&) {
  Scene scene = SpdScene({-1.6, 1.6, 1.7}, {0, 0, 0}, kZAxis, 45, {{-100, -100, 100}});
  scene.triangles.reserve(Count(config));
  scene.triangle_material.reserve(Count(config));

  // Four spheres that touch: one above, three below it at the angle between a tetrahedron's corners.
  const uint32_t glass = AddSurface(scene, {"glass", {1, 1, 1}, 0.1, 0.1, 6.7, 0.9, 1.5});
  const Vec3d center{-0.8, 0.8, 1}, up{0, 0, 0.17 * std::sqrt(1.5)};
  const double d = 1 / std::sqrt(2.0);
  const Vec3d low = Turn(up, {d, d, 0}, {std::sqrt(8.0) / 3, -1.0 / 3});
  AddSphere(scene, center + up, 0.17, glass);
  for (int third = 0; third < 3; ++third)
    AddSphere(scene, center + Turn(low, kZAxis, Degrees(120 * third)), 0.17, glass);

  Mountain(scene, int(SpdSizeOf(config)), AddSurface(scene, {"mountain", {0.5, 0.45, 0.35}}));
  scene.Finish();
  return scene;
}

}  // namespace

const Generator kMountGenerator =
    SpdGenerator("mount", "SPD: a fractal mountain behind four glass spheres; the seed changes nothing",
                 kParams, Count, Generate);

}  // namespace raybench
