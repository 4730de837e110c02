// The procedural scenes: one file each, its stem is the name users type.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "accel/vec3.h"
#include "datasets/scene.h"

namespace raybench {

// A new generator is a file here plus a line in Generators() (load_scene.cpp).
extern const Generator kIcosphereGenerator, kSphereflakeGenerator, kStadiumGenerator, kTerrainBoxGenerator;

/// Triangles over shared vertices, in double until they become part of a scene.
struct Mesh {
  std::vector<Vec3d> positions;
  std::vector<std::array<uint32_t, 3>> triangles;  ///< counter-clockwise seen from outside

  uint32_t Add(Vec3d p) {
    positions.push_back(p);
    return uint32_t(positions.size() - 1);
  }
  void AddQuad(uint32_t a, uint32_t b, uint32_t c, uint32_t d) {
    triangles.push_back({a, b, c});
    triangles.push_back({a, c, d});
  }
};

/// Closed unit sphere: each side of an icosahedron cut in n x n triangles and pushed onto the sphere (a class
/// I geodesic sphere, Fuller). 20 n^2 triangles over 10 n^2 + 2 shared vertices. n >= 1.
Mesh GeodesicSphere(uint32_t n);

/// Appends a mesh to a scene that has not been finished; each position is rounded to float once.
void Append(Scene& scene, const Mesh& mesh, uint32_t material);

/// Adds a material and returns its index.
uint32_t AddMaterial(Scene& scene, Material material);

/// Seeded gradient-free value noise in [-1, 1] with continuous second derivatives (Perlin 1985, 2002), the
/// same on every machine.
class ValueNoise {
 public:
  explicit ValueNoise(uint64_t seed) : seed_(seed) {}
  double At(Vec3d p) const;
  /// Sum of `octaves`, each of twice the frequency and half the height; in (-2, 2).
  double Fractal(Vec3d p, int octaves) const;

 private:
  double Corner(int64_t x, int64_t y, int64_t z) const;
  uint64_t seed_;
};

}  // namespace raybench
