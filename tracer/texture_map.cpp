#include "tracer/texture_map.h"

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <string>
#include <string_view>

#include "accel/parameters.h"
#include "datasets/memory.h"
#include "tracer/oiio.h"

namespace raybench {
namespace {

const std::array<float, 256>& SrgbTable() {
  static const std::array<float, 256> table = [] {
    std::array<float, 256> t;
    for (size_t i = 0; i < t.size(); ++i) t[i] = FromSrgb(double(i) / 255);
    return t;
  }();
  return table;
}

/// A file name that tells OpenImageIO which reader to take; by the first bytes, for names and types may lie.
std::string NameFor(const std::string& bytes) {
  const auto begins = [&](std::string_view magic) { return std::string_view(bytes).starts_with(magic); };
  if (begins("\x89PNG")) return "texture.png";
  if (begins("\xFF\xD8")) return "texture.jpg";
  if (begins("\x76\x2F\x31\x01")) return "texture.exr";
  if (begins("#?")) return "texture.hdr";
  if (begins("RIFF")) return "texture.webp";
  if (begins("DDS ")) return "texture.dds";
  if (begins("BM")) return "texture.bmp";
  if (begins("GIF8")) return "texture.gif";
  if (begins("II*") || begins("MM")) return "texture.tif";
  if (begins("P")) return "texture.ppm";
  return "texture.tga";  // has no mark of its own
}

/// Spreads `channels` numbers a pixel (grey, grey and alpha, RGB, RGBA; more are ignored) to four.
template <class T>
std::vector<T> ToRgba(const std::vector<T>& from, size_t channels, T one) {
  std::vector<T> to(from.size() / channels * 4);
  for (size_t i = 0, n = to.size() / 4; i < n; ++i) {
    const T* const p = &from[i * channels];
    T* const q = &to[4 * i];
    const bool gray = channels < 3;
    q[0] = p[0], q[1] = gray ? p[0] : p[1], q[2] = gray ? p[0] : p[2];
    q[3] = channels == 2 ? p[1] : channels >= 4 ? p[3] : one;
  }
  return to;
}

/// u folded into [0, 1] by the rule for what lies outside.
double Fold(double u, TextureWrap wrap) {
  if (!(std::fabs(u) < 1e9)) return 0;
  switch (wrap) {
    case TextureWrap::kRepeat:
      return u - std::floor(u);
    case TextureWrap::kClampToEdge:
      break;
    case TextureWrap::kMirroredRepeat:
      u -= 2 * std::floor(u / 2);
      return u > 1 ? 2 - u : u;
  }
  return std::clamp(u, 0.0, 1.0);
}

/// The texels on either side of a folded coordinate, and the second one's share.
struct Neighbours {
  uint32_t first, second;
  float share;

