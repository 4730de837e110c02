#include "tracer/texture_map.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <string>

#include "tracer/image_library.h"
#include "tracer/srgb.h"

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
    first = inside(int64_t(low));
    second = inside(int64_t(low) + 1);
  }
};

Texel TexelAt(const DecodedTexture& texture, uint32_t x, uint32_t y) {
  const size_t i = 4 * (size_t{y} * texture.width + x);
  if (texture.bytes.empty()) return {LoadVec3(&texture.floats[i]), texture.floats[i + 3]};
  const std::vector<uint8_t>& bytes = texture.bytes;
  static const std::array<float, 256>& srgb = SrgbTable();
  return {{srgb[bytes[i]], srgb[bytes[i + 1]], srgb[bytes[i + 2]]}, float(bytes[i + 3]) * (1 / 255.0f)};
}

std::shared_ptr<const DecodedTexture> Decode(const Texture& texture) {
  return std::make_shared<const DecodedTexture>(LoadImageLibrary().decode(texture));
}

Texel Mix(const Texel& a, const Texel& b, float share) {
  return {a.color * (1 - share) + b.color * share, a.alpha * (1 - share) + b.alpha * share};
}

}  // namespace

TextureMap::TextureMap(const Texture& texture) : TextureMap(texture, Decode(texture)) {}

uint32_t TextureMap::width() const { return pixels_->width; }
uint32_t TextureMap::height() const { return pixels_->height; }

Texel TextureMap::At(Vec2f uv) const {
  const Neighbours x(Fold(uv.u, wrap_u_), pixels_->width, wrap_u_, filter_),
      y(Fold(uv.v, wrap_v_), pixels_->height, wrap_v_, filter_);
  if (filter_ == TextureFilter::kNearest) return TexelAt(*pixels_, x.first, y.first);
  return Mix(Mix(TexelAt(*pixels_, x.first, y.first), TexelAt(*pixels_, x.second, y.first), x.share),
             Mix(TexelAt(*pixels_, x.first, y.second), TexelAt(*pixels_, x.second, y.second), x.share),
             y.share);
}

TextureMaps::TextureMaps(const Scene& scene, const std::vector<uint32_t>& materials) {
  std::map<const std::string*, std::shared_ptr<const DecodedTexture>> decoded;
  const auto make = [&](const Texture& texture) {
    auto& pixels = decoded[texture.bytes.get()];
    if (!pixels) pixels = Decode(texture);
    return std::unique_ptr<const TextureMap>(new TextureMap(texture, pixels));
  };
  maps_.resize(scene.textures.size());
  for (uint32_t material : materials)
    for (int32_t t :
         {scene.materials[material].base_color_texture, scene.materials[material].emission_texture})
      if (t >= 0 && !maps_[size_t(t)]) maps_[size_t(t)] = make(scene.textures[size_t(t)]);
  if (scene.environment >= 0) {
    Texture map = scene.textures[size_t(scene.environment)];
    map.wrap_u = TextureWrap::kRepeat;
    map.wrap_v = TextureWrap::kClampToEdge;
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
