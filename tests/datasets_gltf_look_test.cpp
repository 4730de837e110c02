// What glTF files say about looks: materials, textures, their coordinates, normals; cameras and lights.

#include <gmock/gmock.h>

#include <cmath>

#include "gltf_builder.h"

namespace raybench {
namespace {

using nlohmann::json;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

TEST_F(GltfTest, MaterialsCamerasAndLights) {
  GltfBuilder b;
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
  EXPECT_THAT(scene.stats.notes, ElementsAre("left out: 1 orthographic camera, 1 directional light"));
  ASSERT_EQ(scene.lights.size(), 1u);
  EXPECT_TRUE(scene.lights[0].falloff);
  EXPECT_EQ(scene.lights[0].position, (Vec3f{1, 2, 3}));
  EXPECT_EQ(scene.lights[0].intensity, (Vec3f{40, 20, 0}));
}

const std::string kPng = "\x89PNG\r\n\x1A\n not decoded here";

/// A square with a textured material whose coordinates are set 0 = positions and set 1 = 2 * positions.
struct Textured : GltfBuilder {
  Textured() {
    positions = Positions(kSquare);
    indices = Indices<uint8_t>({0, 1, 2, 0, 2, 3});
    std::vector<float> one, two;
    for (size_t i = 0; i < 4; ++i)
      for (size_t k = 0; k < 2; ++k) one.push_back(kSquare[3 * i + k]), two.push_back(2 * kSquare[3 * i + k]);
    uv0 = Accessor(Bytes(one), "VEC2", 5126, 4), uv1 = Accessor(Bytes(two), "VEC2", 5126, 4);
    root["images"] = {{{"uri", "data:image/png;base64," + Base64(kPng)}, {"name", "picture"}}};
    root["samplers"] = {{{"magFilter", 9728}, {"minFilter", 9729}, {"wrapS", 33071}, {"wrapT", 33648}}};
    root["textures"] = {{{"source", 0}, {"sampler", 0}}, {{"source", 0}, {"name", "again"}}};
    AddMaterial({{"index", 0}});
  }
  void AddMaterial(const json& base_color_texture) {
    root["materials"].push_back({{"pbrMetallicRoughness", {{"baseColorTexture", base_color_texture}}}});
  }
  json& Draw(int material) {
    json& primitive = Primitive(positions, indices);
    primitive["material"] = material;
    primitive["attributes"]["TEXCOORD_0"] = uv0;
    primitive["attributes"]["TEXCOORD_1"] = uv1;
    return primitive;
  }
  int positions, indices, uv0, uv1;
};

TEST_F(GltfTest, TexturesAreKeptEncoded) {
  Textured b;
  b.AddMaterial({{"index", 1}, {"texCoord", 1}});
  b.Draw(0), b.Draw(1), b.Draw(0);
  Scene scene = Load(b);
  ASSERT_EQ(scene.textures.size(), 2u);
  const Texture& t = scene.textures[0];
  EXPECT_EQ(t.name, "picture");
  EXPECT_EQ(t.mime_type, "image/png");
  EXPECT_EQ(*t.bytes, kPng);
  EXPECT_EQ(t.wrap_u, TextureWrap::kClampToEdge);
  EXPECT_EQ(t.wrap_v, TextureWrap::kMirroredRepeat);
  EXPECT_EQ(t.filter, TextureFilter::kNearest);
  EXPECT_FALSE(t.mipmaps);
  EXPECT_EQ(scene.textures[1].name, "again");
  EXPECT_EQ(scene.textures[1].bytes, t.bytes);  // shared
  EXPECT_EQ(scene.textures[1].wrap_u, TextureWrap::kRepeat);
  EXPECT_EQ(scene.materials[0].base_color_texture, 0);
  EXPECT_EQ(scene.materials[1].base_color_texture, 1);
  // The same positions with other coordinates are other vertices; with the same ones they are shared.
  ASSERT_EQ(scene.positions.size(), 8u);
  ASSERT_EQ(scene.uvs.size(), 8u);
  EXPECT_EQ(scene.positions[2], scene.positions[6]);
  EXPECT_EQ(scene.uvs[2], (Vec2f{1, 1}));
  EXPECT_EQ(scene.uvs[6], (Vec2f{2, 2}));
  EXPECT_EQ(scene.triangles[4], scene.triangles[0]);
  EXPECT_TRUE(scene.normals.empty());
}

TEST_F(GltfTest, TexturesFromFilesAndBufferViews) {
  Textured b;
  files_.Write("my picture.jpg", "\xFF\xD8\xFFjpeg");
  int view = b.View(kPng);
  b.root["images"] = {{{"uri", "my%20picture.jpg"}},
                      {{"bufferView", view}, {"mimeType", "image/png"}},
                      {{"uri", "none.png"}}};
  b.root["textures"] = {{{"source", 0}},
                        {{"extensions", {{"EXT_texture_webp", {{"source", 1}}}}}},
                        {{"source", 2}},
                        json::object()};
  for (int i = 1; i < 4; ++i) b.AddMaterial({{"index", i}});
  for (int i = 0; i < 4; ++i) b.Draw(i);
  Scene scene = LoadScene(files_.Write("m.glb", b.Binary()));
  ASSERT_EQ(scene.textures.size(), 2u);
  EXPECT_EQ(scene.textures[0].mime_type, "image/jpeg");
  EXPECT_THAT(scene.textures[0].source, HasSubstr("my picture.jpg"));
  EXPECT_EQ(*scene.textures[1].bytes, kPng);
  EXPECT_EQ(scene.materials[2].base_color_texture, -1);
  EXPECT_EQ(scene.materials[3].base_color_texture, -1);
  EXPECT_THAT(scene.stats.notes,
              ElementsAre(AllOf(HasSubstr("texture 2 is not used"), HasSubstr("none.png is missing")),
                          "texture 3 has no image and is not used"));
}

TEST_F(GltfTest, CoordinatesOnlyWhereATextureWantsThem) {
  Textured b;
  b.root["materials"].push_back({{"name", "plain"}});
  b.Draw(1);
  EXPECT_TRUE(Load(b).uvs.empty());
  EXPECT_TRUE(Load(b).textures.empty());
  Textured c;
  c.root["materials"].push_back({{"name", "plain"}});
  c.Draw(0), c.Draw(1);
  Scene scene = Load(c);
  ASSERT_EQ(scene.uvs.size(), 8u);
  EXPECT_EQ(scene.uvs[2], (Vec2f{1, 1}));
  EXPECT_EQ(scene.uvs[6], (Vec2f{0, 0}));
  Textured d;
  d.Draw(0)["attributes"].erase("TEXCOORD_0");
  EXPECT_THAT(Load(d).stats.notes, ElementsAre("1 primitive has a texture but no coordinates for it"));
}

TEST_F(GltfTest, IntegerCoordinates) {
  Textured b;
  b.uv0 = b.Accessor(Bytes(std::vector<uint16_t>{0, 0, 65535, 0, 65535, 65535, 0, 13107}), "VEC2", 5123, 4);
  b.root["accessors"][size_t(b.uv0)]["normalized"] = true;
  b.Draw(0);
  Scene scene = Load(b);
  EXPECT_EQ(scene.uvs[2], (Vec2f{1, 1}));
  EXPECT_EQ(scene.uvs[3], (Vec2f{0, 0.2f}));
}

/// The example of KHR_texture_transform: "the lower left quadrant, rotated clockwise by 90 degrees".
TEST_F(GltfTest, TextureTransform) {
  Textured b;
  b.AddMaterial({{"index", 0},
                 {"extensions",
                  {{"KHR_texture_transform",
                    {{"offset", {0, 1}}, {"rotation", 1.57079632679}, {"scale", {0.5, 0.5}}}}}}});
  b.AddMaterial({{"index", 0},
                 {"extensions",
                  {{"KHR_texture_transform", {{"offset", {0, 1}}, {"scale", {1, -1}}, {"texCoord", 1}}}}}});
  b.Draw(0), b.Draw(1), b.Draw(2);
  Scene scene = Load(b);
  ASSERT_EQ(scene.uvs.size(), 12u);
  const Vec2f quadrant[] = {{0, 1}, {0, 0.5f}, {0.5f, 0.5f}, {0.5f, 1}};
  for (size_t i = 0; i < 4; ++i) {
    EXPECT_NEAR(scene.uvs[4 + i].u, quadrant[i].u, 1e-6) << i;
    EXPECT_NEAR(scene.uvs[4 + i].v, quadrant[i].v, 1e-6) << i;
    EXPECT_EQ(scene.uvs[8 + i], (Vec2f{2 * scene.uvs[i].u, 1 - 2 * scene.uvs[i].v})) << i;
  }
  // Any angle, against libm.
  for (double angle : {-100.0, -3.2, -3.14159265358979, -1.0, 0.0, 0.5, 1.6, 2.5, 3.1415926, 7.0, 1e6}) {
    Textured c;
    c.root["materials"] = json::array();
    c.AddMaterial({{"index", 0}, {"extensions", {{"KHR_texture_transform", {{"rotation", angle}}}}}});
    c.Draw(0);
    Scene turned = Load(c);
    EXPECT_NEAR(turned.uvs[1].u, std::cos(angle), 1e-6) << angle;
    EXPECT_NEAR(turned.uvs[1].v, -std::sin(angle), 1e-6) << angle;
    EXPECT_NEAR(turned.uvs[3].u, std::sin(angle), 1e-6) << angle;
  }
}

TEST_F(GltfTest, AlphaAndSpecularGlossiness) {
  Textured b;
  b.root["materials"] = {
      {{"alphaMode", "MASK"},
       {"alphaCutoff", 0.25},
       {"pbrMetallicRoughness", {{"baseColorFactor", {1, 1, 1, 0.75}}, {"metallicFactor", 0}}}},
      {{"alphaMode", "BLEND"},
       {"pbrMetallicRoughness", {{"baseColorFactor", {1, 1, 1, 0.75}}, {"metallicFactor", 0}}}},
      {{"extensions",
        {{"KHR_materials_pbrSpecularGlossiness",
          {{"diffuseFactor", {0.5, 0.25, 0, 1}},
           {"glossinessFactor", 0},
           {"diffuseTexture", {{"index", 1}, {"texCoord", 1}}}}}}}}};
  for (int i = 0; i < 3; ++i) b.Draw(i);
  Scene scene = Load(b);
  EXPECT_EQ(scene.materials[0].alpha_mode, AlphaMode::kMask);
  EXPECT_EQ(scene.materials[0].alpha_cutoff, 0.25f);
  EXPECT_EQ(scene.materials[0].alpha, 0.75f);
  EXPECT_EQ(scene.materials[0].transmit, (Vec3f{0, 0, 0}));
  EXPECT_EQ(scene.materials[1].alpha_mode, AlphaMode::kBlend);
  EXPECT_EQ(scene.materials[1].transmit, (Vec3f{0.25f, 0.25f, 0.25f}));
  EXPECT_EQ(scene.materials[1].diffuse, (Vec3f{0.75f, 0.75f, 0.75f}));
  EXPECT_EQ(scene.materials[2].diffuse, (Vec3f{0.5f, 0.25f, 0}));
  EXPECT_EQ(scene.materials[2].specular, (Vec3f{0, 0, 0}));
  EXPECT_EQ(scene.materials[2].base_color_texture, 0);
  EXPECT_EQ(scene.uvs.back(), (Vec2f{0, 2}));
}

TEST_F(GltfTest, NormalsTurnWithTheirNode) {
  GltfBuilder b;
  int p = b.Positions({0, 0, 0, 1, 0, 0, 0, 1, 0});
  const float h = float(std::sqrt(0.5));
  int n = b.Positions({0, 0, 1, h, 0, h, 0, 0, 0});
  int other = b.Accessor(Bytes(std::vector<int8_t>{127, 0, 0, 0, 127, 0, 0, 0, -127}), "VEC3", 5120, 3);
  b.root["accessors"][size_t(other)]["normalized"] = true;
  b.Primitive(p)["attributes"]["NORMAL"] = n;
  b.Primitive(p);
  b.Primitive(p)["attributes"]["NORMAL"] = other;
  b.root["nodes"][0]["scale"] = {2, 1, -1};  // stretched and mirrored
  Scene scene = Load(b);
  ASSERT_EQ(scene.normals.size(), 9u);
  EXPECT_EQ(scene.normals[0], (Vec3f{0, 0, -1}));
  // A normal of a plane stays one of it: (1, 0, 1) becomes (1/2, 0, -1).
  EXPECT_NEAR(scene.normals[1].x, 1 / std::sqrt(5.0), 1e-6);
  EXPECT_NEAR(scene.normals[1].z, -2 / std::sqrt(5.0), 1e-6);
  for (size_t i : {2, 3, 4, 5}) EXPECT_EQ(scene.normals[i], (Vec3f{0, 0, 0})) << i;
  EXPECT_EQ(scene.normals[6], (Vec3f{1, 0, 0}));
  EXPECT_EQ(scene.normals[8], (Vec3f{0, 0, 1}));
  // Shading and geometric normal agree about the outside.
  EXPECT_LT(scene.GeometricNormal(0, {}).z, 0);
}

TEST_F(GltfTest, NotesSayWhatIsNotApplied) {
  GltfBuilder b;
  int p = b.Positions(kSquare);
  b.Primitive(p)["targets"] = {{{"POSITION", p}}};
  b.root["accessors"][0]["count"] = 3;
  b.Primitive(p, -1, 0), b.Primitive(p, -1, 1), b.Primitive(p, -1, 3);
  b.Primitive(p)["attributes"] = json::object();
  b.root["nodes"][0]["skin"] = 0;
  b.root["skins"] = {{{"joints", {0}}}};
  b.root["animations"] = {{{"channels", json::array()}, {"samplers", json::array()}}};
  EXPECT_THAT(
      Load(b).stats.notes,
      ElementsAre("not applied: animations, skins, morph targets; meshes are as stored",
                  "left out: 1 primitive of points, 2 primitives of lines, 1 primitive without positions"));
}

}  // namespace
}  // namespace raybench
