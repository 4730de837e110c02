#include "datasets/scene/facts.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "accel/base/parallel.h"
#include "datasets/scene/weld.h"

namespace raybench {
namespace {

Spread SpreadOf(std::vector<double>& values) {
  Spread spread;
  if (values.empty()) return spread;
  const auto at = [&](size_t percent) {
    const auto place = values.begin() + std::ptrdiff_t((values.size() - 1) * percent / 100);
    std::nth_element(values.begin(), place, values.end());
    return *place;
  };
  spread.percent1 = at(1);
  spread.median = at(50);
  spread.percent99 = at(99);
  return spread;
}

void CountEdges(const Scene& scene, SceneFacts& facts) {
  const std::vector<uint32_t> same = WeldVertices(scene.positions);
  std::vector<uint8_t> used(same.size());
  std::vector<uint64_t> edges(3 * scene.triangles.size());
  for (const std::array<uint32_t, 3>& t : scene.triangles)
    for (uint32_t v : t) used[same[v]] = 1;
  facts.distinct_positions = uint64_t(std::count(used.begin(), used.end(), 1));
  ParallelFor(size_t{0}, scene.triangles.size(), [&](size_t i) {
    for (size_t k = 0; k < 3; ++k) {
      const uint64_t a = same[scene.triangles[i][k]], b = same[scene.triangles[i][(k + 1) % 3]];
      edges[3 * i + k] = std::min(a, b) << 32 | std::max(a, b);
    }
  });
  ParallelSort(edges.begin(), edges.end());
  for (size_t i = 0, next; i < edges.size(); i = next) {
    for (next = i + 1; next < edges.size() && edges[next] == edges[i];) ++next;
    facts.boundary_edges += next - i == 1;
    facts.non_manifold_edges += next - i > 2;
  }
}

void MeasureTriangles(const Scene& scene, SceneFacts& facts) {
  std::vector<double> area(scene.triangles.size()), aspect(scene.triangles.size()),
      extent(scene.triangles.size());
  ParallelFor(size_t{0}, scene.triangles.size(), [&](size_t i) {
    const auto& [p, q, r] = scene.triangles[i];
    const Vec3d a = ToDouble(scene.positions[p]), b = ToDouble(scene.positions[q]),
                c = ToDouble(scene.positions[r]);
    const double twice = Length(Cross(b - a, c - a));
    const double longest = std::max({Dot(b - a, b - a), Dot(c - a, c - a), Dot(c - b, c - b)});
    area[i] = twice / 2;
    aspect[i] = longest / twice;
    const Vec3f size = Max(Max(scene.positions[p], scene.positions[q]), scene.positions[r]) -
                       Min(Min(scene.positions[p], scene.positions[q]), scene.positions[r]);
    extent[i] = std::max({size.x, size.y, size.z});
  });
  facts.area = SpreadOf(area);
  facts.aspect = SpreadOf(aspect);
  facts.extent = SpreadOf(extent);
}

double SmallestFeatureUlp(const Scene& scene) {
  double reach = 0;
  if (!scene.bounds().Empty()) {
    for (const Vec3f& corner : {scene.bounds().lo, scene.bounds().hi})
      for (int k = 0; k < 3; ++k) reach = std::max(reach, double(std::abs(corner[k])));
  }
  if (!(reach > 0)) return 0;
  constexpr double kNone = std::numeric_limits<double>::infinity();
  double smallest = kNone;
  const auto look = [&](double length) {
    if (length > 0) smallest = std::min(smallest, length);
  };
  const auto edge = [&](uint32_t a, uint32_t b) {
    look(Length(ToDouble(scene.positions[a]) - ToDouble(scene.positions[b])));
  };
  for (const std::array<uint32_t, 3>& t : scene.triangles) {
    edge(t[0], t[1]);
    edge(t[1], t[2]);
    edge(t[2], t[0]);
  }
  for (const Polygon& polygon : scene.polygons) {
    const std::span<const uint32_t> corners = scene.CornersOf(polygon);
    for (size_t i = 0; i < corners.size(); ++i) edge(corners[i], corners[(i + 1) % corners.size()]);
  }
  for (const Sphere& s : scene.spheres) look(std::abs(s.radius));
  for (const Cone& c : scene.cones) {
    look(std::abs(c.base_radius));
    look(std::abs(c.apex_radius));
    look(Length(ToDouble(c.apex) - ToDouble(c.base)));
  }
  return smallest == kNone ? 0 : std::ldexp(smallest, 23 - std::ilogb(reach));
}

template <class T>
uint64_t BytesOfItems(const std::vector<T>& items) {
  return items.capacity() * sizeof(T);
}

}  // namespace

uint64_t BytesOf(const Scene& scene) {
  uint64_t bytes = BytesOfItems(scene.positions) + BytesOfItems(scene.normals) + BytesOfItems(scene.uvs) +
                   BytesOfItems(scene.triangles) + BytesOfItems(scene.triangle_material) +
                   BytesOfItems(scene.triangle_face) + BytesOfItems(scene.spheres) +
                   BytesOfItems(scene.sphere_material) + BytesOfItems(scene.cones) +
                   BytesOfItems(scene.cone_material) + BytesOfItems(scene.polygons) +
                   BytesOfItems(scene.polygon_material) + BytesOfItems(scene.polygon_vertices) +
                   BytesOfItems(scene.materials) + BytesOfItems(scene.textures) + BytesOfItems(scene.lights) +
                   BytesOfItems(scene.cameras);
  std::set<const std::string*> images;  // textures share them
  for (const Texture& texture : scene.textures)
    if (images.insert(texture.bytes.get()).second) bytes += texture.bytes->size();
  return bytes;
}

SceneFacts Examine(const Scene& scene) {
  SceneFacts facts;
  if (!scene.spheres.empty()) facts.procedural.emplace_back("spheres", scene.spheres.size());
  if (!scene.cones.empty()) facts.procedural.emplace_back("cones", scene.cones.size());
  if (!scene.polygons.empty()) facts.procedural.emplace_back("polygons", scene.polygons.size());
  CountEdges(scene, facts);
  MeasureTriangles(scene, facts);
  facts.smallest_feature_ulp = SmallestFeatureUlp(scene);
  facts.bytes = BytesOf(scene);
  return facts;
}

}  // namespace raybench
