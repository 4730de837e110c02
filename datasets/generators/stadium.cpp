// The teapot in a stadium: a small object of many triangles in a huge arena of few. A structure that divides
// space evenly puts the whole object into one cell. The object is a rabbit-like blob.

#include <cstddef>

#include "accel/base/parallel.h"
#include "datasets/generators/generators.h"

namespace raybench {
namespace {

struct Config {
  int64_t size;
  double ratio;
};

constexpr uint32_t kSegments = 96, kRows = 24;
constexpr uint64_t kArenaTriangles = kSegments * (1 + 4 * kRows + 2);

const rb_param kParams[] = {
    IntParam("size",
             "triangles of the object, taken to the nearest 20 n^2: 69,620 at 70000, 1,003,520 at 1000000",
             offsetof(Config, size), 20, 100e6, 70000, RB_PARAM_LOG),
    FloatParam("ratio", "diameter of the arena (9,504 triangles) over the size of the object",
               offsetof(Config, ratio), 5, 1e6, 100, RB_PARAM_LOG),
};
static_assert(kArenaTriangles == 9504);

double Smooth(double t) {
  t = std::clamp(t, 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

/// A sphere pulled into a sitting rabbit: body, head, ears, tail, and fur of seeded noise. About 2 high, feet
/// at y = 0, closed.
Mesh Rabbit(uint32_t n, uint64_t seed) {
  struct Bump {
    Vec3d axis;
    double cosine, height;  // half-angle of the cone that is pulled out, and how far
  };
  const Bump bumps[] = {{Normalize(Vec3d{0, 0.75, 0.75}), 0.6, 0.55},   // head
                        {Normalize(Vec3d{0.22, 1, 0.5}), 0.985, 0.95},  // ears
                        {Normalize(Vec3d{-0.22, 1, 0.5}), 0.985, 0.95},
                        {Normalize(Vec3d{0, -0.35, -1}), 0.95, 0.22},    // tail
                        {Normalize(Vec3d{0.45, -0.8, 0.6}), 0.93, 0.2},  // feet
                        {Normalize(Vec3d{-0.45, -0.8, 0.6}), 0.93, 0.2}};
  Mesh mesh = GeodesicSphere(n);
  const ValueNoise noise(seed);
  ParallelFor(size_t{0}, mesh.positions.size(), [&](size_t i) {
    Vec3d d = mesh.positions[i];
    Vec3d p{0.72 * d.x, 0.78 * d.y, 0.86 * d.z};
    for (const Bump& b : bumps)
      p = p + b.axis * (b.height * Smooth((Dot(d, b.axis) - b.cosine) / (1 - b.cosine)));
    mesh.positions[i] = p * (1 + 0.02 * noise.Fractal(d * 6.0, 5));
  });
  double lowest = 0;
  for (Vec3d p : mesh.positions) lowest = std::min(lowest, p.y);
  for (Vec3d& p : mesh.positions) p.y -= lowest;
  return mesh;
}

/// The unit circle in kSegments equal steps from 60 degrees halved four times: square roots only.
std::array<Vec3d, kSegments> Circle() {
  static_assert(kSegments == 6 << 4);
  double c = 0.5;
  for (int i = 0; i < 4; ++i) c = std::sqrt((1 + c) / 2);
  double s = std::sqrt(1 - c * c);
  std::array<Vec3d, kSegments> points;
  Vec3d p{1, 0, 0};
  for (Vec3d& point : points) {
    point = p;
    p = Vec3d{c * p.x - s * p.z, 0, s * p.x + c * p.z};
  }
  return points;
}

/// Floor, rows of seats and an outer wall around the origin; an oval of diameter 2 along x. The floor is at y
/// = 0.
Mesh Arena() {
  Mesh mesh;
  const std::array<Vec3d, kSegments> circle = Circle();
  auto ring = [&](double radius, double height) {
    uint32_t first = uint32_t(mesh.positions.size());
    for (Vec3d p : circle) mesh.Add({p.x * radius, height, p.z * radius * 0.8});
    return first;
  };
  auto join = [&](uint32_t inner, uint32_t outer) {
    for (uint32_t i = 0; i < kSegments; ++i) {
      uint32_t k = (i + 1) % kSegments;
      mesh.AddQuad(inner + i, inner + k, outer + k, outer + i);
    }
  };
  uint32_t center = mesh.Add({0, 0, 0}), last = ring(0.5, 0);
  for (uint32_t i = 0; i < kSegments; ++i)
    mesh.triangles.push_back({center, last + (i + 1) % kSegments, last + i});
  for (uint32_t row = 0; row < kRows; ++row) {
    double height = 0.3 * (row + 1) / kRows, inner = 0.5 + 0.5 * row / kRows,
           outer = 0.5 + 0.5 * (row + 1) / kRows;
    uint32_t riser = ring(inner, height), tread = ring(outer, height);
    join(last, riser);
    join(riser, tread);
    last = tread;
  }
  join(last, ring(1, 0));
  return mesh;
}

/// Steps along each side of the icosahedron that the object is made of.
uint32_t Steps(const Config& c) {
  return uint32_t(std::max(1.0, std::round(std::sqrt(double(c.size) / 20))));
}

uint64_t Count(const void* config) {
  const uint64_t n = Steps(*static_cast<const Config*>(config));
  return 20 * n * n + kArenaTriangles;
}

Scene Generate(const void* config, const LoadOptions& options) {
  const Config& c = *static_cast<const Config*>(config);
  Scene scene;
  scene.provenance.source = "stadium";
  Mesh rabbit = Rabbit(Steps(c), options.seed), arena = Arena();
  double height = 0;
  for (Vec3d p : rabbit.positions) height = std::max(height, p.y);
  for (Vec3d& p : rabbit.positions) p = p * (1 / height);  // size 1
  const double half = c.ratio / 2;
  for (Vec3d& p : arena.positions) p = p * half;

  Material fur, concrete;
  fur.name = "rabbit";
  fur.diffuse = {0.75f, 0.6f, 0.45f};
  fur.specular = {0.15f, 0.15f, 0.15f};
  fur.shininess = 20;
  concrete.name = "arena";
  concrete.diffuse = {0.55f, 0.57f, 0.6f};
  Append(scene, arena, AddMaterial(scene, concrete));
  Append(scene, rabbit, AddMaterial(scene, fur));

  // The object fills the picture; the seats stand behind it.
  scene.cameras.push_back({{0.8f, 0.8f, 1.55f}, {0, 0.47f, 0.05f}, {0, 1, 0}, 0.38f});
  scene.lights = {{ToFloat(Vec3d{0.35, 0.9, 0.6} * half), Vec3f{1, 1, 1} * 0.7f, false},
                  {ToFloat(Vec3d{-0.7, 0.6, 0.2} * half), Vec3f{1, 1, 1} * 0.3f, false}};
  scene.Finish();
  return scene;
}

}  // namespace

const Generator kStadiumGenerator = {
    "stadium",
    "a small rabbit-like object of many triangles in a huge arena of few; the seed "
    "changes its fur",
    "the teapot in a stadium (Haines, Ray Tracing News, 1988)",
    kParams,
    std::size(kParams),
    sizeof(Config),
    Count,
    Generate};

}  // namespace raybench
