// Pictures in and out, through OpenImageIO.
#pragma once

#include <string>

#include "tracer/tracer.h"

namespace raybench {

/// Writes .png (8-bit sRGB, values clamped to [0,1]) or .exr (32-bit float, linear) by the file's extension,
/// to a temporary file that is then renamed. `software` goes into the file's metadata. Throws InputError
/// naming the file.
void WriteImage(const Image& image, const std::string& path, const std::string& software);

/// Reads what WriteImage wrote (PNG is converted back to linear). Throws InputError.
Image ReadImage(const std::string& path);

}  // namespace raybench
