// How a scene gets into the state that the plugin contract promises: finite, in range, no
// degenerate triangle.

#include "datasets/scene/scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numeric>
#include <stdexcept>

#include "accel/base/hash.h"
#include "accel/base/parallel.h"
#include "datasets/scene/orientation.h"
#include "datasets/scene/text.h"

namespace raybench {

namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr float kMaxFloat = std::numeric_limits<float>::max();
constexpr size_t kGrain = 1 << 14;

bool IsFinite(Vec3f v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

std::string Text(Vec3f v) { return fmt::format("({}, {}, {})", v.x, v.y, v.z); }

float MaxAbs(Vec3f v) { return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)}); }

/// Index of the first of n items that is bad, or n. In parallel, yet always the first.
template <class IsBad>
size_t FindFirst(size_t n, const IsBad& is_bad) {
  return ParallelReduce(
      Range<size_t>(0, n, kGrain), n,
      [&](const Range<size_t>& range, size_t found) {
        for (size_t i = range.begin(); i < std::min(range.end(), found); ++i)
          if (is_bad(i)) return i;
        return found;
      },
      [](size_t a, size_t b) { return std::min(a, b); });
}

template <class Body>
void ForEach(size_t n, const Body& body) {
  ParallelFor(Range<size_t>(0, n, kGrain), [&](const Range<size_t>& range) {
    for (size_t i = range.begin(); i < range.end(); ++i) body(i);
  });
}

/// Times 2^exponent; `exact` is cleared if a bit was lost.
float Scaled(float value, int exponent, bool& exact) {
  float scaled = std::ldexp(value, exponent);
  if (std::ldexp(scaled, -exponent) != value) exact = false;
  return scaled;
}

Vec3f Scaled(Vec3f v, int exponent, bool& exact) {
  return {Scaled(v.x, exponent, exact), Scaled(v.y, exponent, exact), Scaled(v.z, exponent, exact)};
}

/// Times 2^exponent, as near as float gets: for what need not be exact (cameras, lights).
Vec3f Saturated(Vec3f v, int exponent) {
  bool exact = true;
  v = Scaled(v, exponent, exact);
  return Min(Max(v, Vec3f{-kMaxFloat, -kMaxFloat, -kMaxFloat}), Vec3f{kMaxFloat, kMaxFloat, kMaxFloat});
}

/// Three-quarter view from the front, above and to the right (y is up), just far enough to show the whole box
/// in a square picture.
Camera AutomaticCamera(const Bounds3& bounds) {
  Camera camera;
  camera.tan_half_fov = 0.41421356f;  // 45 degrees
  if (bounds.Empty()) {
    camera.eye = {0, 0, 3};
    camera.at = {0, 0, 0};
    return camera;
  }
  Vec3d lo = ToDouble(bounds.lo), hi = ToDouble(bounds.hi), center = (lo + hi) * 0.5;
  Vec3d back = Normalize(Vec3d{0.5, 0.4, 0.8}), right = Normalize(Cross(Vec3d{0, 1, 0}, back)),
        up = Cross(back, right);
  double distance = 0;
  for (int corner = 0; corner < 8; ++corner) {
    Vec3d p = Vec3d{corner & 1 ? hi.x : lo.x, corner & 2 ? hi.y : lo.y, corner & 4 ? hi.z : lo.z} - center;
    double aside = std::max(std::abs(Dot(p, right)), std::abs(Dot(p, up)));
    distance = std::max(distance, Dot(p, back) + aside / camera.tan_half_fov);
  }
  distance *= 1.03;
  camera.at = ToFloat(center);
  // Far from the origin a small scene's distance may vanish in rounding.
  do {
    camera.eye = ToFloat(center + back * distance);
    distance *= 2;
  } while (camera.eye == camera.at);
  return camera;
}

