// Textures decoded (OpenImageIO) and looked up.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "datasets/scene/scene.h"

namespace raybench {

struct DecodedTexture;

struct Texel {
  Vec3f color;  ///< linear RGB
  float alpha;  ///< not multiplied into the colour
};

/// A decoded image with its sampler. Images of integers are sRGB, those of floating-point numbers linear.
/// Magnified only: there are no smaller levels, so minified textures need more samples a pixel.
class TextureMap {
 public:
  /// Throws InputError naming the texture's source if its bytes are no image, or do not fit into memory.
  explicit TextureMap(const Texture& texture);

  /// Coordinates that are not finite, or above 1e9, count as 0.
  Texel At(Vec2f uv) const;

  uint32_t width() const;
  uint32_t height() const;

 private:
  friend class TextureMaps;
  TextureMap(const Texture& texture, std::shared_ptr<const DecodedTexture> pixels)
      : pixels_(std::move(pixels)),
        wrap_u_(texture.wrap_u),
        wrap_v_(texture.wrap_v),
        filter_(texture.filter) {}

  std::shared_ptr<const DecodedTexture> pixels_;
  TextureWrap wrap_u_, wrap_v_;
  TextureFilter filter_;
};

/// The textures of a scene that `materials` (indices into Scene::materials) and its environment read, each
/// image decoded once. Borrows nothing.
class TextureMaps {
 public:
  TextureMaps(const Scene& scene, const std::vector<uint32_t>& materials);

  /// White where `texture` is -1.
  Texel At(int32_t texture, Vec2f uv) const {
    return texture < 0 ? Texel{{1, 1, 1}, 1} : maps_[size_t(texture)]->At(uv);
  }
  /// What is seen along a direction of any length: a latitude-longitude map whose top is +y and whose middle
  /// is -z, with +x to the right of it.
  Vec3f Environment(Vec3d direction) const;

 private:
  std::vector<std::unique_ptr<const TextureMap>> maps_;  ///< null: not read
  std::unique_ptr<const TextureMap> environment_;
};

}  // namespace raybench
