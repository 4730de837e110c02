#include "tracer/image_io.h"

#include <filesystem>

#include "accel/base/error.h"
#include "tracer/image_library.h"

namespace raybench {
namespace {

/// True for .png, false for .exr; throws on others.
bool IsPng(const std::string& path) {
  std::string extension = std::filesystem::path(path).extension().string();
  for (char& c : extension)
    if (c >= 'A' && c <= 'Z') c = char(c - 'A' + 'a');
  if (extension != ".png" && extension != ".exr")
    throw InputError(path + ": unknown picture format; allowed are .png and .exr");
  return extension == ".png";
}

}  // namespace

void WriteImage(const Image& image, const std::string& path, const std::string& software) {
  LoadImageLibrary().write(image, {}, path, IsPng(path), software);
}

void WriteLayers(const Image& image, const std::vector<Channel>& channels, const std::string& path,
                 const std::string& software) {
  if (IsPng(path)) throw InputError(path + ": only .exr holds more than red, green and blue");
  for (const Channel& channel : channels)
    if (channel.values.size() != image.pixels.size())
      throw InputError(path + ": channel " + channel.name + " is not as large as the picture");
  LoadImageLibrary().write(image, channels, path, false, software);
}

Image ReadImage(const std::string& path) {
  const bool png = IsPng(path);
  return LoadImageLibrary().read(path, png);
}

}  // namespace raybench
