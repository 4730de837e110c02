#include "harness/truth/mesh_edges.h"

#include <algorithm>
#include <array>

#include "accel/base/parallel.h"
#include "harness/truth/verdict.h"

namespace raybench {

std::vector<MeshEdge> MeshEdges(const Scene& scene) {
  const Adjacency adjacency(scene);
  std::vector<std::array<uint32_t, 3>> sides;  // both ends and the triangle
  sides.reserve(3 * scene.triangles.size());
  for (uint32_t t = 0; t < scene.triangles.size(); ++t) {
    if (adjacency.Representative(t) != t) continue;
    const Adjacency::Corners c = adjacency.CornersOf(t);
    for (size_t i = 0; i < 3; ++i) {
      const auto [a, b] = std::minmax(c[i], c[(i + 1) % 3]);
      sides.push_back({a, b, t});
    }
  }
  ParallelSort(sides.begin(), sides.end());
  std::vector<MeshEdge> edges;
  for (const auto& [a, b, t] : sides) {
    if (edges.empty() || edges.back().a != a || edges.back().b != b) edges.push_back({a, b, 0, {t, t}});
    MeshEdge& edge = edges.back();
    if (++edge.count == 2) edge.triangles[1] = t;
  }
  return edges;
}

std::vector<bool> DistinctTriangles(const Scene& scene) {
  const Adjacency adjacency(scene);
  std::vector<bool> distinct(scene.triangles.size());
  for (uint32_t t = 0; t < distinct.size(); ++t) distinct[t] = adjacency.Representative(t) == t;
  return distinct;
}

}  // namespace raybench
