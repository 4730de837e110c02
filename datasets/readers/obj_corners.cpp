#include "datasets/readers/obj_corners.h"

#include <fmt/format.h>

#include <algorithm>
#include <span>
#include <unordered_map>

namespace raybench {
namespace {

constexpr uint32_t kNone = RAYBENCH_NONE, kUnset = RAYBENCH_NONE - 1;

/// Gives every (vertex, uv, normal) that is asked for a vertex.
class VertexSplitter {
 public:
  explicit VertexSplitter(std::vector<Vec3f>& positions)
      : positions_(positions), looks_(positions.size(), {kUnset, kUnset}) {}

  struct Look {
    uint32_t uv, normal;
    friend bool operator==(const Look&, const Look&) = default;
  };

  uint32_t Vertex(const ObjCorner& c) {
    Look& own = looks_[c.vertex];  // the first one needs no table
    const Look look{c.uv, c.normal};
    if (own.uv == kUnset) own = look;
    if (own == look) return c.vertex;
    const auto [it, is_new] = split_.try_emplace(c, uint32_t(positions_.size()));
    if (is_new) {
      const Vec3f position = positions_[c.vertex];
      positions_.push_back(position);
      looks_.push_back(look);
    }
    return it->second;
  }

  const std::vector<Look>& looks() const { return looks_; }

 private:
  struct Hash {
    size_t operator()(const ObjCorner& c) const {
      uint64_t h = 0;
      for (uint64_t word : {c.vertex, c.uv, c.normal}) {
        h = (h ^ word) * 0x9FB21C651E98DF25u;
        h ^= h >> 32;
      }
      return h;
    }
  };
  struct Equal {
    bool operator()(const ObjCorner& a, const ObjCorner& b) const {
      return a.vertex == b.vertex && a.uv == b.uv && a.normal == b.normal;
    }
  };

  std::vector<Vec3f>& positions_;
  std::vector<Look> looks_;
  std::unordered_map<ObjCorner, uint32_t, Hash, Equal> split_;
};

bool ByVertex(const ObjCorner& a, const ObjCorner& b) { return a.vertex < b.vertex; }

/// Whether three equal normals say no more than the triangle does: parallel to its own within 0.8 degrees,
/// more than the few digits of such files are off.
bool IsFlat(const Vec3f (&normal)[3], Vec3d own) {
  if (!(normal[0] == normal[1] && normal[0] == normal[2])) return false;
  const Vec3d n = ToDouble(normal[0]);
  const double cosine = Dot(n, own);
  return cosine * cosine >= 0.9998 * Dot(n, n) * Dot(own, own);
}

}  // namespace

void ObjCorners::AddFace(uint32_t face, std::vector<ObjCorner>& corners) {
  first_.resize(size_t{face} + 1, corners_.size());
  std::stable_sort(corners.begin(), corners.end(), ByVertex);
  corners_.insert(corners_.end(), corners.begin(), corners.end());
}

void ObjCorners::Apply(Scene& scene, bool keep_unread) {
  if (corners_.empty() && scene.textures.empty()) return;
  first_.resize(scene.stats.faces + 1, corners_.size());
  const auto find = [&](uint32_t face, uint32_t vertex) {
    const std::span<const ObjCorner> all =
        std::span(corners_).subspan(first_[face], first_[face + 1] - first_[face]);
    const auto it = std::lower_bound(all.begin(), all.end(), ObjCorner{vertex, kNone, kNone}, ByVertex);
    return it != all.end() && it->vertex == vertex ? *it : ObjCorner{vertex, kNone, kNone};
  };
  uint64_t beyond = 0, bare = 0;
  const auto check = [&](uint32_t& index, size_t count) {
    if (index == kNone || index < count) return;
    index = kNone;
    ++beyond;
  };
  const size_t vertices = scene.positions.size();
  VertexSplitter splitter(scene.positions);
  bool has_uvs = false, has_normals = false;
  for (size_t i = 0; i < scene.triangles.size(); ++i) {
    std::array<uint32_t, 3>& t = scene.triangles[i];
    if (std::any_of(t.begin(), t.end(), [&](uint32_t v) { return v >= vertices; })) continue;  // for Finish()
    const Material& m = scene.materials[scene.triangle_material[i]];
    const bool is_textured = m.base_color_texture >= 0 || m.emission_texture >= 0;
    ObjCorner corners[3];
    Vec3f normal[3];
    for (size_t k = 0; k < 3; ++k) {
      ObjCorner& c = corners[k] = find(scene.triangle_face[i], t[k]);
      if (!is_textured && !keep_unread) c.uv = kNone;
      check(c.uv, uvs.size());
      check(c.normal, normals.size());
      if (c.normal != kNone) normal[k] = normals[c.normal];
    }
    const Vec3d a = ToDouble(scene.positions[t[0]]);
    const bool is_flat =
        IsFlat(normal, Cross(ToDouble(scene.positions[t[1]]) - a, ToDouble(scene.positions[t[2]]) - a));
    bare += is_textured && std::any_of(std::begin(corners), std::end(corners),
                                       [](const ObjCorner& c) { return c.uv == kNone; });
    for (size_t k = 0; k < 3; ++k) {
      if (is_flat && !keep_unread) corners[k].normal = kNone;
      has_uvs = has_uvs || corners[k].uv != kNone;
      has_normals = has_normals || corners[k].normal != kNone;
      t[k] = splitter.Vertex(corners[k]);
    }
  }
  const auto fill = [&](auto& items, const auto& of_file, uint32_t VertexSplitter::Look::*index) {
    items.resize(scene.positions.size());
    for (size_t v = 0; v < items.size(); ++v)
      if (const uint32_t i = splitter.looks()[v].*index; i < of_file.size()) items[v] = of_file[i];
  };
  if (has_uvs) fill(scene.uvs, uvs, &VertexSplitter::Look::uv);
  if (has_normals) fill(scene.normals, normals, &VertexSplitter::Look::normal);
  if (!has_uvs) scene.stats.saved_bytes += uvs.size() * sizeof uvs[0];
  if (!has_normals) scene.stats.saved_bytes += normals.size() * sizeof normals[0];
  if (beyond > 0)
    scene.stats.notes.push_back(fmt::format(
        "{} corners of triangles refer to texture coordinates or normals that are not there", beyond));
  if (bare > 0)
    scene.stats.notes.push_back(fmt::format("{} triangles have a texture but no coordinates for it", bare));
}

}  // namespace raybench
