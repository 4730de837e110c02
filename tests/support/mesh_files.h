// One triangle mesh as a file of every format, whatever is in it; shared by tests.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include "tests/support/gltf_builder.h"

namespace raybench::testing {

/// What a file shall hold. In double and signed, so that it can be what no scene may be.
struct FileMesh {
  std::vector<Vec3d> positions;
  std::vector<std::array<int64_t, 3>> triangles;
};

template <class T>
void Append(std::string& text, T value, bool big_endian = false) {
  char bytes[sizeof value];
  std::memcpy(bytes, &value, sizeof value);
  if (big_endian != (std::endian::native == std::endian::big)) std::reverse(bytes, bytes + sizeof value);
  text.append(bytes, sizeof value);
}

inline std::string Obj(const FileMesh& m) {
  std::string text = "# OBJ\n";
  for (Vec3d p : m.positions) text += fmt::format("v {} {} {}\n", p.x, p.y, p.z);
  for (auto [a, b, c] : m.triangles) text += fmt::format("f {} {} {}\n", a + 1, b + 1, c + 1);
  return text;
}

inline std::string Off(const FileMesh& m) {
  std::string text = fmt::format("OFF\n{} {} 0\n", m.positions.size(), m.triangles.size());
  for (Vec3d p : m.positions) text += fmt::format("{} {} {}\n", p.x, p.y, p.z);
  for (auto [a, b, c] : m.triangles) text += fmt::format("3 {} {} {}\n", a, b, c);
  return text;
}

inline std::string PlyHeader(const FileMesh& m, const char* format) {
  return fmt::format(
      "ply\nformat {} 1.0\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\n"
      "element face {}\nproperty list uchar int vertex_indices\nend_header\n",
      format, m.positions.size(), m.triangles.size());
}

inline std::string PlyAscii(const FileMesh& m) {
  std::string text = PlyHeader(m, "ascii");
  for (Vec3d p : m.positions) text += fmt::format("{} {} {}\n", p.x, p.y, p.z);
  for (auto [a, b, c] : m.triangles) text += fmt::format("3 {} {} {}\n", a, b, c);
  return text;
}

inline std::string PlyBinary(const FileMesh& m, bool big) {
  std::string text = PlyHeader(m, big ? "binary_big_endian" : "binary_little_endian");
  for (Vec3d p : m.positions)
    for (int k = 0; k < 3; ++k) Append(text, p[k], big);
  for (const auto& t : m.triangles) {
    Append(text, uint8_t(3));
    for (int64_t v : t) Append(text, int32_t(v), big);
  }
  return text;
}

inline std::string StlAscii(const FileMesh& m) {
  std::string text = "solid model\n";
  for (const auto& t : m.triangles) {
    text += "facet normal 0 0 0\nouter loop\n";
    for (int64_t v : t) {
      const Vec3d p = m.positions.at(size_t(v));
      text += fmt::format("vertex {} {} {}\n", p.x, p.y, p.z);
    }
    text += "endloop\nendfacet\n";
  }
  return text + "endsolid model\n";
}

inline std::string StlBinary(const FileMesh& m) {
  std::string text(80, ' ');
  Append(text, uint32_t(m.triangles.size()));
  for (const auto& t : m.triangles) {
    text.append(12, '\0');
    for (int64_t v : t)
      for (int k = 0; k < 3; ++k) Append(text, float(m.positions.at(size_t(v))[k]));
    Append(text, uint16_t(0));
  }
  return text;
}

inline GltfBuilder GltfOf(const FileMesh& m) {
  GltfBuilder b;
  std::vector<float> positions;
  for (Vec3d p : m.positions)
    for (int k = 0; k < 3; ++k) positions.push_back(float(p[k]));
  std::vector<uint32_t> indices;
  for (const auto& t : m.triangles)
    for (int64_t v : t) indices.push_back(uint32_t(v));
  const int p = b.Positions(positions), i = b.Indices(indices);
  b.Primitive(p, i);
  return b;
}
inline std::string Gltf(const FileMesh& m) { return GltfOf(m).Text(); }
inline std::string Glb(const FileMesh& m) { return GltfOf(m).Binary(); }

inline std::string Nff(const FileMesh& m) {
  std::string text = "# NFF\n";
  for (const auto& t : m.triangles) {
    text += "p 3\n";
    for (int64_t v : t) {
      const Vec3d p = m.positions.at(size_t(v));
      text += fmt::format("{} {} {}\n", p.x, p.y, p.z);
    }
  }
  return text;
}

/// A format: the name of a file in it, and how to write one.
struct MeshFormat {
  const char* file;
  std::string (*write)(const FileMesh&);
  bool has_indices;  ///< corners name vertices; else they are the vertices
};

inline std::vector<MeshFormat> MeshFormats() {
  return {{"m.obj", &Obj, true},
          {"m.off", &Off, true},
          {"ascii.ply", &PlyAscii, true},
          {"little.ply", [](const FileMesh& m) { return PlyBinary(m, false); }, true},
          {"big.ply", [](const FileMesh& m) { return PlyBinary(m, true); }, true},
          {"ascii.stl", &StlAscii, false},
          {"binary.stl", &StlBinary, false},
          {"m.gltf", &Gltf, true},
          {"m.glb", &Glb, true},
          {"m.nff", &Nff, false}};
}

}  // namespace raybench::testing
