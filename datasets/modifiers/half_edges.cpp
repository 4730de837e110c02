#include "datasets/modifiers/half_edges.h"

#include <fmt/format.h>

#include "datasets/scene/weld.h"

namespace raybench {

void RequireTrianglesAlone(const char* modifier, const Scene& scene) {
  if (const uint64_t procedural = scene.procedural_count(); procedural > 0)
    throw InputError(fmt::format("{}: {}: {} of its primitives are procedural; only triangles can be {}d",
                                 modifier, scene.name, procedural, modifier));
}

HalfEdges ToHalfEdges(const char* modifier, Scene& scene, bool weld, uint64_t growth, bool drop_bad,
                      std::vector<uint32_t>& origin) {
  HalfEdges mesh;
  // Euler: about half as many vertices and one and a half times as many edges as triangles.
  const size_t last = scene.triangles.size() * growth;
  mesh.reserve(std::max(scene.positions.size(), last / 2), last + last / 2, last);
  std::vector<uint32_t> same;
  if (weld) same = WeldVertices(scene.positions);
  std::vector<HalfEdges::VertexHandle> handles(scene.positions.size());
  uint64_t refused = 0;
  uint32_t first = 0;
  for (size_t i = 0; i < scene.triangles.size(); ++i) {
    HalfEdges::VertexHandle corners[3];
    for (int k = 0; k < 3; ++k) {
      const uint32_t v = scene.triangles[i][size_t(k)], kept = weld ? same[v] : v;
      if (!handles[kept].is_valid()) {
        const Vec3f p = scene.positions[kept];
        handles[kept] = mesh.add_vertex(OpenMesh::Vec3d(p.x, p.y, p.z));
      }
      corners[k] = handles[kept];
    }
    if (mesh.add_face(corners[0], corners[1], corners[2]).is_valid()) {
      origin.push_back(uint32_t(i));
    } else if (refused++ == 0) {
      first = scene.triangle_face[i];
    }
  }
  if (refused > 0 && !drop_bad)
    throw InputError(
        fmt::format("{}: {}: {} of {} faces are not manifold with those before them, face {} is the first; "
                    "--drop-bad leaves "
                    "them out{}",
                    modifier, scene.name, refused, scene.triangles.size(), first,
                    weld ? ", weld=false keeps vertices of equal coordinates apart" : ""));
  scene.stats.dropped_triangles += refused;
  return mesh;
}

void LeaveOutAttributes(const char* modifier, Scene& scene) {
  if (!scene.normals.empty() || !scene.uvs.empty())
    scene.stats.notes.push_back(fmt::format("{} leaves out shading normals and textures", modifier));
  scene.normals.clear();
  scene.uvs.clear();
  scene.textures.clear();
  for (Material& m : scene.materials) {
    m.base_color_texture = -1;
    if (m.emission_texture >= 0) m.emission = {0, 0, 0};  // without its picture all of it would glow
    m.emission_texture = -1;
  }
}

}  // namespace raybench
