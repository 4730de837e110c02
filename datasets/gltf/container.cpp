#include "datasets/gltf/container.h"

#include <fmt/format.h>

#include <cstring>
#include <fstream>

#include "accel/base/error.h"
#include "datasets/gltf/schema.h"
#include "datasets/readers/readers.h"

namespace raybench {
namespace {

namespace fs = std::filesystem;

/// Far beyond what glTF has, far below what the recursion of JSON libraries can stand.
constexpr int kMaxDepth = 100;

/// The deepest nesting of arrays and objects; brackets inside strings do not count.
int Depth(std::string_view json) {
  int depth = 0, deepest = 0;
  bool in_string = false;
  for (size_t i = 0; i < json.size(); ++i) {
    switch (json[i]) {
      case '\\':
        i += in_string;
        break;
      case '"':
        in_string = !in_string;
        break;
      case '[':
      case '{':
        deepest = std::max(deepest, depth += !in_string);
        break;
      case ']':
      case '}':
        depth -= !in_string;
        break;
    }
  }
  return deepest;
}

int HexDigit(char c) {
  return c >= '0' && c <= '9' ? c - '0' : (c | 32) >= 'a' && (c | 32) <= 'f' ? (c | 32) - 'a' + 10 : -1;
}

/// %20 and the like (RFC 3986). What is no escape stays as it is: exporters forget to escape.
std::string Unescaped(std::string_view uri) {
  std::string text;
  for (size_t i = 0; i < uri.size(); ++i) {
    int high = i + 2 < uri.size() ? HexDigit(uri[i + 1]) : -1;
    int low = high >= 0 ? HexDigit(uri[i + 2]) : -1;
    if (uri[i] == '%' && low >= 0) {
      text += char(high << 4 | low);
      i += 2;
    } else {
      text += uri[i];
    }
  }
  return text;
}

/// RFC 4648. Empty result: not base64 (or nothing).
std::string DecodeBase64(std::string_view text) {
  static const auto kValues = [] {
    std::array<int8_t, 256> values;
    values.fill(-1);
    const std::string_view digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    for (size_t i = 0; i < digits.size(); ++i) values[uint8_t(digits[i])] = int8_t(i);
    return values;
  }();
  for (int pad = 0; pad < 2 && text.ends_with('='); ++pad) text.remove_suffix(1);
  if (text.size() % 4 == 1) return {};
  std::string bytes;
  bytes.reserve(text.size() / 4 * 3 + 2);
  uint32_t word = 0;
  int bits = 0;
  for (char c : text) {
    int value = kValues[uint8_t(c)];
    if (value < 0) return {};
    word = word << 6 | uint32_t(value);
    if ((bits += 6) >= 8) bytes += char(word >> (bits -= 8));
  }
  return bytes;
}

/// At most the first `limit` bytes of a regular file; null if there is none. A device or a pipe has no end.
std::shared_ptr<const std::string> ReadStart(const fs::path& path, uint64_t limit) {
  std::error_code error;
  if (!fs::is_regular_file(path, error)) return nullptr;
  uint64_t size = fs::file_size(path, error);
  std::ifstream in(path, std::ios::binary);
  if (error || !in) return nullptr;
  auto bytes = std::make_shared<std::string>(size_t(std::min(size, limit)), '\0');
  in.read(bytes->data(), std::streamsize(bytes->size()));
  bytes->resize(size_t(in.gcount()));
  return bytes;
}

std::string Short(std::string_view text) {
  constexpr size_t kMost = 80;
  return text.size() <= kMost ? std::string(text) : std::string(text.substr(0, kMost)) + "...";
}

}  // namespace

GltfContainer::GltfContainer(const fs::path& path) : path_(path) {
  std::error_code ignored;
  // A .gltf of this size would be no better: its data belong into buffers.
  if (fs::is_regular_file(path, ignored) && fs::file_size(path, ignored) > UINT32_MAX)
    Fail("is larger than 4 GiB, the limit of GLB");
  file_ = ReadFile(path);
  size_ = file_.size();
  if (file_.starts_with("\xFF\xFE") || file_.starts_with("\xFE\xFF")) MakePlain(path_, file_);
  size_t start = file_.starts_with("\xEF\xBB\xBF") ? 3 : 0;
  start = std::min(file_.find_first_not_of(" \t\r\n", start), file_.size());
  if (start < file_.size() && file_[start] == '{') {
    ParseJson(std::string_view(file_).substr(start));
    file_ = {};
  } else if (std::string_view("glTF").starts_with(file_.substr(0, 4))) {
    OpenBinary();
  } else {
    Fail("is not glTF: it begins neither with '{' (JSON text) nor with 'glTF' (GLB)");
  }
}

void GltfContainer::Fail(const std::string& what) const {
  throw InputError(path_.string() + ": " + OneLine(what));
}

/// Header (magic, version, length), then chunks (length, type, data), all numbers 32-bit little-endian.
void GltfContainer::OpenBinary() {
  auto word = [&](size_t at) {
    uint32_t value;
    std::memcpy(&value, file_.data() + at, sizeof value);
    return value;
  };
  if (file_.size() < 12) Fail(fmt::format("is cut off: {} bytes, less than the 12 of a GLB header", size_));
  if (word(4) != 2) Fail(fmt::format("is GLB of version {}; 2 is read", word(4)));
  if (word(8) > file_.size())
    Fail(fmt::format("is cut off: its GLB header says {} bytes, it has {}", word(8), size_));
  if (word(8) < file_.size())
    Fail(fmt::format("goes on behind its end: its GLB header says {} bytes, it has {}", word(8), size_));
  std::string_view json;
  size_t at = 12;
  for (int chunk = 0; at < file_.size(); ++chunk) {
    if (file_.size() - at < 8) Fail(fmt::format("is cut off inside the header of GLB chunk {}", chunk));
    const uint32_t length = word(at), type = word(at + 4);
    at += 8;
    if (length > file_.size() - at)
      Fail(
          fmt::format("is cut off: GLB chunk {} says {} bytes, {} follow", chunk, length, file_.size() - at));
    std::string_view data = std::string_view(file_).substr(at, length);
    at += length;
    if (chunk == 0) {
      if (type != 0x4E4F534A) Fail("has another first GLB chunk than JSON");
      json = data;
    } else if (chunk == 1 && type == 0x004E4942) {
      binary_ = data;
      has_binary_ = true;
    }  // other chunks are to be ignored
  }
  if (json.empty()) Fail("has no GLB chunk with JSON");
  ParseJson(json);
}

void GltfContainer::ParseJson(std::string_view text) {
  if (Depth(text) > kMaxDepth)
    Fail(fmt::format("nests JSON {} deep; at most {} is allowed", Depth(text), kMaxDepth));
  try {
    root = nlohmann::json::parse(text);
  } catch (const nlohmann::json::exception& e) {
    // "[json.exception.parse_error.101] parse error at line 1, column 2: ... last read: '...'"; the last part
    // may be as long as the file.
    std::string message = e.what();
    message.erase(0, message.find("] ") + 2);
    constexpr size_t kMost = 200;
    if (message.size() > kMost) message = message.substr(0, kMost) + "...";
    Fail("is not valid JSON: " + message);
  }
  if (std::string error = CheckGltfSchema(root); !error.empty()) Fail(error);
  auto list = root.find("buffers");
  if (list == root.end()) return;
  buffer_list_ = std::move(*list);
  root.erase(list);
  for (const nlohmann::json& buffer : buffer_list_) {
    auto uri = buffer.find("uri");
    if (uri == buffer.end() || uri->get_ref<const std::string&>().starts_with("data:")) continue;
    uint64_t& needed = files_[uri->get<std::string>()].needed;
    needed = std::max(needed, buffer["byteLength"].get<uint64_t>());
  }
}

std::string_view GltfContainer::Buffer(int64_t index) {
  if (auto it = buffers_.find(index); it != buffers_.end()) return it->second;
  if (index < 0 || size_t(index) >= buffer_list_.size())
    Fail(fmt::format("refers to buffer {}; there are {}", index, buffer_list_.size()));
  const nlohmann::json& buffer = buffer_list_[size_t(index)];
  const uint64_t length = buffer["byteLength"].get<uint64_t>();
  const std::string what = fmt::format("buffer {}", index);
  std::string_view data;
  std::string source = "its data";
  if (buffer.contains("uri")) {
    const std::string& uri = buffer["uri"].get_ref<const std::string&>();
    auto file = files_.find(uri);
    if (file == files_.end() || file->second.bytes == nullptr) {
      GltfResource resource = Resource(uri, what, file == files_.end() ? length : file->second.needed);
      source = resource.source;
      if (resource.bytes == nullptr) Fail(fmt::format("{} is missing: there is no file {}", what, source));
      size_ += resource.bytes->size();
      data = *decoded_.emplace_back(resource.bytes);
      if (file != files_.end()) file->second.bytes = resource.bytes;
    } else {
      data = *file->second.bytes;
    }
  } else if (index == 0 && has_binary_) {
    data = binary_;
    source = "the GLB's binary chunk";
  } else {
    Fail(what + " has neither a URI nor the binary chunk of a GLB");
  }
  if (data.size() < length)
    Fail(fmt::format("{} says {} bytes; {} has {}", what, length, source, data.size()));
  return buffers_[index] = data.substr(0, length);
}

GltfResource GltfContainer::Resource(const std::string& uri, const std::string& what, uint64_t limit) const {
  GltfResource out;
  if (uri.starts_with("data:")) {
    const size_t comma = uri.find(',');
    const std::string header = uri.substr(5, std::min(comma, size_t{200}) - 5);
    if (comma == uri.npos || !header.ends_with(";base64"))
      Fail(fmt::format("{} has the URI '{}'; data must be written as 'data:TYPE;base64,...'", what,
                       Short(uri)));
    out.mime_type = header.substr(0, header.find(';'));
    out.source = what;
    auto bytes = std::make_shared<std::string>(DecodeBase64(std::string_view(uri).substr(comma + 1)));
    if (bytes->empty() && comma + 1 < uri.size()) Fail(what + " is not valid base64");
    out.bytes = std::move(bytes);
    return out;
  }
  const std::string name = Unescaped(uri);
  const size_t colon = name.find(':');
  if (name.empty() || name.starts_with('/') || name.find('\0') != name.npos ||
      (colon != name.npos && name.find('/') > colon))
    Fail(fmt::format("{} has the URI '{}'; allowed are relative paths and 'data:'", what, Short(uri)));
  const fs::path file = path_.parent_path() / name;
  out.source = file.string();
  out.bytes = ReadStart(file, limit);
  return out;
}

}  // namespace raybench
