#include "datasets/gltf/schema.h"

#include <fmt/format.h>

#include <algorithm>
#include <climits>
#include <cmath>
#include <string_view>
#include <vector>

namespace raybench {
namespace {

using nlohmann::json;

enum class Type { kObject, kArray, kString, kBool, kNumber, kNumbers, kIndex, kIndices, kSize };

/// What has to be at a place. In paths "[]" means every element of an array, "{}" every value of an object.
/// Where the holder is not there the rule is not asked.
struct Rule {
  std::string_view path;
  Type type;
  bool required = false;
  size_t length = 0;  // of kNumbers; 0: any
};

// In an order in which holders come before what they hold.
constexpr Rule kRules[] = {
    {"asset", Type::kObject, true},
    {"asset.version", Type::kString, true},
    {"asset.minVersion", Type::kString},
    {"extensions", Type::kObject},
    {"extensionsUsed", Type::kArray},
    {"extensionsUsed[]", Type::kString},
    {"extensionsRequired", Type::kArray},
    {"extensionsRequired[]", Type::kString},
    {"scene", Type::kIndex},
    {"scenes", Type::kArray},
    {"scenes[]", Type::kObject},
    {"scenes[].name", Type::kString},
    {"scenes[].nodes", Type::kIndices},
    {"nodes", Type::kArray},
    {"nodes[]", Type::kObject},
    {"nodes[].name", Type::kString},
    {"nodes[].children", Type::kIndices},
    {"nodes[].mesh", Type::kIndex},
    {"nodes[].camera", Type::kIndex},
    {"nodes[].skin", Type::kIndex},
    {"nodes[].matrix", Type::kNumbers, false, 16},
    {"nodes[].translation", Type::kNumbers, false, 3},
    {"nodes[].rotation", Type::kNumbers, false, 4},
    {"nodes[].scale", Type::kNumbers, false, 3},
    {"nodes[].extensions", Type::kObject},
    {"nodes[].extensions{}", Type::kObject},
    {"nodes[].extensions.KHR_lights_punctual.light", Type::kIndex, true},
    {"nodes[].extensions.KHR_node_visibility.visible", Type::kBool},
    {"nodes[].extensions.EXT_mesh_gpu_instancing.attributes", Type::kObject, true},
    {"nodes[].extensions.EXT_mesh_gpu_instancing.attributes{}", Type::kIndex},
    {"meshes", Type::kArray},
    {"meshes[]", Type::kObject},
    {"meshes[].name", Type::kString},
    {"meshes[].primitives", Type::kArray, true},
    {"meshes[].primitives[]", Type::kObject},
    {"meshes[].primitives[].attributes", Type::kObject, true},
    {"meshes[].primitives[].attributes{}", Type::kIndex},
    {"meshes[].primitives[].indices", Type::kIndex},
    {"meshes[].primitives[].material", Type::kIndex},
    {"meshes[].primitives[].mode", Type::kIndex},
    {"meshes[].primitives[].targets", Type::kArray},
    {"meshes[].primitives[].extensions", Type::kObject},
    {"accessors", Type::kArray},
    {"accessors[]", Type::kObject},
    {"accessors[].bufferView", Type::kIndex},
    {"accessors[].byteOffset", Type::kSize},
    {"accessors[].componentType", Type::kIndex, true},
    {"accessors[].normalized", Type::kBool},
    {"accessors[].count", Type::kSize, true},
    {"accessors[].type", Type::kString, true},
    {"accessors[].sparse", Type::kObject},
    {"accessors[].sparse.count", Type::kIndex, true},
    {"accessors[].sparse.indices", Type::kObject, true},
    {"accessors[].sparse.indices.bufferView", Type::kIndex, true},
    {"accessors[].sparse.indices.byteOffset", Type::kIndex},
    {"accessors[].sparse.indices.componentType", Type::kIndex, true},
    {"accessors[].sparse.values", Type::kObject, true},
    {"accessors[].sparse.values.bufferView", Type::kIndex, true},
    {"accessors[].sparse.values.byteOffset", Type::kIndex},
    {"bufferViews", Type::kArray},
    {"bufferViews[]", Type::kObject},
    {"bufferViews[].buffer", Type::kIndex, true},
    {"bufferViews[].byteOffset", Type::kSize},
    {"bufferViews[].byteLength", Type::kSize, true},
    {"bufferViews[].byteStride", Type::kSize},
    {"bufferViews[].extensions", Type::kObject},
    {"buffers", Type::kArray},
    {"buffers[]", Type::kObject},
    {"buffers[].uri", Type::kString},
    {"buffers[].byteLength", Type::kSize, true},
    {"images", Type::kArray},
    {"images[]", Type::kObject},
    {"images[].name", Type::kString},
    {"images[].uri", Type::kString},
    {"images[].mimeType", Type::kString},
    {"images[].bufferView", Type::kIndex},
    {"samplers", Type::kArray},
    {"samplers[]", Type::kObject},
    {"samplers[].magFilter", Type::kIndex},
    {"samplers[].minFilter", Type::kIndex},
    {"samplers[].wrapS", Type::kIndex},
    {"samplers[].wrapT", Type::kIndex},
    {"textures", Type::kArray},
    {"textures[]", Type::kObject},
    {"textures[].name", Type::kString},
    {"textures[].source", Type::kIndex},
    {"textures[].sampler", Type::kIndex},
    {"textures[].extensions", Type::kObject},
    {"textures[].extensions{}", Type::kObject},
    {"textures[].extensions{}.source", Type::kIndex},
    {"materials", Type::kArray},
    {"materials[]", Type::kObject},
    {"materials[].name", Type::kString},
    {"materials[].alphaMode", Type::kString},
    {"materials[].alphaCutoff", Type::kNumber},
    {"materials[].doubleSided", Type::kBool},
    {"materials[].emissiveFactor", Type::kNumbers, false, 3},
    {"materials[].extensions", Type::kObject},
    {"materials[].extensions{}", Type::kObject},
    {"materials[].extensions.KHR_materials_transmission.transmissionFactor", Type::kNumber},
    {"materials[].extensions.KHR_materials_ior.ior", Type::kNumber},
    {"materials[].extensions.KHR_materials_emissive_strength.emissiveStrength", Type::kNumber},
    {"materials[].extensions.KHR_materials_dispersion.dispersion", Type::kNumber},
    {"materials[].extensions.KHR_materials_volume.thicknessFactor", Type::kNumber},
    {"materials[].emissiveTexture", Type::kObject},
    {"materials[].emissiveTexture.index", Type::kIndex, true},
    {"materials[].emissiveTexture.texCoord", Type::kIndex},
    {"materials[].emissiveTexture.extensions", Type::kObject},
    {"materials[].pbrMetallicRoughness", Type::kObject},
    {"materials[].pbrMetallicRoughness.baseColorFactor", Type::kNumbers, false, 4},
    {"materials[].pbrMetallicRoughness.metallicFactor", Type::kNumber},
    {"materials[].pbrMetallicRoughness.roughnessFactor", Type::kNumber},
    {"materials[].pbrMetallicRoughness.baseColorTexture", Type::kObject},
    {"materials[].pbrMetallicRoughness.baseColorTexture.index", Type::kIndex, true},
    {"materials[].pbrMetallicRoughness.baseColorTexture.texCoord", Type::kIndex},
    {"materials[].pbrMetallicRoughness.baseColorTexture.extensions", Type::kObject},
    {"cameras", Type::kArray},
    {"cameras[]", Type::kObject},
    {"cameras[].type", Type::kString, true},
    {"cameras[].perspective", Type::kObject},
    {"cameras[].perspective.yfov", Type::kNumber, true},
    {"extensions.KHR_lights_punctual", Type::kObject},
    {"extensions.KHR_lights_punctual.lights", Type::kArray, true},
    {"extensions.KHR_lights_punctual.lights[]", Type::kObject},
    {"extensions.KHR_lights_punctual.lights[].type", Type::kString, true},
    {"extensions.KHR_lights_punctual.lights[].color", Type::kNumbers, false, 3},
    {"extensions.KHR_lights_punctual.lights[].intensity", Type::kNumber},
    {"extensions.KHR_lights_punctual.lights[].range", Type::kNumber},
    {"extensions.KHR_lights_punctual.lights[].spot", Type::kObject},
    {"extensions.KHR_lights_punctual.lights[].spot.innerConeAngle", Type::kNumber},
    {"extensions.KHR_lights_punctual.lights[].spot.outerConeAngle", Type::kNumber},
};

const char* Wanted(Type type) {
  switch (type) {
    case Type::kObject:
      return "an object";
    case Type::kArray:
      return "an array";
    case Type::kString:
      return "a string";
    case Type::kBool:
      return "true or false";
    case Type::kNumber:
      return "a number";
    case Type::kNumbers:
      return "an array of numbers";
    case Type::kIndex:
      return "a whole number from 0 to 2147483647";
    case Type::kIndices:
      return "an array of whole numbers from 0 to 2147483647";
    case Type::kSize:
      return "a whole number from 0";
  }
  return "";
}

bool IsWhole(json& value, uint64_t most) {
  if (value.is_number_float()) {
    const double x = value.get<double>();
    if (x >= 0 && x <= 0x1p53 && x == std::floor(x)) value = uint64_t(x);
  }
  return value.is_number_unsigned() && value.get<uint64_t>() <= most;
}

bool IsOf(Type type, json& value, size_t length) {
  auto all = [&](auto&& is_good) { return std::all_of(value.begin(), value.end(), is_good); };
  switch (type) {
    case Type::kObject:
      return value.is_object();
    case Type::kArray:
      return value.is_array();
    case Type::kString:
      return value.is_string();
    case Type::kBool:
      return value.is_boolean();
    case Type::kNumber:
      return value.is_number();
    case Type::kNumbers:
      return value.is_array() && (length == 0 || value.size() == length) &&
             all([](const json& item) { return item.is_number(); });
    case Type::kIndex:
      return IsWhole(value, INT_MAX);
    case Type::kIndices:
      return value.is_array() && all([](json& item) { return IsWhole(item, INT_MAX); });
    case Type::kSize:
      return IsWhole(value, uint64_t{1} << 53);
  }
  return false;
}

/// Where a value stands; written out only where it is wrong.
struct Place {
  const Place* holder = nullptr;
  std::string_view key;
  size_t index = 0;  // where the key is empty

