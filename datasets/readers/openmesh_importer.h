// Mesh files through OpenMesh's reader modules.
//
// OpenMesh's readers are lax: a vertex that does not parse ("nan") is skipped, which shifts all later
// indices; a face of repeated vertices is skipped; a truncated file repeats its last values; doubles in a PLY
// file become 0; some input aborts. So a strict pass over the file comes first. It refuses what is wrong,
// naming the line or byte, and hands OpenMesh the vertices and faces alone, without what it would misread.
// What OpenMesh then tells must agree with what the strict pass saw.
#pragma once

#include <OpenMesh/Core/IO/reader/BaseReader.hh>
#include <string>
#include <vector>

#include "datasets/scene/scene.h"

namespace raybench {

/// What the strict pass over a mesh file leaves.
struct CleanMesh {
  /// A face that OpenMesh would not pass on, so it is not in `text`; `corners` are vertex indices from 0.
  struct HeldBack {
    uint32_t face;
    std::vector<uint32_t> corners;
  };
  /// From this face on faces have this material.
  struct Use {
    uint32_t face, material;
  };

  std::string text;  ///< what OpenMesh reads
  uint64_t vertices = 0, faces = 0;
  /// Not finite, which drop_bad keeps until Finish(); 0 0 0 in `text`.
  std::vector<std::pair<uint32_t, Vec3f>> bad_vertices;
  std::vector<HeldBack> held_back;  ///< by face
  std::vector<Use> materials;       ///< by face; material 0 before the first
};

/// Runs an OpenMesh reader over the prepared text, fills positions and triangles of the scene, and tells
/// progress from 0.4 on. Throws InputError, beginning with the path, if OpenMesh disagrees with the strict
/// pass.
void ReadWithOpenMesh(OpenMesh::IO::BaseReader& reader, const std::string& path, CleanMesh mesh,
                      const LoadOptions& options, Scene& scene);

}  // namespace raybench
