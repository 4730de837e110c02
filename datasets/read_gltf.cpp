// glTF 2.0 through tinygltf: the node hierarchy of the default scene, flattened. What tinygltf hands over is
// not trusted: every index and every byte range is checked here. Skins, morph targets and animations are not
// applied; images are not decoded.

#include <fmt/format.h>
#include <tiny_gltf.h>

#include <cmath>
#include <cstring>
#include <map>
#include <set>

#include "datasets/readers.h"

namespace raybench {
namespace {

/// Affine map, column-major as in glTF: columns x, y, z and the translation.
struct Affine {
  Vec3d x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1}, t{0, 0, 0};

  Vec3d Vector(Vec3d v) const { return x * v.x + y * v.y + z * v.z; }
  Vec3d Point(Vec3d p) const { return Vector(p) + t; }
  Affine operator*(const Affine& b) const { return {Vector(b.x), Vector(b.y), Vector(b.z), Point(b.t)}; }
};

/// Tangent from the Taylor series and the double-angle formula, so that cameras are the same with every libm.
double Tangent(double angle) {
  double h = angle / 64, h2 = h * h;
  double t = h * (1 + h2 * (1.0 / 3 + h2 * (2.0 / 15 + h2 * (17.0 / 315 + h2 * (62.0 / 2835)))));
  for (int i = 0; i < 6; ++i) t = 2 * t / (1 - t * t);
  return t;
}

bool IgnoreImage(tinygltf::Image*, int, std::string*, std::string*, int, int, const unsigned char*, int,
                 void*) {
  return true;
}

constexpr char kDraco[] = "KHR_draco_mesh_compression";

class GltfReader {
 public:
  GltfReader(const std::filesystem::path& path, const LoadOptions& options)
      : path_(path.string()), options_(options) {
    scene_.provenance.source = path_;
  }

  Scene Read() {
    Parse();
    CheckExtensions();
    for (const tinygltf::Material& m : model_.materials) AddMaterial(m);
    CountInstances();
    Walk();
    return std::move(scene_);
  }

 private:
  [[noreturn]] void Fail(const std::string& what) const { throw InputError(path_ + ": " + OneLine(what)); }

  template <class T>
  const T& At(const std::vector<T>& items, int64_t index, const char* what) const {
    if (index < 0 || size_t(index) >= items.size())
      Fail(fmt::format("refers to {} {}; there are {}", what, index, items.size()));
    return items[size_t(index)];
  }

  void Parse() {
    std::string bytes = ReadFile(path_);
    bool binary = bytes.starts_with("glTF");
    tinygltf::TinyGLTF loader;
    loader.SetImageLoader(IgnoreImage, nullptr);
    std::string error, warning;
    bool ok = false;
    if (bytes.size() > std::numeric_limits<uint32_t>::max()) Fail("is larger than 4 GiB, the limit of glTF");
    auto folder = std::filesystem::path(path_).parent_path().string();
    try {
      ok = binary ? loader.LoadBinaryFromMemory(&model_, &error, &warning,
                                                reinterpret_cast<const unsigned char*>(bytes.data()),
                                                unsigned(bytes.size()), folder)
                  : loader.LoadASCIIFromString(&model_, &error, &warning, bytes.data(),
                                               unsigned(bytes.size()), folder);
    } catch (const std::exception& e) {
      error = e.what();
    }
    if (!ok) {
      // tinygltf may stumble over the accessors without data that such files have.
      if (bytes.find(kDraco) != bytes.npos) FailDraco();
      if (error.empty()) error = warning.empty() ? "unknown error" : warning;
      Fail("is not valid glTF: " + error);
    }
  }

  void CheckExtensions() const {
    for (const tinygltf::Mesh& mesh : model_.meshes)
      for (const tinygltf::Primitive& p : mesh.primitives)
        if (p.extensions.count(kDraco)) FailDraco();
    for (const std::string& name : model_.extensionsRequired) {
      if (name == kDraco) FailDraco();
      // These change how surfaces look, not which triangles there are.
      if (name.starts_with("KHR_materials_") || name.starts_with("KHR_texture_") ||
          name.starts_with("EXT_texture_") || name == "KHR_lights_punctual" ||
          name == "KHR_mesh_quantization" || name.starts_with("KHR_xmp"))
        continue;
      Fail(fmt::format("requires the glTF extension {}, which raybench does not read", name));
    }
  }