/// A key light over the camera's left shoulder and a weaker fill light from its right, both outside
/// the bounds.
std::vector<Light> AutomaticLights(const Bounds3& bounds, const Camera& camera) {
  Vec3d at = ToDouble(camera.at), back = ToDouble(camera.eye) - at;
  Vec3d up = ToDouble(camera.up), side = Cross(up, back);
  if (Dot(side, side) == 0) side = Cross(Vec3d{0.6, 0, 0.8}, back);
  side = Normalize(side);
  back = Normalize(back);
  up = Cross(back, side);
  double radius = 1;
  if (!bounds.Empty()) {
    at = (ToDouble(bounds.lo) + ToDouble(bounds.hi)) * 0.5;
    radius = Length(ToDouble(bounds.hi) - ToDouble(bounds.lo)) / 2;
  }
  auto light = [&](Vec3d direction, float intensity) {
    return Light{ToFloat(at + Normalize(direction) * (4 * radius)), Vec3f{1, 1, 1} * intensity, false};
  };
  return {light(back + up * 1.2 - side * 0.7, 0.75f), light(back * 0.6 + up * 0.3 + side, 0.3f)};
}

/// What is wrong with a light; empty: nothing, and it is as scene.h promises.
std::string FinishLight(Light& l) {
  if (!IsFinite(l.position) || !IsFinite(l.intensity))
    return fmt::format("is not finite: position {}, intensity {}", Text(l.position), Text(l.intensity));
  if (!(l.range > 0)) return fmt::format("has the range {}; more than 0 is needed", l.range);
  if (l.kind == LightKind::kDirectional) l.falloff = false;
  if (l.kind == LightKind::kPoint) return {};
  const Vec3d direction = ToDouble(l.direction);
  if (!IsFinite(l.direction) || !(Length(direction) > 0))
    return fmt::format("has the direction {}; a finite vector other than 0 is needed", Text(l.direction));
  l.direction = ToFloat(Normalize(direction));
  if (l.kind == LightKind::kSpot && !(l.cos_outer >= -1 && l.cos_inner >= l.cos_outer && l.cos_inner <= 1))
    return fmt::format(
        "has cones of the cosines {} (inner) and {} (outer); -1 <= outer <= inner <= 1 is needed",
        l.cos_inner, l.cos_outer);
  return {};
}

/// Leaves out the primitives that `flaw` finds fault with, or refuses them.
template <class Prim, class Flaw, class Fail>
uint64_t KeepSound(std::vector<Prim>& prims, std::vector<uint32_t>& material, const char* kind,
                   size_t materials, bool drop_bad, const Flaw& flaw, const Fail& fail) {
  size_t kept = 0;
  for (size_t i = 0; i < prims.size(); ++i) {
    if (material[i] >= materials)
      fail(fmt::format("{} {} has material {}; there are {}", kind, i, material[i], materials));
    if (const std::string what = flaw(prims[i]); !what.empty()) {
      if (!drop_bad) fail(fmt::format("{} {} {}{}", kind, i, what, kOrDropBad));
      continue;
    }
    prims[kept] = prims[i];
    material[kept++] = material[i];
  }
  const uint64_t dropped = prims.size() - kept;
  prims.resize(kept);
  material.resize(kept);
  return dropped;
}

/// Times 2^exponent; false if a bit would be lost.
bool Rescale(Sphere& s, int exponent) {
  bool exact = true;
  s = {Scaled(s.center, exponent, exact), Scaled(s.radius, exponent, exact)};
  return exact;
}

bool Rescale(Cone& c, int exponent) {
  bool exact = true;
  c = {Scaled(c.base, exponent, exact), Scaled(c.base_radius, exponent, exact),
       Scaled(c.apex, exponent, exact), Scaled(c.apex_radius, exponent, exact)};
  return exact;
}

}  // namespace

