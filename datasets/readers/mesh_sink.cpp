#include "datasets/readers/mesh_sink.h"

#include <fmt/format.h>

#include <algorithm>

#include "datasets/readers/triangulate.h"

namespace raybench {

MeshSink::MeshSink(Scene& scene, uint64_t vertices, uint64_t faces) : scene_(scene) {
  scene_.positions.reserve(vertices + 2);  // Finish() wants room for two more
  scene_.triangles.reserve(faces);
  scene_.triangle_face.reserve(faces);
  scene_.triangle_material.reserve(faces);
}

void MeshSink::AddTriangle(uint32_t a, uint32_t b, uint32_t c, uint32_t material) {
  scene_.triangles.push_back({a, b, c});
  scene_.triangle_face.push_back(uint32_t(faces()));
  scene_.triangle_material.push_back(material);
}

void MeshSink::AddFace(std::span<const uint32_t> corners, uint32_t material) {
  if (corners.size() == 3) {
    AddTriangle(corners[0], corners[1], corners[2], material);
  } else if (corners.size() > 3) {
    constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
    outline_.clear();
    bool is_usable = true;
    for (uint32_t v : corners) {
      outline_.push_back(v < scene_.positions.size() ? scene_.positions[v] : Vec3f{kNan, kNan, kNan});
      is_usable = is_usable && outline_.back() == outline_.back();
    }
    if (!Triangulate(outline_, cut_) && is_usable && scene_.stats.crossed_faces++ == 0)
      first_crossed_ = faces();
    for (const std::array<uint32_t, 3>& t : cut_)
      AddTriangle(corners[t[0]], corners[t[1]], corners[t[2]], material);
  }
  ++scene_.stats.faces;
}

void MeshSink::Close() {
  if (scene_.stats.crossed_faces > 0)
    scene_.stats.notes.push_back(
        fmt::format("{} polygons whose outlines cross themselves, such as face {}, are fans of triangles, "
                    "which may cover "
                    "more or less than meant",
                    scene_.stats.crossed_faces, first_crossed_));
}

}  // namespace raybench
