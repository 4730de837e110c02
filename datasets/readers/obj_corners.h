// Texture coordinates and normals of OBJ files. There every corner of a face has its own; in a scene they
// belong to vertices.
#pragma once

#include <cstdint>
#include <vector>

#include "datasets/scene/scene.h"

namespace raybench {

/// Indices from 0; RAYBENCH_NONE: none.
struct ObjCorner {
  uint32_t vertex, uv, normal;
};

class ObjCorners {
 public:
  std::vector<Vec2f> uvs;      ///< of `vt`, turned to what texture.h says
  std::vector<Vec3f> normals;  ///< of `vn`

  /// Faces come in rising order; one that is left out has neither. `corners` are sorted. Of a vertex that
  /// occurs twice in a face the first corner counts.
  void AddFace(uint32_t face, std::vector<ObjCorner>& corners);

  /// Gives the scene's vertices what is needed of it: coordinates where the material has a texture, normals
  /// where they differ over a triangle or from its own; with `keep_unread` all that the file has. A vertex
  /// with several of them becomes several, the new ones at the end. Notes what is not there.
  void Apply(Scene& scene, bool keep_unread);

 private:
  std::vector<uint64_t> first_;  // of each face so far, in corners_
  std::vector<ObjCorner> corners_;
};

}  // namespace raybench