  Neighbours(double u, uint32_t size, TextureWrap wrap, TextureFilter filter) {
    const auto n = int64_t(size);
    if (filter == TextureFilter::kNearest) {
      first = second = uint32_t(std::min(int64_t(u * double(n)), n - 1));
      share = 0;
      return;
    }
    const double x = u * double(n) - 0.5, low = std::floor(x);
    share = float(x - low);
    const auto inside = [&](int64_t i) {
      if (wrap == TextureWrap::kRepeat) return uint32_t((i + n) % n);
      return uint32_t(std::clamp(i, int64_t{0}, n - 1));  // mirrored: the border texel is its own neighbour
    };
    first = inside(int64_t(low)), second = inside(int64_t(low) + 1);
  }
};

Texel Mix(const Texel& a, const Texel& b, float share) {
  return {a.color * (1 - share) + b.color * share, a.alpha * (1 - share) + b.alpha * share};
}

}  // namespace

std::shared_ptr<const TextureMap::Pixels> TextureMap::Decode(const Texture& texture) {
  const auto fail = [&](const std::string& why) {
    throw InputError("texture " + texture.source + " cannot be read: " + why);
  };
  OIIO::Filesystem::IOMemReader memory(texture.bytes->data(), texture.bytes->size());
  OIIO::ImageSpec config, spec;
  config["oiio:UnassociatedAlpha"] = 1;
  const std::string name = NameFor(*texture.bytes);
  const auto input = OIIO::ImageInput::create(name, false, nullptr, &memory);
  if (!input) fail(FirstLine(OIIO::geterror()));
  if (!input->set_ioproxy(&memory) || !input->open(name, spec, config)) fail(FirstLine(input->geterror()));
  if (spec.width < 1 || spec.height < 1 || spec.depth > 1 || spec.nchannels < 1)
    fail("it is no flat picture of at least one pixel");
  auto pixels = std::make_shared<Pixels>();
  pixels->width = uint32_t(spec.width), pixels->height = uint32_t(spec.height);
  const auto channels = size_t(spec.nchannels), count = size_t{pixels->width} * pixels->height;
  const bool bytes = spec.format == OIIO::TypeDesc::UINT8;
  RequireMemory("texture " + texture.source, count * (channels + 4) * (bytes ? 1 : sizeof(float)));
  const auto read = [&](auto& all, OIIO::TypeDesc type) {
    all.resize(count * channels);
    if (!input->read_image(0, 0, 0, spec.nchannels, type, all.data())) fail(FirstLine(input->geterror()));
  };
  if (bytes) {
    std::vector<uint8_t> all;
    read(all, OIIO::TypeDesc::UINT8);
    pixels->bytes = ToRgba(all, channels, uint8_t{255});
  } else {
    std::vector<float> all;
    read(all, OIIO::TypeDesc::FLOAT);
    pixels->floats = ToRgba(all, channels, 1.0f);
    if (!spec.format.is_floating_point())
      for (size_t i = 0; i < pixels->floats.size(); ++i)
        if (i % 4 != 3) pixels->floats[i] = FromSrgb(pixels->floats[i]);
  }
  return pixels;
}

Texel TextureMap::Pixels::At(uint32_t x, uint32_t y) const {
  const size_t i = 4 * (size_t{y} * width + x);
  if (bytes.empty()) return {LoadVec3(&floats[i]), floats[i + 3]};
  static const std::array<float, 256>& srgb = SrgbTable();
  return {{srgb[bytes[i]], srgb[bytes[i + 1]], srgb[bytes[i + 2]]}, float(bytes[i + 3]) * (1 / 255.0f)};
}

Texel TextureMap::At(Vec2f uv) const {
  const Neighbours x(Fold(uv.u, wrap_u_), pixels_->width, wrap_u_, filter_),
      y(Fold(uv.v, wrap_v_), pixels_->height, wrap_v_, filter_);
  if (filter_ == TextureFilter::kNearest) return pixels_->At(x.first, y.first);
  return Mix(Mix(pixels_->At(x.first, y.first), pixels_->At(x.second, y.first), x.share),
             Mix(pixels_->At(x.first, y.second), pixels_->At(x.second, y.second), x.share), y.share);
}

TextureMaps::TextureMaps(const Scene& scene, const std::vector<uint32_t>& materials) {
  std::map<const std::string*, std::shared_ptr<const TextureMap::Pixels>> decoded;
  const auto make = [&](const Texture& texture) {
    auto& pixels = decoded[texture.bytes.get()];
    if (!pixels) pixels = TextureMap::Decode(texture);
    return std::unique_ptr<const TextureMap>(new TextureMap(texture, pixels));
  };
  maps_.resize(scene.textures.size());
  for (uint32_t material : materials)
    for (int32_t t :
         {scene.materials[material].base_color_texture, scene.materials[material].emission_texture})
      if (t >= 0 && !maps_[size_t(t)]) maps_[size_t(t)] = make(scene.textures[size_t(t)]);
  if (scene.environment >= 0) {
    Texture map = scene.textures[size_t(scene.environment)];
    map.wrap_u = TextureWrap::kRepeat, map.wrap_v = TextureWrap::kClampToEdge;
    environment_ = make(map);
  }
}

Vec3f TextureMaps::Environment(Vec3d direction) const {
  const Vec3d d = Normalize(direction);
  const double u = 0.5 + std::atan2(d.x, -d.z) * (0.5 / std::numbers::pi),
               v = std::acos(std::clamp(d.y, -1.0, 1.0)) / std::numbers::pi;
  return environment_->At({float(u), float(v)}).color;
}

}  // namespace raybench
