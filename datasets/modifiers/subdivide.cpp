// Grows a model for scaling studies: each triangle becomes four (three with sqrt3) a level, by OpenMesh's
// uniform subdividers on its half-edges, in double, rounded to float once at the end.
//
// Vertices of equal coordinates are made one before, since files often repeat them along seams, where the
// surface would tear. Subdividers run with weights rounded to float: they come from libm's cosine, whose last
// bit differs between machines, and the scene must not.

#include <fmt/format.h>

#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>
#include <OpenMesh/Tools/Subdivider/Uniform/LoopT.hh>
#include <OpenMesh/Tools/Subdivider/Uniform/ModifiedButterFlyT.hh>
#include <OpenMesh/Tools/Subdivider/Uniform/Sqrt3T.hh>
#include <cstddef>
#include <numeric>

#include "accel/base/memory.h"
#include "datasets/modifiers/half_edges.h"
#include "datasets/modifiers/modifiers.h"

namespace raybench {
namespace {

enum Scheme : uint32_t { kLoop, kMidpoint, kSqrt3, kButterfly };
const char* const kSchemes[] = {"loop", "midpoint", "sqrt3", "butterfly", nullptr};

struct Config {
  int64_t levels;
  uint32_t scheme, weld;
};

const rb_param kParams[] = {
    IntParam("levels", "times that each triangle becomes four, or three with sqrt3", offsetof(Config, levels),
             0, 15, 1),
    ChoiceParam("scheme",
                "loop smooths (Loop 1987), midpoint keeps the surface, sqrt3 smooths in smaller steps "
                "(Kobbelt 2000), butterfly smooths and keeps the vertices (Zorin, Schroeder, Sweldens 1996)",
                offsetof(Config, scheme), kSchemes, kLoop),
    BoolParam("weld", "make vertices of equal coordinates one first", offsetof(Config, weld), true),
};

namespace uniform = OpenMesh::Subdivider::Uniform;

/// Loop's scheme with weights for vertices of any number of neighbours; without moving anything it cuts each
/// edge in the middle.
class Loop : public uniform::LoopT<HalfEdges, float> {
 public:
  Loop(bool moves, size_t neighbours) : moves_(moves) { init_weights(std::max<size_t>(50, neighbours + 1)); }

 protected:
  bool subdivide(HalfEdges& mesh, size_t levels, const bool) override {
    return uniform::LoopT<HalfEdges, float>::subdivide(mesh, levels, moves_);
  }

 private:
  bool moves_;
};

class Sqrt3 : public uniform::Sqrt3T<HalfEdges, float> {
 public:
  explicit Sqrt3(size_t neighbours) { init_weights(std::max<size_t>(50, neighbours + 1)); }
};

using Subdivider = uniform::SubdividerT<HalfEdges, float>;

/// A subdivider at work on a mesh; it takes what it added to the mesh away again.
class Attached {
 public:
  Attached(std::unique_ptr<Subdivider> subdivider, HalfEdges& mesh) : subdivider_(std::move(subdivider)) {
    subdivider_->attach(mesh);
  }
  ~Attached() { subdivider_->detach(); }
  Attached(const Attached&) = delete;
  Attached& operator=(const Attached&) = delete;
  void OneLevel() { (*subdivider_)(1); }