void Scene::Finish(bool drop_bad) {
  const std::string& file = provenance.source;
  auto fail = [&](const std::string& what) { throw InputError(file + ": " + what); };

  if (materials.empty()) materials.emplace_back().name = "default";
  if (triangle_material.empty()) triangle_material.resize(triangles.size());
  if (sphere_material.empty()) sphere_material.resize(spheres.size());
  if (cone_material.empty()) cone_material.resize(cones.size());
  if (polygon_material.empty()) polygon_material.resize(polygons.size());
  if (triangle_face.empty()) {
    triangle_face.resize(triangles.size());
    std::iota(triangle_face.begin(), triangle_face.end(), 0u);
  }
  if (triangle_material.size() != triangles.size() || triangle_face.size() != triangles.size() ||
      sphere_material.size() != spheres.size() || cone_material.size() != cones.size() ||
      polygon_material.size() != polygons.size())
    throw std::logic_error("Scene::Finish: one material and one face id is needed for each primitive");
  if ((!normals.empty() && normals.size() != positions.size()) ||
      (!uvs.empty() && uvs.size() != positions.size()))
    throw std::logic_error("Scene::Finish: normals and uvs are one per position, or none");
  const auto is_texture = [&](int32_t i) { return i >= -1 && i < int64_t(textures.size()); };
  for (size_t i = 0; i < materials.size(); ++i)
    for (int32_t texture : {materials[i].base_color_texture, materials[i].emission_texture})
      if (!is_texture(texture))
        fail(fmt::format("material {} has texture {}; there are {}", i, texture, textures.size()));
  if (!is_texture(environment))
    fail(fmt::format("the environment is texture {}; there are {}", environment, textures.size()));
  if (positions.size() >= RAYBENCH_NONE || primitive_count() >= RAYBENCH_NONE)
    fail(fmt::format("{} vertices and {} primitives; fewer than {} of each are allowed", positions.size(),
                     primitive_count(), RAYBENCH_NONE));

  // Before anything is left out or rescaled: so that the geometry's program can compute the same.
  if (!has_hash_) TakeHash();
  has_hash_ = false;

  // Triangles: 0 stays, 1 is bad, 2 is degenerate.
  if (!drop_bad) {
    if (size_t i = FindFirst(positions.size(), [&](size_t k) { return !IsFinite(positions[k]); });
        i < positions.size())
      fail(fmt::format("vertex {} is {}; coordinates must be finite{}", i, Text(positions[i]), kOrDropBad));
  }
  std::vector<uint8_t> state(triangles.size());
  ForEach(triangles.size(), [&](size_t i) {
    const std::array<uint32_t, 3>& t = triangles[i];
    for (uint32_t v : t)
      if (v >= positions.size() || !IsFinite(positions[v])) state[i] = 1;
    if (state[i] == 0 && IsDegenerate(positions[t[0]], positions[t[1]], positions[t[2]])) state[i] = 2;
  });
  if (!drop_bad) {
    if (size_t i = FindFirst(triangles.size(), [&](size_t k) { return state[k] == 1; });
        i < triangles.size()) {
      const std::array<uint32_t, 3>& t = triangles[i];
      fail(fmt::format("face {} refers to vertices {}, {}, {}; allowed are 0 to {}{}", triangle_face[i], t[0],
                       t[1], t[2], int64_t(positions.size()) - 1, kOrDropBad));
    }
  }
  for (size_t i = 0; i < triangles.size(); ++i) {
    if (triangle_material[i] >= materials.size())
      fail(fmt::format("face {} has material {}; there are {}", triangle_face[i], triangle_material[i],
                       materials.size()));
    stats.dropped_triangles += state[i] == 1;
    stats.degenerate_triangles += state[i] == 2;
  }
  const auto keep_triangles = [&](const auto& is_kept) {
    size_t kept = 0;
    for (size_t i = 0; i < triangles.size(); ++i) {
      if (!is_kept(i)) continue;
      triangles[kept] = triangles[i];
      triangle_material[kept] = triangle_material[i];
      triangle_face[kept++] = triangle_face[i];
    }
    triangles.resize(kept);
    triangle_material.resize(kept);
    triangle_face.resize(kept);
  };
  keep_triangles([&](size_t i) { return state[i] == 0; });

  FinishProcedurals(drop_bad);

  auto finite_or_zero = [&](auto& items, const auto& is_finite, const char* what) {
    size_t bad = 0;
    for (auto& item : items)
      if (!is_finite(item)) {
        item = {};
        ++bad;
      }
    if (bad > 0) stats.notes.push_back(fmt::format("{} {} are not finite and count as 0", bad, what));
  };
  finite_or_zero(
      normals, [](Vec3f n) { return IsFinite(n); }, "shading normals");
  finite_or_zero(
      uvs, [](Vec2f t) { return std::isfinite(t.u) && std::isfinite(t.v); }, "texture coordinates");

  // Vertices that no primitive uses must not decide about bounds and scale; at 0 they are in anybody's range.
  std::vector<uint8_t> used(positions.size());
  for (const std::array<uint32_t, 3>& t : triangles)
    for (uint32_t v : t) used[v] = 1;
  for (const Polygon& p : polygons)
    for (uint32_t v : CornersOf(p)) used[v] = 1;
  for (size_t i = 0; i < positions.size(); ++i)
    if (!used[i]) positions[i] = {0, 0, 0};

  double largest = ParallelReduce(
      Range<size_t>(0, positions.size(), kGrain), 0.0,
      [&](const Range<size_t>& range, double m) {
        for (size_t i = range.begin(); i < range.end(); ++i) m = std::max(m, double(MaxAbs(positions[i])));
        return m;
      },
      [](double a, double b) { return std::max(a, b); });
  for (const Sphere& s : spheres) largest = std::max(largest, Reach(s));
  for (const Cone& c : cones) largest = std::max(largest, Reach(c));

  for (size_t i = 0; i < cameras.size(); ++i) {
    const Camera& c = cameras[i];
    Vec3d forward = ToDouble(c.at) - ToDouble(c.eye), side = Cross(forward, ToDouble(c.up));
    if (!IsFinite(c.eye) || !IsFinite(c.at) || !IsFinite(c.up) || !(Dot(side, side) > 0) ||
        !(c.tan_half_fov > 0) || !std::isfinite(c.tan_half_fov))
      fail(fmt::format("camera {} is not usable: eye {}, at {}, up {}, tan(fov/2) {}", i, Text(c.eye),
                       Text(c.at), Text(c.up), c.tan_half_fov));
  }
  for (size_t i = 0; i < lights.size(); ++i)
    if (const std::string flaw = FinishLight(lights[i]); !flaw.empty())
      fail(fmt::format("light {} {}", i, flaw));

  if (largest > 0 && !(largest >= 0x1p-30 && largest <= 0x1p30)) {
    int exponent = -std::ilogb(largest);  // brings the largest coordinate into [1, 2)
    std::vector<uint8_t> inexact(positions.size());
    ForEach(positions.size(), [&](size_t i) {
      bool exact = true;
      Vec3f scaled = Scaled(positions[i], exponent, exact);
      if (exact) positions[i] = scaled;
      inexact[i] = !exact;
    });
    const std::string too_small =
        fmt::format("too small beside the largest coordinate {} to be rescaled without loss", largest);
    if (size_t i = FindFirst(positions.size(), [&](size_t k) { return inexact[k] != 0; });
        i < positions.size()) {
      if (!drop_bad) fail(fmt::format("vertex {} is {}, {}{}", i, Text(positions[i]), too_small, kOrDropBad));
      const auto uses_inexact = [&](const auto& corners) {
        return std::any_of(corners.begin(), corners.end(), [&](uint32_t v) { return inexact[v] != 0; });
      };
      const size_t before = triangles.size();
      keep_triangles([&](size_t k) { return !uses_inexact(triangles[k]); });
      stats.dropped_triangles += before - triangles.size();
      stats.dropped_triangles += KeepSound(
          polygons, polygon_material, "polygon", materials.size(), true,
          [&](const Polygon& p) { return uses_inexact(CornersOf(p)) ? too_small : std::string(); }, fail);
      for (size_t k = 0; k < positions.size(); ++k)
        if (inexact[k] != 0) positions[k] = {0, 0, 0};
    }
    const auto rescale_all = [&](auto& prims, std::vector<uint32_t>& material, const char* kind) {
      stats.dropped_triangles += KeepSound(
          prims, material, kind, materials.size(), drop_bad,
          [&](auto& prim) { return Rescale(prim, exponent) ? std::string() : "is " + too_small; }, fail);
    };
    rescale_all(spheres, sphere_material, "sphere");
    rescale_all(cones, cone_material, "cone");
    for (Camera& c : cameras) {
      c.eye = Saturated(c.eye, exponent);
      c.at = Saturated(c.at, exponent);
    }
    for (Light& l : lights) {
      l.position = Saturated(l.position, exponent);
      if (l.falloff) l.intensity = Saturated(l.intensity, 2 * exponent);
      if (l.range < kInfinity)
        l.range =
            std::clamp(std::ldexp(l.range, exponent), std::numeric_limits<float>::denorm_min(), kMaxFloat);
    }
    scale_exponent += exponent;
  }

  bounds_ = ParallelReduce(
      Range<size_t>(0, triangles.size(), kGrain), Bounds3{},
      [&](const Range<size_t>& range, Bounds3 b) {
        for (size_t i = range.begin(); i < range.end(); ++i)
          for (uint32_t v : triangles[i]) b.Extend(positions[v]);
        return b;
      },
      [](Bounds3 a, const Bounds3& b) { return a.Extend(b), a; });
  polygon_planes_.resize(polygons.size());
  ForEach(polygons.size(),
          [&](size_t i) { polygon_planes_[i] = PlaneOf(positions, CornersOf(polygons[i])); });
  for (uint64_t i = 0; i < procedural_count(); ++i) bounds_.Extend(ProceduralBounds(i));

  if (cameras.empty()) {
    cameras.push_back(AutomaticCamera(bounds_));
    automatic_camera = true;
  }
  if (lights.empty()) {
    lights = AutomaticLights(bounds_, cameras.front());
    automatic_lights = true;
  }

  // The contract's 16 readable bytes after the last position.
  positions.reserve(positions.size() + 2);
  std::memset(static_cast<void*>(positions.data() + positions.size()), 0, 2 * sizeof(Vec3f));
}

