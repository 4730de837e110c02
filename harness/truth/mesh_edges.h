// The edges of a mesh, by vertex position: which lie inside a surface, and whether it is closed.
#pragma once

#include <cstdint>
#include <vector>

#include "datasets/scene/scene.h"

namespace raybench {

/// An edge. Positions decide, not indices; triangles that coincide count once.
struct MeshEdge {
  uint32_t a = 0, b = 0;           ///< vertices, the lowest index of each position; a < b
  uint32_t count = 0;              ///< distinct triangles at it, at least 1
  uint32_t triangles[2] = {0, 0};  ///< the first two of them, by lowest id; the same twice if there is one
};

/// All edges, ascending by (a, b).
std::vector<MeshEdge> MeshEdges(const Scene& scene);

/// Whether each triangle is the lowest id of those that coincide with it (the same three positions).
std::vector<bool> DistinctTriangles(const Scene& scene);

}  // namespace raybench
