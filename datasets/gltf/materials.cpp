#include "datasets/gltf/materials.h"

#include <fmt/format.h>

#include <climits>
#include <cmath>
#include <numbers>

#include "datasets/tangent.h"

namespace raybench {
namespace {

float Unit(double value) { return float(std::isfinite(value) ? std::clamp(value, 0.0, 1.0) : 0.0); }

const tinygltf::Value* Find(const tinygltf::ExtensionMap& extensions, const char* name) {
  auto it = extensions.find(name);
  return it != extensions.end() && it->second.IsObject() ? &it->second : nullptr;
}

const tinygltf::Value* Find(const tinygltf::Value* object, const char* key) {
  return object != nullptr && object->IsObject() && object->Has(key) ? &object->Get(key) : nullptr;
}

double Element(const tinygltf::Value* array, int i, double fallback) {
  if (array == nullptr || !array->IsArray() || size_t(i) >= array->ArrayLen()) return fallback;
  const tinygltf::Value& value = array->Get(i);
  return value.IsNumber() ? value.GetNumberAsDouble() : fallback;
}

float Channel(const std::vector<double>& values, size_t i, double fallback) {
  return Unit(i < values.size() ? values[i] : fallback);
}

constexpr char kSpecularGlossiness[] = "KHR_materials_pbrSpecularGlossiness";

/// Sine and cosine without libm, so that texture coordinates are the same on every machine.
void Rotation(double angle, double& sine, double& cosine) {
  if (!(std::abs(angle) < 0x1p40)) angle = 0;
  angle -= std::floor(angle / (2 * std::numbers::pi) + 0.5) * (2 * std::numbers::pi);
  const double t = Tangent(angle / 4), s = 2 * t / (1 + t * t), c = (1 - t * t) / (1 + t * t);
  sine = 2 * s * c, cosine = c * c - s * s;
}

TextureWrap Wrap(int mode) {
  return mode == TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE     ? TextureWrap::kClampToEdge
         : mode == TINYGLTF_TEXTURE_WRAP_MIRRORED_REPEAT ? TextureWrap::kMirroredRepeat
                                                         : TextureWrap::kRepeat;
}

std::string SniffedType(std::string_view bytes) {
  using namespace std::string_view_literals;
  if (bytes.starts_with("\x89PNG")) return "image/png";
  if (bytes.starts_with("\xFF\xD8\xFF")) return "image/jpeg";
  if (bytes.starts_with("RIFF") && bytes.substr(8).starts_with("WEBP")) return "image/webp";
  if (bytes.starts_with("\xABKTX 20\xBB"sv)) return "image/ktx2";
  if (bytes.starts_with("DDS ")) return "image/vnd-ms.dds";
  if (bytes.starts_with("GIF8")) return "image/gif";
  if (bytes.starts_with("BM")) return "image/bmp";
  return {};
}

}  // namespace

double GltfNumber(const tinygltf::Value& object, const char* key, double fallback) {
  const tinygltf::Value* value = Find(&object, key);
  return value != nullptr && value->IsNumber() ? value->GetNumberAsDouble() : fallback;
}

int GltfIndex(const tinygltf::Value& object, const char* key, int fallback) {
  const double number = GltfNumber(object, key, fallback);
  return number == fallback ? fallback : number >= 0 && number < INT_MAX ? int(number) : INT_MAX;
}

Material GltfMaterial(const tinygltf::Material& m) {
  const tinygltf::PbrMetallicRoughness& pbr = m.pbrMetallicRoughness;
  Vec3f base{Channel(pbr.baseColorFactor, 0, 1), Channel(pbr.baseColorFactor, 1, 1),
             Channel(pbr.baseColorFactor, 2, 1)};
  float alpha = Channel(pbr.baseColorFactor, 3, 1);
  float smooth = 1 - Unit(pbr.roughnessFactor), metal = Unit(pbr.metallicFactor);
  Vec3f glossy{0.04f, 0.04f, 0.04f};
  if (const tinygltf::Value* old = Find(m.extensions, kSpecularGlossiness)) {
    const tinygltf::Value *diffuse = Find(old, "diffuseFactor"), *specular = Find(old, "specularFactor");
    for (int i = 0; i < 3; ++i) {
      base[i] = Unit(Element(diffuse, i, 1));
      glossy[i] = Unit(Element(specular, i, 1));
    }
    alpha = Unit(Element(diffuse, 3, 1));
    smooth = Unit(GltfNumber(*old, "glossinessFactor", 1));
    metal = 0;
  }
  const float mirror = metal * smooth;
  Material out;
  out.name = m.name;
  out.reflect = base * mirror;
  out.diffuse = base * (1 - mirror);
  out.specular = (base * mirror + glossy * (1 - mirror)) * smooth;
  out.shininess = 1 + 127 * smooth * smooth;
  for (int i = 0; i < 3; ++i) out.emission[i] = Channel(m.emissiveFactor, size_t(i), 0);
  out.alpha = alpha;
  out.alpha_mode = m.alphaMode == "MASK"    ? AlphaMode::kMask
                   : m.alphaMode == "BLEND" ? AlphaMode::kBlend
                                            : AlphaMode::kOpaque;
  out.alpha_cutoff = float(std::clamp(m.alphaCutoff, 0.0, 2.0));  // above 1 nothing is seen
  float through = out.alpha_mode == AlphaMode::kBlend ? 1 - alpha : 0.0f;
  out.ior = 1;  // blending does not bend the ray
  if (const tinygltf::Value* transmission = Find(m.extensions, "KHR_materials_transmission")) {
    through = Unit(GltfNumber(*transmission, "transmissionFactor", 0));
    const tinygltf::Value* ior = Find(m.extensions, "KHR_materials_ior");
    out.ior = ior != nullptr ? float(std::clamp(GltfNumber(*ior, "ior", 1.5), 1.0, 4.0)) : 1.5f;
  }
  out.transmit = base * through;
  out.diffuse = out.diffuse * (1 - through);
  return out;
}

GltfLookup GltfBaseColor(const tinygltf::Material& m) {
  GltfLookup out;
  const tinygltf::Value* transform = nullptr;
  if (const tinygltf::Value* old = Find(Find(m.extensions, kSpecularGlossiness), "diffuseTexture")) {
    out.texture = GltfIndex(*old, "index", -1);
    out.set = GltfIndex(*old, "texCoord", 0);
    transform = Find(Find(old, "extensions"), "KHR_texture_transform");
  } else {
    const tinygltf::TextureInfo& info = m.pbrMetallicRoughness.baseColorTexture;
    out.texture = info.index;
    out.set = info.texCoord;
    transform = Find(info.extensions, "KHR_texture_transform");
  }
  if (transform == nullptr) return out;
  // Offset * rotation * scale. The rotation is counter-clockwise in the picture, whose v points down.
  const tinygltf::Value *offset = Find(transform, "offset"), *scale = Find(transform, "scale");
  const double u = Element(scale, 0, 1), v = Element(scale, 1, 1);
  double sine, cosine;
  Rotation(GltfNumber(*transform, "rotation", 0), sine, cosine);
  out.set = GltfIndex(*transform, "texCoord", out.set);
  out.xx = cosine * u, out.xy = sine * v, out.x = Element(offset, 0, 0);
  out.yx = -sine * u, out.yy = cosine * v, out.y = Element(offset, 1, 0);
  out.mapped = out.xx != 1 || out.xy != 0 || out.x != 0 || out.yx != 0 || out.yy != 1 || out.y != 0;
  return out;
}

/// The bytes are null where the file is not there.
const GltfResource& GltfTextures::Image(int64_t index) {
  auto [it, is_new] = resources_.try_emplace(index);
  GltfResource& out = it->second;
  if (!is_new) return out;
  if (index < 0 || size_t(index) >= images_.size())
    container_.Fail(fmt::format("refers to image {}; there are {}", index, images_.size()));
  const nlohmann::json& image = images_[size_t(index)];
  const std::string what = fmt::format("image {}", index);
  if (image.contains("uri")) {
    out = container_.Resource(image["uri"].get_ref<const std::string&>(), what, UINT64_MAX);
  } else if (image.contains("bufferView")) {
    const int view = image["bufferView"].get<int>();
    out.bytes = std::make_shared<std::string>(accessors_.View(view, what));
    out.source = fmt::format("{} (buffer view {})", what, view);
  } else {
    container_.Fail(what + " has neither a URI nor a buffer view");
  }
  if (image.contains("mimeType")) out.mime_type = image["mimeType"].get<std::string>();
  if (out.bytes != nullptr && out.mime_type.empty()) out.mime_type = SniffedType(*out.bytes);
  return out;
}

int32_t GltfTextures::Load(int index) {
  if (index < 0 || size_t(index) >= model_.textures.size())
    container_.Fail(fmt::format("refers to texture {}; there are {}", index, model_.textures.size()));
  auto [it, is_new] = textures_.try_emplace(index, -1);
  if (!is_new) return it->second;
  const tinygltf::Texture& texture = model_.textures[size_t(index)];
  int64_t source = texture.source;
  // Other encodings name their image in an extension; the picture in the core is their fallback.
  for (const auto& [name, extension] : texture.extensions)
    if (source < 0) source = GltfIndex(extension, "source", -1);
  if (source < 0) {
    scene_.stats.notes.push_back(fmt::format("texture {} has no image and is not used", index));
    return -1;
  }
  const GltfResource& image = Image(source);
  if (image.bytes == nullptr || image.bytes->empty()) {
    scene_.stats.notes.push_back(fmt::format("texture {} is not used: {} is {}", index, image.source,
                                             image.bytes == nullptr ? "missing" : "empty"));
    return -1;
  }
  Texture out;
  out.name = !texture.name.empty() ? texture.name : images_[size_t(source)].value("name", std::string());
  out.source = image.source;
  out.mime_type = image.mime_type;
  out.bytes = image.bytes;
  if (texture.sampler >= 0) {
    if (size_t(texture.sampler) >= model_.samplers.size())
      container_.Fail(fmt::format("texture {} refers to sampler {}; there are {}", index, texture.sampler,
                                  model_.samplers.size()));
    const tinygltf::Sampler& sampler = model_.samplers[size_t(texture.sampler)];
    out.wrap_u = Wrap(sampler.wrapS), out.wrap_v = Wrap(sampler.wrapT);
    if (sampler.magFilter == TINYGLTF_TEXTURE_FILTER_NEAREST) out.filter = TextureFilter::kNearest;
    out.mipmaps = sampler.minFilter != TINYGLTF_TEXTURE_FILTER_NEAREST &&
                  sampler.minFilter != TINYGLTF_TEXTURE_FILTER_LINEAR;
  }
  scene_.textures.push_back(std::move(out));
  return it->second = int32_t(scene_.textures.size() - 1);
}

}  // namespace raybench