void Scene::TakeHash() {
  Hash64 hash;
  hash.AddValue(uint64_t{positions.size()});
  hash.AddValue(uint64_t{triangles.size()});
  hash.AddValue(uint64_t{spheres.size()});
  hash.Add(positions.data(), positions.size() * sizeof(Vec3f));
  hash.Add(triangles.data(), triangles.size() * sizeof triangles[0]);
  hash.Add(spheres.data(), spheres.size() * sizeof(Sphere));
  if (!cones.empty() || !polygons.empty()) {
    hash.AddValue(uint64_t{cones.size()});
    hash.AddValue(uint64_t{polygons.size()});
    hash.AddValue(uint64_t{polygon_vertices.size()});
    hash.Add(cones.data(), cones.size() * sizeof(Cone));
    hash.Add(polygons.data(), polygons.size() * sizeof(Polygon));
    hash.Add(polygon_vertices.data(), polygon_vertices.size() * sizeof(uint32_t));
  }
  hash_ = hash.Hex();
  has_hash_ = true;
}

void Scene::FinishProcedurals(bool drop_bad) {
  const auto fail = [&](const std::string& what) { throw InputError(provenance.source + ": " + what); };
  const auto keep = [&](auto& prims, std::vector<uint32_t>& material, const char* kind, const auto& flaw) {
    stats.dropped_triangles += KeepSound(prims, material, kind, materials.size(), drop_bad, flaw, fail);
  };
  keep(spheres, sphere_material, "sphere", [](const Sphere& s) { return Flaw(s); });
  keep(cones, cone_material, "cone", [](const Cone& c) { return Flaw(c); });
  keep(polygons, polygon_material, "polygon", [&](const Polygon& p) -> std::string {
    if (p.count < 3) return fmt::format("has {} corners; at least 3 are needed", p.count);
    if (p.first > polygon_vertices.size() || p.count > polygon_vertices.size() - p.first)
      return fmt::format("has corners {} to {} of {}", p.first, uint64_t{p.first} + p.count - 1,
                         polygon_vertices.size());
    for (uint32_t v : CornersOf(p))
      if (v >= positions.size() || !IsFinite(positions[v]))
        return fmt::format("refers to vertex {}; allowed are finite ones, 0 to {}", v,
                           int64_t(positions.size()) - 1);
    return {};
  });
  size_t kept = 0;
  for (size_t i = 0; i < polygons.size(); ++i) {
    if (PlaneOf(positions, CornersOf(polygons[i])).normal == Vec3d{0, 0, 0}) continue;
    polygons[kept] = polygons[i];
    polygon_material[kept++] = polygon_material[i];
  }
  stats.degenerate_triangles += polygons.size() - kept;
  polygons.resize(kept);
  polygon_material.resize(kept);
}

