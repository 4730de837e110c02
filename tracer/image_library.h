// OpenImageIO's part of raybench, a library of its own that is loaded when the first picture is read or
// written: OpenImageIO brings some 250 libraries along, and to link them takes 0.4 s that every start
// would pay.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "datasets/scene/scene.h"
#include "tracer/image_io.h"

namespace raybench {

/// RGBA, row 0 at the top.
struct DecodedTexture {
  uint32_t width = 0, height = 0;
  std::vector<uint8_t> bytes;  ///< sRGB; one of the two is empty
  std::vector<float> floats;   ///< linear
};

/// What image_io.h and texture_map.h promise, errors included.
struct ImageLibrary {
  /// `layers` needs .exr.
  void (*write)(const Image& image, const std::vector<Channel>& layers, const std::string& path, bool png,
                const std::string& software);
  Image (*read)(const std::string& path, bool png);
  DecodedTexture (*decode)(const Texture& texture);
};

/// Loads it at the first call. Throws InputError where libraybench_images.so is missing.
const ImageLibrary& LoadImageLibrary();

}  // namespace raybench