 private:
  std::unique_ptr<Subdivider> subdivider_;
};

std::unique_ptr<Subdivider> MakeSubdivider(uint32_t scheme, size_t neighbours) {
  switch (scheme) {
    case kLoop:
    case kMidpoint:
      return std::make_unique<Loop>(scheme == kLoop, neighbours);
    case kSqrt3:
      return std::make_unique<Sqrt3>(neighbours);
    default:
      return std::make_unique<uniform::ModifiedButterflyT<HalfEdges, float>>();  // asks the mesh itself
  }
}

/// Vertices inside the surface with two neighbours: the butterfly has no weights for them, and sqrt3 would
/// flip an edge onto another.
uint64_t CountTwoNeighbours(const HalfEdges& mesh) {
  uint64_t count = 0;
  for (const auto v : mesh.vertices()) count += mesh.valence(v) == 2 && !mesh.is_boundary(v);
  return count;
}

size_t MostNeighbours(const HalfEdges& mesh) {
  size_t most = 0;
  for (const auto v : mesh.vertices()) most = std::max<size_t>(most, mesh.valence(v));
  return most;
}

Scene Apply(Scene scene, const void* config, const LoadOptions& options) {
  const Config& c = *static_cast<const Config*>(config);
  const auto fail = [&](const std::string& what) {
    throw InputError(fmt::format("subdivide: {}: {}", scene.name, what));
  };
  RequireTrianglesAlone("subdivide", scene);
  // OpenMesh numbers half-edges, three a triangle, by int.
  constexpr uint64_t kMost = ((uint64_t{1} << 31) - 1) / 3, kBytesPerTriangle = 200;
  const uint64_t factor = c.scheme == kSqrt3 ? 3 : 4;
  uint64_t growth = 1;
  for (int64_t i = 0; i < c.levels; ++i) growth *= factor;
  const uint64_t count = scene.triangles.size() * growth;
  if (count > kMost)
    fail(fmt::format("{} levels would make {} triangles of {}; at most {} are allowed", c.levels, count,
                     scene.triangles.size(), kMost));
  RequireMemory(fmt::format("subdivide: {} at {} levels ({} triangles)", scene.name, c.levels, count),
                count * kBytesPerTriangle);

  const QuietOpenMesh quiet;
  std::vector<uint32_t> origin;
  origin.reserve(count);
  HalfEdges mesh = ToHalfEdges("subdivide", scene, c.weld != 0, growth, options.drop_bad, origin);
  const bool cuts = c.scheme == kLoop || c.scheme == kMidpoint;
  if (const uint64_t bad = cuts ? 0 : CountTwoNeighbours(mesh); bad > 0)
    fail(fmt::format(
        "{} vertices inside the surface have only two neighbours; scheme=loop and scheme=midpoint can do "
        "them",
        bad));

  Attached subdivider(MakeSubdivider(c.scheme, MostNeighbours(mesh)), mesh);
  uint64_t made = 0, all = 0;
  for (uint64_t level = 1, now = factor; level <= uint64_t(c.levels); ++level, now *= factor) all += now;
  for (uint64_t level = 1, now = factor; level <= uint64_t(c.levels); ++level, now *= factor) {
    subdivider.OneLevel();
    // A face keeps its id; those that it is cut into follow at the end, face by face.
    const size_t before = origin.size();
    for (size_t i = 0; i < before; ++i) origin.insert(origin.end(), factor - 1, origin[i]);
    if (origin.size() != mesh.n_faces())
      throw std::logic_error(fmt::format("subdivide: {} faces became {}", before, mesh.n_faces()));
    made += now;
    if (options.progress) options.progress(0.8 * double(made) / double(all));
  }

  // Back, in the order of the triangles they came from.
  std::vector<uint64_t> place(scene.triangles.size() + 1);
  for (uint32_t i : origin) ++place[i + 1];
  std::partial_sum(place.begin(), place.end(), place.begin());
  std::vector<std::array<uint32_t, 3>> triangles(origin.size());
  std::vector<uint32_t> material(origin.size()), face(origin.size());
  for (const auto f : mesh.faces()) {
    const uint32_t from = origin[size_t(f.idx())];
    const uint64_t to = place[from]++;
    size_t k = 0;
    for (auto v = mesh.cfv_iter(f); v.is_valid(); ++v) triangles[to][k++] = uint32_t(v->idx());
    material[to] = scene.triangle_material[from];
    face[to] = scene.triangle_face[from];
  }
  scene.triangles = std::move(triangles);
  scene.triangle_material = std::move(material);
  scene.triangle_face = std::move(face);
  scene.positions.resize(mesh.n_vertices());
  for (size_t i = 0; i < scene.positions.size(); ++i) {
    const OpenMesh::Vec3d& p = mesh.point(HalfEdges::VertexHandle(int(i)));
    scene.positions[i] = ToFloat({p[0], p[1], p[2]});
  }
  LeaveOutAttributes("subdivide", scene);
  scene.Finish(options.drop_bad);
  return scene;
}

}  // namespace

const Modifier kSubdivideModifier = {
    "subdivide",
    "each triangle cut into smaller ones; materials follow, face ids stay those of the file",
    "OpenMesh's uniform subdividers (Botsch et al. 2002)",
    kParams,
    std::size(kParams),
    sizeof(Config),
    Apply};

}  // namespace raybench
