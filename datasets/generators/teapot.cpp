// Newell's teapot (1975) with Crow's bottom (1987), as triangles with normals, on a checkerboard.

#include <cmath>

#include "datasets/generators/spd.h"

namespace raybench {
namespace {

// At 1 more triangles than the databases leave out would have no area.
const rb_param kParams[] = {
    SpdSize("steps along each side of a patch: 64 size^2 - 8 size triangles on size^2 squares", 2, 1000, 12)};

uint64_t Count(const void* config) {
  const uint64_t n = uint64_t(SpdSizeOf(config));
  return 65 * n * n - 8 * n;
}

/// Control points of a bicubic Bezier patch.
struct Patch {
  Vec3d points[4][4];
};

/// A quarter of a surface of revolution about z: four circles, each an arc of 90 degrees from the x axis in
/// the sense of `turn`.
struct Revolved {
  double radius[4], z[4];
  double arm;  ///< of the arc's inner control points, over the radius of their row
  double turn;
};

Patch Quarter(const Revolved& shape, int quarter) {
  Patch patch;
  for (int row = 0; row < 4; ++row) {
    // The knob's widest circle has arms of its own.
    const double r = shape.radius[row], a = r * (row == 1 ? shape.arm : 0.56), z = shape.z[row];
    const Vec3d arc[4] = {{r, 0, z}, {r, a, z}, {a, r, z}, {0, r, z}};
    for (int column = 0; column < 4; ++column) {
      Vec3d p = arc[column];
      for (int i = 0; i < quarter; ++i) p = {-p.y, p.x, p.z};  // seen with y along `turn`
      patch.points[row][column] = {p.x, p.y * shape.turn, p.z};
    }
  }
  return patch;
}

/// Half of a tube that the plane y = 0 cuts: four sections from one of its points in that plane to the other.
struct Tube {
  struct {
    double x0, z0, x1, z1, width;
  } section[4];
};

Patch Half(const Tube& tube, bool mirrored) {
  Patch patch;
  for (int row = 0; row < 4; ++row) {
    const auto& s = tube.section[row];
    const Vec3d points[4] = {
        {s.x0, 0, s.z0}, {s.x0, -s.width, s.z0}, {s.x1, -s.width, s.z1}, {s.x1, 0, s.z1}};
    for (int column = 0; column < 4; ++column) {
      const Vec3d p = points[mirrored ? 3 - column : column];
      patch.points[row][column] = {p.x, mirrored ? -p.y : p.y, p.z};
    }
  }
  return patch;
}

std::vector<Patch> TeapotPatches() {
  constexpr Revolved kRim{{1.4, 1.3375, 1.4375, 1.5}, {2.4, 2.53125, 2.53125, 2.4}, 0.56, -1};
  constexpr Revolved kUpperBody{{1.5, 1.75, 2, 2}, {2.4, 1.875, 1.35, 0.9}, 0.56, -1};
  constexpr Revolved kLowerBody{{2, 2, 1.5, 1.5}, {0.9, 0.45, 0.225, 0.15}, 0.56, -1};
  constexpr Tube kUpperHandle{{{-1.6, 2.025, -1.5, 2.25, 0.3},
                               {-2.3, 2.025, -2.5, 2.25, 0.3},
                               {-2.7, 2.025, -3, 2.25, 0.3},
                               {-2.7, 1.8, -3, 1.8, 0.3}}};
  constexpr Tube kLowerHandle{{{-2.7, 1.8, -3, 1.8, 0.3},
                               {-2.7, 1.575, -3, 1.35, 0.3},
                               {-2.5, 1.125, -2.65, 0.9375, 0.3},
                               {-2, 0.9, -1.9, 0.6, 0.3}}};
  constexpr Tube kLowerSpout{{{1.7, 1.425, 1.7, 0.6, 0.66},
                              {2.6, 1.425, 3.1, 0.825, 0.66},
                              {2.3, 2.1, 2.4, 2.025, 0.25},
                              {2.7, 2.4, 3.3, 2.4, 0.25}}};
  constexpr Tube kUpperSpout{{{2.7, 2.4, 3.3, 2.4, 0.25},
                              {2.8, 2.475, 3.525, 2.49375, 0.25},
                              {2.9, 2.475, 3.45, 2.5125, 0.15},
                              {2.8, 2.4, 3.2, 2.4, 0.15}}};
  constexpr Revolved kKnob{{0, 0.8, 0, 0.2}, {3.15, 3.15, 2.85, 2.7}, 0.5625, -1};
  constexpr Revolved kLid{{0.2, 0.4, 1.3, 1.3}, {2.7, 2.55, 2.55, 2.4}, 0.56, -1};
  constexpr Revolved kBottom{{0, 1.425, 1.5, 1.5}, {0, 0, 0.075, 0.15}, 0.56, 1};
  std::vector<Patch> patches;
  auto add_revolved = [&](const Revolved& shape) {
    for (int quarter = 0; quarter < 4; ++quarter) patches.push_back(Quarter(shape, quarter));
  };
  for (const Revolved& shape : {kRim, kUpperBody, kLowerBody}) add_revolved(shape);
  for (const Tube& tube : {kUpperHandle, kLowerHandle, kLowerSpout, kUpperSpout})
    for (bool mirrored : {false, true}) patches.push_back(Half(tube, mirrored));
  for (const Revolved& shape : {kKnob, kLid, kBottom}) add_revolved(shape);
  return patches;
}

/// Cubic Bernstein polynomials and their derivatives. At 0 and 1 all but one are exactly 0, so that patches
/// that share an edge's control points share the edge.
struct Bernstein {
  double value[4], slope[4];
  explicit Bernstein(double t) {
    const double s = 1 - t;
    value[0] = s * s * s;
    value[1] = 3 * s * s * t;
    value[2] = 3 * s * t * t;
    value[3] = t * t * t;
    slope[0] = -3 * s * s;
    slope[1] = 3 * s * (s - 2 * t);
    slope[2] = 3 * t * (2 * s - t);
    slope[3] = 3 * t * t;
  }
};

Vec3d Weighted(const Patch& patch, const double (&rows)[4], const double (&columns)[4]) {
  Vec3d sum{0, 0, 0};
  for (int row = 0; row < 4; ++row) {
    Vec3d line{0, 0, 0};
    for (int column = 0; column < 4; ++column) line = line + patch.points[row][column] * columns[column];
    sum = sum + line * rows[row];
  }
  return sum;
}

void AddPatch(Scene& scene, const Patch& patch, uint32_t n, uint32_t material) {
  // Where the first row is a single point, on the axis, patches have no tangent plane.
  const bool has_cusp = patch.points[0][0] == patch.points[0][3];
  const Vec3f cusp_normal{0, 0, patch.points[0][0].z > 1.5 ? 1.0f : -1.0f};
  const uint32_t first = uint32_t(scene.positions.size());
  for (uint32_t i = 0; i <= n; ++i)
    for (uint32_t j = 0; j <= n; ++j) {
      const Bernstein s(double(i) / n), t(double(j) / n);
      AddVertex(scene, Weighted(patch, s.value, t.value));
      const Vec3d normal = Cross(Weighted(patch, s.value, t.slope), Weighted(patch, s.slope, t.value));
      scene.normals.push_back(has_cusp && i == 0 ? cusp_normal : ToFloat(Normalize(normal)));
    }
  for (uint32_t i = 0; i < n; ++i)
    for (uint32_t j = 0; j < n; ++j) {
      const uint32_t a = first + i * (n + 1) + j, b = a + 1, c = b + n + 1, d = a + n + 1;
      if (!(has_cusp && i == 0)) AddTriangle(scene, {a, b, c}, material);
      AddTriangle(scene, {c, d, a}, material);
    }
}

/// The squares of one colour, those with i + j odd or even.
void AddSquares(Scene& scene, uint32_t n, uint32_t odd, uint32_t material) {
  for (uint32_t i = 0; i < n; ++i)
    for (uint32_t j = 0; j < n; ++j) {
      if ((i + j) % 2 != odd) continue;
      auto corner = [&](uint32_t di, uint32_t dj) { return (i + di) * (n + 1) + j + dj; };
      const uint32_t corners[] = {corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)};
      AddPolygon(scene, corners, material);
    }
}

Scene Generate(const void* config, const LoadOptions&) {
  const uint32_t n = uint32_t(SpdSizeOf(config));
  Scene scene = SpdScene({4.86, 7.2, 5.4}, {0, 0, 0}, kZAxis, 45, {{-3.1, 9.8, 12.1}, {11.3, 5.1, 8.8}});
  scene.triangles.reserve(Count(config));
  scene.triangle_material.reserve(Count(config));
  for (uint32_t i = 0; i <= n; ++i)
    for (uint32_t j = 0; j <= n; ++j) AddVertex(scene, {8.0 * i / n - 4, 8.0 * j / n - 4, 0});
  scene.normals.resize(scene.positions.size());
  AddSquares(scene, n, 1, AddSurface(scene, {"white", {1, 1, 1}, 0.5, 0.5, 30}));
  AddSquares(scene, n, 0, AddSurface(scene, {"grey", {0.5, 0.5, 0.5}, 0.5, 0.5, 30}));
  const uint32_t pot = AddSurface(scene, {"teapot", {1, 0.5, 0.1}, 0.75, 0.25, 37});
  for (const Patch& patch : TeapotPatches()) AddPatch(scene, patch, n, pot);
  scene.Finish();
  return scene;
}

}  // namespace

const Generator kTeapotGenerator =
    SpdGenerator("teapot", "SPD: Newell's teapot on a checkerboard, mirroring; the seed changes nothing",
                 kParams, Count, Generate);

}  // namespace raybench
