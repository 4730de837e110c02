// The geometry of glTF and GLB files.

#include <gmock/gmock.h>

#include <cmath>

#include "tests/support/gltf_builder.h"

namespace raybench {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

using Triangle = std::array<uint32_t, 3>;

TEST_F(GltfTest, IndicesOfEveryType) {
  GltfBuilder b;
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
  GltfBuilder b;
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
  GltfBuilder b;
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

TEST_F(GltfTest, SparseIndicesWithoutABufferView) {
  GltfBuilder b;
  int p = b.Positions(kSquare);
  int where = b.View(Bytes(std::vector<uint8_t>{1, 2, 4, 5}));
  int what = b.View(Bytes(std::vector<uint16_t>{1, 2, 2, 3}));
  b.root["accessors"].push_back({{"componentType", 5123},
                                 {"count", 6},
                                 {"type", "SCALAR"},
                                 {"sparse",
                                  {{"count", 4},
                                   {"indices", {{"bufferView", where}, {"componentType", 5121}}},
                                   {"values", {{"bufferView", what}}}}}});
  b.Primitive(p, 1);
  EXPECT_THAT(Load(b).triangles, ElementsAre(Triangle{0, 1, 2}, Triangle{0, 2, 3}));
}

TEST_F(GltfTest, IntegerPositionsAreNormalizedWhereSaid) {
  const std::vector<int8_t> bytes = {-128, 0, 0, 0, 127, 0, 0, 0, 0, 127, 0, 0};
  const std::vector<uint16_t> shorts = {0, 0, 0, 0, 65535, 0, 0, 0, 0, 3, 0, 0};
  GltfBuilder b;
  b.root["extensionsUsed"] = b.root["extensionsRequired"] = {"KHR_mesh_quantization"};
  int byte_view = b.View(Bytes(bytes), 4), short_view = b.View(Bytes(shorts), 8);
  for (auto [view, type, normalized] :
       {std::tuple(byte_view, 5120, true), std::tuple(byte_view, 5120, false),
        std::tuple(short_view, 5123, true), std::tuple(short_view, 5123, false)}) {
    b.root["accessors"].push_back({{"bufferView", view},
                                   {"componentType", type},
                                   {"normalized", normalized},
                                   {"count", 3},
                                   {"type", "VEC3"}});
    b.Primitive(int(b.root["accessors"].size()) - 1);
  }
  Scene scene = Load(b);
  EXPECT_EQ(scene.positions[0], (Vec3f{-1, 0, 0}));
  EXPECT_EQ(scene.positions[1], (Vec3f{1, 0, 0}));
  EXPECT_EQ(scene.positions[3], (Vec3f{-128, 0, 0}));
  EXPECT_EQ(scene.positions[4], (Vec3f{127, 0, 0}));
  EXPECT_EQ(scene.positions[7], (Vec3f{1, 0, 0}));
  EXPECT_EQ(scene.positions[8], (Vec3f{0, float(3 / 65535.0), 0}));
  EXPECT_EQ(scene.positions[10], (Vec3f{65535, 0, 0}));
  b.root.erase("extensionsUsed"), b.root.erase("extensionsRequired");
  EXPECT_THAT(Error(b), HasSubstr("accessor 0 (POSITION) is VEC3 of byte; allowed is VEC3 of float"));
}

TEST_F(GltfTest, HierarchyAndInstances) {
  GltfBuilder b;
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
  GltfBuilder b;
  b.Primitive(b.Positions({0.1f, 0.2f, 0.3f, 1, 0, 0, 0, 1, 0}));
  b.root["nodes"] = {{{"children", {1}}, {"translation", {1e6, 0, 0}}, {"scale", {3, 3, 3}}},
                     {{"mesh", 0}, {"translation", {-1e6 / 3, 0.7, 0}}}};
  Scene scene = Load(b);
  EXPECT_EQ(scene.positions[0].x, float(1e6 + 3 * (double(0.1f) - 1e6 / 3)));
  EXPECT_EQ(scene.positions[0].y, float(3 * (double(0.2f) + 0.7)));
}

TEST_F(GltfTest, MirroredSolidsKeepTheirOutside) {
  GltfBuilder b;
  b.Primitive(b.Positions({0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1}),
              b.Indices<uint8_t>({0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3}));
  b.root["nodes"] = {{{"mesh", 0}, {"scale", {2, -3, 1}}, {"children", {1}}},
                     {{"mesh", 0}, {"scale", {1, 1, -1}}, {"translation", {9, 0, 0}}}};
  Scene scene = Load(b);
  double volume[2] = {0, 0};
  for (uint32_t i = 0; i < 8; ++i) {
    const auto corners = CornersOf(scene, i);
    const Vec3d far = {i < 4 ? 0.0 : 18.0, 0, 0};  // the solid's own origin
    volume[i / 4] += Dot(ToDouble(corners[0]) - far, scene.GeometricNormal(i, {}));
  }
  EXPECT_DOUBLE_EQ(volume[0], 6);
  EXPECT_DOUBLE_EQ(volume[1], 6);
}

TEST_F(GltfTest, InstancesByAttributes) {
  GltfBuilder b;
  b.Primitive(b.Positions({0, 0, 0, 1, 0, 0, 0, 1, 0}));
  int t = b.Positions({0, 0, 0, 5, 0, 0, 0, 0, 7});
  int r = b.Accessor(Bytes(std::vector<int16_t>{0, 0, 0, 32767, 0, 0, 32767, 0, 0, 0, 0, 32767}), "VEC4",
                     5122, 3);
  b.root["accessors"][size_t(r)]["normalized"] = true;
  int s = b.Positions({1, 1, 1, 2, 1, 1, 3, 3, 3});
  b.root["nodes"][0]["scale"] = {10, 10, 10};
  b.root["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = {
      {"TRANSLATION", t}, {"ROTATION", r}, {"SCALE", s}, {"_ID", 0}};
  b.root["extensionsUsed"] = b.root["extensionsRequired"] = {"EXT_mesh_gpu_instancing"};
  Scene scene = Load(b);
  EXPECT_EQ(scene.stats.instances, 3u);
  EXPECT_EQ(scene.stats.shared_triangles, 2u);
  ASSERT_EQ(scene.positions.size(), 9u);
  EXPECT_EQ(scene.positions[1], (Vec3f{10, 0, 0}));
  EXPECT_EQ(scene.positions[3], (Vec3f{50, 0, 0}));
  EXPECT_EQ(scene.positions[4], (Vec3f{30, 0, 0}));  // half a turn about z
  EXPECT_EQ(scene.positions[8], (Vec3f{0, 30, 70}));
  b.root["accessors"][size_t(s)]["count"] = 2;
  EXPECT_THAT(Error(b), HasSubstr("node 0 has instances of 3 and of 2 elements"));
  b.root["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = json::object();
  EXPECT_THAT(Error(b), HasSubstr("without TRANSLATION, ROTATION or SCALE"));
}

TEST_F(GltfTest, OneSceneIsRead) {
  GltfBuilder b;
  b.Primitive(b.Positions({0, 0, 0, 1, 0, 0, 0, 1, 0}));
  b.EndMesh();
  b.root["meshes"].push_back({{"primitives", json::array()}});  // empty
  b.root["meshes"].push_back(b.root["meshes"][0]);              // used by no node
  b.root["nodes"] = {{{"mesh", 0}}, {{"mesh", 0}, {"translation", {1, 2, 3}}}, {{"mesh", 1}}};
  b.root["scenes"] = {{{"nodes", {0}}}, {{"nodes", {1, 2}}}};
  b.root["scene"] = 1;
  Scene scene = Load(b);
  ASSERT_EQ(scene.triangles.size(), 1u);
  EXPECT_EQ(scene.positions[0], (Vec3f{1, 2, 3}));
  EXPECT_THAT(scene.stats.notes, ElementsAre("has 2 scenes; scene 1 is read",
                                             "left out: 1 mesh that no node of the scene uses"));
  b.root.erase("scene");  // the first, then
  EXPECT_EQ(Load(b).positions[0], (Vec3f{0, 0, 0}));
  b.root.erase("scenes");  // without scenes: all nodes
  EXPECT_EQ(Load(b).triangles.size(), 2u);
}

TEST_F(GltfTest, EmptyAccessorsAndMeshes) {
  GltfBuilder b;
  int p = b.Positions(kSquare);
  b.Primitive(p, b.Indices<uint8_t>({0, 1, 2}));
  b.root["accessors"].push_back({{"bufferView", 0}, {"componentType", 5126}, {"count", 0}, {"type", "VEC3"}});
  b.root["accessors"].push_back(
      {{"bufferView", 1}, {"componentType", 5121}, {"count", 0}, {"type", "SCALAR"}});
  b.Primitive(2);
  b.Primitive(p, 3);
  b.Primitive(2, 3, 6);
  Scene scene = Load(b);
  EXPECT_EQ(scene.triangles.size(), 1u);
  EXPECT_EQ(scene.positions.size(), 4u);
}

TEST_F(GltfTest, BinaryAndExternalBuffers) {
  GltfBuilder b;
  int p = b.Positions(kSquare);
  b.Primitive(p, b.Indices<uint8_t>({0, 1, 2, 0, 2, 3}));
  EXPECT_EQ(LoadScene(files_.Write("m.glb", b.Binary())).triangles.size(), 2u);
  GltfBuilder external;
  int ep = external.Positions(kSquare);
  external.Primitive(ep, external.Indices<uint8_t>({0, 1, 2}));
  external.root["buffers"] = {{{"byteLength", external.buffer.size()}, {"uri", "data.bin"}}};
  EXPECT_THAT(Error(external), HasSubstr("data.bin"));
  files_.Write("data.bin", external.buffer);
  EXPECT_EQ(Load(external).triangles.size(), 1u);
  files_.Write("data.bin", external.buffer.substr(0, 20));
  Error(external);

  // Escapes in the name, a folder, and a second buffer.
  std::filesystem::create_directory(files_.path() / "a b");
  files_.Write("a b/p%20.bin", external.buffer);
  external.root["buffers"] = {{{"byteLength", external.buffer.size()}, {"uri", "a%20b/../a%20b/p%2520.bin"}},
                              {{"byteLength", 3}, {"uri", "data:;base64,AAEC"}}};
  external.root["bufferViews"][1] = {{"buffer", 1}, {"byteLength", 3}};
  EXPECT_EQ(Load(external).triangles.size(), 1u);
}

TEST_F(GltfTest, WholeNumbersMayBeWrittenAsFractions) {
  GltfBuilder b;
  int p = b.Positions(kSquare);
  b.Primitive(p, b.Indices<uint8_t>({0, 1, 2}));
  std::string text = b.Text();
  size_t at = text.find("\"count\":3");
  ASSERT_NE(at, text.npos);
  text.replace(at, 9, "\"count\":3.0e0");
  EXPECT_EQ(LoadScene(files_.Write("m.gltf", "\xEF\xBB\xBF \n" + text)).triangles.size(), 1u);
  text.replace(at, 13, "\"count\":3.5");
  EXPECT_THAT(Error(text), HasSubstr("accessors[1].count is 3.5; a whole number from 0 is needed"));
}

TEST_F(GltfTest, DeepHierarchiesDoNotOverflowTheStack) {
  GltfBuilder b;
  b.Primitive(b.Positions({0, 0, 0, 1, 0, 0, 0, 1, 0}));
  json nodes = json::array();
  for (int i = 0; i < 100000; ++i) nodes.push_back({{"children", {i + 1}}, {"translation", {0.5, 0, 0}}});
  nodes.push_back({{"mesh", 0}});
  b.root["nodes"] = nodes;
  EXPECT_EQ(Load(b).positions[0].x, 50000);
}

TEST_F(GltfTest, ProgressGoesUpToOne) {
  GltfBuilder b;
  b.Primitive(b.Positions(kSquare), b.Indices<uint8_t>({0, 1, 2}));
  b.root["nodes"] = {{{"mesh", 0}}, {{"mesh", 0}}};
  b.root["scenes"][0]["nodes"] = {0, 1};
  std::vector<double> told;
  LoadOptions options;
  options.progress = [&](double fraction) { told.push_back(fraction); };
  Load(b, options);
  EXPECT_TRUE(std::is_sorted(told.begin(), told.end()));
  EXPECT_THAT(told, AllOf(::testing::SizeIs(::testing::Ge(3u)), ::testing::Contains(0.5)));
  EXPECT_EQ(told.back(), 1);
}

}  // namespace
}  // namespace raybench
