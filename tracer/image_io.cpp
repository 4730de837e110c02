#include "tracer/image_io.h"

#include <OpenImageIO/imageio.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <system_error>

#include "accel/parameters.h"
#include "tracer/oiio.h"

namespace raybench {
namespace {

namespace fs = std::filesystem;

/// ".png" or ".exr"; throws on others.
std::string FormatOf(const std::string& path) {
  std::string extension = fs::path(path).extension().string();
  for (char& c : extension)
    if (c >= 'A' && c <= 'Z') c = char(c - 'A' + 'a');
  if (extension != ".png" && extension != ".exr")
    throw InputError(path + ": unknown picture format; allowed are .png and .exr");
  return extension;
}

// The transfer curve of IEC 61966-2-1.
uint8_t ToSrgb(float linear) {
  if (!(linear > 0)) return 0;  // NaN too
  if (linear >= 1) return 255;
  const double x = linear;
  const double encoded = x <= 0.0031308 ? 12.92 * x : 1.055 * std::pow(x, 1 / 2.4) - 0.055;
  return uint8_t(encoded * 255 + 0.5);
}

/// Removes the temporary file unless it has been renamed.
struct TemporaryFile {
  fs::path path;
  ~TemporaryFile() {
    std::error_code ignored;
    fs::remove(path, ignored);
  }
};

/// What WriteImage() and WriteLayers() do. `layers` needs .exr.
void Write(const Image& image, const std::vector<Channel>& layers, const std::string& path,
           const std::string& software) {
  const std::string format = FormatOf(path);
  if (image.width == 0 || image.height == 0 || image.pixels.size() != size_t{image.width} * image.height)
    throw InputError(path + ": a picture to be written needs width x height pixels, at least one");
  const fs::path target(path), directory = target.has_parent_path() ? target.parent_path() : fs::path(".");
  std::error_code error;
  if (!fs::is_directory(directory, error))
    throw InputError(path + ": cannot be written: " + directory.string() + " is not a directory");

  // The extension stays last: OpenImageIO goes by it.
  const TemporaryFile temporary{directory /
                                (target.stem().string() + ".tmp" + std::to_string(::getpid()) + format)};
  const auto output = OIIO::ImageOutput::create(temporary.path.string());
  if (!output) throw InputError(path + ": cannot be written: " + FirstLine(OIIO::geterror()));

  const bool png = format == ".png";
  OIIO::ImageSpec spec(int(image.width), int(image.height), int(3 + layers.size()),
                       png ? OIIO::TypeDesc::UINT8 : OIIO::TypeDesc::FLOAT);
  for (size_t i = 0; i < layers.size(); ++i) spec.channelnames[3 + i] = layers[i].name;
  spec.attribute("Software", software);
  spec.attribute("oiio:ColorSpace", png ? "sRGB" : "Linear");
  bool good = output->open(temporary.path.string(), spec);
  if (good && png) {
    std::vector<uint8_t> bytes;
    bytes.reserve(image.pixels.size() * 3);
    for (const Vec3f& p : image.pixels) bytes.insert(bytes.end(), {ToSrgb(p.x), ToSrgb(p.y), ToSrgb(p.z)});
    good = output->write_image(OIIO::TypeDesc::UINT8, bytes.data());
  } else if (good) {
    std::vector<float> row(size_t(spec.nchannels) * image.width);
    for (uint32_t y = 0; good && y < image.height; ++y) {
      float* to = row.data();
      for (size_t p = size_t{y} * image.width, end = p + image.width; p < end; ++p) {
        const Vec3f& rgb = image.pixels[p];
        *to++ = rgb.x, *to++ = rgb.y, *to++ = rgb.z;
        for (const Channel& layer : layers) *to++ = layer.values[p];
      }
      good = output->write_scanline(int(y), 0, OIIO::TypeDesc::FLOAT, row.data());
    }
  }
  good = good && output->close();
  if (!good) throw InputError(path + ": cannot be written: " + FirstLine(output->geterror()));
  fs::rename(temporary.path, target, error);
  if (error) throw InputError(path + ": cannot be written: " + error.message());
}

}  // namespace

void WriteImage(const Image& image, const std::string& path, const std::string& software) {
  Write(image, {}, path, software);
}

void WriteLayers(const Image& image, const std::vector<Channel>& channels, const std::string& path,
                 const std::string& software) {
  if (FormatOf(path) != ".exr") throw InputError(path + ": only .exr holds more than red, green and blue");
  for (const Channel& channel : channels)
    if (channel.values.size() != image.pixels.size())
      throw InputError(path + ": channel " + channel.name + " is not as large as the picture");
  Write(image, channels, path, software);
}

Image ReadImage(const std::string& path) {
  const bool png = FormatOf(path) == ".png";
  const auto input = OIIO::ImageInput::open(path);
  if (!input) throw InputError(path + ": cannot be read: " + FirstLine(OIIO::geterror()));
  const OIIO::ImageSpec& spec = input->spec();
  if (spec.nchannels < 3) throw InputError(path + ": a picture needs at least three channels (RGB)");
  Image image{uint32_t(spec.width), uint32_t(spec.height), {}};
  image.pixels.resize(size_t{image.width} * image.height);
  if (!input->read_image(0, 0, 0, 3, OIIO::TypeDesc::FLOAT, image.pixels.data()))
    throw InputError(path + ": cannot be read: " + FirstLine(input->geterror()));
  if (png)
    for (Vec3f& p : image.pixels) p = {FromSrgb(p.x), FromSrgb(p.y), FromSrgb(p.z)};
  return image;
}

}  // namespace raybench
