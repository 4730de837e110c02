#include "datasets/scene_facts.h"

#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include <algorithm>
#include <set>

#include "datasets/weld.h"

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
  spread.percent1 = at(1), spread.median = at(50), spread.percent99 = at(99);
  return spread;
}

void CountEdges(const Scene& scene, SceneFacts& facts) {
  const std::vector<uint32_t> same = WeldVertices(scene.positions);
  std::vector<uint8_t> used(same.size());
  std::vector<uint64_t> edges(3 * scene.triangles.size());
  for (const std::array<uint32_t, 3>& t : scene.triangles)
    for (uint32_t v : t) used[same[v]] = 1;
  facts.distinct_positions = uint64_t(std::count(used.begin(), used.end(), 1));
  tbb::parallel_for(size_t{0}, scene.triangles.size(), [&](size_t i) {
    for (size_t k = 0; k < 3; ++k) {
      const uint64_t a = same[scene.triangles[i][k]], b = same[scene.triangles[i][(k + 1) % 3]];
      edges[3 * i + k] = std::min(a, b) << 32 | std::max(a, b);
    }
  });
  tbb::parallel_sort(edges.begin(), edges.end());
  for (size_t i = 0, next; i < edges.size(); i = next) {
    for (next = i + 1; next < edges.size() && edges[next] == edges[i];) ++next;
    facts.boundary_edges += next - i == 1;
    facts.non_manifold_edges += next - i > 2;
  }
}

void MeasureTriangles(const Scene& scene, SceneFacts& facts) {
  std::vector<double> area(scene.triangles.size()), aspect(scene.triangles.size());
  tbb::parallel_for(size_t{0}, scene.triangles.size(), [&](size_t i) {
    const auto& [p, q, r] = scene.triangles[i];
    const Vec3d a = ToDouble(scene.positions[p]), b = ToDouble(scene.positions[q]),
                c = ToDouble(scene.positions[r]);
    const double twice = Length(Cross(b - a, c - a));
    const double longest = std::max({Dot(b - a, b - a), Dot(c - a, c - a), Dot(c - b, c - b)});
    area[i] = twice / 2, aspect[i] = longest / twice;
  });
  facts.area = SpreadOf(area), facts.aspect = SpreadOf(aspect);
}

template <class T>
uint64_t BytesOf(const std::vector<T>& items) {
  return items.capacity() * sizeof(T);
}

}  // namespace

SceneFacts Examine(const Scene& scene) {
  SceneFacts facts;
  if (!scene.spheres.empty()) facts.procedural.emplace_back("spheres", scene.spheres.size());
  if (!scene.cones.empty()) facts.procedural.emplace_back("cones", scene.cones.size());
  if (!scene.polygons.empty()) facts.procedural.emplace_back("polygons", scene.polygons.size());
  CountEdges(scene, facts);
  MeasureTriangles(scene, facts);
  facts.bytes = BytesOf(scene.positions) + BytesOf(scene.normals) + BytesOf(scene.uvs) +
                BytesOf(scene.triangles) + BytesOf(scene.triangle_material) + BytesOf(scene.triangle_face) +
                BytesOf(scene.spheres) + BytesOf(scene.sphere_material) + BytesOf(scene.cones) +
                BytesOf(scene.cone_material) + BytesOf(scene.polygons) + BytesOf(scene.polygon_material) +
                BytesOf(scene.polygon_vertices) + BytesOf(scene.materials) + BytesOf(scene.textures) +
                BytesOf(scene.lights) + BytesOf(scene.cameras);
  std::set<const std::string*> images;  // textures share them
  for (const Texture& texture : scene.textures)
    if (images.insert(texture.bytes.get()).second) facts.bytes += texture.bytes->size();
  return facts;
}

}  // namespace raybench
