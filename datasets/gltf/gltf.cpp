// glTF 2.0: the node hierarchy of the default scene, flattened. datasets/gltf/ takes the file apart:
// container and JSON schema are checked before tinygltf turns the JSON into its model; accessors and
// materials are read from that. tinygltf touches neither files nor buffers nor images, and its indices are
// not trusted.
//
// Skins, morph targets and animations are not applied: meshes are read as they are stored, under their nodes'
// transforms. Mirrored instances (negative determinant) have their winding reversed, as glTF 2.0 says
// (3.7.4), so that closed surfaces keep their inside.

#include <fmt/format.h>
#include <tiny_gltf.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>
#include <set>

#include "accel/base/memory.h"
#include "datasets/gltf/accessors.h"
#include "datasets/gltf/container.h"
#include "datasets/gltf/materials.h"
#include "datasets/readers/readers.h"
#include "datasets/scene/tangent.h"

namespace raybench {
namespace {

/// Affine map, column-major as in glTF: columns x, y, z and the translation.
struct Affine {
  Vec3d x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1}, t{0, 0, 0};

  Vec3d Vector(Vec3d v) const { return x * v.x + y * v.y + z * v.z; }
  Vec3d Point(Vec3d p) const { return Vector(p) + t; }
  Affine operator*(const Affine& b) const { return {Vector(b.x), Vector(b.y), Vector(b.z), Point(b.t)}; }
  bool Mirrors() const { return Dot(Cross(x, y), z) < 0; }
  /// A unit normal, by the inverse transpose; (0, 0, 0) where there is none.
  Vec3f Normal(Vec3d n) const {
    Vec3d v = Cross(y, z) * n.x + Cross(z, x) * n.y + Cross(x, y) * n.z;
    const double length = Length(v);
    if (!(length > 0)) return {0, 0, 0};
    return ToFloat(v * ((Mirrors() ? -1 : 1) / length));
  }
};

/// Translation * rotation * scale. The rotation is a quaternion (x, y, z, w) of any length but 0.
Affine FromTrs(Vec3d t, std::array<double, 4> q, Vec3d s) {
  const double f = 2 / (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  const double x = q[0], y = q[1], z = q[2], w = q[3];
  return {Vec3d{1 - f * (y * y + z * z), f * (x * y + z * w), f * (x * z - y * w)} * s.x,
          Vec3d{f * (x * y - z * w), 1 - f * (x * x + z * z), f * (y * z + x * w)} * s.y,
          Vec3d{f * (x * z + y * w), f * (y * z - x * w), 1 - f * (x * x + y * y)} * s.z, t};
}

constexpr char kInstancing[] = "EXT_mesh_gpu_instancing";
constexpr char kQuantization[] = "KHR_mesh_quantization";

class GltfReader {
 public:
  GltfReader(const std::filesystem::path& path, const LoadOptions& options)
      : options_(options),
        container_(path),
        images_(Take("images")),
        has_animations_(!Take("animations").empty()) {
    scene_.provenance.source = path.string();
    Parse();
    const std::vector<std::string>& used = model_.extensionsUsed;
    const bool quantized = std::find(used.begin(), used.end(), kQuantization) != used.end();
    position_types_ = kGltfFloat | (quantized ? kGltfBytes | kGltfShorts : 0);
    uv_types_ = kGltfFloat | kGltfUnsignedByte | kGltfUnsignedShort | position_types_;
  }

  Scene Read() {
    for (const tinygltf::Material& material : model_.materials)
      scene_.materials.push_back(GltfMaterial(container_, material, scene_.materials.size()));
    lookups_.resize(scene_.materials.size());
    Walk();
    Prepare();
    Fill();
    TakeFileHash();
    AddNotes();
    if (scene_.triangles.empty())
      Fail(fmt::format("has no triangles in its default scene{}",
                       left_out_.empty() ? "" : fmt::format(" (left out: {})", left_out_)));
    return std::move(scene_);
  }

 private:
  [[noreturn]] void Fail(const std::string& what) const { container_.Fail(what); }
  void Note(std::string text) { scene_.stats.notes.push_back(std::move(text)); }

  template <class T>
  const T& At(const std::vector<T>& items, int64_t index, const char* what) const {
    if (index < 0 || size_t(index) >= items.size())
      Fail(fmt::format("refers to {} {}; there are {}", what, index, items.size()));
    return items[size_t(index)];
  }

  /// Moves an array out of the JSON: what tinygltf shall not see.
  nlohmann::json Take(const char* key) {
    nlohmann::json taken = nlohmann::json::array();
    if (auto it = container_.root.find(key); it != container_.root.end()) {
      taken = std::move(*it);
      container_.root.erase(it);
    }
    return taken;
  }

  void Parse() {
    nlohmann::json& root = container_.root;
    // tinygltf wants a view of every accessor of indices; accessors of zeros get one that is known as theirs.
    if (auto accessors = root.find("accessors"); accessors != root.end()) {
      nlohmann::json& views = root["bufferViews"];
      zero_view_ = int(views.size());
      for (nlohmann::json& accessor : *accessors)
        if (!accessor.contains("bufferView")) accessor["bufferView"] = zero_view_;
      views.push_back({{"buffer", 0}, {"byteLength", 0}});
    }
    std::string error, warning;
    bool ok = false;
    try {
      const std::string text = root.dump();
      root = {};
      if (text.size() > INT_MAX) Fail("has more than 2 GiB of JSON");
      ok = tinygltf::TinyGLTF().LoadASCIIFromString(&model_, &error, &warning, text.data(),
                                                    unsigned(text.size()), "");
    } catch (const nlohmann::json::exception& e) {
      error = e.what();
    }
    if (!ok) Fail("is not valid glTF: " + (error.empty() ? "tinygltf says no more" : error));
  }

  // --- Nodes

  struct Instance {
    int node, mesh;
    Affine to_world;
  };

  std::vector<int> Roots() {
    if (!model_.scenes.empty()) {
      const int index = std::max(model_.defaultScene, 0);
      if (model_.scenes.size() > 1)
        Note(fmt::format("has {} scenes; scene {} is read", model_.scenes.size(), index));
      return At(model_.scenes, index, "scene").nodes;
    }
    if (model_.defaultScene >= 0) At(model_.scenes, model_.defaultScene, "scene");
    // A file without scenes is a library of nodes: show all of it.
    std::vector<bool> is_child(model_.nodes.size());
    for (const tinygltf::Node& node : model_.nodes)
      for (int child : node.children) {
        At(model_.nodes, child, "node");
        is_child[size_t(child)] = true;
      }
    std::vector<int> roots;
    for (size_t i = 0; i < model_.nodes.size(); ++i)
      if (!is_child[i]) roots.push_back(int(i));
    return roots;
  }

  /// Depth first in the order of the file, parents first. Without recursion, and each node once: glTF demands
  /// strict trees, and a cycle or a node of two parents is an error.
  void Walk() {
    struct Step {
      int node, parent;
    };
    std::vector<bool> seen(model_.nodes.size()), is_hidden(model_.nodes.size());
    std::vector<Affine> world(model_.nodes.size());
    std::vector<Step> stack;
    const std::vector<int> roots = Roots();
    for (auto it = roots.rbegin(); it != roots.rend(); ++it) stack.push_back({*it, -1});
    while (!stack.empty()) {
      const Step step = stack.back();
      stack.pop_back();
      const tinygltf::Node& node = At(model_.nodes, step.node, "node");
      if (seen[size_t(step.node)])
        Fail(fmt::format("node {} is reached twice; glTF nodes must form trees, without cycles", step.node));
      seen[size_t(step.node)] = true;
      const Affine local = LocalTransform(node, step.node);
      const Affine& to_world = world[size_t(step.node)] =
          step.parent < 0 ? local : world[size_t(step.parent)] * local;
      // A node that is not visible hides all below it.
      is_hidden[size_t(step.node)] =
          (step.parent >= 0 && is_hidden[size_t(step.parent)]) || IsInvisible(node);
      if (is_hidden[size_t(step.node)]) {
        hidden_meshes_ += node.mesh >= 0;
      } else if (node.mesh >= 0) {
        AddInstances(node, step.node, to_world);
      }
      if (node.camera >= 0) AddCamera(At(model_.cameras, node.camera, "camera"), to_world, step.node);
      if (auto it = node.extensions.find("KHR_lights_punctual");
          it != node.extensions.end() && !is_hidden[size_t(step.node)])
        AddLight(GltfIndex(it->second, "light", -1), to_world, step.node);
      for (auto it = node.children.rbegin(); it != node.children.rend(); ++it)
        stack.push_back({*it, step.node});
    }
  }

  static bool IsInvisible(const tinygltf::Node& node) {
    const auto extension = node.extensions.find("KHR_node_visibility");
    if (extension == node.extensions.end() || !extension->second.Has("visible")) return false;
    return !extension->second.Get("visible").Get<bool>();
  }

  Affine LocalTransform(const tinygltf::Node& node, int index) const {
    const std::vector<double>&m = node.matrix, &t = node.translation, &q = node.rotation, &s = node.scale;
    if (m.size() == 16)
      return {{m[0], m[1], m[2]}, {m[4], m[5], m[6]}, {m[8], m[9], m[10]}, {m[12], m[13], m[14]}};
    std::array<double, 4> rotation{0, 0, 0, 1};
    if (q.size() == 4) {
      std::copy(q.begin(), q.end(), rotation.begin());
      CheckRotation(rotation, fmt::format("node {}", index));
    }
    return FromTrs(t.size() == 3 ? Vec3d{t[0], t[1], t[2]} : Vec3d{0, 0, 0}, rotation,
                   s.size() == 3 ? Vec3d{s[0], s[1], s[2]} : Vec3d{1, 1, 1});
  }

  void CheckRotation(const std::array<double, 4>& q, const std::string& what) const {
    const double length2 = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
    if (!(length2 >= 1e-30 && length2 <= 1e30))
      Fail(fmt::format("{} has the rotation ({}, {}, {}, {}); a unit quaternion is needed", what, q[0], q[1],
                       q[2], q[3]));
  }

  /// One, or with EXT_mesh_gpu_instancing as many as its arrays say.
  void AddInstances(const tinygltf::Node& node, int index, const Affine& to_world) {
    At(model_.meshes, node.mesh, "mesh");
    auto extension = node.extensions.find(kInstancing);
    if (extension == node.extensions.end()) {
      instances_.push_back({index, node.mesh, to_world});
      return;
    }
    const tinygltf::Value& attributes = extension->second.Get("attributes");
    uint64_t count = RAYBENCH_NONE;
    auto read = [&]<size_t N>(const char* name, GltfTypes types, std::vector<std::array<float, N>>& out) {
      if (!attributes.IsObject() || !attributes.Has(name)) return;
      out = accessors_.Floats<N>(GltfIndex(attributes, name, -1), name, types);
      if (count != RAYBENCH_NONE && count != out.size())
        Fail(fmt::format("node {} has instances of {} and of {} elements; as many are needed of each", index,
                         count, out.size()));
      count = out.size();
    };
    std::vector<std::array<float, 3>> translations, scales;
    std::vector<std::array<float, 4>> rotations;
    read("TRANSLATION", kGltfFloat, translations);
    read("ROTATION", kGltfFloat | kGltfBytes | kGltfShorts, rotations);
    read("SCALE", kGltfFloat, scales);
    if (count == RAYBENCH_NONE)
      Fail(fmt::format("node {} has {} without TRANSLATION, ROTATION or SCALE", index, kInstancing));
    RequireMemory(scene_.provenance.source + ":", count * sizeof(Instance));
    for (uint64_t i = 0; i < count; ++i) {
      auto vector = [&](const auto& items, double fallback) {
        return items.empty() ? Vec3d{fallback, fallback, fallback}
                             : Vec3d{items[i][0], items[i][1], items[i][2]};
      };
      std::array<double, 4> rotation{0, 0, 0, 1};
      if (!rotations.empty()) std::copy(rotations[i].begin(), rotations[i].end(), rotation.begin());
      CheckRotation(rotation, fmt::format("instance {} of node {}", i, index));
      instances_.push_back(
          {index, node.mesh, to_world * FromTrs(vector(translations, 0), rotation, vector(scales, 1))});
    }
  }

  void AddCamera(const tinygltf::Camera& camera, const Affine& to_world, int node) {
    if (camera.type != "perspective") {
      ++orthographic_cameras_;
      return;
    }
    double yfov = camera.perspective.yfov;
    if (!(yfov > 0 && yfov < 3.1415926))
      Fail(fmt::format("the camera of node {} has yfov {}; 0 < yfov < pi is needed", node, yfov));
    Vec3d forward = -to_world.z;
    double length = Length(forward);
    if (!(length > 0)) Fail(fmt::format("the camera of node {} has no direction", node));
    Camera out;
    out.eye = ToFloat(to_world.t);
    // Far enough ahead that rounding to float leaves the direction as it is.
    out.at = ToFloat(to_world.t + forward * (std::max(1.0, Length(to_world.t)) / length));
    out.up = ToFloat(to_world.y * (1 / Length(to_world.y)));
    out.tan_half_fov = float(Tangent(yfov / 2));
    scene_.cameras.push_back(out);
  }

  /// KHR_lights_punctual. Intensities are taken as they are, whatever their unit. Scales act on places alone.
  void AddLight(int index, const Affine& to_world, int node) {
    const tinygltf::Light& light = At(model_.lights, index, "light");
    Light out;
    if (light.type == "directional")
      out.kind = LightKind::kDirectional;
    else if (light.type == "spot")
      out.kind = LightKind::kSpot;
    else if (light.type != "point")
      Fail(fmt::format("light {} has the type {}; allowed are directional, point, spot", index,
                       Quoted(light.type)));
    for (size_t i = 0; i < 3; ++i) {
      const double color = i < light.color.size() ? light.color[i] : 1;
      if (!(color >= 0 && light.intensity >= 0))
        Fail(fmt::format("light {} has intensity {} and a channel of colour {}; at least 0 is needed", index,
                         light.intensity, color));
      out.intensity[int(i)] = float(color * light.intensity);
    }
    if (out.kind != LightKind::kPoint) {
      const double length = Length(to_world.z);
      if (!(length > 0)) Fail(fmt::format("the light of node {} has no direction", node));
      out.direction = ToFloat(to_world.z * (-1 / length));
    }
    if (out.kind == LightKind::kSpot) {
      const double inner = light.spot.innerConeAngle, outer = light.spot.outerConeAngle;
      // Real files have pi / 2 as a float, and equal angles for a sharp edge.
      if (!(inner >= 0 && outer >= inner && outer > 0 && outer <= std::numbers::pi / 2 + 1e-6))
        Fail(fmt::format(
            "light {} has innerConeAngle {} and outerConeAngle {}; 0 <= inner <= outer <= pi/2 and "
            "outer > 0 is needed",
            index, inner, outer));
      const auto cosine = [](double angle) {
        const double t = Tangent(angle / 2), t2 = t * t;
        return float(std::max(0.0, (1 - t2) / (1 + t2)));
      };
      out.cos_inner = cosine(inner);
      out.cos_outer = cosine(outer);
    }
    if (out.kind != LightKind::kDirectional) {
      out.position = ToFloat(to_world.t);
      out.falloff = true;
      if (!(light.range >= 0))
        Fail(fmt::format("light {} has range {}; more than 0 is needed", index, light.range));
      if (light.range > 0) out.range = float(light.range);  // 0: none is given
    }
    scene_.lights.push_back(out);
  }

  // --- Meshes

  /// A primitive of triangles. Only its accessors are known yet: the data of each instance are read
  /// from them.
  struct Part {
    int positions, normals = -1, uvs = -1, indices = -1;
    int mode;
    uint32_t material = 0;
    uint64_t vertices = 0, corners = 0, triangles = 0;

    /// Parts of the same key share their vertices.
    std::array<int64_t, 4> Key(const GltfLookup* lookup) const {
      // Each material's map makes coordinates of its own.
      return {positions, normals, uvs, uvs >= 0 && lookup->mapped ? int64_t(material) : -1};
    }
  };
  /// Vertices that were added together; where those of the same accessor and instance were added first.
  struct Block {
    uint32_t start, of_file;
  };
  struct Mesh {
    std::vector<Part> parts;
    uint64_t vertices = 0, triangles = 0;
  };

  /// Where a material's textures are looked up; null where it has none. They are loaded at first use, so that
  /// those of materials that nothing wears stay out.
  const GltfLookup* LookupOf(uint32_t material) {
    if (material >= lookups_.size()) return nullptr;
    std::optional<GltfLookup>& lookup = lookups_[material];
    if (!lookup) {
      Material& m = scene_.materials[material];
      lookup = GltfBaseColor(model_.materials[material]);
      if (lookup->texture >= 0) m.base_color_texture = textures_.Load(lookup->texture);
      const GltfLookup glow = GltfEmission(model_.materials[material]);
      if (glow.texture >= 0 && !(m.emission == Vec3f{0, 0, 0})) {
        if (m.base_color_texture < 0) lookup = glow;
        if (lookup->SamePlaces(glow))
          m.emission_texture = textures_.Load(glow.texture);
        else
          Note(
              fmt::format("material {} does not glow: its emissive texture has other coordinates than its "
                          "base colour",
                          material));
        if (m.emission_texture < 0) m.emission = {0, 0, 0};  // without its picture all of it would glow
      }
      lookup->texture = std::max(m.base_color_texture, m.emission_texture);
    }
    return lookup->texture >= 0 ? &*lookup : nullptr;
  }

  uint32_t MaterialOf(int material) {
    if (material >= 0) {
      At(model_.materials, material, "material");
      return uint32_t(material);
    }
    // The specification's default material is a metal, and rough: nobody means it.
    if (scene_.materials.size() == model_.materials.size()) scene_.materials.emplace_back().name = "default";
    return uint32_t(model_.materials.size());
  }

  static int Attribute(const tinygltf::Primitive& primitive, const std::string& name) {
    auto it = primitive.attributes.find(name);
    return it == primitive.attributes.end() ? -1 : it->second;
  }

  /// What an instance of a mesh consists of, with every accessor checked.
  const Mesh& MeshOf(int index) {
    auto [it, is_new] = meshes_.try_emplace(index);
    Mesh& out = it->second;
    if (!is_new) return out;
    std::set<std::array<int64_t, 4>> keys;
    const tinygltf::Mesh& mesh = At(model_.meshes, index, "mesh");
    for (size_t i = 0; i < mesh.primitives.size(); ++i) {
      const tinygltf::Primitive& p = mesh.primitives[i];
      if (p.mode > TINYGLTF_MODE_TRIANGLE_FAN)
        Fail(fmt::format("mesh {} has the primitive mode {}; allowed are 0 to 6", index, p.mode));
      Part part;
      part.mode = p.mode;
      part.positions = Attribute(p, "POSITION");
      morph_targets_ = morph_targets_ || !p.targets.empty();
      if (p.mode < TINYGLTF_MODE_TRIANGLES) {
        ++(p.mode == TINYGLTF_MODE_POINTS ? point_primitives_ : line_primitives_);
        continue;
      }
      if (part.positions < 0) {  // the specification: to be left out
        ++without_positions_;
        continue;
      }
      part.vertices = accessors_.Check(part.positions, "POSITION", 3, position_types_);
      part.corners = part.vertices;
      if (p.indices >= 0) {
        part.indices = p.indices;
        part.corners = accessors_.Check(p.indices, "indices", 1,
                                        kGltfUnsignedByte | kGltfUnsignedShort | kGltfUnsignedInt);
      }
      if (p.mode != TINYGLTF_MODE_TRIANGLES) {
        part.triangles = part.corners < 3 ? 0 : part.corners - 2;
      } else {
        if (part.corners % 3 != 0 && !options_.drop_bad)
          Fail(fmt::format("primitive {} of mesh {} has triangles of {} indices; a multiple of 3 is needed{}",
                           i, index, part.corners, kOrDropBad));
        part.triangles = part.corners / 3;
      }
      if (part.triangles == 0) continue;
      part.material = MaterialOf(p.material);
      auto shading = [&](const std::string& name, int components, GltfTypes types) {
        const int accessor = Attribute(p, name);
        if (accessor < 0) return -1;
        const uint64_t count = accessors_.Check(accessor, name.c_str(), components, types);
        if (count != part.vertices)
          Fail(fmt::format("primitive {} of mesh {} has {} vertices, but {} of {}", i, index, part.vertices,
                           count, name));
        return accessor;
      };
      part.normals = shading("NORMAL", 3, kGltfFloat | kGltfBytes | kGltfShorts);
      has_normals_ = has_normals_ || part.normals >= 0;
      const GltfLookup* lookup = LookupOf(part.material);
      if (lookup != nullptr) {
        part.uvs = shading(fmt::format("TEXCOORD_{}", lookup->set), 2, uv_types_);
        has_uvs_ = has_uvs_ || part.uvs >= 0;
        without_uvs_ += part.uvs < 0;
      }
      out.triangles += part.triangles;
      if (keys.insert(part.Key(lookup)).second) out.vertices += part.vertices;
      out.parts.push_back(part);
    }
    return out;
  }

  /// Counts everything before anything is filled, so that what cannot fit is refused at once.
  void Prepare() {
    uint64_t vertices = 0, triangles = 0;
    std::vector<bool> used(model_.meshes.size());
    for (const Instance& instance : instances_) {
      const Mesh& mesh = MeshOf(instance.mesh);
      vertices += mesh.vertices;
      triangles += mesh.triangles;
      if (used[size_t(instance.mesh)]) scene_.stats.shared_triangles += mesh.triangles;
      used[size_t(instance.mesh)] = true;
      if (vertices >= RAYBENCH_NONE || triangles >= RAYBENCH_NONE)
        Fail(fmt::format("has {} or more vertices or triangles with all instances; fewer are needed",
                         RAYBENCH_NONE));
    }
    unused_meshes_ = uint64_t(std::count(used.begin(), used.end(), false));
    scene_.stats.instances = instances_.size();
    scene_.stats.faces = triangles;
    const uint64_t per_vertex = sizeof(Vec3f) * (has_normals_ ? 2 : 1) + (has_uvs_ ? sizeof(Vec2f) : 0);
    RequireMemory(scene_.provenance.source + ":",
                  vertices * per_vertex + triangles * (3 + 2) * sizeof(uint32_t));
    scene_.positions.reserve(vertices + 2);
    if (has_normals_) scene_.normals.reserve(vertices);
    if (has_uvs_) scene_.uvs.reserve(vertices);
    scene_.triangles.reserve(triangles);
    scene_.triangle_material.reserve(triangles);
  }

  void Fill() {
    for (const Instance& instance : instances_) {
      std::map<std::array<int64_t, 4>, uint32_t> first;  // where each key's vertices start
      std::map<int, uint32_t> of_file;                   // and each accessor's, when they were first added
      for (const Part& part : MeshOf(instance.mesh).parts) {
        auto [it, is_new] =
            first.try_emplace(part.Key(LookupOf(part.material)), uint32_t(scene_.positions.size()));
        if (is_new) {
          blocks_.push_back({it->second, of_file.try_emplace(part.positions, it->second).first->second});
          AddVertices(part, instance);
        }
        AddTriangles(part, instance, it->second);
        if (options_.progress)
          options_.progress(double(scene_.triangles.size()) / double(scene_.stats.faces));
      }
    }
  }

  /// The hash is of vertices that were added for their places, not again for other looks: whether those are
  /// wanted depends on pictures that may be missing.
  void TakeFileHash() {
    const auto is_copy = [](const Block& block) { return block.start != block.of_file; };
    if (std::none_of(blocks_.begin(), blocks_.end(), is_copy)) return scene_.TakeHash();
    std::vector<uint32_t> number(scene_.positions.size());
    std::vector<Vec3f> positions;
    for (size_t b = 0; b < blocks_.size(); ++b) {
      const size_t end = b + 1 < blocks_.size() ? blocks_[b + 1].start : number.size();
      for (size_t v = blocks_[b].start; v < end; ++v) {
        number[v] = is_copy(blocks_[b]) ? number[blocks_[b].of_file + (v - blocks_[b].start)]
                                        : uint32_t(positions.size());
        if (!is_copy(blocks_[b])) positions.push_back(scene_.positions[v]);
      }
    }
    std::vector<std::array<uint32_t, 3>> triangles = scene_.triangles;
    for (std::array<uint32_t, 3>& t : triangles)
      for (uint32_t& v : t)
        if (v < number.size()) v = number[v];
    scene_.positions.swap(positions);
    scene_.triangles.swap(triangles);
    scene_.TakeHash();
    scene_.positions.swap(positions);
    scene_.triangles.swap(triangles);
  }

  void AddVertices(const Part& part, const Instance& instance) {
    const std::vector<std::array<float, 3>> positions =
        accessors_.Floats<3>(part.positions, "POSITION", position_types_);
    for (size_t i = 0; i < positions.size(); ++i) {
      const std::array<float, 3>& p = positions[i];
      const Vec3f at = ToFloat(instance.to_world.Point({p[0], p[1], p[2]}));
      if (!(std::isfinite(at.x) && std::isfinite(at.y) && std::isfinite(at.z)) && !options_.drop_bad)
        Fail(fmt::format(
            "vertex {} of accessor {} (POSITION) is ({}, {}, {}){}; coordinates must be finite{}", i,
            part.positions, p[0], p[1], p[2],
            std::isfinite(p[0] + p[1] + p[2]) ? fmt::format(", beyond float under node {}", instance.node)
                                              : "",
            kOrDropBad));
      scene_.positions.push_back(at);
    }
    if (part.normals >= 0) {
      for (const std::array<float, 3>& n :
           accessors_.Floats<3>(part.normals, "NORMAL", kGltfFloat | kGltfBytes | kGltfShorts))
        scene_.normals.push_back(instance.to_world.Normal({n[0], n[1], n[2]}));
    } else if (has_normals_) {
      scene_.normals.resize(scene_.positions.size());
    }
    if (part.uvs >= 0) {
      const GltfLookup& lookup = *LookupOf(part.material);
      for (std::array<float, 2> uv : accessors_.Floats<2>(part.uvs, "TEXCOORD", uv_types_))
        scene_.uvs.push_back(lookup(uv));
    } else if (has_uvs_) {
      scene_.uvs.resize(scene_.positions.size());
    }
  }

  void AddTriangles(const Part& part, const Instance& instance, uint32_t first) {
    std::vector<uint32_t> corners;
    if (part.indices >= 0) {
      corners = accessors_.Integers(part.indices, "indices");
      for (size_t i = 0; i < corners.size(); ++i) {
        if (corners[i] < part.vertices) {
          corners[i] += first;
        } else {
          if (!options_.drop_bad)
            Fail(fmt::format("element {} of accessor {} (indices) refers to vertex {}; allowed are 0 to {}{}",
                             i, part.indices, corners[i], int64_t(part.vertices) - 1, kOrDropBad));
          corners[i] = RAYBENCH_NONE;  // for Scene::Finish()
        }
      }
    } else {
      corners.resize(part.corners);
      for (size_t i = 0; i < corners.size(); ++i) corners[i] = first + uint32_t(i);
    }
    const bool mirrors = instance.to_world.Mirrors();
    auto add = [&](uint32_t a, uint32_t b, uint32_t c) {
      if (mirrors) std::swap(b, c);
      scene_.triangles.push_back({a, b, c});
    };
    const uint32_t* v = corners.data();
    // In the order of glTF 2.0, 3.7.2.1.
    for (size_t i = 0; i < part.triangles; ++i) {
      if (part.mode == TINYGLTF_MODE_TRIANGLES)
        add(v[3 * i], v[3 * i + 1], v[3 * i + 2]);
      else if (part.mode == TINYGLTF_MODE_TRIANGLE_STRIP)
        add(v[i], v[i + 1 + i % 2], v[i + 2 - i % 2]);
      else
        add(v[i + 1], v[i + 2], v[0]);
    }
    scene_.triangle_material.resize(scene_.triangles.size(), part.material);
  }

  /// What the file has and the scene has not.
  void AddNotes() {
    auto plural = [](uint64_t n, const char* one, const char* many) {
      return fmt::format("{} {}", n, n == 1 ? one : many);
    };
    std::string moves;
    auto add = [&](bool is_there, const char* what) {
      if (is_there) moves += fmt::format("{}{}", moves.empty() ? "" : ", ", what);
    };
    const bool skinned = std::any_of(instances_.begin(), instances_.end(), [&](const Instance& instance) {
      return model_.nodes[size_t(instance.node)].skin >= 0;
    });
    add(has_animations_, "animations");
    add(skinned, "skins");
    add(morph_targets_, "morph targets");
    if (!moves.empty()) Note("not applied: " + moves + "; meshes are as stored");
    std::string& left = left_out_;
    auto leave = [&](uint64_t n, const char* one, const char* many) {
      if (n > 0) left += (left.empty() ? "" : ", ") + plural(n, one, many);
    };
    leave(point_primitives_, "primitive of points", "primitives of points");
    leave(line_primitives_, "primitive of lines", "primitives of lines");
    leave(without_positions_, "primitive without positions", "primitives without positions");
    leave(unused_meshes_, "mesh that no node of the scene uses", "meshes that no node of the scene uses");
    leave(hidden_meshes_, "mesh of a node that is not visible", "meshes of nodes that are not visible");
    leave(orthographic_cameras_, "orthographic camera", "orthographic cameras");
    if (!left.empty()) Note("left out: " + left);
    if (const std::string ignored = GltfIgnoredExtensions(model_.materials); !ignored.empty())
      Note("extensions of materials that are not followed: " + ignored);
    if (without_uvs_ > 0)
      Note(plural(without_uvs_, "primitive has", "primitives have") + " a texture but no coordinates for it");
  }

  const LoadOptions& options_;
  GltfContainer container_;
  nlohmann::json images_;
  bool has_animations_;
  tinygltf::Model model_;
  int zero_view_ = -1;
  Scene scene_;
  GltfAccessors accessors_{model_, zero_view_, container_};
  GltfTextures textures_{model_, images_, container_, accessors_, scene_};
  GltfTypes position_types_ = 0, uv_types_ = 0;
  std::vector<std::optional<GltfLookup>> lookups_;  // by material; see LookupOf()
  std::vector<Instance> instances_;
  std::map<int, Mesh> meshes_;
  std::vector<Block> blocks_;
  std::string left_out_;
  bool has_normals_ = false, has_uvs_ = false, morph_targets_ = false;
  uint64_t point_primitives_ = 0, line_primitives_ = 0, without_positions_ = 0, without_uvs_ = 0,
           unused_meshes_ = 0, orthographic_cameras_ = 0, hidden_meshes_ = 0;
};

Scene ReadGltf(const std::filesystem::path& path, const LoadOptions& options) {
  return GltfReader(path, options).Read();
}

}  // namespace

const Format kGltf = {".gltf", ReadGltf};
const Format kGlb = {".glb", ReadGltf};

}  // namespace raybench
