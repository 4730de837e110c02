#include "datasets/readers/openmesh_importer.h"

#include <fmt/format.h>

#include <OpenMesh/Core/IO/importer/BaseImporter.hh>
#include <OpenMesh/Core/System/omstream.hh>
#include <iostream>
#include <mutex>
#include <sstream>

#include "datasets/readers/mesh_sink.h"
#include "datasets/scene/text.h"

namespace raybench {
namespace {

/// Passes what an OpenMesh reader tells on to a MeshSink.
class SceneImporter final : public OpenMesh::IO::BaseImporter {
 public:
  SceneImporter(Scene& scene, const CleanMesh& mesh, const LoadOptions& options, const std::string& path)
      : scene_(scene),
        mesh_(mesh),
        path_(path),
        sink_(scene, mesh.vertices, mesh.faces),
        stage_(options, 0.4, 0.95) {}

  OpenMesh::VertexHandle add_vertex(const OpenMesh::Vec3f& p) override {
    sink_.AddVertex({});
    OpenMesh::VertexHandle vertex(int(scene_.positions.size() - 1));
    set_point(vertex, p);
    return vertex;
  }
  OpenMesh::VertexHandle add_vertex() override { return add_vertex(OpenMesh::Vec3f(0, 0, 0)); }
  void set_point(OpenMesh::VertexHandle vertex, const OpenMesh::Vec3f& p) override {
    scene_.positions[size_t(vertex.idx())] = {p[0], p[1], p[2]};
  }

  OpenMesh::FaceHandle add_face(const VHandles& corners) override {
    if (calls_++ == 0) SpoilBadVertices();
    AddHeldBack();
    corners_.clear();
    for (OpenMesh::VertexHandle corner : corners) corners_.push_back(uint32_t(corner.idx()));
    AddFace(corners_);
    return OpenMesh::FaceHandle(int(calls_ - 1));
  }

  /// To be called when the reader is through.
  void Close() {
    if (calls_ == 0) SpoilBadVertices();
    AddHeldBack();
    if (n_vertices() != mesh_.vertices || sink_.faces() != mesh_.faces)
      throw InputError(fmt::format("{}: OpenMesh read {} vertices and {} faces of {} and {}", path_,
                                   n_vertices(), sink_.faces(), mesh_.vertices, mesh_.faces));
    sink_.Close();
  }

  size_t n_vertices() const override { return scene_.positions.size(); }
  size_t n_faces() const override { return calls_; }
  size_t n_edges() const override { return 0; }

