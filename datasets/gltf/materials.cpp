#include "datasets/gltf/materials.h"

#include <fmt/format.h>

#include <algorithm>
#include <climits>
#include <cmath>
#include <numbers>
#include <set>
#include <string_view>

#include "datasets/scene/tangent.h"
#include "datasets/scene/text.h"

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
constexpr char kTransform[] = "KHR_texture_transform";
constexpr double kMaxIor = 1000;  // stands for infinity: all but 0.4 % is mirrored

/// Sine and cosine without libm, so that texture coordinates are the same on every machine.
void Rotation(double angle, double& sine, double& cosine) {
  if (!(std::abs(angle) < 0x1p40)) angle = 0;
  angle -= std::floor(angle / (2 * std::numbers::pi) + 0.5) * (2 * std::numbers::pi);
  const double t = Tangent(angle / 4), s = 2 * t / (1 + t * t), c = (1 - t * t) / (1 + t * t);
  sine = 2 * s * c;
  cosine = c * c - s * s;
}

TextureWrap Wrap(int mode) {
  return mode == TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE     ? TextureWrap::kClampToEdge
         : mode == TINYGLTF_TEXTURE_WRAP_MIRRORED_REPEAT ? TextureWrap::kMirroredRepeat
                                                         : TextureWrap::kRepeat;
}

GltfLookup Lookup(int texture, int set, const tinygltf::Value* transform) {
  GltfLookup out;
  out.texture = texture;
  out.set = set;
  if (transform == nullptr) return out;
  // Offset * rotation * scale. The rotation is counter-clockwise in the picture, whose v points down.
  const tinygltf::Value *offset = Find(transform, "offset"), *scale = Find(transform, "scale");
  const double u = Element(scale, 0, 1), v = Element(scale, 1, 1);
  double sine, cosine;
  Rotation(GltfNumber(*transform, "rotation", 0), sine, cosine);
  out.set = GltfIndex(*transform, "texCoord", out.set);
  out.xx = cosine * u;
  out.xy = sine * v;
  out.x = Element(offset, 0, 0);
  out.yx = -sine * u;
  out.yy = cosine * v;
  out.y = Element(offset, 1, 0);
  out.mapped = out.xx != 1 || out.xy != 0 || out.x != 0 || out.yx != 0 || out.yy != 1 || out.y != 0;
  return out;
}

