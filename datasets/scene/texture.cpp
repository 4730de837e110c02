#include "datasets/scene/texture.h"

namespace raybench {

std::string ImageType(std::string_view bytes) {
  using namespace std::string_view_literals;
  if (bytes.starts_with("\x89PNG")) return "image/png";
  if (bytes.starts_with("\xFF\xD8\xFF")) return "image/jpeg";
  if (bytes.starts_with("RIFF") && bytes.substr(8).starts_with("WEBP")) return "image/webp";
  if (bytes.starts_with("\xABKTX 20\xBB"sv)) return "image/ktx2";
  if (bytes.starts_with("DDS ")) return "image/vnd-ms.dds";
  if (bytes.starts_with("GIF8")) return "image/gif";
  if (bytes.starts_with("BM")) return "image/bmp";
  if (bytes.starts_with("II*\0"sv) || bytes.starts_with("MM\0*"sv)) return "image/tiff";
  if (bytes.starts_with("\x76\x2F\x31\x01")) return "image/x-exr";
  if (bytes.starts_with("#?RADIANCE") || bytes.starts_with("#?RGBE")) return "image/vnd.radiance";
  return {};
}

}  // namespace raybench