  std::string Text() const {
    if (holder == nullptr) return {};
    const std::string before = holder->Text();
    if (key.empty()) return fmt::format("{}[{}]", before, index);
    return fmt::format("{}{}{}", before, before.empty() ? "" : ".", key.substr(0, 60));
  }
};

/// Asks `rule` of everything below `value` that the rest of its path leads to.
std::string Check(const Rule& rule, std::string_view rest, json& value, const Place& place) {
  if (rest.empty()) {
    if (IsOf(rule.type, value, rule.length)) return {};
    std::string found = value.dump(-1, ' ', true, json::error_handler_t::replace);
    constexpr size_t kMost = 60;
    if (found.size() > kMost) found = found.substr(0, kMost) + "...";
    std::string wanted = Wanted(rule.type);
    if (rule.length > 0) wanted = fmt::format("an array of {} numbers", rule.length);
    return fmt::format("{} is {}; {} is needed", place.Text(), found, wanted);
  }
  if (rest.starts_with("[]")) {
    if (!value.is_array()) return {};
    for (size_t i = 0; i < value.size(); ++i)
      if (std::string error = Check(rule, rest.substr(2), value[i], {&place, {}, i}); !error.empty())
        return error;
    return {};
  }
  if (!value.is_object()) return {};
  if (rest.starts_with("{}")) {
    for (auto& [key, item] : value.items())
      if (std::string error = Check(rule, rest.substr(2), item, {&place, key}); !error.empty()) return error;
    return {};
  }
  if (rest[0] == '.') rest.remove_prefix(1);
  const std::string key(rest.substr(0, rest.find_first_of(".[{")));
  rest.remove_prefix(key.size());
  const Place inner{&place, key};
  auto it = value.find(key);
  if (it != value.end()) return Check(rule, rest, *it, inner);
  if (!rest.empty() || !rule.required) return {};
  return fmt::format("{} is missing; {} is needed", inner.Text(), Wanted(rule.type));
}

/// First of all: an older version has another schema (and 1.0 a number in place of a string).
std::string CheckVersion(const json& root) {
  auto asset = root.find("asset");
  if (asset == root.end() || !asset->is_object()) return {};  // as the rules will say
  for (const char* key : {"version", "minVersion"}) {
    auto version = asset->find(key);
    if (version == asset->end() || !(version->is_string() || version->is_number())) continue;
    const std::string text = version->is_string() ? version->get<std::string>() : version->dump();
    // A later 2.x is read as far as 2.0 goes, unless the file says that this is not enough.
    if (!text.starts_with("2.") || (key == std::string_view("minVersion") && text != "2.0"))
      return fmt::format("is glTF {} (asset.{}); 2.0 is read", text.substr(0, 20), key);
  }
  return {};
}

constexpr char kSave[] = ", which raybench does not read: save it again without mesh compression";

/// Compressed data, wherever their extension stands.
std::string CheckCompression(const json& root) {
  auto uses = [](const json& holder, const char* name) {
    auto extensions = holder.find("extensions");
    return extensions != holder.end() && extensions->contains(name);
  };
  if (auto meshes = root.find("meshes"); meshes != root.end())
    for (const json& mesh : *meshes)
      for (const json& primitive : mesh["primitives"])
        if (uses(primitive, "KHR_draco_mesh_compression"))
          return std::string("uses Draco compression (KHR_draco_mesh_compression)") + kSave;
  if (auto views = root.find("bufferViews"); views != root.end())
    for (const json& view : *views)
      for (const char* name : {"EXT_meshopt_compression", "KHR_meshopt_compression"})
        if (uses(view, name)) return fmt::format("uses meshopt compression ({}){}", name, kSave);
  return {};
}

std::string CheckRequired(const json& root) {
  auto required = root.find("extensionsRequired");
  if (required == root.end()) return {};
  for (const json& item : *required) {
    const std::string& name = item.get_ref<const std::string&>();
    // Read, or without influence on which triangles there are.
    if (name == "KHR_lights_punctual" || name == "KHR_mesh_quantization" || name == "KHR_node_visibility" ||
        name == "EXT_mesh_gpu_instancing" || name.starts_with("KHR_materials_") ||
        name.starts_with("KHR_texture_") || name.starts_with("EXT_texture_") ||
        name.starts_with("MSFT_texture_") || name.starts_with("KHR_xmp"))
      continue;
    return fmt::format("requires the glTF extension {}, which raybench does not read", name.substr(0, 80));
  }
  return {};
}

}  // namespace

std::string CheckGltfSchema(json& root) {
  if (std::string error = CheckVersion(root); !error.empty()) return error;
  for (const Rule& rule : kRules)
    if (std::string error = Check(rule, rule.path, root, {}); !error.empty()) return error;
  if (std::string error = CheckCompression(root); !error.empty()) return error;
  return CheckRequired(root);
}

}  // namespace raybench
