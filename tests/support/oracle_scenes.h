// Small meshes for the tests of oracle and verdicts.
#pragma once

#include <cmath>
#include <limits>
#include <map>
#include <vector>

#include "accel/base/random.h"
#include "datasets/scene/scene.h"
#include "tests/support/rays.h"

namespace raybench::testing {

inline Scene MakeScene(std::vector<Vec3f> positions, std::vector<std::array<uint32_t, 3>> triangles) {
  Scene scene;
  scene.name = scene.provenance.source = "test";
  scene.positions = std::move(positions);
  scene.triangles = std::move(triangles);
  scene.Finish();
  return scene;
}

/// Unit icosphere with 20 * 4^level triangles.
inline Scene MakeIcosphere(int level) {
  const double g = (1 + std::sqrt(5.0)) / 2;
  std::vector<Vec3d> p = {{-1, g, 0},  {1, g, 0},  {-1, -g, 0}, {1, -g, 0}, {0, -1, g},  {0, 1, g},
                          {0, -1, -g}, {0, 1, -g}, {g, 0, -1},  {g, 0, 1},  {-g, 0, -1}, {-g, 0, 1}};
  for (Vec3d& v : p) v = Normalize(v);
  std::vector<std::array<uint32_t, 3>> t = {{0, 11, 5}, {0, 5, 1},  {0, 1, 7},   {0, 7, 10}, {0, 10, 11},
                                            {1, 5, 9},  {5, 11, 4}, {11, 10, 2}, {10, 7, 6}, {7, 1, 8},
                                            {3, 9, 4},  {3, 4, 2},  {3, 2, 6},   {3, 6, 8},  {3, 8, 9},
                                            {4, 9, 5},  {2, 4, 11}, {6, 2, 10},  {8, 6, 7},  {9, 8, 1}};
  for (int i = 0; i < level; ++i) {
    std::map<std::pair<uint32_t, uint32_t>, uint32_t> middles;
    const auto middle = [&](uint32_t a, uint32_t b) {
      const auto [it, fresh] = middles.try_emplace(std::minmax(a, b), uint32_t(p.size()));
      if (fresh) p.push_back(Normalize(p[a] + p[b]));
      return it->second;
    };
    std::vector<std::array<uint32_t, 3>> finer;
    for (const auto& [a, b, c] : t) {
      const uint32_t ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
      finer.insert(finer.end(), {{a, ab, ca}, {b, bc, ab}, {c, ca, bc}, {ab, bc, ca}});
    }
    t = std::move(finer);
  }
  std::vector<Vec3f> positions;
  for (Vec3d v : p) positions.push_back(ToFloat(v));
  return MakeScene(std::move(positions), std::move(t));
}

/// Surface of the cube [0, n]^3 on the integer lattice, 12 n^2 triangles, moved by `shift` and scaled.
/// Vertices are not shared between faces of the cube: adjacency has to go by position.
inline Scene MakeLatticeBox(int n, Vec3f shift = {0, 0, 0}, float scale = 1, int copies = 1) {
  std::vector<Vec3f> p;
  std::vector<std::array<uint32_t, 3>> t;
  for (int copy = 0; copy < copies; ++copy)
    for (int axis = 0; axis < 3; ++axis)
      for (int side = 0; side < 2; ++side) {
        const uint32_t base = uint32_t(p.size());
        for (int i = 0; i <= n; ++i)
          for (int j = 0; j <= n; ++j) {
            Vec3f v{0, 0, 0};
            v[axis] = float(side * n), v[(axis + 1) % 3] = float(i), v[(axis + 2) % 3] = float(j);
            p.push_back((v + shift) * scale);
          }
        for (int i = 0; i < n; ++i)
          for (int j = 0; j < n; ++j) {
            const uint32_t a = base + uint32_t(i * (n + 1) + j), b = a + uint32_t(n + 1);
            t.push_back({a, b, b + 1});
            t.push_back({a, b + 1, a + 1});
          }
      }
  return MakeScene(std::move(p), std::move(t));
}

/// Random triangles on a small integer lattice: many shared points, coplanar and crossing triangles.
inline Scene MakeLatticeSoup(int count, uint64_t seed) {
  Random random(seed);
  std::vector<Vec3f> p;
  std::vector<std::array<uint32_t, 3>> t;
  for (uint32_t i = 0; i < uint32_t(count); ++i) {
    for (int k = 0; k < 3; ++k)
      p.push_back({float(random.Below(5)), float(random.Below(5)), float(random.Below(5))});
    t.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  return MakeScene(std::move(p), std::move(t));
}

/// Triangles of aspect 1e6 with coordinates of all magnitudes.
inline Scene MakeSlivers(int count, uint64_t seed) {
  Random random(seed);
  std::vector<Vec3f> p;
  std::vector<std::array<uint32_t, 3>> t;
  for (uint32_t i = 0; i < uint32_t(count); ++i) {
    const Vec3d a = random.UnitVector(), b = random.UnitVector();
    p.push_back(ToFloat(a)), p.push_back(ToFloat(b)),
        p.push_back(ToFloat((a + b) * 0.5 + random.UnitVector() * 1e-6));
    t.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  return MakeScene(std::move(p), std::move(t));
}

/// Triangles over one square whose corners' heights differ by a few ulp: seen from afar, t of all of them
/// rounds to one or two floats, in an order that has nothing to do with their ids.
inline Scene MakeSheets(int count, uint64_t seed) {
  Random random(seed);
  std::vector<Vec3f> p;
  std::vector<std::array<uint32_t, 3>> t;
  for (uint32_t i = 0; i < uint32_t(count); ++i) {
    for (const Vec3f& corner : {Vec3f{-1, -1, 1}, {3, -1, 1}, {-1, 3, 1}})
      p.push_back(corner + Vec3f{0, 0, float(random.Below(5)) * 0x1p-23f});
    t.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  return MakeScene(std::move(p), std::move(t));
}

}  // namespace raybench::testing