rb_geometry Scene::Geometry() const {
  if (positions.capacity() < positions.size() + 2)
    throw std::logic_error("Scene::Geometry: Finish() has not run on this scene (or on this copy of it)");
  rb_geometry g{};
  g.struct_size = sizeof g;
  g.positions = reinterpret_cast<const float(*)[3]>(positions.data());
  g.vertex_count = positions.size();
  g.triangles = reinterpret_cast<const uint32_t(*)[3]>(triangles.data());
  g.triangle_count = triangles.size();
  g.procedural_count = procedural_count();
  g.procedural_bounds = [](const void* user, uint64_t i, float lo[3], float hi[3]) {
    const Bounds3 bounds = static_cast<const Scene*>(user)->ProceduralBounds(i);
    for (int k = 0; k < 3; ++k) {
      lo[k] = bounds.lo[k];
      hi[k] = bounds.hi[k];
    }
  };
  g.procedural_intersect = [](const void* user, uint64_t i, uint32_t /*numerics*/, const rb_ray* ray,
                              rb_hit* hit) -> int {
    // No surface parameters.
    hit->u = hit->v = 0;
    return static_cast<const Scene*>(user)->IntersectProcedural(i, *ray, hit->t);
  };
  g.procedural_user = this;
  static_assert(sizeof(Sphere) == sizeof(rb_sphere) && sizeof(Cone) == sizeof(rb_cone) &&
                sizeof(Polygon) == sizeof(rb_polygon));
  g.spheres = reinterpret_cast<const rb_sphere*>(spheres.data());
  g.cones = reinterpret_cast<const rb_cone*>(cones.data());
  g.polygons = reinterpret_cast<const rb_polygon*>(polygons.data());
  g.polygon_vertices = polygon_vertices.data();
  g.sphere_count = spheres.size(), g.cone_count = cones.size();
  g.polygon_count = polygons.size(), g.polygon_vertex_count = polygon_vertices.size();
  return g;
}

