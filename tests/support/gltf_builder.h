// Builds glTF and GLB files for tests, piece by piece.
#pragma once

#include <cstring>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "tests/support/datasets.h"

namespace raybench {

inline std::string Base64(const std::string& bytes) {
  static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (size_t i = 0; i < bytes.size(); i += 3) {
    uint32_t word = 0;
    for (size_t k = 0; k < 3; ++k) word = word << 8 | (i + k < bytes.size() ? uint8_t(bytes[i + k]) : 0u);
    for (size_t k = 0; k < 4; ++k) text += i + k <= bytes.size() ? digits[word >> (18 - 6 * k) & 63] : '=';
  }
  return text;
}

template <class T>
std::string Bytes(const std::vector<T>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)};
}

/// `root` may be changed at will before Text() or Binary().
struct GltfBuilder {
  nlohmann::json root = {{"asset", {{"version", "2.0"}}},
                         {"scene", 0},
                         {"scenes", {{{"nodes", {0}}}}},
                         {"nodes", {{{"mesh", 0}}}}};
  std::string buffer;

  int View(const std::string& bytes, int stride = 0) {
    while (buffer.size() % 4 != 0) buffer += '\0';
    nlohmann::json view = {{"buffer", 0}, {"byteOffset", buffer.size()}, {"byteLength", bytes.size()}};
    if (stride != 0) view["byteStride"] = stride;
    buffer += bytes;
    root["bufferViews"].push_back(view);
    return int(root["bufferViews"].size()) - 1;
  }
  int Accessor(const std::string& bytes, const char* type, int component, size_t count) {
    root["accessors"].push_back(
        {{"bufferView", View(bytes)}, {"componentType", component}, {"count", count}, {"type", type}});
    return int(root["accessors"].size()) - 1;
  }
  int Positions(const std::vector<float>& p) { return Accessor(Bytes(p), "VEC3", 5126, p.size() / 3); }
  template <class T>
  int Indices(const std::vector<T>& v) {
    return Accessor(Bytes(v), "SCALAR", sizeof(T) == 1 ? 5121 : sizeof(T) == 2 ? 5123 : 5125, v.size());
  }
  nlohmann::json& Primitive(int positions, int indices = -1, int mode = -1) {
    nlohmann::json primitive = {{"attributes", {{"POSITION", positions}}}};
    if (indices >= 0) primitive["indices"] = indices;
    if (mode >= 0) primitive["mode"] = mode;
    return primitives_.emplace_back(primitive), primitives_.back();
  }
  void EndMesh() {
    root["meshes"].push_back({{"primitives", std::exchange(primitives_, nlohmann::json::array())}});
  }

  std::string Text() {
    if (!primitives_.empty()) EndMesh();
    if (!buffer.empty() && !root.contains("buffers"))
      root["buffers"] = {
          {{"byteLength", buffer.size()}, {"uri", "data:application/octet-stream;base64," + Base64(buffer)}}};
    return root.dump();
  }
  std::string Binary() {
    if (!root.contains("buffers")) root["buffers"] = {{{"byteLength", buffer.size()}}};
    std::string text = Text();
    while (text.size() % 4 != 0) text += ' ';
    while (buffer.size() % 4 != 0) buffer += '\0';
    auto word = [](size_t value) { return Bytes(std::vector<uint32_t>{uint32_t(value)}); };
    return "glTF" + word(2) + word(12 + 8 + text.size() + 8 + buffer.size()) + word(text.size()) + "JSON" +
           text + word(buffer.size()) + std::string("BIN\0", 4) + buffer;
  }

 private:
  nlohmann::json primitives_ = nlohmann::json::array();
};

inline const std::vector<float> kSquare = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};

class GltfTest : public ::testing::Test {
 protected:
  Scene Load(GltfBuilder& b, const LoadOptions& options = {}) {
    return LoadScene(files_.Write("m.gltf", b.Text()), options);
  }
  std::string Error(GltfBuilder& b) { return LoadError(files_.Write("m.gltf", b.Text())); }
  std::string Error(const std::string& text) { return LoadError(files_.Write("m.gltf", text)); }
  ScratchDirectory files_;
};

}  // namespace raybench
