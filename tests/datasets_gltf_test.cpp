// glTF and GLB files.

#include <gmock/gmock.h>

#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>

#include "datasets_testing.h"

namespace raybench {
namespace {

using nlohmann::json;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

using Triangle = std::array<uint32_t, 3>;

std::string Base64(const std::string& bytes) {
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

/// Builds a glTF file piece by piece; `root` may be changed at will before Text().
struct Builder {
  json root = {{"asset", {{"version", "2.0"}}},
               {"scene", 0},
               {"scenes", {{{"nodes", {0}}}}},
               {"nodes", {{{"mesh", 0}}}}};
  std::string buffer;

  int View(const std::string& bytes, int stride = 0) {
    while (buffer.size() % 4 != 0) buffer += '\0';
    json view = {{"buffer", 0}, {"byteOffset", buffer.size()}, {"byteLength", bytes.size()}};
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
  json& Primitive(int positions, int indices = -1, int mode = -1) {
    json primitive = {{"attributes", {{"POSITION", positions}}}};
    if (indices >= 0) primitive["indices"] = indices;
    if (mode >= 0) primitive["mode"] = mode;
    return primitives_.emplace_back(primitive), primitives_.back();
  }
  void EndMesh() { root["meshes"].push_back({{"primitives", std::exchange(primitives_, json::array())}}); }

  std::string Text() {
    if (!primitives_.empty()) EndMesh();
    if (!buffer.empty() && !root.contains("buffers"))
      root["buffers"] = {
          {{"byteLength", buffer.size()}, {"uri", "data:application/octet-stream;base64," + Base64(buffer)}}};
    return root.dump();
  }
  std::string Binary() {
    root["buffers"] = {{{"byteLength", buffer.size()}}};
    std::string text = Text();
    while (text.size() % 4 != 0) text += ' ';
    while (buffer.size() % 4 != 0) buffer += '\0';
    auto word = [](size_t value) { return Bytes(std::vector<uint32_t>{uint32_t(value)}); };
    return "glTF" + word(2) + word(12 + 8 + text.size() + 8 + buffer.size()) + word(text.size()) + "JSON" +
           text + word(buffer.size()) + std::string("BIN\0", 4) + buffer;
  }

 private:
  json primitives_ = json::array();
};

const std::vector<float> kSquare = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};

class GltfTest : public testing::Test {
 protected:
  Scene Load(Builder& b, const LoadOptions& options = {}) {
    return LoadScene(files_.Write("m.gltf", b.Text()), options);
  }
  std::string Error(Builder& b) { return LoadError(files_.Write("m.gltf", b.Text())); }
  std::string Error(const std::string& text) { return LoadError(files_.Write("m.gltf", text)); }
  ScratchDirectory files_;
};

TEST_F(GltfTest, IndicesOfEveryType) {
  Builder b;
  int p = b.Positions(kSquare);
  b.Primitive(p, b.Indices<uint8_t>({0, 1, 2}));
  b.Primitive(p, b.Indices<uint16_t>({0, 2, 3}));
  b.Primitive(p, b.Indices<uint32_t>({3, 1, 0}));
  b.Primitive(b.Positions({0, 0, 5, 1, 0, 5, 0, 1, 5}));
  Scene scene = Load(b);
  EXPECT_THAT(scene.triangles,
              ElementsAre(Triangle{0, 1, 2}, Triangle{0, 2, 3}, Triangle{3, 1, 0}, Triangle{4, 5, 6}));
  EXPECT_THAT(scene.triangle_face, ElementsAre(0, 1, 2, 3));
  EXPECT_EQ(scene.positions.size(), 7u);
  EXPECT_EQ(scene.stats.faces, 4u);
  EXPECT_EQ(scene.stats.instances, 1u);
}

TEST_F(GltfTest, StripsAndFansKeepTheirOrientation) {
  Builder b;
  int p = b.Positions({0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0, 0, 2.5, 0});
  b.Primitive(p, -1, 5);
  b.Primitive(p, b.Indices<uint16_t>({0, 1, 3, 2}), 6);
  b.Primitive(p, -1, 0);
  b.Primitive(p, -1, 1);
  b.Primitive(p, -1, 2);
  b.Primitive(p, -1, 3);
  Scene scene = Load(b);
  EXPECT_THAT(scene.triangles, ElementsAre(Triangle{0, 1, 2}, Triangle{1, 3, 2}, Triangle{2, 3, 4},
                                           Triangle{1, 3, 0}, Triangle{3, 2, 0}));
  for (uint32_t i = 0; i < 5; ++i) EXPECT_GT(scene.GeometricNormal(i, {}).z, 0) << i;
}

TEST_F(GltfTest, StridesOffsetsAndSparseAccessors) {
  Builder b;
  // Position and a pad interleaved, 16 bytes apart, beginning at byte 16.
  std::vector<float> interleaved = {9, 9, 9, 9};
  for (size_t i = 0; i < 4; ++i)
    interleaved.insert(interleaved.end(), {kSquare[3 * i], kSquare[3 * i + 1], 7, -1});
  int view = b.View(Bytes(interleaved), 16);
  int indices = b.View(Bytes(std::vector<uint16_t>{1, 3})),
      values = b.View(Bytes(std::vector<float>{5, 5, 5, 6, 6, 7}));
  b.root["accessors"] = {
      {{"bufferView", view}, {"byteOffset", 16}, {"componentType", 5126}, {"count", 4}, {"type", "VEC3"}},
      {{"componentType", 5126},
       {"count", 4},
       {"type", "VEC3"},
       {"sparse",
        {{"count", 2},
         {"indices", {{"bufferView", indices}, {"componentType", 5123}}},
         {"values", {{"bufferView", values}}}}}}};
  b.Primitive(0, b.Indices<uint8_t>({0, 1, 2}));
  b.Primitive(1, b.Indices<uint8_t>({0, 1, 3}));
  Scene scene = Load(b);
  EXPECT_EQ(scene.positions[1], (Vec3f{1, 0, 7}));
  EXPECT_EQ(scene.positions[2], (Vec3f{1, 1, 7}));
  EXPECT_EQ(scene.positions[4], (Vec3f{0, 0, 0}));
  EXPECT_EQ(scene.positions[5], (Vec3f{5, 5, 5}));
  EXPECT_EQ(scene.positions[7], (Vec3f{6, 6, 7}));
}

TEST_F(GltfTest, HierarchyAndInstances) {
  Builder b;
  int p = b.Positions(kSquare);
  b.Primitive(p, b.Indices<uint8_t>({0, 1, 2, 0, 2, 3}));
  // 0: a root of scale 2 at (10,0,0), with 1 (a quarter turn about z) and 2 (a matrix that mirrors x).
  const double h = std::sqrt(0.5);
  b.root["nodes"] = {{{"children", {1, 2}}, {"translation", {10, 0, 0}}, {"scale", {2, 2, 2}}},
                     {{"mesh", 0}, {"rotation", {0, 0, h, h}}, {"translation", {0, 0, 1}}},
                     {{"mesh", 0}, {"matrix", {-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 5, 1}}},
                     {{"mesh", 0}, {"name", "not in the scene"}}};
  Scene scene = Load(b);
  ASSERT_EQ(scene.positions.size(), 8u);
  EXPECT_EQ(scene.triangles.size(), 4u);
  EXPECT_EQ(scene.stats.instances, 2u);
  EXPECT_EQ(scene.stats.shared_triangles, 2u);
  auto expect = [&](size_t i, Vec3f p) {
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(scene.positions[i][k], p[k], 1e-6) << i;
  };
  expect(0, {10, 0, 2});
  expect(1, {10, 2, 2});
  expect(2, {8, 2, 2});
  expect(5, {8, 0, 10});
  expect(6, {8, 2, 10});
  EXPECT_EQ(scene.triangles[2], (Triangle{4, 6, 5}));  // mirrored, so wound the other way: up as the first
}

TEST_F(GltfTest, TransformsAreRoundedOnce) {
  Builder b;
  b.Primitive(b.Positions({0.1f, 0.2f, 0.3f, 1, 0, 0, 0, 1, 0}));
  b.root["nodes"] = {{{"children", {1}}, {"translation", {1e6, 0, 0}}, {"scale", {3, 3, 3}}},
                     {{"mesh", 0}, {"translation", {-1e6 / 3, 0.7, 0}}}};
  Scene scene = Load(b);
  EXPECT_EQ(scene.positions[0].x, float(1e6 + 3 * (double(0.1f) - 1e6 / 3)));
  EXPECT_EQ(scene.positions[0].y, float(3 * (double(0.2f) + 0.7)));
}

TEST_F(GltfTest, BinaryAndExternalBuffers) {
  Builder b;
  int p = b.Positions(kSquare);
  b.Primitive(p, b.Indices<uint8_t>({0, 1, 2, 0, 2, 3}));
  EXPECT_EQ(LoadScene(files_.Write("m.glb", b.Binary())).triangles.size(), 2u);
  Builder external;
  int ep = external.Positions(kSquare);
  external.Primitive(ep, external.Indices<uint8_t>({0, 1, 2}));
  external.root["buffers"] = {{{"byteLength", external.buffer.size()}, {"uri", "data.bin"}}};
  EXPECT_THAT(Error(external), HasSubstr("data.bin"));
  files_.Write("data.bin", external.buffer);
  EXPECT_EQ(Load(external).triangles.size(), 1u);
  files_.Write("data.bin", external.buffer.substr(0, 20));
  Error(external);
}

TEST_F(GltfTest, EveryTruncationOfAGlbNamesTheFile) {
  Builder b;
  int p = b.Positions(kSquare);
  b.Primitive(p, b.Indices<uint8_t>({0, 1, 2, 0, 2, 3}));
  std::string bytes = b.Binary();
  for (size_t n = 0; n < bytes.size(); ++n) LoadError(files_.Write("m.glb", bytes.substr(0, n)));
}

TEST_F(GltfTest, DamagedFilesLoadOrNameTheFile) {
  Builder b;
  int p = b.Positions(kSquare);
  b.Primitive(p, b.Indices<uint8_t>({0, 1, 2, 0, 2, 3}));
  b.root["nodes"] = {{{"children", {1}}, {"rotation", {0, 0, 0, 1}}}, {{"mesh", 0}, {"scale", {2, 2, 2}}}};
  EXPECT_LT(CountRefusedMutations(files_, "m.gltf", b.Text(), 2000), 2000);
  EXPECT_LT(CountRefusedMutations(files_, "m.glb", b.Binary(), 2000), 2000);
}

TEST_F(GltfTest, MaterialsCamerasAndLights) {
  Builder b;
  int p = b.Positions(kSquare), i = b.Indices<uint8_t>({0, 1, 2});
  b.Primitive(p, i)["material"] = 1;
  b.Primitive(p, i);
  b.root["images"] = {{{"uri", "data:image/png;base64,AAAA"}}};
  b.root["textures"] = {{{"source", 0}}};
  b.root["materials"] = {
      {{"name", "unused"}},
      {{"name", "gold"},
       {"pbrMetallicRoughness", {{"baseColorFactor", {1, 0.5, 0.25, 1}}, {"roughnessFactor", 0.25}}}}};
  b.root["cameras"] = {
      {{"type", "perspective"}, {"perspective", {{"yfov", 1.0471975511965976}, {"znear", 0.1}}}},
      {{"type", "orthographic"}, {"orthographic", {{"xmag", 1}, {"ymag", 1}, {"zfar", 9}, {"znear", 0.1}}}}};
  b.root["extensionsUsed"] = {"KHR_lights_punctual"};
  b.root["extensions"] = {
      {"KHR_lights_punctual",
       {{"lights",
         {{{"type", "point"}, {"color", {1, 0.5, 0}}, {"intensity", 40}}, {{"type", "directional"}}}}}}};
  b.root["nodes"] = {{{"mesh", 0}},
                     {{"camera", 0}, {"translation", {0, 0, 5}}},
                     {{"camera", 1}},
                     {{"translation", {1, 2, 3}}, {"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}},
                     {{"extensions", {{"KHR_lights_punctual", {{"light", 1}}}}}}};
  b.root["scenes"] = {{{"nodes", {0, 1, 2, 3, 4}}}};
  Scene scene = Load(b);
  ASSERT_EQ(scene.materials.size(), 3u);
  const Material& gold = scene.materials[scene.MaterialOf(0)];
  EXPECT_EQ(gold.name, "gold");
  EXPECT_EQ(gold.reflect, (Vec3f{0.75f, 0.375f, 0.1875f}));
  EXPECT_EQ(gold.diffuse, (Vec3f{0.25f, 0.125f, 0.0625f}));
  EXPECT_EQ(scene.materials[scene.MaterialOf(1)].name, "default");
  ASSERT_EQ(scene.cameras.size(), 1u);
  EXPECT_FALSE(scene.automatic_camera);
  EXPECT_EQ(scene.cameras[0].eye, (Vec3f{0, 0, 5}));
  EXPECT_EQ(scene.cameras[0].at, (Vec3f{0, 0, 0}));
  EXPECT_FLOAT_EQ(scene.cameras[0].tan_half_fov, float(1 / std::sqrt(3.0)));
  ASSERT_EQ(scene.lights.size(), 1u);
  EXPECT_TRUE(scene.lights[0].falloff);
  EXPECT_EQ(scene.lights[0].position, (Vec3f{1, 2, 3}));
  EXPECT_EQ(scene.lights[0].intensity, (Vec3f{40, 20, 0}));
}

TEST_F(GltfTest, DracoIsNamed) {
  for (bool required : {false, true}) {
    Builder b;
    int p = b.Positions(kSquare), i = b.Indices<uint8_t>({0, 1, 2});
    b.Primitive(p, i)["extensions"] = {
        {"KHR_draco_mesh_compression", {{"bufferView", 0}, {"attributes", {{"POSITION", 0}}}}}};
    b.root["extensionsUsed"] = {"KHR_draco_mesh_compression"};
    if (required) {
      b.root["extensionsRequired"] = {"KHR_draco_mesh_compression"};
      // As real files have it: the accessors have no data of their own.
      for (json& accessor : b.root["accessors"]) accessor.erase("bufferView");
    }
    EXPECT_THAT(
        Error(b),
        HasSubstr("uses Draco compression (KHR_draco_mesh_compression), which raybench does not read: "));
  }
  Builder b;
  int p = b.Positions(kSquare);
  b.Primitive(p, b.Indices<uint8_t>({0, 1, 2}));
  b.root["extensionsRequired"] = {"EXT_meshopt_compression"};
  EXPECT_THAT(Error(b), HasSubstr("requires the glTF extension EXT_meshopt_compression"));
}

TEST_F(GltfTest, BrokenText) {
  EXPECT_THAT(Error(std::string()), HasSubstr("is empty"));
  for (const char* text : {"x", "{", "[]", "{}", "null", "{\"asset\": 5}",
                           "{\"asset\": {\"version\": \"2.0\"}, \"nodes\": [1, 2]}",
                           "{\"asset\": {\"version\": \"2.0\"}, \"accessors\": [{}]}", "glTF", "\xff\xfe{}"})
    Error(std::string(text));
  EXPECT_THAT(LoadError((files_.path() / "none.glb").string()), HasSubstr("no such file"));
  EXPECT_THAT(Error("{\"asset\": {\"version\": \"2.0\"}, \"scenes\": [{\"nodes\": []}], \"nodes\": [], "
                    "\"meshes\": []}"),
              HasSubstr("no triangles"));
}

TEST_F(GltfTest, CyclesAndTwoParents) {
  for (json nodes :
       {json{{{"mesh", 0}, {"children", {1}}}, {{"children", {0}}}}, json{{{"mesh", 0}, {"children", {0}}}},
        json{{{"mesh", 0}, {"children", {1, 2}}}, {{"children", {2}}}, json::object()}}) {
    Builder b;
    b.Primitive(b.Positions(kSquare));
    b.root["nodes"] = nodes;
    b.root["accessors"][0]["count"] = 3;
    EXPECT_THAT(Error(b), HasSubstr("reached twice"));
  }
}

TEST_F(GltfTest, DeepHierarchiesDoNotOverflowTheStack) {
  Builder b;
  b.Primitive(b.Positions({0, 0, 0, 1, 0, 0, 0, 1, 0}));
  json nodes = json::array();
  for (int i = 0; i < 20000; ++i) nodes.push_back({{"children", {i + 1}}, {"translation", {0.5, 0, 0}}});
  nodes.push_back({{"mesh", 0}});
  b.root["nodes"] = nodes;
  EXPECT_EQ(Load(b).positions[0].x, 10000);
}

TEST_F(GltfTest, ReferencesOutOfRange) {
  auto broken = [&](const std::function<void(json&)>& change) {
    Builder b;
    int p = b.Positions(kSquare);
    b.Primitive(p, b.Indices<uint16_t>({0, 1, 2}));
    b.EndMesh();
    change(b.root);
    return Error(b);
  };
  EXPECT_THAT(broken([](json& j) { j["nodes"][0]["mesh"] = 7; }), HasSubstr("mesh 7; there are 1"));
  EXPECT_THAT(broken([](json& j) { j["nodes"][0]["children"] = {5}; }), HasSubstr("node 5"));
  EXPECT_THAT(broken([](json& j) { j["scenes"][0]["nodes"] = {3}; }), HasSubstr("node 3"));
  EXPECT_THAT(broken([](json& j) { j["scene"] = 3; }), HasSubstr("scene 3"));
  EXPECT_THAT(broken([](json& j) { j["nodes"][0]["camera"] = 0; }), HasSubstr("camera 0"));
  EXPECT_THAT(broken([](json& j) { j["meshes"][0]["primitives"][0]["material"] = 2; }),
              HasSubstr("material 2"));
  broken([](json& j) { j["meshes"][0]["primitives"][0]["indices"] = 9; });
  broken([](json& j) { j["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = 9; });
  broken([](json& j) { j["accessors"][0]["bufferView"] = 9; });
  broken([](json& j) { j["bufferViews"][0]["buffer"] = 9; });
  broken([](json& j) { j["bufferViews"][0]["byteLength"] = 4000000000u; });
  broken([](json& j) { j["bufferViews"][0]["byteOffset"] = 4000000000u; });
  EXPECT_THAT(broken([](json& j) { j["accessors"][0]["count"] = 5; }),
              HasSubstr("accessor 0 (POSITION) needs 5 elements"));
  broken([](json& j) { j["accessors"][0]["count"] = 4000000000u; });
  broken([](json& j) { j["accessors"][0]["byteOffset"] = 4; });
  broken([](json& j) { j["accessors"][0]["type"] = "VEC2"; });
  EXPECT_THAT(broken([](json& j) { j["accessors"][0]["componentType"] = 5123; }), HasSubstr("VEC3 of float"));
  broken([](json& j) { j["accessors"][1]["componentType"] = 5126; });
  EXPECT_THAT(broken([](json& j) { j["accessors"][1]["count"] = 2; }), HasSubstr("a multiple of 3"));
  broken([](json& j) { j["nodes"][0]["matrix"] = {1, 2, 3}; });
  broken([](json& j) { j["nodes"][0]["rotation"] = {0, 0, 0, 0}; });
  broken([](json& j) { j["nodes"][0]["scale"] = {1e300, 1, 1}; });
}

TEST_F(GltfTest, BadIndicesAndVertices) {
  Builder b;
  int p = b.Positions({0, 0, 0, NAN, 0, 0, 1, 1, 0, 0, 1, 0});
  b.Primitive(p, b.Indices<uint8_t>({0, 2, 3, 0, 1, 2, 0, 2, 4}));
  EXPECT_THAT(Error(b), AllOf(HasSubstr("vertex 1"), HasSubstr("finite")));
  LoadOptions options;
  options.drop_bad = true;
  Scene scene = Load(b, options);
  EXPECT_THAT(scene.triangle_face, ElementsAre(0));
  EXPECT_EQ(scene.stats.dropped_triangles, 2u);
  Builder c;
  int q = c.Positions(kSquare);
  c.Primitive(q, c.Indices<uint8_t>({0, 2, 4}));
  EXPECT_THAT(Error(c), HasSubstr("refers to vertex 4; allowed are 0 to 3"));
}

}  // namespace
}  // namespace raybench
