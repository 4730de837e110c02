// Small meshes and ray sets that break naive traversal; shared by tests.
#pragma once

#include <array>
#include <cmath>
#include <cstdlib>
#include <map>
#include <string>
#include <vector>

#include "accel/base/random.h"
#include "accel/base/vec3.h"
#include "accel/host/registry.h"

namespace raybench::testing {

/// An indexed mesh with the padding that the contract asks for.
struct Mesh {
  std::string name;
  std::vector<Vec3f> positions;
  std::vector<std::array<uint32_t, 3>> triangles;

  rb_geometry Geometry() const {
    // The contract lets structures read 16 bytes behind the last position.
    const_cast<Mesh*>(this)->positions.reserve(positions.size() + 2);
    rb_geometry g{};
    g.struct_size = sizeof g;
    g.positions = reinterpret_cast<const float(*)[3]>(positions.data());
    g.vertex_count = positions.size();
    g.triangles = reinterpret_cast<const uint32_t(*)[3]>(triangles.data());
    g.triangle_count = triangles.size();
    return g;
  }
  Vec3f Corner(size_t triangle, int corner) const { return positions[triangles[triangle][size_t(corner)]]; }
};

/// Every vertex moved by `scale * p + offset`, in float.
inline Mesh Moved(Mesh mesh, float scale, Vec3f offset, const std::string& name) {
  for (Vec3f& p : mesh.positions) p = p * scale + offset;
  mesh.name = name;
  return mesh;
}

/// A closed sphere-like mesh: an octahedron subdivided `level` times, vertices turned off the lattice.
inline Mesh Ball(int level) {
  Mesh mesh{"ball", {}, {}};
  for (Vec3f p : {Vec3f{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}})
    mesh.positions.push_back(p);
  mesh.triangles = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4}, {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
  for (int i = 0; i < level; ++i) {
    std::map<std::pair<uint32_t, uint32_t>, uint32_t> middle;
    auto mid = [&](uint32_t a, uint32_t b) {
      auto [it, is_new] = middle.try_emplace(std::minmax(a, b), uint32_t(mesh.positions.size()));
      if (is_new) mesh.positions.push_back(Normalize(mesh.positions[a] + mesh.positions[b]));
      return it->second;
    };
    std::vector<std::array<uint32_t, 3>> finer;
    for (auto [a, b, c] : mesh.triangles) {
      const uint32_t ab = mid(a, b), bc = mid(b, c), ca = mid(c, a);
      for (std::array<uint32_t, 3> t : {std::array{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}})
        finer.push_back(t);
    }
    mesh.triangles = std::move(finer);
  }
  const float c = 0.8253356f, s = 0.5646425f;  // cos and sin of 0.6
  for (Vec3f& p : mesh.positions) {
    p = {c * p.x - s * p.y, s * p.x + c * p.y, p.z};
    p = {p.x, c * p.y - s * p.z, s * p.y + c * p.z};
  }
  return mesh;
}

/// A flat n x n lattice in the plane z = 0, vertices on integers: everything lies on split planes.
inline Mesh Lattice(int n) {
  Mesh mesh{"flat", {}, {}};
  for (int y = 0; y <= n; ++y) {
    for (int x = 0; x <= n; ++x) mesh.positions.push_back({float(x - n / 2), float(y - n / 2), 0});
  }
  auto at = [&](int x, int y) { return uint32_t(y * (n + 1) + x); };
  for (int y = 0; y < n; ++y) {
    for (int x = 0; x < n; ++x) {
      mesh.triangles.push_back({at(x, y), at(x + 1, y), at(x + 1, y + 1)});
      mesh.triangles.push_back({at(x, y), at(x + 1, y + 1), at(x, y + 1)});
    }
  }
  return mesh;
}

/// `copies` of the same two triangles.
inline Mesh Coincident(int copies) {
  Mesh mesh{"coincident", {{0, 0, 0}, {1, 0, 0.25f}, {1, 1, 0}, {0, 1, 0.5f}}, {}};
  for (int i = 0; i < copies; ++i) {
    mesh.triangles.push_back({0, 1, 2});
    mesh.triangles.push_back({0, 2, 3});
  }
  return mesh;
}

/// Long thin triangles in all directions, up to 4 long and 1e-4 wide.
inline Mesh Needles(int n) {
  Mesh mesh{"needles", {}, {}};
  Random random(11);
  for (int i = 0; i < n; ++i) {
    const Vec3d at = random.UnitVector() * random.NextDouble(), along = random.UnitVector() * 4.0;
    const uint32_t first = uint32_t(mesh.positions.size());
    for (Vec3d p : {at, at + along, at + random.UnitVector() * 1e-4}) mesh.positions.push_back(ToFloat(p));
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  return mesh;
}

/// Balls as procedural primitives, by the quadratic formula in double.
struct Balls {
  struct Ball {
    Vec3d at;
    double radius;
  };
  std::vector<Ball> balls;

  /// Strewn about the origin.
  Balls(int count, uint64_t seed) {
    Random random(seed);
    for (int i = 0; i < count; ++i)
      balls.push_back({random.UnitVector() * (2 * random.NextDouble()), 0.05 + 0.2 * random.NextDouble()});
  }
  /// Behind a mesh's triangles.
  rb_geometry Geometry(const Mesh& mesh) const {
    rb_geometry g = mesh.Geometry();
    g.procedural_count = balls.size(), g.procedural_user = this;
    g.procedural_bounds = &Bounds, g.procedural_intersect = &Intersect;
    return g;
  }

  static void Bounds(const void* user, uint64_t i, float lo[3], float hi[3]) {
    const Ball& b = static_cast<const Balls*>(user)->balls[i];
    for (int a = 0; a < 3; ++a) {
      lo[a] = std::nextafter(float(b.at[a] - b.radius), -INFINITY);
      hi[a] = std::nextafter(float(b.at[a] + b.radius), INFINITY);
    }
  }
  static int Intersect(const void* user, uint64_t i, uint32_t, const rb_ray* ray, rb_hit* hit) {
    const Ball& b = static_cast<const Balls*>(user)->balls[i];
    const Vec3d o = ToDouble(LoadVec3(ray->org)) - b.at, d = ToDouble(LoadVec3(ray->dir));
    const double dd = Dot(d, d), od = Dot(o, d), root = od * od - dd * (Dot(o, o) - b.radius * b.radius);
    if (root < 0) return 0;
    for (double t : {(-od - std::sqrt(root)) / dd, (-od + std::sqrt(root)) / dd}) {
      if (float(t) <= ray->tnear || float(t) > ray->tfar) continue;
      *hit = {float(t), 0, 0, RAYBENCH_NONE};
      return 1;
    }
    return 0;
  }
};

inline Bounds3 BoundsOf(const Mesh& mesh) {
  Bounds3 b;
  for (Vec3f p : mesh.positions) b.Extend(p);
  return b;
}

/// Rays that aim where float fails: at vertices, at edge midpoints, along axes through vertices with +-0
/// components, at the faces of the whole box, and some at random. `count` of each.
inline std::vector<rb_ray> NastyRays(const Mesh& mesh, int count, uint64_t seed) {
  std::vector<rb_ray> rays;
  Random random(seed);
  const float inf = std::numeric_limits<float>::infinity();
  Bounds3 box = BoundsOf(mesh);
  if (box.Empty()) box = {{-1, -1, -1}, {1, 1, 1}};
  const Vec3d center = (ToDouble(box.lo) + ToDouble(box.hi)) * 0.5;
  const double size = std::max(Length(ToDouble(box.Extent())), 1e-30);
  auto add = [&](Vec3f from, Vec3f to) {
    const Vec3f d = to - from;
    if (d == Vec3f{0, 0, 0}) return;
    rays.push_back({{from.x, from.y, from.z}, 0, {d.x, d.y, d.z}, inf});
  };
  auto somewhere = [&](double reach) {
    return ToFloat(center + random.UnitVector() * (size * reach * random.NextDouble()));
  };
  for (int i = 0; i < count; ++i) {
    if (!mesh.triangles.empty()) {
      const size_t t = random.Below(mesh.triangles.size());
      const int k = int(random.Below(3));
      const Vec3f a = mesh.Corner(t, k), b = mesh.Corner(t, (k + 1) % 3);
      add(somewhere(0.3), a);
      add(somewhere(0.3), (a + b) * 0.5f);
      add(somewhere(2), (a + b) * 0.5f);
      // Along an axis through a vertex: the other components are +0 or -0.
      const int axis = int(random.Below(3));
      const float sign = random.Below(2) ? 1.0f : -1.0f;
      rb_ray ray{
          {a.x, a.y, a.z}, 0, {random.Below(2) ? 0.0f : -0.0f, random.Below(2) ? 0.0f : -0.0f, 0.0f}, inf};
      ray.org[axis] = float(center[axis] - sign * size * (1 + random.NextDouble()));
      ray.dir[axis] = sign * float(random.Below(2) ? 1.0 : size);
      rays.push_back(ray);
    }
    // Within a face of the whole box.
    Vec3f from = somewhere(1), to = somewhere(1);
    const int axis = int(random.Below(3));
    from[axis] = to[axis] = random.Below(2) ? box.hi[axis] : box.lo[axis];
    add(from, to);
    add(somewhere(2), somewhere(1));
  }
  return rays;
}

inline std::vector<rb_hit> Closest(const Tree& tree, const std::vector<rb_ray>& rays) {
  std::vector<rb_hit> hits(rays.size());
  rb_query q{};
  q.struct_size = sizeof q, q.kind = RB_CLOSEST, q.n = rays.size(), q.rays = rays.data(),
  q.hits = hits.data();
  tree.Query(q);
  return hits;
}

inline std::vector<uint8_t> Occluded(const Tree& tree, const std::vector<rb_ray>& rays) {
  std::vector<uint8_t> occluded(rays.size());
  rb_query q{};
  q.struct_size = sizeof q, q.kind = RB_ANY, q.n = rays.size(), q.rays = rays.data(),
  q.occluded = occluded.data();
  tree.Query(q);
  return occluded;
}

/// The built-in structures, and those of the plugin that RAYBENCH_TEST_PLUGIN names.
inline const Registry& TestRegistry() {
  static const Registry registry = [] {
    Registry all;
    if (const char* plugin = std::getenv("RAYBENCH_TEST_PLUGIN")) all.LoadPlugin(plugin);
    return all;
  }();
  return registry;
}

inline Tree Build(const std::string& spec, const rb_geometry& geometry, uint32_t threads = 1) {
  rb_build_options options = DefaultBuildOptions();
  options.threads = threads;
  return Tree(ParseContestant(TestRegistry(), spec), geometry, options);
}

}  // namespace raybench::testing
