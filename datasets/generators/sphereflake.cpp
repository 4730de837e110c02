// The sphereflake of Haines' standard procedural databases: each sphere carries nine of a third of its
// radius, six around its equator and three on its upper half.

#include <fmt/format.h>

#include <cstddef>

#include "datasets/generators/generators.h"

namespace raybench {
namespace {

struct Config {
  int64_t depth, tessellation;
};

const rb_param kParams[] = {
    IntParam("depth", "generations below the first sphere: (9^(depth+1) - 1) / 8 spheres",
             offsetof(Config, depth), 0, 8, 3),
    IntParam(
        "tessellation",
        "0: analytic spheres; else the first sphere has 20 * 4^tessellation triangles and each generation a "
        "quarter of the one before, 20 at least (100,882 triangles in all at (3,4), 1,413,082 at (5,4))",
        offsetof(Config, tessellation), 0, 8, 4),
};

struct Placement {
  Vec3d center, x, y, z;  // z points away from the parent
  double radius;
};

class Flake {
 public:
  Flake(Scene& scene, const Config& config)
      : scene_(scene), depth_(int(config.depth)), analytic_(config.tessellation == 0) {
    for (int g = 0; g <= depth_; ++g) {
      int level = std::max(int(config.tessellation) - g, 0);
      if (!analytic_) templates_.push_back(GeodesicSphere(1u << level));
      Material m;
      m.name = fmt::format("generation {}", g);
      float warm = float(g % 3) / 2;
      m.diffuse = Vec3f{0.55f, 0.42f - 0.1f * warm, 0.2f + 0.25f * warm};
      m.specular = {0.5f, 0.5f, 0.5f};
      m.shininess = 60;
      m.reflect = {0.35f, 0.33f, 0.3f};
      materials_.push_back(AddMaterial(scene_, m));
    }
  }

  void Add(const Placement& frame, int generation) {
    if (analytic_) {
      scene_.spheres.push_back({ToFloat(frame.center), float(frame.radius)});
      scene_.sphere_material.push_back(materials_[size_t(generation)]);
    } else {
      const Mesh& mesh = templates_[size_t(generation)];
      uint32_t first = uint32_t(scene_.positions.size());
      for (Vec3d p : mesh.positions)
        scene_.positions.push_back(
            ToFloat(frame.center + (frame.x * p.x + frame.y * p.y + frame.z * p.z) * frame.radius));
      for (const std::array<uint32_t, 3>& t : mesh.triangles)
        scene_.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
      scene_.triangle_material.resize(scene_.triangles.size(), materials_[size_t(generation)]);
    }
    if (generation == depth_) return;
    const double s = std::sqrt(3.0) / 2, low = std::sqrt(1.0 / 3), high = std::sqrt(2.0 / 3);
    const Vec3d around[9] = {{1, 0, 0},
                             {0.5, s, 0},
                             {-0.5, s, 0},
                             {-1, 0, 0},
                             {-0.5, -s, 0},
                             {0.5, -s, 0},  // and above, between them:
                             {s * low, 0.5 * low, high},
                             {-s * low, 0.5 * low, high},
                             {0, -low, high}};
    for (Vec3d a : around) {
      Placement child;
      child.z = Normalize(frame.x * a.x + frame.y * a.y + frame.z * a.z);
      // Any direction that is not along z will do for x; the parent's axis keeps the figure symmetric.
      Vec3d reference = a.z == 0 ? frame.z : frame.x * -a.y + frame.y * a.x;
      child.x = Normalize(Cross(reference, child.z));
      child.y = Cross(child.z, child.x);
      child.radius = frame.radius / 3;
      child.center = frame.center + child.z * (frame.radius + child.radius);
      Add(child, generation + 1);
    }
  }

 private:
  Scene& scene_;
  int depth_;
  bool analytic_;
  std::vector<Mesh> templates_;
  std::vector<uint32_t> materials_;
};

uint64_t Count(const void* config) {
  const Config& c = *static_cast<const Config*>(config);
  uint64_t count = 2, spheres = 1;
  for (int64_t g = 0; g <= c.depth; ++g, spheres *= 9)
    count +=
        spheres * (c.tessellation == 0 ? 1 : uint64_t{20} << (2 * std::max<int64_t>(c.tessellation - g, 0)));
  return count;
}

Scene Generate(const void* config, const LoadOptions&) {
  const Config& c = *static_cast<const Config*>(config);
  const uint64_t count = Count(config);
  Scene scene;
  scene.provenance.source = "sphereflake";
  if (c.tessellation == 0) {
    scene.spheres.reserve(count);
  } else {
    scene.triangles.reserve(count);
    scene.positions.reserve(count);
  }
  Material ground;
  ground.name = "ground";
  ground.diffuse = {0.45f, 0.5f, 0.42f};
  ground.reflect = {0.12f, 0.12f, 0.12f};
  Mesh quad;
  const double size = 12, y = -1.02;
  for (Vec3d p : {Vec3d{-size, y, -size}, Vec3d{-size, y, size}, Vec3d{size, y, size}, Vec3d{size, y, -size}})
    quad.Add(p);
  quad.AddQuad(0, 1, 2, 3);
  Append(scene, quad, AddMaterial(scene, ground));

  // 3-4-5 angles turn the figure, so that it does not stand parallel to the axes.
  Flake(scene, c).Add({{0, 0, 0}, {0.8, 0, 0.6}, {0.6, 0, -0.8}, {0, 1, 0}, 1}, 0);

  scene.cameras.push_back({{2.6f, 2.3f, 4.4f}, {0, 0.05f, 0}, {0, 1, 0}, 0.41421356f});
  scene.lights = {{{5, 8, 4}, Vec3f{1, 1, 1} * 0.55f, false},
                  {{-6, 5, 6}, Vec3f{1, 1, 1} * 0.3f, false},
                  {{1, 9, -5}, Vec3f{1, 1, 1} * 0.25f, false}};
  scene.Finish();
  return scene;
}

}  // namespace

const Generator kSphereflakeGenerator = {
    "sphereflake",
    "reflecting spheres of nine thirds each over a ground of 2 triangles; the seed changes nothing",
    "Haines, A proposal for standard graphics environments, 1987",
    kParams,
    std::size(kParams),
    sizeof(Config),
    Count,
    Generate};

}  // namespace raybench