  [[noreturn]] void FailDraco() const {
    Fail(
        "uses Draco compression (KHR_draco_mesh_compression), which raybench does not read: save it again "
        "without "
        "mesh compression");
  }

  /// A Whitted material that stands for metallic-roughness: the smoother a metal, the more it is a mirror.
  void AddMaterial(const tinygltf::Material& m) {
    const tinygltf::PbrMetallicRoughness& pbr = m.pbrMetallicRoughness;
    auto unit = [](double v) { return float(std::isfinite(v) ? std::clamp(v, 0.0, 1.0) : 0.0); };
    auto factor = [&](const std::vector<double>& v, size_t i, double fallback) {
      return unit(i < v.size() ? v[i] : fallback);
    };
    Vec3f base{factor(pbr.baseColorFactor, 0, 1), factor(pbr.baseColorFactor, 1, 1),
               factor(pbr.baseColorFactor, 2, 1)};
    float smooth = 1 - unit(pbr.roughnessFactor), mirror = unit(pbr.metallicFactor) * smooth;
    Material out;
    out.name = m.name;
    out.reflect = base * mirror;
    out.diffuse = base * (1 - mirror);
    out.specular = (base * mirror + Vec3f{0.04f, 0.04f, 0.04f} * (1 - mirror)) * smooth;
    out.shininess = 1 + 127 * smooth * smooth;
    out.emission = {factor(m.emissiveFactor, 0, 0), factor(m.emissiveFactor, 1, 0),
                    factor(m.emissiveFactor, 2, 0)};
    float through = m.alphaMode == "BLEND" ? 1 - factor(pbr.baseColorFactor, 3, 1) : 0.0f;
    out.ior = 1;  // blending does not bend the ray
    if (auto it = m.extensions.find("KHR_materials_transmission"); it != m.extensions.end()) {
      through = unit(Number(it->second, "transmissionFactor", 0));
      out.ior = 1.5f;
      if (auto ior = m.extensions.find("KHR_materials_ior"); ior != m.extensions.end())
        out.ior = float(std::clamp(Number(ior->second, "ior", 1.5), 1.0, 4.0));
    }
    out.transmit = base * through;
    out.diffuse = out.diffuse * (1 - through);
    scene_.materials.push_back(out);
  }

  static double Number(const tinygltf::Value& value, const char* key, double fallback) {
    if (!value.IsObject() || !value.Has(key) || !value.Get(key).IsNumber()) return fallback;
    return value.Get(key).GetNumberAsDouble();
  }

  uint32_t MaterialOf(const tinygltf::Primitive& primitive) {
    if (primitive.material >= 0) {
      At(model_.materials, primitive.material, "material");
      return uint32_t(primitive.material);
    }
    if (scene_.materials.size() == model_.materials.size()) scene_.materials.emplace_back().name = "default";
    return uint32_t(model_.materials.size());
  }

  // --- Accessors
  // ---------------------------------------------------------------------------------------------

  struct View {
    const unsigned char* data;
    uint64_t stride;
  };

  /// `count` elements of `size` bytes at `offset` in a buffer view; all of them lie inside the buffer.
  View Elements(int view_index, uint64_t offset, uint64_t count, uint64_t size,
                const std::string& what) const {
    const tinygltf::BufferView& view = At(model_.bufferViews, view_index, "buffer view");
    const tinygltf::Buffer& buffer = At(model_.buffers, view.buffer, "buffer");
    uint64_t stride = view.byteStride == 0 ? size : view.byteStride;
    bool fits = view.byteOffset <= buffer.data.size() &&
                view.byteLength <= buffer.data.size() - view.byteOffset && stride >= size && stride <= 255 &&
                count <= buffer.data.size() / size && offset <= view.byteLength &&
                (count == 0 || (count - 1) * stride + size <= view.byteLength - offset);
    if (!fits)
      Fail(fmt::format(
          "{} needs {} elements of {} bytes (stride {}) at offset {} of buffer view {}, which has {} bytes "
          "in a buffer of {}",
          what, count, size, stride, offset, view_index, view.byteLength, buffer.data.size()));
    return {buffer.data.data() + view.byteOffset + offset, stride};
  }

