// Levels of detail: edges collapse onto one of their ends in the order of what that adds to the squared distances
// from the planes that have met there (quadrics: Garland and Heckbert 1997), by OpenMesh's decimater. So every vertex
// that is left is one of the scene's, and no rounding moves it.
//
// Topology stays: what is closed stays closed. No collapse may turn a triangle over or make it a needle, so that none
// degenerates and leaves a hole.

#include <fmt/format.h>

#include <OpenMesh/Tools/Decimater/DecimaterT.hh>
#include <OpenMesh/Tools/Decimater/ModQuadricT.hh>
#include <cmath>
#include <cstddef>

#include "accel/base/memory.h"
#include "datasets/modifiers/half_edges.h"
#include "datasets/modifiers/modifiers.h"

namespace raybench {
namespace {

struct Config {
  double keep;
  int64_t triangles;
  uint32_t weld;
};

const rb_param kParams[] = {
    FloatParam("keep", "share of the triangles that is left", offsetof(Config, keep), 0, 1, 0.5),
    IntParam("triangles", "number of them instead; 0: as `keep` says", offsetof(Config, triangles), 0, 1e9,
             0),
    BoolParam("weld", "make vertices of equal coordinates one first", offsetof(Config, weld), true),
};

/// Refuses collapses that turn a triangle by more than some 80 degrees or leave it an aspect above 10^4.
template <class MeshT>
class ModSoundTriangles : public OpenMesh::Decimater::ModBaseT<MeshT> {
 public:
  DECIMATING_MODULE(ModSoundTriangles, MeshT, SoundTriangles);

  explicit ModSoundTriangles(MeshT& mesh) : Base(mesh, /*binary=*/true) {}

  float collapse_priority(const CollapseInfo& collapse) override {
    for (const auto face : Base::mesh().vf_range(collapse.v0)) {
      if (face == collapse.fl || face == collapse.fr) continue;  // these vanish
      OpenMesh::Vec3d before[3], after[3];
      size_t k = 0;
      for (const auto v : Base::mesh().fv_range(face)) {
        before[k] = Base::mesh().point(v);
        after[k++] = v == collapse.v0 ? collapse.p1 : Base::mesh().point(v);
      }
      const OpenMesh::Vec3d old = Normal(before), now = Normal(after);
      double longest = 0;
      for (size_t i = 0; i < 3; ++i) longest = std::max(longest, (after[(i + 1) % 3] - after[i]).sqrnorm());
      if (!(now.norm() > 1e-4 * longest) || !((old | now) > 0.17 * old.norm() * now.norm()))
        return float(Base::ILLEGAL_COLLAPSE);
    }
    return float(Base::LEGAL_COLLAPSE);
  }

 private:
  static OpenMesh::Vec3d Normal(const OpenMesh::Vec3d (&p)[3]) { return (p[1] - p[0]) % (p[2] - p[0]); }
};

class Reporter : public OpenMesh::Decimater::Observer {
 public:
  Reporter(const std::function<void(double)>& progress, size_t collapses)
      : Observer(std::max<size_t>(1, collapses / 64)), progress_(progress), collapses_(double(collapses)) {}
  void notify(size_t step) override {
    if (progress_) progress_(std::min(0.9, 0.1 + 0.8 * double(step) / collapses_));
  }

 private:
  const std::function<void(double)>& progress_;
  const double collapses_;
};

Scene Apply(Scene scene, const void* config, const LoadOptions& options) {
  const Config& c = *static_cast<const Config*>(config);
  RequireTrianglesAlone("decimate", scene);
  const uint64_t count = scene.triangles.size();
  const uint64_t wanted =
      c.triangles != 0 ? uint64_t(c.triangles) : uint64_t(std::llround(c.keep * double(count)));
  constexpr uint64_t kMost = ((uint64_t{1} << 31) - 1) / 3, kBytesPerTriangle = 400;
  if (count > kMost)
    throw InputError(
        fmt::format("decimate: {}: has {} triangles; at most {} are allowed", scene.name, count, kMost));
  RequireMemory(fmt::format("decimate: {} ({} triangles)", scene.name, count), count * kBytesPerTriangle);

  const QuietOpenMesh quiet;
  std::vector<uint32_t> origin;
  origin.reserve(count);
  HalfEdges mesh = ToHalfEdges("decimate", scene, c.weld != 0, 1, options.drop_bad, origin);
  // Its status marks say what is left, and go with it.
  OpenMesh::Decimater::DecimaterT<HalfEdges> decimater(mesh);
  OpenMesh::Decimater::ModQuadricT<HalfEdges>::Handle quadrics;
  ModSoundTriangles<HalfEdges>::Handle sound;
  decimater.add(quadrics);
  decimater.add(sound);
  decimater.module(quadrics).unset_max_err();  // it decides the order, and forbids nothing
  decimater.initialize();
  if (wanted < origin.size()) {
    Reporter reporter(options.progress, (origin.size() - wanted) / 2);
    decimater.set_observer(&reporter);
    decimater.decimate_to_faces(0, wanted);
    decimater.set_observer(nullptr);
  }

  size_t left = 0;
  std::vector<std::array<uint32_t, 3>> triangles;
  for (size_t f = 0; f < origin.size(); ++f) {
    const HalfEdges::FaceHandle face{int(f)};
    if (mesh.status(face).deleted()) continue;
    auto& corners = triangles.emplace_back();
    size_t k = 0;
    for (auto v = mesh.cfv_iter(face); v.is_valid(); ++v) corners[k++] = uint32_t(v->idx());
    scene.triangle_material[left] = scene.triangle_material[origin[f]];
    scene.triangle_face[left++] = scene.triangle_face[origin[f]];
  }
  // Vertices in the order of the mesh, those that are left.
  std::vector<uint32_t> place(mesh.n_vertices());
  std::vector<Vec3f> positions;
  for (size_t v = 0; v < place.size(); ++v) {
    const HalfEdges::VertexHandle vertex{int(v)};
    if (mesh.status(vertex).deleted()) continue;
    place[v] = uint32_t(positions.size());
    const OpenMesh::Vec3d& p = mesh.point(vertex);
    positions.push_back(ToFloat({p[0], p[1], p[2]}));
  }
  for (auto& corners : triangles)
    for (uint32_t& v : corners) v = place[v];
  scene.triangles = std::move(triangles);
  scene.positions = std::move(positions);
  scene.triangle_material.resize(left);
  scene.triangle_face.resize(left);
  if (left > wanted + 1)
    scene.stats.notes.push_back(
        fmt::format("decimate stops at {} of {} triangles: no further collapse is sound", left, wanted));
  LeaveOutAttributes("decimate", scene);
  scene.Finish(options.drop_bad);
  return scene;
}

}  // namespace

const Modifier kDecimateModifier = {
    "decimate",
    "fewer triangles, those that differ least in shape; materials and face ids follow",
    "quadrics (Garland and Heckbert 1997) by OpenMesh's decimater",
    kParams,
    std::size(kParams),
    sizeof(Config),
    Apply};

}  // namespace raybench
