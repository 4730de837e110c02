#include "datasets/generators/generators.h"

#include "accel/base/parallel.h"

namespace raybench {

namespace {

/// The icosahedron: 12 vertices, and its sides counter-clockwise seen from outside.
struct Icosahedron {
  Vec3d vertices[12];
  int faces[20][3] = {{0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
                      {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
                      {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1}};
  Icosahedron() {
    double g = (1 + std::sqrt(5.0)) / 2;
    const Vec3d v[12] = {{-1, g, 0},  {1, g, 0},  {-1, -g, 0}, {1, -g, 0}, {0, -1, g},  {0, 1, g},
                         {0, -1, -g}, {0, 1, -g}, {g, 0, -1},  {g, 0, 1},  {-g, 0, -1}, {-g, 0, 1}};
    for (int i = 0; i < 12; ++i) vertices[i] = Normalize(v[i]);
  }
};

}  // namespace

Mesh GeodesicSphere(uint32_t n) {
  const Icosahedron ico;
  Mesh mesh;
  mesh.positions.resize(size_t{10} * n * n + 2);
  mesh.triangles.resize(size_t{20} * n * n);
  for (uint32_t i = 0; i < 12; ++i) mesh.positions[i] = ico.vertices[i];

  // Vertices are numbered corners first, then edge by edge (from the lower corner to the higher), then the
  // insides of the sides: so each is computed once and shared.
  uint32_t edge_start[12][12] = {};
  uint32_t next = 12;
  for (const auto& face : ico.faces)
    for (int k = 0; k < 3; ++k) {
      int a = face[k], b = face[(k + 1) % 3];
      if (a > b) continue;  // each edge is met once in each direction
      edge_start[a][b] = next;
      for (uint32_t i = 1; i < n; ++i)
        mesh.positions[next++] = Normalize(ico.vertices[a] * double(n - i) + ico.vertices[b] * double(i));
    }
  const uint32_t inside_start = next, inside = n >= 3 ? (n - 1) * (n - 2) / 2 : 0;

  ParallelFor(0, 20, [&](int f) {
    const int* c = ico.faces[f];
    auto edge = [&](int a, int b, uint32_t i) {  // the i-th of n steps from a to b, 0 < i < n
      return a < b ? edge_start[a][b] + i - 1 : edge_start[b][a] + (n - i) - 1;
    };
    // (i, j): i steps from corner 0 towards 1, j towards 2.
    auto index = [&](uint32_t i, uint32_t j) -> uint32_t {
      if (i + j == 0) return uint32_t(c[0]);
      if (i == n) return uint32_t(c[1]);
      if (j == n) return uint32_t(c[2]);
      if (j == 0) return edge(c[0], c[1], i);
      if (i == 0) return edge(c[0], c[2], j);
      if (i + j == n) return edge(c[1], c[2], j);
      uint32_t row = j - 1;  // rows of n-2, n-3, ... vertices
      return inside_start + uint32_t(f) * inside + row * (n - 2) - row * (row - 1) / 2 + (i - 1);
    };
    for (uint32_t j = 1; j + 1 < n; ++j)
      for (uint32_t i = 1; i + j < n; ++i)
        mesh.positions[index(i, j)] =
            Normalize(ico.vertices[c[0]] * double(n - i - j) + ico.vertices[c[1]] * double(i) +
                      ico.vertices[c[2]] * double(j));
    size_t t = size_t(f) * n * n;
    for (uint32_t j = 0; j < n; ++j)
      for (uint32_t i = 0; i + j < n; ++i) {
        mesh.triangles[t++] = {index(i, j), index(i + 1, j), index(i, j + 1)};
        if (i + j + 1 < n) mesh.triangles[t++] = {index(i + 1, j), index(i + 1, j + 1), index(i, j + 1)};
      }
  });
  return mesh;
}

Frame RandomFrame(Random& random) {
  Frame frame;
  frame.x = random.UnitVector();
  do frame.z = Cross(frame.x, random.UnitVector());
  while (Dot(frame.z, frame.z) < 0.01);
  frame.z = Normalize(frame.z);
  frame.y = Cross(frame.z, frame.x);
  return frame;
}

void Append(Scene& scene, const Mesh& mesh, uint32_t material) {
  const size_t first = scene.positions.size(), start = scene.triangles.size();
  scene.positions.resize(first + mesh.positions.size());
  scene.triangles.resize(start + mesh.triangles.size());
  scene.triangle_material.resize(scene.triangles.size(), material);
  ParallelFor(size_t{0}, mesh.positions.size(),
              [&](size_t i) { scene.positions[first + i] = ToFloat(mesh.positions[i]); });
  const uint32_t shift = uint32_t(first);
  ParallelFor(size_t{0}, mesh.triangles.size(), [&](size_t i) {
    const std::array<uint32_t, 3>& t = mesh.triangles[i];
    scene.triangles[start + i] = {t[0] + shift, t[1] + shift, t[2] + shift};
  });
}

uint32_t AddMaterial(Scene& scene, Material material) {
  scene.materials.push_back(std::move(material));
  return uint32_t(scene.materials.size() - 1);
}

double ValueNoise::Corner(int64_t x, int64_t y, int64_t z) const {
  uint64_t cell =
      uint64_t(x) * 0x8DA6B343u ^ uint64_t(y) * 0xD8163841u << 16 ^ uint64_t(z) * 0xCB1AB31Fu << 32;
  return 2 * Random(seed_, cell).NextDouble() - 1;
}

double ValueNoise::At(Vec3d p) const {
  Vec3d base{std::floor(p.x), std::floor(p.y), std::floor(p.z)}, f = p - base;
  auto smooth = [](double t) { return t * t * t * (t * (t * 6 - 15) + 10); };
  double weight[3][2];
  for (int k = 0; k < 3; ++k) {
    weight[k][1] = smooth(f[k]);
    weight[k][0] = 1 - weight[k][1];
  }
  double sum = 0;
  for (int i = 0; i < 8; ++i) {
    int dx = i & 1, dy = i >> 1 & 1, dz = i >> 2;
    sum += weight[0][dx] * weight[1][dy] * weight[2][dz] *
           Corner(int64_t(base.x) + dx, int64_t(base.y) + dy, int64_t(base.z) + dz);
  }
  return sum;
}

double ValueNoise::Fractal(Vec3d p, int octaves) const {
  double sum = 0, height = 1;
  for (int i = 0; i < octaves; ++i, height /= 2) {
    sum += height * At(p);
    p = p * 2.0 + Vec3d{0.37, 0.53, 0.71};  // so that the lattices do not share corners
  }
  return sum;
}

}  // namespace raybench