  /// The accessor's elements as T, with sparse replacements.
  template <class T>
  std::vector<T> ReadAccessor(const tinygltf::Accessor& a, const std::string& what) const {
    if (a.bufferView < 0 && !a.sparse.isSparse) Fail(what + " has no buffer view");
    if (a.count > (uint64_t{1} << 32))
      Fail(fmt::format("{} has {} elements; at most 2^32 are allowed", what, a.count));
    std::vector<T> items;
    if (a.bufferView >= 0) {
      View view = Elements(a.bufferView, a.byteOffset, a.count, sizeof(T), what);
      items.resize(a.count);
      for (size_t i = 0; i < a.count; ++i) std::memcpy(&items[i], view.data + i * view.stride, sizeof(T));
    } else {
      items.resize(a.count, T{});
    }
    if (a.sparse.isSparse) {
      uint64_t n = uint64_t(std::max(a.sparse.count, 0));
      int size = tinygltf::GetComponentSizeInBytes(uint32_t(a.sparse.indices.componentType));
      if (size != 1 && size != 2 && size != 4)
        Fail(what + " has sparse indices of a type that is not allowed");
      View indices = Elements(a.sparse.indices.bufferView, uint64_t(a.sparse.indices.byteOffset), n,
                              uint64_t(size), what);
      View values =
          Elements(a.sparse.values.bufferView, uint64_t(a.sparse.values.byteOffset), n, sizeof(T), what);
      for (uint64_t i = 0; i < n; ++i) {
        uint32_t index = 0;
        std::memcpy(&index, indices.data + i * indices.stride, size_t(size));
        if (index >= items.size())
          Fail(fmt::format("{} has the sparse index {}; it has {} elements", what, index, items.size()));
        std::memcpy(&items[index], values.data + i * values.stride, sizeof(T));
      }
    }
    return items;
  }

  struct Triangles {
    int positions = -1;  // accessor
    uint32_t material = 0;
    std::vector<std::array<uint32_t, 3>> indices;
  };

