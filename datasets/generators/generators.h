// The procedural scenes: one file each, its stem is the name users type. What it defines as `const Generator kNAME`
// is found by its name.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "accel/base/parallel.h"
#include "accel/base/random.h"
#include "accel/base/vec3.h"
#include "accel/contract/parameters.h"
#include "datasets/generators/all_generators.h"
#include "datasets/scene/scene.h"

namespace raybench {

/// Calls body(i) for each i of 0 <= i < n, in parallel; now and then tells `progress`, on the calling thread,
/// how much of `share` of the whole is done. A body writes only what belongs to its i, so results do not
/// depend on the number of threads.
template <class Body>
void ForEachItem(size_t n, const std::function<void(double)>& progress, double share, const Body& body) {
  constexpr size_t kPieces = 32;
  const size_t piece =
      progress && n > (size_t{1} << 16) ? (n + kPieces - 1) / kPieces : std::max<size_t>(n, 1);
  for (size_t begin = 0; begin < n; begin += piece) {
    const size_t end = std::min(n, begin + piece);
    ParallelFor(begin, end, body);
    if (progress) progress(share * double(end) / double(n));
  }
}

/// Three perpendicular unit vectors, right-handed.
struct Frame {
  Vec3d x, y, z;
  Vec3d operator*(Vec3d p) const { return x * p.x + y * p.y + z * p.z; }
};
/// Uniform in x; around it as good as uniform.
Frame RandomFrame(Random& random);

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
