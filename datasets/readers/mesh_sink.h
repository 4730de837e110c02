// Where the mesh readers put what they read.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "datasets/scene/scene.h"

namespace raybench {

/// Vertices and faces a file may have: OpenMesh's handles are ints.
constexpr int64_t kMaxCount = (1u << 31) - 1;

/// Collects the vertices and faces of a file, in its order, into a scene. No half-edge mesh stands between:
/// that drops or duplicates what is not manifold, and so changes the number and the order of the faces. Here
/// every face keeps its id. Faces of more than 3 corners are triangulated (see Triangulate()).
class MeshSink {
 public:
  MeshSink(Scene& scene, uint64_t vertices, uint64_t faces);

  void AddVertex(Vec3f position) { scene_.positions.push_back(position); }
  /// Its id is the number of faces before it. Corners may lie beyond the vertices: Finish() refuses or drops
  /// them. Faces of fewer than 3 corners have no triangles. All vertices must be there.
  void AddFace(std::span<const uint32_t> corners, uint32_t material);
  uint64_t faces() const { return scene_.stats.faces; }
  /// Notes what could not be triangulated. Call it once, at the end.
  void Close();

 private:
  void AddTriangle(uint32_t a, uint32_t b, uint32_t c, uint32_t material);

  Scene& scene_;
  std::vector<Vec3f> outline_;
  std::vector<std::array<uint32_t, 3>> cut_;
  uint64_t first_crossed_ = 0;
};

/// Tells LoadOptions::progress how far one stage of loading is.
class LoadStage {
 public:
  /// The stage covers the fractions `from` to `to` of the whole.
  LoadStage(const LoadOptions& options, double from, double to) : options_(options), from_(from), to_(to) {}
  /// To be called at every step; passes on every 2^16th.
  void Tell(uint64_t done, uint64_t total) {
    if ((++calls_ & 0xFFFF) == 0 && options_.progress)
      options_.progress(from_ + (to_ - from_) * double(done) / double(total));
  }

 private:
  const LoadOptions& options_;
  double from_, to_;
  uint32_t calls_ = 0;
};

}  // namespace raybench
