// Pictures in and out, through OpenImageIO.
#pragma once

#include <string>
#include <vector>

#include "tracer/tracer.h"

namespace raybench {

/// Writes .png (8-bit sRGB, values clamped to [0,1]) or .exr (32-bit float, linear) by the file's extension,
/// to a temporary file that is then renamed. `software` goes into the file's metadata. Throws InputError
/// naming the file.
void WriteImage(const Image& image, const std::string& path, const std::string& software);

/// Floats under a name of their own, such as "bvh_sah.steps", row by row.
struct Channel {
  std::string name;
  std::vector<float> values;
};

/// WriteImage() to an .exr file that holds more `channels` of the picture's size after R, G and B.
/// Throws InputError.
void WriteLayers(const Image& image, const std::vector<Channel>& channels, const std::string& path,
                 const std::string& software);

/// Reads what WriteImage wrote (PNG is converted back to linear). Throws InputError.
Image ReadImage(const std::string& path);

}  // namespace raybench