  // Not asked for and not needed.
  OpenMesh::HalfedgeHandle add_edge(OpenMesh::VertexHandle, OpenMesh::VertexHandle) override {
    return OpenMesh::HalfedgeHandle();
  }
  OpenMesh::FaceHandle add_face(OpenMesh::HalfedgeHandle) override { return OpenMesh::FaceHandle(); }
  void add_face_texcoords(OpenMesh::FaceHandle, OpenMesh::VertexHandle,
                          const std::vector<OpenMesh::Vec2f>&) override {}
  void add_face_texcoords(OpenMesh::FaceHandle, OpenMesh::VertexHandle,
                          const std::vector<OpenMesh::Vec3f>&) override {}
  void set_face_texindex(OpenMesh::FaceHandle, int) override {}
  void set_halfedge(OpenMesh::VertexHandle, OpenMesh::HalfedgeHandle) override {}
  void set_normal(OpenMesh::VertexHandle, const OpenMesh::Vec3f&) override {}
  void set_normal(OpenMesh::VertexHandle, const OpenMesh::Vec3d&) override {}
  void set_color(OpenMesh::VertexHandle, const OpenMesh::Vec3uc&) override {}
  void set_color(OpenMesh::VertexHandle, const OpenMesh::Vec4uc&) override {}
  void set_color(OpenMesh::VertexHandle, const OpenMesh::Vec3f&) override {}
  void set_color(OpenMesh::VertexHandle, const OpenMesh::Vec4f&) override {}
  void set_texcoord(OpenMesh::VertexHandle, const OpenMesh::Vec2f&) override {}
  void set_status(OpenMesh::VertexHandle, const OpenMesh::Attributes::StatusInfo&) override {}
  void set_next(OpenMesh::HalfedgeHandle, OpenMesh::HalfedgeHandle) override {}
  void set_face(OpenMesh::HalfedgeHandle, OpenMesh::FaceHandle) override {}
  void request_face_texcoords2D() override {}
  void set_texcoord(OpenMesh::HalfedgeHandle, const OpenMesh::Vec2f&) override {}
  void set_texcoord(OpenMesh::VertexHandle, const OpenMesh::Vec3f&) override {}
  void set_texcoord(OpenMesh::HalfedgeHandle, const OpenMesh::Vec3f&) override {}
  void set_status(OpenMesh::HalfedgeHandle, const OpenMesh::Attributes::StatusInfo&) override {}
  void set_color(OpenMesh::EdgeHandle, const OpenMesh::Vec3uc&) override {}
  void set_color(OpenMesh::EdgeHandle, const OpenMesh::Vec4uc&) override {}
  void set_color(OpenMesh::EdgeHandle, const OpenMesh::Vec3f&) override {}
  void set_color(OpenMesh::EdgeHandle, const OpenMesh::Vec4f&) override {}
  void set_status(OpenMesh::EdgeHandle, const OpenMesh::Attributes::StatusInfo&) override {}
  void set_normal(OpenMesh::FaceHandle, const OpenMesh::Vec3f&) override {}
  void set_normal(OpenMesh::FaceHandle, const OpenMesh::Vec3d&) override {}
  void set_color(OpenMesh::FaceHandle, const OpenMesh::Vec3uc&) override {}
  void set_color(OpenMesh::FaceHandle, const OpenMesh::Vec4uc&) override {}
  void set_color(OpenMesh::FaceHandle, const OpenMesh::Vec3f&) override {}
  void set_color(OpenMesh::FaceHandle, const OpenMesh::Vec4f&) override {}
  void set_status(OpenMesh::FaceHandle, const OpenMesh::Attributes::StatusInfo&) override {}
  void add_texture_information(int, std::string) override {}

 private:
  void SpoilBadVertices() {
    for (const auto& [v, position] : mesh_.bad_vertices)
      if (v < scene_.positions.size()) scene_.positions[v] = position;
  }

  void AddFace(std::span<const uint32_t> corners) {
    while (next_use_ < mesh_.materials.size() && mesh_.materials[next_use_].face <= sink_.faces())
      material_ = mesh_.materials[next_use_++].material;
    if (sink_.faces() >= mesh_.faces)
      throw InputError(path_ + ": OpenMesh read more faces than the file has");
    sink_.AddFace(corners, material_);
    stage_.Tell(sink_.faces(), mesh_.faces);
  }

  void AddHeldBack() {
    while (next_held_ < mesh_.held_back.size() && mesh_.held_back[next_held_].face == sink_.faces())
      AddFace(mesh_.held_back[next_held_++].corners);
  }

  Scene& scene_;
  const CleanMesh& mesh_;
  const std::string& path_;
  MeshSink sink_;
  LoadStage stage_;
  uint64_t calls_ = 0;
  size_t next_held_ = 0, next_use_ = 0;
  uint32_t material_ = 0;
  std::vector<uint32_t> corners_;
};

/// While it lives, what OpenMesh would print goes into text().
class OpenMeshMessages {
 public:
  OpenMeshMessages() {
    omerr().disconnect(std::cerr);
    omerr().connect(text_);
  }
  ~OpenMeshMessages() {
    omerr().disconnect(text_);
    omerr().connect(std::cerr);
  }
  std::string text() const { return OneLine(text_.str()); }

 private:
  std::ostringstream text_;
};

}  // namespace

void ReadWithOpenMesh(OpenMesh::IO::BaseReader& reader, const std::string& path, CleanMesh mesh,
                      const LoadOptions& options, Scene& scene) {
  static std::mutex mutex;  // the reader modules are singletons with state
  std::lock_guard lock(mutex);
  OpenMeshMessages messages;
  SceneImporter importer(scene, mesh, options, path);
  OpenMesh::IO::Options flags;
  flags.clear();
  std::istringstream in(std::move(mesh.text));
  if (!reader.read(in, importer, flags))
    throw InputError(path + ": OpenMesh cannot read it: " + messages.text());
  importer.Close();
}

}  // namespace raybench