GltfLookup Lookup(const tinygltf::TextureInfo& info) {
  return Lookup(info.index, info.texCoord, Find(info.extensions, kTransform));
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

Material GltfMaterial(const GltfContainer& container, const tinygltf::Material& m, size_t index) {
  const auto number = [&](const char* extension, const char* key, double fallback) {
    const tinygltf::Value* object = Find(m.extensions, extension);
    const double value = object == nullptr ? fallback : GltfNumber(*object, key, fallback);
    if (!(value >= 0))
      container.Fail(
          fmt::format("material {} has {} {} ({}); at least 0 is needed", index, key, value, extension));
    return value;
  };
  const tinygltf::PbrMetallicRoughness& pbr = m.pbrMetallicRoughness;
  Vec3f base{Channel(pbr.baseColorFactor, 0, 1), Channel(pbr.baseColorFactor, 1, 1),
             Channel(pbr.baseColorFactor, 2, 1)};
  float alpha = Channel(pbr.baseColorFactor, 3, 1);
  float smooth = 1 - Unit(pbr.roughnessFactor), metal = Unit(pbr.metallicFactor);
  double ior = number("KHR_materials_ior", "ior", 1.5);
  if (ior > 0 && ior < 1)
    container.Fail(fmt::format(
        "material {} has ior {} (KHR_materials_ior); 0 (infinite) or at least 1 is needed", index, ior));
  ior = ior == 0 ? kMaxIor : std::min(ior, kMaxIor);
  const double mirrored = (ior - 1) / (ior + 1);
  Vec3f glossy = Vec3f{1, 1, 1} * float(mirrored * mirrored);
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
  Material out;
  out.name = m.name;
  out.alpha = alpha;
  out.alpha_mode = m.alphaMode == "MASK"    ? AlphaMode::kMask
                   : m.alphaMode == "BLEND" ? AlphaMode::kBlend
                                            : AlphaMode::kOpaque;
  out.alpha_cutoff = float(std::clamp(m.alphaCutoff, 0.0, 2.0));  // above 1 nothing is seen

  // What passes through the body of a dielectric; else what a blended surface leaves uncovered.
  const float through = Unit(number("KHR_materials_transmission", "transmissionFactor", 0)) * (1 - metal);
  const bool blends = through == 0 && out.alpha_mode == AlphaMode::kBlend;
  const float covered = blends ? alpha : 1;
  const float mirror = metal * smooth;
  out.reflect = base * (mirror * covered);
  out.diffuse = base * (std::max(0.0f, 1 - mirror - through) * covered);
  out.specular = (base * mirror + glossy * (1 - mirror)) * (smooth * covered);
  out.shininess = 1 + 127 * smooth * smooth;
  const double strength = number("KHR_materials_emissive_strength", "emissiveStrength", 1) * covered;
  for (size_t i = 0; i < 3; ++i)
    if (i < m.emissiveFactor.size())
      out.emission[int(i)] = float(std::clamp(m.emissiveFactor[i] * strength, 0.0, 1e30));
  out.transmit = base * (blends ? 1 - alpha : through);
  if (blends) {
    out.ior = 1;
    out.thin = true;
    return out;
  }
  out.ior = float(ior);
  const double thickness = number("KHR_materials_volume", "thicknessFactor", 0),
               dispersion = number("KHR_materials_dispersion", "dispersion", 0);
  if (through > 0) {
    out.fresnel = true;
    out.thin = m.doubleSided && thickness == 0;
    // Abbe's number is V = 20 / dispersion = (n - 1) / (n_F - n_C), with n_F for blue and n_C for red light.
    const float half = float((ior - 1) * std::min(dispersion / 40, 1.0));
    if (!out.thin) out.dispersion = {-half, 0, half};
  }
  return out;
}

std::string GltfIgnoredExtensions(const std::vector<tinygltf::Material>& materials) {
  constexpr std::string_view kFollowed[] = {
      "KHR_materials_transmission", "KHR_materials_ior",    "KHR_materials_emissive_strength",
      "KHR_materials_dispersion",   "KHR_materials_volume", kSpecularGlossiness};
  std::set<std::string> names;
  for (const tinygltf::Material& m : materials)
    for (const auto& [name, extension] : m.extensions)
      if (std::find(std::begin(kFollowed), std::end(kFollowed), name) == std::end(kFollowed))
        names.insert(OneLine(name.substr(0, 80)));
  return fmt::format("{}", fmt::join(names, ", "));
}

GltfLookup GltfBaseColor(const tinygltf::Material& m) {
  if (const tinygltf::Value* old = Find(Find(m.extensions, kSpecularGlossiness), "diffuseTexture"))
    return Lookup(GltfIndex(*old, "index", -1), GltfIndex(*old, "texCoord", 0),
                  Find(Find(old, "extensions"), kTransform));
  return Lookup(m.pbrMetallicRoughness.baseColorTexture);
}

GltfLookup GltfEmission(const tinygltf::Material& m) { return Lookup(m.emissiveTexture); }

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
  if (out.bytes != nullptr && out.mime_type.empty()) out.mime_type = ImageType(*out.bytes);
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
    out.wrap_u = Wrap(sampler.wrapS);
    out.wrap_v = Wrap(sampler.wrapT);
    if (sampler.magFilter == TINYGLTF_TEXTURE_FILTER_NEAREST) out.filter = TextureFilter::kNearest;
    out.mipmaps = sampler.minFilter != TINYGLTF_TEXTURE_FILTER_NEAREST &&
                  sampler.minFilter != TINYGLTF_TEXTURE_FILTER_LINEAR;
  }
  scene_.textures.push_back(std::move(out));
  return it->second = int32_t(scene_.textures.size() - 1);
}

}  // namespace raybench