Scene::Place Scene::Locate(uint32_t prim) const {
  uint64_t i = prim;
  if (i < triangles.size()) return {PrimKind::kTriangle, uint32_t(i)};
  if ((i -= triangles.size()) < spheres.size()) return {PrimKind::kSphere, uint32_t(i)};
  if ((i -= spheres.size()) < cones.size()) return {PrimKind::kCone, uint32_t(i)};
  return {PrimKind::kPolygon, uint32_t(i - cones.size())};
}

Bounds3 Scene::ProceduralBounds(uint64_t i) const {
  if (i < spheres.size()) return BoundsOf(spheres[i]);
  if ((i -= spheres.size()) < cones.size()) return BoundsOf(cones[i]);
  return polygon_planes_[i - cones.size()].bounds;
}

bool Scene::IntersectProcedural(uint64_t i, const rb_ray& ray, float& t) const {
  if (i < spheres.size()) return Intersect(spheres[i], ray, t);
  if ((i -= spheres.size()) < cones.size()) return Intersect(cones[i], ray, t);
  i -= cones.size();
  return Intersect(polygon_planes_[i], positions, CornersOf(polygons[i]), ray, t);
}

uint32_t Scene::MaterialOf(uint32_t prim) const {
  const auto [kind, i] = Locate(prim);
  switch (kind) {
    case PrimKind::kTriangle:
      return triangle_material[i];
    case PrimKind::kSphere:
      return sphere_material[i];
    case PrimKind::kCone:
      return cone_material[i];
    case PrimKind::kPolygon:
      break;
  }
  return polygon_material[i];
}

Vec3d Scene::GeometricNormal(uint32_t prim, Vec3d point) const {
  const auto [kind, i] = Locate(prim);
  if (kind == PrimKind::kSphere) return NormalAt(spheres[i], point);
  if (kind == PrimKind::kCone) return NormalAt(cones[i], point);
  if (kind == PrimKind::kPolygon) return polygon_planes_[i].normal;
  const std::array<uint32_t, 3>& t = triangles[i];
  const Vec3d a = ToDouble(positions[t[0]]);
  return Cross(ToDouble(positions[t[1]]) - a, ToDouble(positions[t[2]]) - a);
}

}  // namespace raybench
