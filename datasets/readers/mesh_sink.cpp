#include "datasets/readers/mesh_sink.h"

#include <fmt/format.h>

#include <algorithm>

#include "datasets/readers/triangulate.h"

namespace raybench {

void MeshSink::Expect(uint64_t vertices, uint64_t faces, uint64_t bytes) {
  vertices_ = vertices;
  scene_.positions.reserve(std::min(vertices, bytes) + 2);  // Finish() wants room for two more
  faces = std::min(faces, bytes);
  scene_.triangles.reserve(faces);
  scene_.triangle_face.reserve(faces);
  scene_.triangle_material.reserve(faces);
}

void MeshSink::AddFace(std::span<const uint32_t> corners, uint32_t material) {
  const uint32_t face = uint32_t(scene_.stats.faces++);
  scene_.stats.degenerate_triangles += corners.size() < 3;
  const auto is_to_come = [&](uint32_t v) { return v >= scene_.positions.size() && v < vertices_; };
  if (waiting_.empty() && (corners.size() <= 3 || std::none_of(corners.begin(), corners.end(), is_to_come)))
    return AddTriangles(corners, face, material);
  waiting_.insert(waiting_.end(), {face, material, uint32_t(corners.size())});
  waiting_.insert(waiting_.end(), corners.begin(), corners.end());
}

void MeshSink::AddTriangles(std::span<const uint32_t> corners, uint32_t face, uint32_t material) {
  if (corners.size() == 3) return AddTriangle(corners[0], corners[1], corners[2], face, material);
  if (corners.size() < 3) return;
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  outline_.clear();
  bool is_usable = true;
  for (uint32_t v : corners) {
    outline_.push_back(v < scene_.positions.size() ? scene_.positions[v] : Vec3f{kNan, kNan, kNan});
    is_usable = is_usable && outline_.back() == outline_.back();
  }
  if (!Triangulate(outline_, cut_) && is_usable && scene_.stats.crossed_faces++ == 0) first_crossed_ = face;
  for (const auto& [a, b, c] : cut_) AddTriangle(corners[a], corners[b], corners[c], face, material);
}

void MeshSink::AddTriangle(uint32_t a, uint32_t b, uint32_t c, uint32_t face, uint32_t material) {
  scene_.triangles.push_back({a, b, c});
  scene_.triangle_face.push_back(face);
  scene_.triangle_material.push_back(material);
}

void MeshSink::Close() {
  for (std::span<const uint32_t> rest = waiting_; !rest.empty(); rest = rest.subspan(3 + rest[2]))
    AddTriangles(rest.subspan(3, rest[2]), rest[0], rest[1]);
  waiting_ = std::vector<uint32_t>();
  if (scene_.stats.crossed_faces > 0)
    scene_.stats.notes.push_back(
        fmt::format("{} polygons whose outlines cross themselves, such as face {}, are fans of triangles, "
                    "which may cover more or less than meant",
                    scene_.stats.crossed_faces, first_crossed_));
}

}  // namespace raybench
