// Where the mesh readers put what they read.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "datasets/scene/scene.h"

namespace raybench {

/// Vertices and faces a file may have.
constexpr int64_t kMaxCount = (1u << 31) - 1;

/// Collects the vertices and faces of a file, in its order, into a scene. No half-edge mesh stands between:
/// that drops or duplicates what is not manifold, and so changes the number and the order of the faces. Here
/// every face keeps its id. Faces of more than 3 corners are triangulated (see Triangulate()).
class MeshSink {
 public:
  explicit MeshSink(Scene& scene) : scene_(scene) {}

  /// How many a file of so many bytes says it has; memory is taken for no more than it has bytes.
  void Expect(uint64_t vertices, uint64_t faces, uint64_t bytes);
  uint64_t vertices() const { return vertices_; }  ///< as expected

  void AddVertex(Vec3f position) { scene_.positions.push_back(position); }
  /// Its id is the number of faces before it. Corners may lie beyond the vertices: Finish() refuses or drops
  /// them. Faces of fewer than 3 corners have no triangles and are counted. A polygon with vertices that are
  /// still to come waits for Close(), and so does what follows it.
  void AddFace(std::span<const uint32_t> corners, uint32_t material);
  uint64_t faces() const { return scene_.stats.faces; }
  /// Notes what could not be triangulated. Call it once, at the end.
  void Close();

 private:
  void AddTriangle(uint32_t a, uint32_t b, uint32_t c, uint32_t face, uint32_t material);
  void AddTriangles(std::span<const uint32_t> corners, uint32_t face, uint32_t material);

  Scene& scene_;
  uint64_t vertices_ = 0;
  std::vector<uint32_t> waiting_;  ///< faces: id, material, number of corners, corners
  std::vector<Vec3f> outline_;
  std::vector<std::array<uint32_t, 3>> cut_;
  uint32_t first_crossed_ = 0;
};

}  // namespace raybench
