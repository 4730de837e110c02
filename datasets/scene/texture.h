// Textures as a scene's file holds them: encoded images and how to look them up. Nothing is decoded here.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "accel/base/vec3.h"

namespace raybench {

/// Texture coordinates: (0, 0) is the image's upper left corner, (1, 1) its lower right one, as in glTF 2.0.
struct Vec2f {
  float u = 0, v = 0;
  friend constexpr bool operator==(const Vec2f&, const Vec2f&) = default;
};

enum class TextureWrap : uint8_t { kRepeat, kClampToEdge, kMirroredRepeat };
enum class TextureFilter : uint8_t { kNearest, kLinear };

/// The MIME type of an encoded image by its first bytes ("image/png"); empty: none that is known.
std::string ImageType(std::string_view bytes);

/// An image with its sampler. Textures of the same image share its bytes.
struct Texture {
  std::string name;
  std::string source;  ///< where the bytes were: a file's path, or the place inside the scene's file
  std::string
      mime_type;  ///< "image/png", "image/jpeg", ...; told from the first bytes where the file is silent
  std::shared_ptr<const std::string> bytes;  ///< the encoded image; never null or empty
  TextureWrap wrap_u = TextureWrap::kRepeat, wrap_v = TextureWrap::kRepeat;
  TextureFilter filter = TextureFilter::kLinear;  ///< within a level
  bool mipmaps = true;                            ///< whether smaller levels are wanted for minification
};

}  // namespace raybench
