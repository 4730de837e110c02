// The image library's inside: everything that calls OpenImageIO.
#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

#include <cmath>
#include <filesystem>
#include <string_view>
#include <system_error>

#include "accel/base/error.h"
#include "accel/base/files.h"
#include "accel/base/memory.h"
#include "tracer/image_library.h"
#include "tracer/srgb.h"

namespace raybench {
namespace {

namespace fs = std::filesystem;

/// OpenImageIO may report several lines.
std::string FirstLine(const std::string& text) {
  return text.empty() ? "no reason given" : text.substr(0, text.find('\n'));
}

// The transfer curve of IEC 61966-2-1.
uint8_t ToSrgb(float linear) {
  if (!(linear > 0)) return 0;  // NaN too
  if (linear >= 1) return 255;
  const double x = linear;
  const double encoded = x <= 0.0031308 ? 12.92 * x : 1.055 * std::pow(x, 1 / 2.4) - 0.055;
  return uint8_t(encoded * 255 + 0.5);
}

void Write(const Image& image, const std::vector<Channel>& layers, const std::string& path, bool png,
           const std::string& software) {
  if (image.width == 0 || image.height == 0 || image.pixels.size() != size_t{image.width} * image.height)
    throw InputError(path + ": a picture to be written needs width x height pixels, at least one");
  const auto output = OIIO::ImageOutput::create(path);
  if (!output) throw InputError(path + ": cannot be written: " + FirstLine(OIIO::geterror()));
  // Its PNG writer tells of no write that failed, so it writes to memory.
  OIIO::Filesystem::IOVecOutput memory;
  if (!output->set_ioproxy(&memory))
    throw InputError(path + ": cannot be written: no way to write it to memory");

  OIIO::ImageSpec spec(int(image.width), int(image.height), int(3 + layers.size()),
                       png ? OIIO::TypeDesc::UINT8 : OIIO::TypeDesc::FLOAT);
  for (size_t i = 0; i < layers.size(); ++i) spec.channelnames[3 + i] = layers[i].name;
  spec.attribute("Software", software);
  spec.attribute("oiio:ColorSpace", png ? "sRGB" : "Linear");
  bool good = output->open(path, spec);
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
        *to++ = rgb.x;
        *to++ = rgb.y;
        *to++ = rgb.z;
        for (const Channel& layer : layers) *to++ = layer.values[p];
      }
      good = output->write_scanline(int(y), 0, OIIO::TypeDesc::FLOAT, row.data());
    }
  }
  good = good && output->close();
  if (!good) throw InputError(path + ": cannot be written: " + FirstLine(output->geterror()));
  const std::vector<unsigned char>& bytes = memory.buffer();
  WriteFileAtomically(path, {{reinterpret_cast<const char*>(bytes.data()), bytes.size()}});
}

Image Read(const std::string& path, bool png) {
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
    q[0] = p[0];
    q[1] = gray ? p[0] : p[1];
    q[2] = gray ? p[0] : p[2];
    q[3] = channels == 2 ? p[1] : channels >= 4 ? p[3] : one;
  }
  return to;
}

DecodedTexture Decode(const Texture& texture) {
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
  DecodedTexture pixels;
  pixels.width = uint32_t(spec.width);
  pixels.height = uint32_t(spec.height);
  const auto channels = size_t(spec.nchannels), count = size_t{pixels.width} * pixels.height;
  const bool bytes = spec.format == OIIO::TypeDesc::UINT8;
  RequireMemory("texture " + texture.source, count * (channels + 4) * (bytes ? 1 : sizeof(float)));
  const auto read = [&](auto& all, OIIO::TypeDesc type) {
    all.resize(count * channels);
    if (!input->read_image(0, 0, 0, spec.nchannels, type, all.data())) fail(FirstLine(input->geterror()));
  };
  if (bytes) {
    std::vector<uint8_t> all;
    read(all, OIIO::TypeDesc::UINT8);
    pixels.bytes = ToRgba(all, channels, uint8_t{255});
  } else {
    std::vector<float> all;
    read(all, OIIO::TypeDesc::FLOAT);
    pixels.floats = ToRgba(all, channels, 1.0f);
    if (!spec.format.is_floating_point())
      for (size_t i = 0; i < pixels.floats.size(); ++i)
        if (i % 4 != 3) pixels.floats[i] = FromSrgb(pixels.floats[i]);
  }
  return pixels;
}

}  // namespace

extern "C" const ImageLibrary* RaybenchImageLibrary() {
  static const ImageLibrary library{Write, Read, Decode};
  return &library;
}

}  // namespace raybench
