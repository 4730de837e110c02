// One model in every format is one model.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cstring>

#include "datasets/fetch.h"
#include "datasets_testing.h"
#include "meshes.h"

namespace raybench {
namespace {

template <class T>
void Append(std::string& text, T value, bool big_endian = false) {
  char bytes[sizeof value];
  std::memcpy(bytes, &value, sizeof value);
  if (big_endian != (std::endian::native == std::endian::big)) std::reverse(bytes, bytes + sizeof value);
  text.append(bytes, sizeof value);
}

std::string Obj(const Scene& m) {
  std::string text = "# OBJ\n";
  for (Vec3f p : m.positions) text += fmt::format("v {} {} {}\n", p.x, p.y, p.z);
  for (auto [a, b, c] : m.triangles) text += fmt::format("f {} {} {}\n", a + 1, b + 1, c + 1);
  return text;
}

std::string Off(const Scene& m) {
  std::string text = fmt::format("OFF\n{} {} 0\n", m.positions.size(), m.triangles.size());
  for (Vec3f p : m.positions) text += fmt::format("{} {} {}\n", p.x, p.y, p.z);
  for (auto [a, b, c] : m.triangles) text += fmt::format("3 {} {} {}\n", a, b, c);
  return text;
}

std::string PlyHeader(const Scene& m, const char* format) {
  return fmt::format(
      "ply\nformat {} 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n"
      "element face {}\nproperty list uchar int vertex_indices\nend_header\n",
      format, m.positions.size(), m.triangles.size());
}

std::string PlyAscii(const Scene& m) {
  std::string text = PlyHeader(m, "ascii");
  for (Vec3f p : m.positions) text += fmt::format("{} {} {}\n", p.x, p.y, p.z);
  for (auto [a, b, c] : m.triangles) text += fmt::format("3 {} {} {}\n", a, b, c);
  return text;
}

std::string PlyBinary(const Scene& m, bool big) {
  std::string text = PlyHeader(m, big ? "binary_big_endian" : "binary_little_endian");
  for (Vec3f p : m.positions)
    for (int k = 0; k < 3; ++k) Append(text, p[k], big);
  for (const auto& t : m.triangles) {
    Append(text, uint8_t(3));
    for (uint32_t v : t) Append(text, v, big);
  }
  return text;
}

std::string StlAscii(const Scene& m) {
  std::string text = "solid model\n";
  for (const auto& t : m.triangles) {
    text += "facet normal 0 0 0\nouter loop\n";
    for (uint32_t v : t)
      text += fmt::format("vertex {} {} {}\n", m.positions[v].x, m.positions[v].y, m.positions[v].z);
    text += "endloop\nendfacet\n";
  }
  return text + "endsolid model\n";
}

std::string StlBinary(const Scene& m) {
  std::string text(80, ' ');
  Append(text, uint32_t(m.triangles.size()));
  for (const auto& t : m.triangles) {
    text.append(12, '\0');
    for (uint32_t v : t)
      for (int k = 0; k < 3; ++k) Append(text, m.positions[v][k]);
    Append(text, uint16_t(0));
  }
  return text;
}

std::string Glb(const Scene& m) {
  std::string buffer;
  for (Vec3f p : m.positions)
    for (int k = 0; k < 3; ++k) Append(buffer, p[k]);
  for (const auto& t : m.triangles)
    for (uint32_t v : t) Append(buffer, v);
  const size_t split = 12 * m.positions.size();
  std::string json = fmt::format(
      R"({{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],)"
      R"("meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1}}]}}],)"
      R"("accessors":[{{"bufferView":0,"componentType":5126,"count":{},"type":"VEC3"}},)"
      R"({{"bufferView":1,"componentType":5125,"count":{},"type":"SCALAR"}}],)"
      R"("bufferViews":[{{"buffer":0,"byteLength":{}}},{{"buffer":0,"byteOffset":{},"byteLength":{}}}],)"
      R"("buffers":[{{"byteLength":{}}}]}})",
      m.positions.size(), 3 * m.triangles.size(), split, split, buffer.size() - split, buffer.size());
  json.resize((json.size() + 3) / 4 * 4, ' ');
  std::string text = "glTF";
  for (size_t word : {size_t{2}, 12 + 8 + json.size() + 8 + buffer.size(), json.size()})
    Append(text, uint32_t(word));
  text += "JSON" + json;
  Append(text, uint32_t(buffer.size()));
  return text + std::string("BIN\0", 4) + buffer;
}

std::vector<rb_ray> RaysThrough(const Scene& scene, int count) {
  std::vector<rb_ray> rays;
  Random random(7);
  const Vec3d lo = ToDouble(scene.bounds().lo), size = ToDouble(scene.bounds().hi) - lo;
  auto somewhere = [&] {
    Vec3d p = lo;
    for (int k = 0; k < 3; ++k) p[k] += size[k] * random.NextDouble();
    return ToFloat(p);
  };
  for (int i = 0; i < count; ++i) {
    const Vec3f from = somewhere(), d = somewhere() - from;
    rays.push_back({{from.x, from.y, from.z}, 0, {d.x, d.y, d.z}, std::numeric_limits<float>::infinity()});
  }
  return rays;
}

void ExpectOneModel(const Scene& model) {
  const std::vector<rb_ray> rays = RaysThrough(model, 2000);
  const std::vector<rb_hit> truth = testing::Closest(testing::Build("bvh_sah", model.Geometry()), rays);
  EXPECT_GT(
      std::count_if(truth.begin(), truth.end(), [](const rb_hit& h) { return h.prim != RAYBENCH_NONE; }), 50);
  ScratchDirectory files;
  for (const auto& [name, text] : {std::pair{"m.obj", Obj(model)},
                                   {"m.off", Off(model)},
                                   {"ascii.ply", PlyAscii(model)},
                                   {"little.ply", PlyBinary(model, false)},
                                   {"big.ply", PlyBinary(model, true)},
                                   {"ascii.stl", StlAscii(model)},
                                   {"binary.stl", StlBinary(model)},
                                   {"m.glb", Glb(model)}}) {
    const Scene scene = LoadScene(files.Write(name, text));
    ASSERT_EQ(scene.triangles.size(), model.triangles.size()) << name;
    EXPECT_EQ(scene.stats.faces, model.triangles.size()) << name;
    size_t different = 0;
    for (size_t i = 0; i < scene.triangles.size(); ++i)
      different += Corners(scene, i) != Corners(model, i) || scene.triangle_face[i] != i;
    EXPECT_EQ(different, 0u) << name;
    const std::vector<rb_hit> hits = testing::Closest(testing::Build("bvh_sah", scene.Geometry()), rays);
    size_t other_hits = 0;
    for (size_t i = 0; i < rays.size(); ++i)
      other_hits += std::memcmp(&hits[i], &truth[i], sizeof hits[i]) != 0;
    EXPECT_EQ(other_hits, 0u) << name;
  }
}

TEST(FormatsTest, AGeneratedModelIsTheSameInEach) { ExpectOneModel(LoadScene("sphereflake(depth=2)")); }

TEST(FormatsTest, ARealModelIsTheSameInEach) {
  for (const char* name : {"bunny", "armadillo", "engine"})
    if (IsFetched(FindManifestEntry(name))) return ExpectOneModel(LoadScene(name));
  GTEST_SKIP() << "no real model is fetched; 'raybench fetch bunny' gets one";
}

}  // namespace
}  // namespace raybench
