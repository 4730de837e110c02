// glTF and GLB files that are wrong: one line that says what, in bounded memory and time.

#include <gmock/gmock.h>
#include <sys/resource.h>

#include <cmath>

#include "tests/support/gltf_builder.h"

namespace raybench {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST_F(GltfTest, DamagedFilesLoadOrNameTheFile) {
  GltfBuilder b;
  int p = b.Positions(kSquare);
  b.Primitive(p, b.Indices<uint8_t>({0, 1, 2, 0, 2, 3}));
  b.root["nodes"] = {{{"children", {1}}, {"rotation", {0, 0, 0, 1}}}, {{"mesh", 0}, {"scale", {2, 2, 2}}}};
  EXPECT_LT(CountRefusedMutations(files_, "m.gltf", b.Text(), 2000), 2000);
  EXPECT_LT(CountRefusedMutations(files_, "m.glb", b.Binary(), 2000), 2000);
}

TEST_F(GltfTest, DracoIsNamed) {
  for (bool required : {false, true}) {
    GltfBuilder b;
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
  GltfBuilder b;
  int p = b.Positions(kSquare);
  b.Primitive(p, b.Indices<uint8_t>({0, 1, 2}));
  b.root["extensionsRequired"] = {"EXT_meshopt_compression"};
  EXPECT_THAT(Error(b), HasSubstr("requires the glTF extension EXT_meshopt_compression"));
  b.root.erase("extensionsRequired");
  b.root["bufferViews"][0]["extensions"]["EXT_meshopt_compression"] = {{"buffer", 0}};
  EXPECT_THAT(Error(b), HasSubstr("uses meshopt compression (EXT_meshopt_compression), which"));
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
    GltfBuilder b;
    b.Primitive(b.Positions(kSquare));
    b.root["nodes"] = nodes;
    b.root["accessors"][0]["count"] = 3;
    EXPECT_THAT(Error(b), HasSubstr("reached twice"));
  }
}

TEST_F(GltfTest, ReferencesOutOfRange) {
  auto broken = [&](const std::function<void(json&)>& change) {
    GltfBuilder b;
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
  EXPECT_THAT(broken([](json& j) { j["accessors"][0]["componentType"] = 5123; }),
              HasSubstr("is VEC3 of unsigned short; allowed is VEC3 of float"));
  broken([](json& j) { j["accessors"][1]["componentType"] = 5126; });
  EXPECT_THAT(broken([](json& j) { j["accessors"][1]["count"] = 2; }), HasSubstr("a multiple of 3"));
  broken([](json& j) { j["nodes"][0]["matrix"] = {1, 2, 3}; });
  broken([](json& j) { j["nodes"][0]["rotation"] = {0, 0, 0, 0}; });
  broken([](json& j) { j["nodes"][0]["scale"] = {1e300, 1, 1}; });
}

TEST_F(GltfTest, BadIndicesAndVertices) {
  GltfBuilder b;
  int p = b.Positions({0, 0, 0, NAN, 0, 0, 1, 1, 0, 0, 1, 0});
  b.Primitive(p, b.Indices<uint8_t>({0, 2, 3, 0, 1, 2, 0, 2, 4}));
  EXPECT_THAT(Error(b), AllOf(HasSubstr("vertex 1"), HasSubstr("finite")));
  LoadOptions options;
  options.drop_bad = true;
  Scene scene = Load(b, options);
  EXPECT_THAT(scene.triangle_face, ElementsAre(0));
  EXPECT_EQ(scene.stats.dropped_triangles, 2u);
  GltfBuilder c;
  int q = c.Positions(kSquare);
  c.Primitive(q, c.Indices<uint8_t>({0, 2, 4}));
  EXPECT_THAT(Error(c), HasSubstr("refers to vertex 4; allowed are 0 to 3"));
}

TEST_F(GltfTest, GlbHeadersAndChunks) {
  GltfBuilder b;
  b.Primitive(b.Positions(kSquare), b.Indices<uint8_t>({0, 1, 2}));
  const std::string good = b.Binary();
  auto with = [&](size_t at, const std::string& bytes) {
    std::string text = good;
    text.replace(at, bytes.size(), bytes);
    return LoadError(files_.Write("m.glb", text));
  };
  auto word = [](uint32_t value) { return Bytes(std::vector<uint32_t>{value}); };
  const size_t json_size = good.find("BIN") - 4 - 20;
  EXPECT_THAT(with(0, "GLTF"), HasSubstr("neither with '{' (JSON text) nor with 'glTF' (GLB)"));
  EXPECT_THAT(with(4, word(1)), HasSubstr("GLB of version 1; 2 is read"));
  EXPECT_THAT(with(8, word(uint32_t(good.size() + 1))), HasSubstr("is cut off: its GLB header says"));
  EXPECT_THAT(with(8, word(uint32_t(good.size() - 4))), HasSubstr("goes on behind its end"));
  EXPECT_THAT(with(12, word(0xFFFFFFFF)), HasSubstr("GLB chunk 0 says 4294967295 bytes"));
  EXPECT_THAT(with(16, "BIN"), HasSubstr("another first GLB chunk than JSON"));
  EXPECT_THAT(with(20 + json_size, word(uint32_t(b.buffer.size() + 4))), HasSubstr("GLB chunk 1 says"));
  EXPECT_THAT(with(24 + json_size, "XIN"), HasSubstr("buffer 0 has neither a URI nor the binary chunk"));
  std::string header_only = good.substr(0, 12);
  header_only.replace(8, 4, word(12));
  EXPECT_THAT(LoadError(files_.Write("m.glb", header_only)), HasSubstr("no GLB chunk with JSON"));
  // A cut at every chunk's border, with the length that fits.
  for (size_t n : {size_t{16}, size_t{20}, 20 + json_size, 24 + json_size, 28 + json_size}) {
    std::string cut = good.substr(0, n);
    cut.replace(8, 4, word(uint32_t(n)));
    LoadError(files_.Write("m.glb", cut));
  }
}

TEST_F(GltfTest, VersionsAndTypes) {
  GltfBuilder b;
  b.Primitive(b.Positions(kSquare), b.Indices<uint8_t>({0, 1, 2}));
  b.EndMesh();
  const json good = b.root;
  auto with = [&](const std::string& pointer, const json& value) {
    b.root = good;
    b.root[json::json_pointer(pointer)] = value;
    return Error(b);
  };
  EXPECT_THAT(with("/asset/version", "1.0"), HasSubstr("is glTF 1.0 (asset.version); 2.0 is read"));
  EXPECT_THAT(with("/asset/version", 1), HasSubstr("is glTF 1 (asset.version); 2.0 is read"));
  EXPECT_THAT(with("/asset/minVersion", "3.0"), HasSubstr("is glTF 3.0 (asset.minVersion)"));
  EXPECT_THAT(with("/asset", json::object()), HasSubstr("asset.version is missing"));
  EXPECT_THAT(with("/scene", "hello"), HasSubstr("scene is \"hello\"; a whole number"));
  EXPECT_THAT(with("/nodes/0/matrix", {1, 2}), HasSubstr("nodes[0].matrix is [1,2]; an array of 16 numbers"));
  EXPECT_THAT(with("/meshes/0/primitives/0/attributes/POSITION", -1),
              HasSubstr("meshes[0].primitives[0].attributes.POSITION is -1; a whole number"));
  EXPECT_THAT(with("/meshes/0/primitives", 5), HasSubstr("meshes[0].primitives is 5; an array is needed"));
  EXPECT_THAT(with("/accessors/0/count", -4), HasSubstr("accessors[0].count is -4"));
  EXPECT_THAT(with("/accessors/0/count", 1e300), HasSubstr("accessors[0].count is 1e+300"));
  EXPECT_THAT(with("/extensionsRequired", {"EXT_unheard_of"}),
              HasSubstr("requires the glTF extension EXT_unheard_of, which raybench does not read"));
  // What is wrong inside a name or a value is not repeated at any length, nor raw.
  EXPECT_LT(with("/scene", std::string(1000000, 'x')).size(), 400u);
  with("/scene", "two\nlines");
}

TEST_F(GltfTest, BuffersThatAreNotThere) {
  auto error = [&](const json& buffer) {
    GltfBuilder b;
    b.Primitive(b.Positions(kSquare), b.Indices<uint8_t>({0, 1, 2}));
    b.root["buffers"] = {buffer};
    return Error(b);
  };
  files_.Write("short.bin", "12345");
  EXPECT_THAT(error({{"byteLength", 51}, {"uri", "gone%21.bin"}}),
              AllOf(HasSubstr("buffer 0 is missing: there is no file"), HasSubstr("gone!.bin")));
  EXPECT_THAT(error({{"byteLength", 51}, {"uri", "short.bin"}}),
              AllOf(HasSubstr("buffer 0 says 51 bytes"), HasSubstr("short.bin has 5")));
  EXPECT_THAT(error({{"byteLength", 51}}), HasSubstr("buffer 0 has neither a URI nor the binary chunk"));
  EXPECT_THAT(error({{"byteLength", 51}, {"uri", "data:application/octet-stream;base64,AAAA"}}),
              HasSubstr("buffer 0 says 51 bytes; buffer 0 has 3"));
  EXPECT_THAT(error({{"byteLength", 51}, {"uri", "data:application/octet-stream;base64,A!AA"}}),
              HasSubstr("buffer 0 is not valid base64"));
  EXPECT_THAT(error({{"byteLength", 51}, {"uri", "data:text/plain,hello"}}), HasSubstr("'data:TYPE;base64,"));
  // Only relative paths, and only files that end.
  for (const char* uri : {"/etc/hostname", "file:///etc/hostname", "https://example.org/a.bin", "a%00b"})
    EXPECT_THAT(error({{"byteLength", 1}, {"uri", uri}}),
                HasSubstr("allowed are relative paths and 'data:'"));
  std::string root = "..";
  for (auto p = files_.path(); p.has_relative_path(); p = p.parent_path()) root += "/..";
  EXPECT_THAT(error({{"byteLength", 51}, {"uri", root + "/dev/zero"}}), HasSubstr("there is no file"));
  EXPECT_THAT(error({{"byteLength", 51}, {"uri", "."}}), HasSubstr("there is no file"));
}

uint64_t PeakMegabytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return uint64_t(usage.ru_maxrss) >> 10;
}

TEST_F(GltfTest, ClaimsBeyondTheFileCostNothing) {
  const uint64_t before = PeakMegabytes();
  auto claim = [&](const std::string& pointer, uint64_t value) {
    GltfBuilder b;
    int p = b.Positions(kSquare), i = b.Indices<uint8_t>({0, 1, 2});
    int where = b.View(std::string(1, '\0')), what = b.View(std::string(12, '\0'));
    b.root["accessors"].push_back({{"componentType", 5126},
                                   {"count", 4},
                                   {"type", "VEC3"},
                                   {"sparse",
                                    {{"count", 1},
                                     {"indices", {{"bufferView", where}, {"componentType", 5121}}},
                                     {"values", {{"bufferView", what}}}}}});
    b.Primitive(p, i), b.Primitive(2, i);
    const std::string text = b.Text();
    b.root[json::json_pointer(pointer)] = value;
    return Error(b);
  };
  for (uint64_t value : {uint64_t{4000000000}, uint64_t{2000000000}, uint64_t{1} << 52, uint64_t{1} << 62}) {
    for (const char* pointer :
         {"/accessors/0/count", "/accessors/1/count", "/accessors/2/count", "/accessors/2/sparse/count",
          "/accessors/0/byteOffset", "/accessors/2/sparse/values/byteOffset", "/bufferViews/0/byteLength",
          "/bufferViews/0/byteOffset", "/buffers/0/byteLength"})
      claim(pointer, value);
  }
  EXPECT_THAT(claim("/accessors/2/count", 4000000000),
              HasSubstr("accessor 2 (POSITION) says 4000000000 elements without a buffer view"));
  // More instances than there can be primitive ids, or memory.
  GltfBuilder b;
  b.Primitive(b.Positions(kSquare), b.Indices(std::vector<uint8_t>(30000)));
  b.root["nodes"] = json::array();
  b.root["scenes"][0]["nodes"] = json::array();
  for (int i = 0; i < 1000; ++i) {
    b.root["nodes"].push_back({{"mesh", 0}});
    b.root["scenes"][0]["nodes"].push_back(i);
    b.root["nodes"].back()["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = {{"TRANSLATION", 2}};
  }
  b.Positions(std::vector<float>(3000));
  EXPECT_THAT(Error(b), HasSubstr("with all instances; fewer are needed"));
  EXPECT_LT(PeakMegabytes() - before, 500u);
}

TEST_F(GltfTest, DeepJsonIsRefused) {
  for (const char* open : {"[", "{\"a\":"}) {
    std::string text = "{\"asset\": {\"version\": \"2.0\"}, \"extras\": ";
    for (int i = 0; i < 1000000; ++i) text += open;
    EXPECT_THAT(Error(text), HasSubstr("nests JSON 1000001 deep; at most 100 is allowed"));
  }
}

TEST_F(GltfTest, ShadingOfAnotherLength) {
  GltfBuilder b;
  int p = b.Positions(kSquare), n = b.Positions({0, 0, 1, 0, 0, 1, 0, 0, 1});
  b.Primitive(p, b.Indices<uint8_t>({0, 1, 2}))["attributes"]["NORMAL"] = n;
  EXPECT_THAT(Error(b), HasSubstr("primitive 0 of mesh 0 has 4 vertices, but 3 of NORMAL"));
}

TEST_F(GltfTest, FilesWithoutTrianglesSayWhatTheyHave) {
  GltfBuilder b;
  b.Primitive(b.Positions(kSquare), -1, 1);
  EXPECT_THAT(Error(b), HasSubstr("has no triangles in its default scene (left out: 1 primitive of lines)"));
}

}  // namespace
}  // namespace raybench
