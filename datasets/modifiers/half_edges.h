// Scenes as OpenMesh's half-edges, for modifiers that need to know neighbours.
#pragma once

#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>
#include <OpenMesh/Core/System/omstream.hh>
#include <cstdint>
#include <vector>

#include "datasets/scene/scene.h"

namespace raybench {

struct HalfEdgeTraits : OpenMesh::DefaultTraits {
  using Point = OpenMesh::Vec3d;
  using Normal = OpenMesh::Vec3d;
  VertexAttributes(OpenMesh::Attributes::None);
  HalfedgeAttributes(OpenMesh::Attributes::PrevHalfedge);
  EdgeAttributes(OpenMesh::Attributes::None);
  FaceAttributes(OpenMesh::Attributes::None);
};
using HalfEdges = OpenMesh::TriMesh_ArrayKernelT<HalfEdgeTraits>;

/// Keeps OpenMesh from writing to stderr what modifiers say in their own words.
class QuietOpenMesh {
 public:
  QuietOpenMesh() { omerr().disable(); }
  ~QuietOpenMesh() { omerr().enable(); }
};

/// Throws InputError where the scene has procedural primitives.
void RequireTrianglesAlone(const char* modifier, const Scene& scene);

/// The scene's triangles as half-edges, with room for `growth` times as many; `weld`: vertices of equal coordinates
/// are made one. `origin` gets, for each face of the mesh, its triangle. Faces that half-edges cannot hold are left
/// out and counted with `drop_bad`; else throws InputError.
HalfEdges ToHalfEdges(const char* modifier, Scene& scene, bool weld, uint64_t growth, bool drop_bad,
                      std::vector<uint32_t>& origin);

/// Shading normals, texture coordinates and textures, with a note.
void LeaveOutAttributes(const char* modifier, Scene& scene);

}  // namespace raybench