  const std::vector<Vec3f>& Positions(int accessor_index) {
    auto [it, is_new] = positions_.try_emplace(accessor_index);
    if (is_new) {
      const tinygltf::Accessor& a = At(model_.accessors, accessor_index, "accessor");
      std::string what = fmt::format("accessor {} (POSITION)", accessor_index);
      if (a.type != TINYGLTF_TYPE_VEC3 || a.componentType != TINYGLTF_COMPONENT_TYPE_FLOAT)
        Fail(what + " is not of type VEC3 of float, the only one read for positions");
      it->second = ReadAccessor<Vec3f>(a, what);
      for (size_t i = 0; i < it->second.size() && !options_.drop_bad; ++i) {
        Vec3f p = it->second[i];
        if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z))
          Fail(fmt::format("vertex {} of {} is ({}, {}, {}); coordinates must be finite", i, what, p.x, p.y,
                           p.z));
      }
    }
    return it->second;
  }

  std::vector<uint32_t> Indices(const tinygltf::Primitive& primitive, size_t vertex_count) const {
    std::vector<uint32_t> indices;
    if (primitive.indices < 0) {
      indices.resize(vertex_count);
      for (size_t i = 0; i < vertex_count; ++i) indices[i] = uint32_t(i);
      return indices;
    }
    const tinygltf::Accessor& a = At(model_.accessors, primitive.indices, "accessor");
    std::string what = fmt::format("accessor {} (indices)", primitive.indices);
    auto widen = [&](const auto& narrow) { indices.assign(narrow.begin(), narrow.end()); };
    if (a.type != TINYGLTF_TYPE_SCALAR) Fail(what + " is not of type SCALAR");
    switch (a.componentType) {
      case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
        widen(ReadAccessor<uint8_t>(a, what));
        break;
      case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
        widen(ReadAccessor<uint16_t>(a, what));
        break;
      case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
        indices = ReadAccessor<uint32_t>(a, what);
        break;
      default:
        Fail(what + " is not of an unsigned integer type");
    }
    for (size_t i = 0; i < indices.size(); ++i) {
      if (indices[i] < vertex_count) continue;
      if (!options_.drop_bad)
        Fail(fmt::format("element {} of {} refers to vertex {}; allowed are 0 to {}", i, what, indices[i],
                         int64_t(vertex_count) - 1));
      indices[i] = RAYBENCH_NONE;
    }
    return indices;
  }

  /// The triangles of a mesh, read once however often it is instanced.
  const std::vector<Triangles>& Mesh(int mesh_index) {
    auto [it, is_new] = meshes_.try_emplace(mesh_index);
    if (!is_new) return it->second;
    for (const tinygltf::Primitive& p : At(model_.meshes, mesh_index, "mesh").primitives) {
      int mode = p.mode < 0 ? TINYGLTF_MODE_TRIANGLES : p.mode;
      if (mode > TINYGLTF_MODE_TRIANGLE_FAN)
        Fail(fmt::format("mesh {} has the unknown primitive mode {}", mesh_index, mode));
      if (mode < TINYGLTF_MODE_TRIANGLES) continue;  // points and lines
      auto attribute = p.attributes.find("POSITION");
      if (attribute == p.attributes.end()) continue;  // the specification: to be left out
      Triangles out;
      out.positions = attribute->second;
      std::vector<uint32_t> v = Indices(p, Positions(out.positions).size());
      if (mode == TINYGLTF_MODE_TRIANGLES) {
        if (v.size() % 3 != 0)
          Fail(fmt::format("mesh {} has triangles of {} indices; a multiple of 3 is needed", mesh_index,
                           v.size()));
        for (size_t i = 0; i + 2 < v.size(); i += 3) out.indices.push_back({v[i], v[i + 1], v[i + 2]});
      } else if (mode == TINYGLTF_MODE_TRIANGLE_STRIP) {
        for (size_t i = 0; i + 2 < v.size(); ++i)
          out.indices.push_back({v[i], v[i + 1 + i % 2], v[i + 2 - i % 2]});
      } else {
        for (size_t i = 1; i + 1 < v.size(); ++i) out.indices.push_back({v[i], v[i + 1], v[0]});
      }
      if (!out.indices.empty()) {
        out.material = MaterialOf(p);
        it->second.push_back(std::move(out));
      }
    }
    return it->second;
  }

  // --- Nodes
  // -------------------------------------------------------------------------------------------------

  std::vector<int> Roots() const {
    if (!model_.scenes.empty()) return At(model_.scenes, std::max(model_.defaultScene, 0), "scene").nodes;
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

  /// Calls f(node index) in depth-first order of the file, parents first. Without recursion, and each node
  /// once: glTF demands strict trees, and a cycle or a node of two parents is an error.
  template <class F>
  void ForEachNode(const F& f) const {
    std::vector<bool> seen(model_.nodes.size());
    std::vector<int> stack = Roots();
    std::reverse(stack.begin(), stack.end());
    while (!stack.empty()) {
      int index = stack.back();
      stack.pop_back();
      const tinygltf::Node& node = At(model_.nodes, index, "node");
      if (seen[size_t(index)])
        Fail(fmt::format("node {} is reached twice; glTF nodes must form trees, without cycles", index));
      seen[size_t(index)] = true;
      f(index);
      stack.insert(stack.end(), node.children.rbegin(), node.children.rend());
    }
  }

  void CountInstances() {
    std::map<int, uint64_t> uses;
    uint64_t vertices = 0;
    ForEachNode([&](int index) {
      int mesh = model_.nodes[size_t(index)].mesh;
      if (mesh < 0) return;
      ++scene_.stats.instances;
      uint64_t count = 0;
      std::set<int> accessors;
      for (const Triangles& t : Mesh(mesh)) {
        count += t.indices.size();
        if (accessors.insert(t.positions).second) vertices += Positions(t.positions).size();
      }
      if (uses[mesh]++ > 0) scene_.stats.shared_triangles += count;
      scene_.stats.faces += count;
    });
    if (vertices >= RAYBENCH_NONE || scene_.stats.faces >= RAYBENCH_NONE)
      Fail(fmt::format("has {} vertices and {} triangles with all instances; fewer than {} are allowed",
                       vertices, scene_.stats.faces, RAYBENCH_NONE));
    scene_.positions.reserve(vertices + 2);
    scene_.triangles.reserve(scene_.stats.faces);
    scene_.triangle_material.reserve(scene_.stats.faces);
  }

  Affine LocalTransform(const tinygltf::Node& node, int index) const {
    auto expect = [&](const std::vector<double>& v, size_t n, const char* what) {
      if (!v.empty() && v.size() != n)
        Fail(fmt::format("node {} has a {} of {} numbers; {} are needed", index, what, v.size(), n));
      return !v.empty();
    };
    const std::vector<double>&m = node.matrix, &t = node.translation, &q = node.rotation, &s = node.scale;
    if (expect(m, 16, "matrix"))
      return {{m[0], m[1], m[2]}, {m[4], m[5], m[6]}, {m[8], m[9], m[10]}, {m[12], m[13], m[14]}};
    Affine a;
    if (expect(q, 4, "rotation")) {
      double length2 = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
      if (!(length2 > 0)) Fail(fmt::format("node {} has the rotation 0", index));
      double x = q[0], y = q[1], z = q[2], w = q[3], f = 2 / length2;
      a.x = {1 - f * (y * y + z * z), f * (x * y + z * w), f * (x * z - y * w)};
      a.y = {f * (x * y - z * w), 1 - f * (x * x + z * z), f * (y * z + x * w)};
      a.z = {f * (x * z + y * w), f * (y * z - x * w), 1 - f * (x * x + y * y)};
    }
    if (expect(s, 3, "scale")) a.x = a.x * s[0], a.y = a.y * s[1], a.z = a.z * s[2];
    if (expect(t, 3, "translation")) a.t = {t[0], t[1], t[2]};
    return a;
  }

  void Walk() {
    std::vector<Affine> world(model_.nodes.size());
    std::vector<int> parent(model_.nodes.size(), -1);
    uint64_t done = 0;
    ForEachNode([&](int index) {
      const tinygltf::Node& node = model_.nodes[size_t(index)];
      for (int child : node.children) {
        At(model_.nodes, child, "node");
        parent[size_t(child)] = index;
      }
      Affine local = LocalTransform(node, index);
      int p = parent[size_t(index)];
      const Affine& to_world = world[size_t(index)] = p < 0 ? local : world[size_t(p)] * local;
      if (node.mesh >= 0) AddInstance(Mesh(node.mesh), to_world);
      if (node.camera >= 0) AddCamera(At(model_.cameras, node.camera, "camera"), to_world, index);
      if (auto it = node.extensions.find("KHR_lights_punctual"); it != node.extensions.end())
        AddLight(At(model_.lights, int64_t(Number(it->second, "light", -1)), "light"), to_world);
      if (options_.progress) options_.progress(double(++done) / double(model_.nodes.size()));
    });
  }

  void AddInstance(const std::vector<Triangles>& mesh, const Affine& to_world) {
    std::map<int, uint32_t> first;  // where each accessor's vertices start in this instance
    for (const Triangles& part : mesh) {
      auto [it, is_new] = first.try_emplace(part.positions, uint32_t(scene_.positions.size()));
      if (is_new)
        for (Vec3f p : Positions(part.positions))
          scene_.positions.push_back(ToFloat(to_world.Point(ToDouble(p))));
      for (std::array<uint32_t, 3> t : part.indices) {
        for (uint32_t& v : t)
          if (v != RAYBENCH_NONE) v += it->second;
        scene_.triangles.push_back(t);
        scene_.triangle_material.push_back(part.material);
      }
    }
  }

  void AddCamera(const tinygltf::Camera& camera, const Affine& to_world, int node) {
    if (camera.type != "perspective") return;
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

  /// Point and spot lights, both as point lights. A light at infinity has no place in this model.
  void AddLight(const tinygltf::Light& light, const Affine& to_world) {
    if (light.type != "point" && light.type != "spot") return;
    auto channel = [&](size_t i) {
      return float((i < light.color.size() ? light.color[i] : 1.0) * light.intensity);
    };
    scene_.lights.push_back({ToFloat(to_world.t), {channel(0), channel(1), channel(2)}, true});
  }

  std::string path_;
  const LoadOptions& options_;
  tinygltf::Model model_;
  Scene scene_;
  std::map<int, std::vector<Vec3f>> positions_;
  std::map<int, std::vector<Triangles>> meshes_;
};

}  // namespace

Scene ReadGltf(const std::filesystem::path& path, const LoadOptions& options) {
  Scene scene = GltfReader(path, options).Read();
  if (scene.triangles.empty()) throw InputError(path.string() + ": has no triangles in its default scene");
  return scene;
}

}  // namespace raybench
