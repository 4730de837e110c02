// What glTF files say about looks: materials, textures, their coordinates, normals; cameras and lights.

#include <gmock/gmock.h>

#include <cmath>

#include "tests/support/gltf_builder.h"

namespace raybench {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

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
  EXPECT_THAT(scene.stats.notes, ElementsAre("left out: 1 orthographic camera"));
  ASSERT_EQ(scene.lights.size(), 2u);
  EXPECT_EQ(scene.lights[0].kind, LightKind::kPoint);
  EXPECT_TRUE(scene.lights[0].falloff);
  EXPECT_EQ(scene.lights[0].range, INFINITY);
  EXPECT_EQ(scene.lights[0].position, (Vec3f{1, 2, 3}));
  EXPECT_EQ(scene.lights[0].intensity, (Vec3f{40, 20, 0}));
  EXPECT_EQ(scene.lights[1].kind, LightKind::kDirectional);
  EXPECT_EQ(scene.lights[1].direction, (Vec3f{0, 0, -1}));
  EXPECT_EQ(scene.lights[1].intensity, (Vec3f{1, 1, 1}));
  EXPECT_FALSE(scene.lights[1].falloff);
}

/// A triangle, and a light of its own node.
GltfBuilder Lit(const json& light, const json& node = json::object()) {
  GltfBuilder b;
  b.Primitive(b.Positions(kSquare), b.Indices<uint8_t>({0, 1, 2}));
  b.root["extensions"] = {{"KHR_lights_punctual", {{"lights", json::array({light})}}}};
  b.root["nodes"].push_back(node);
  b.root["nodes"][1]["extensions"] = {{"KHR_lights_punctual", {{"light", 0}}}};
  b.root["scenes"][0]["nodes"] = {0, 1};
  return b;
}

TEST_F(GltfTest, SpotAndDirectionalLightsShineAlongTheirNode) {
  // A quarter turn about x takes -z to y; the scale bends nothing, since it acts first and along the axes.
  const double h = std::sqrt(0.5);
  const json node = {{"rotation", {h, 0, 0, h}}, {"scale", {2, 3, 5}}, {"translation", {1, 2, 3}}};
  GltfBuilder spot = Lit({{"type", "spot"},
                          {"intensity", 8},
                          {"range", 20},
                          {"spot", {{"innerConeAngle", 0.5}, {"outerConeAngle", 1.0471975511965976}}}},
                         node);
  const Light s = Load(spot).lights.at(0);
  EXPECT_EQ(s.kind, LightKind::kSpot);
  EXPECT_TRUE(s.falloff);
  EXPECT_EQ(s.position, (Vec3f{1, 2, 3}));
  EXPECT_EQ(s.intensity, (Vec3f{8, 8, 8}));
  EXPECT_EQ(s.range, 20);  // scales act on places alone
  EXPECT_NEAR(s.direction.x, 0, 1e-7);
  EXPECT_NEAR(s.direction.y, 1, 1e-7);
  EXPECT_NEAR(s.direction.z, 0, 1e-7);
  EXPECT_FLOAT_EQ(s.cos_inner, float(std::cos(0.5)));
  EXPECT_FLOAT_EQ(s.cos_outer, 0.5f);

  GltfBuilder sun =
      Lit({{"type", "directional"}, {"color", {1, 0.5, 0.25}}, {"intensity", 4}, {"range", 20}}, node);
  const Light d = Load(sun).lights.at(0);
  EXPECT_EQ(d.kind, LightKind::kDirectional);
  EXPECT_FALSE(d.falloff);
  EXPECT_EQ(d.intensity, (Vec3f{4, 2, 1}));
  EXPECT_NEAR(d.direction.y, 1, 1e-7);

  // Defaults, and the widest cone as files have it: pi / 2 rounded to float.
  GltfBuilder plain = Lit({{"type", "spot"}, {"spot", json::object()}});
  EXPECT_EQ(Load(plain).lights.at(0).cos_inner, 1);
  EXPECT_FLOAT_EQ(Load(plain).lights.at(0).cos_outer, float(std::sqrt(0.5)));
  GltfBuilder wide = Lit({{"type", "spot"}, {"spot", {{"outerConeAngle", 1.57079637}}}});
  EXPECT_EQ(Load(wide).lights.at(0).cos_outer, 0);
}

TEST_F(GltfTest, LightErrors) {
  const auto error = [&](const json& light, const json& node = json::object()) {
    GltfBuilder b = Lit(light, node);
    return Error(b);
  };
  EXPECT_THAT(error({{"type", "ambient"}}),
              HasSubstr("light 0 has the type 'ambient'; allowed are directional, point, spot"));
  EXPECT_THAT(error({{"type", "point"}, {"intensity", -1}}),
              HasSubstr("light 0 has intensity -1 and a channel of colour 1; at least 0 is needed"));
  EXPECT_THAT(error({{"type", "point"}, {"intensity", "1"}}),
              HasSubstr("lights[0].intensity is \"1\"; a number"));
  EXPECT_THAT(error({{"type", "point"}, {"color", {1, -0.5, 1}}}), HasSubstr("a channel of colour -0.5"));
  EXPECT_THAT(error({{"type", "point"}, {"color", {1, 1}}}), HasSubstr("an array of 3 numbers is needed"));
  EXPECT_THAT(error({{"type", "point"}, {"range", -2}}), HasSubstr("light 0 has range -2; more than 0"));
  EXPECT_THAT(error({{"type", "point"}, {"intensity", 1e300}}), HasSubstr("light 0 is not finite"));
  EXPECT_THAT(error({{"type", "spot"}}), HasSubstr("Spot light description not found"));
  for (const json& cones :
       {json{{"innerConeAngle", 0.5}, {"outerConeAngle", 0.4}}, json{{"innerConeAngle", -0.1}},
        json{{"outerConeAngle", 1.6}}, json{{"innerConeAngle", 0}, {"outerConeAngle", 0}}})
    EXPECT_THAT(error({{"type", "spot"}, {"spot", cones}}), HasSubstr("0 <= inner <= outer <= pi/2"))
        << cones;
  EXPECT_THAT(error({{"type", "directional"}}, {{"scale", {1, 1, 0}}}),
              HasSubstr("the light of node 1 has no direction"));
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

class GltfMaterialTest : public GltfTest {
 protected:
  /// One material on a triangle.
  static GltfBuilder Wearing(const json& material) {
    GltfBuilder b;
    b.Primitive(b.Positions(kSquare), b.Indices<uint8_t>({0, 1, 2}))["material"] = 0;
    b.root["materials"].push_back(material);
    return b;
  }
  Material Read(const json& material) {
    GltfBuilder b = Wearing(material);
    return Load(b).materials.at(0);
  }
  std::string MaterialError(const json& material) {
    GltfBuilder b = Wearing(material);
    return Error(b);
  }
  static json Glass(const json& more = json::object()) {
    json glass = {{"pbrMetallicRoughness", {{"metallicFactor", 0}, {"baseColorFactor", {1, 0.5, 0.25, 1}}}},
                  {"extensions", {{"KHR_materials_transmission", {{"transmissionFactor", 0.75}}}}}};
    glass.merge_patch(more);
    return glass;
  }
};

TEST_F(GltfMaterialTest, TransmissionRefractsInABodyAndGoesStraightThroughAPane) {
  const Material body = Read(Glass({{"extensions", {{"KHR_materials_ior", {{"ior", 1.25}}}}}}));
  EXPECT_EQ(body.transmit, (Vec3f{0.75f, 0.375f, 0.1875f}));
  EXPECT_EQ(body.diffuse, (Vec3f{0.25f, 0.125f, 0.0625f}));
  EXPECT_EQ(body.ior, 1.25f);
  EXPECT_TRUE(body.fresnel);
  EXPECT_FALSE(body.thin);
  EXPECT_EQ(Read(Glass()).ior, 1.5f);
  const json two_sided = {{"doubleSided", true}};
  EXPECT_TRUE(Read(Glass(two_sided)).thin);
  EXPECT_TRUE(Read(Glass(two_sided)).fresnel);
  json thick = two_sided;
  thick["extensions"]["KHR_materials_volume"]["thicknessFactor"] = 0.5;
  EXPECT_FALSE(Read(Glass(thick)).thin);
  thick["extensions"]["KHR_materials_volume"]["thicknessFactor"] = 0;
  EXPECT_TRUE(Read(Glass(thick)).thin);
  // Metals let nothing through, whatever the factor.
  const Material metal = Read(Glass({{"pbrMetallicRoughness", {{"metallicFactor", 1}}}}));
  EXPECT_EQ(metal.transmit, (Vec3f{0, 0, 0}));
  EXPECT_FALSE(metal.fresnel);
  // Nor does a factor of 0; a blended surface is no dielectric.
  json blend =
      Glass({{"alphaMode", "BLEND"}, {"pbrMetallicRoughness", {{"baseColorFactor", {1, 1, 1, 0.25}}}}});
  blend["extensions"]["KHR_materials_transmission"]["transmissionFactor"] = 0;
  const Material veil = Read(blend);
  EXPECT_EQ(veil.transmit, (Vec3f{0.75f, 0.75f, 0.75f}));
  EXPECT_TRUE(veil.thin);
  EXPECT_FALSE(veil.fresnel);
  EXPECT_EQ(veil.ior, 1);
}

TEST_F(GltfMaterialTest, IorDecidesTheHighlightOfDielectrics) {
  const auto specular = [&](const json& extensions) {
    return Read({{"extensions", extensions},
                 {"pbrMetallicRoughness", {{"metallicFactor", 0}, {"roughnessFactor", 0}}}})
        .specular.x;
  };
  EXPECT_FLOAT_EQ(specular(json::object()), 0.04f);
  EXPECT_FLOAT_EQ(specular({{"KHR_materials_ior", {{"ior", 3}}}}), 0.25f);
  EXPECT_EQ(specular({{"KHR_materials_ior", {{"ior", 1}}}}), 0);
  EXPECT_GT(specular({{"KHR_materials_ior", {{"ior", 0}}}}), 0.99f);  // "infinite"
}

TEST_F(GltfMaterialTest, DispersionIsAbbesNumber) {
  const json prism = {
      {"extensions",
       {{"KHR_materials_ior", {{"ior", 1.6}}}, {"KHR_materials_dispersion", {{"dispersion", 0.5}}}}}};
  const Material m = Read(Glass(prism));
  EXPECT_LT(m.dispersion.x, 0);
  EXPECT_EQ(m.dispersion.y, 0);
  const double abbe = (m.ior - 1.0) / (m.dispersion.z - m.dispersion.x);
  EXPECT_NEAR(abbe, 20 / 0.5, 1e-4);
  // However strong, no index falls below that of air.
  json strong = prism;
  strong["extensions"]["KHR_materials_dispersion"]["dispersion"] = 1000;
  const Material rainbow = Read(Glass(strong));
  EXPECT_GE(rainbow.ior + rainbow.dispersion.x, 1);
  json pane = prism;
  pane["doubleSided"] = true;
  EXPECT_EQ(Read(Glass(pane)).dispersion, (Vec3f{0, 0, 0}));
  EXPECT_EQ(Read(prism).dispersion, (Vec3f{0, 0, 0})) << "opaque";
}

TEST_F(GltfMaterialTest, EmissionMayExceedOne) {
  const json lamp = {{"emissiveFactor", {1, 0.5, 0.25}},
                     {"extensions", {{"KHR_materials_emissive_strength", {{"emissiveStrength", 8}}}}}};
  EXPECT_EQ(Read(lamp).emission, (Vec3f{8, 4, 2}));
  EXPECT_EQ(Read({{"emissiveFactor", {1, 0.5, 0.25}}}).emission, (Vec3f{1, 0.5f, 0.25f}));
  EXPECT_EQ(Read({{"name", "dark"}}).emission, (Vec3f{0, 0, 0}));
}

TEST_F(GltfMaterialTest, ErrorsNameTheMaterialAndTheNumber) {
  const auto with = [](const char* extension, const char* key, const json& value) {
    return json{{"extensions", {{extension, {{key, value}}}}}};
  };
  EXPECT_THAT(MaterialError(with("KHR_materials_ior", "ior", 0.5)),
              HasSubstr("material 0 has ior 0.5 (KHR_materials_ior); 0 (infinite) or at least 1 is needed"));
  const std::pair<const char*, const char*> keys[] = {{"KHR_materials_ior", "ior"},
                                                      {"KHR_materials_transmission", "transmissionFactor"},
                                                      {"KHR_materials_emissive_strength", "emissiveStrength"},
                                                      {"KHR_materials_dispersion", "dispersion"},
                                                      {"KHR_materials_volume", "thicknessFactor"}};
  for (const auto& [extension, key] : keys) {
    EXPECT_THAT(MaterialError(with(extension, key, -1)),
                AllOf(HasSubstr("material 0 has "), HasSubstr(key), HasSubstr("-1"),
                      HasSubstr("at least 0 is needed")));
    EXPECT_THAT(MaterialError(with(extension, key, "1")),
                AllOf(HasSubstr(key), HasSubstr("a number is needed")));
  }
  EXPECT_THAT(MaterialError({{"emissiveTexture", {{"texCoord", 0}}}}),
              HasSubstr("materials[0].emissiveTexture.index is missing"));
  EXPECT_THAT(MaterialError({{"emissiveFactor", {1, 1, 1}}, {"emissiveTexture", {{"index", 3}}}}),
              HasSubstr("refers to texture 3; there are 0"));
}

TEST_F(GltfMaterialTest, IgnoredExtensionsAreNamed) {
  GltfBuilder b = Wearing({{"extensions",
                            {{"KHR_materials_sheen", json::object()},
                             {"KHR_materials_clearcoat", json::object()},
                             {"KHR_materials_ior", json::object()}}}});
  EXPECT_THAT(Load(b).stats.notes, ElementsAre("extensions of materials that are not followed: "
                                               "KHR_materials_clearcoat, KHR_materials_sheen"));
}

/// Whatever the factors, a surface gives back no more than it gets.
TEST_F(GltfMaterialTest, WeightsAddUpToAtMostOne) {
  for (double metal : {0.0, 0.3, 1.0})
    for (double rough : {0.0, 0.4, 1.0})
      for (double transmission : {0.0, 0.7, 1.0})
        for (const char* mode : {"OPAQUE", "BLEND"}) {
          const Material m = Read(
              {{"alphaMode", mode},
               {"pbrMetallicRoughness",
                {{"metallicFactor", metal}, {"roughnessFactor", rough}, {"baseColorFactor", {1, 1, 1, 0.6}}}},
               {"extensions", {{"KHR_materials_transmission", {{"transmissionFactor", transmission}}}}}});
          EXPECT_LE(m.diffuse.x + m.reflect.x + m.transmit.x, 1 + 1e-6f)
              << metal << " " << rough << " " << transmission << " " << mode;
          EXPECT_GE(m.diffuse.x, 0);
        }
}

TEST_F(GltfTest, EmissiveTextures) {
  const json glow = {{"emissiveFactor", {1, 1, 1}}, {"emissiveTexture", {{"index", 1}, {"texCoord", 1}}}};
  {  // alone, and with coordinates of its own
    Textured b;
    b.root["materials"] = json::array({glow});
    b.Draw(0);
    const Scene scene = Load(b);
    EXPECT_EQ(scene.materials[0].base_color_texture, -1);
    EXPECT_EQ(scene.materials[0].emission_texture, 0);
    EXPECT_EQ(scene.textures.at(0).name, "again");
    EXPECT_EQ(scene.uvs.at(2), (Vec2f{2, 2}));
  }
  {  // at the places of the base colour
    Textured b;
    b.root["materials"] = json::array({glow});
    b.root["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = {{"index", 0}, {"texCoord", 1}};
    b.Draw(0);
    const Scene scene = Load(b);
    EXPECT_EQ(scene.materials[0].base_color_texture, 0);
    EXPECT_EQ(scene.materials[0].emission_texture, 1);
    EXPECT_TRUE(scene.stats.notes.empty());
  }
  const json turned = {{"KHR_texture_transform", {{"rotation", 1}}}};
  for (const json& base : {json{{"index", 0}}, json{{"index", 0}, {"texCoord", 1}, {"extensions", turned}}}) {
    Textured b;
    b.root["materials"] = json::array({glow});
    b.root["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = base;
    b.Draw(0);
    const Scene scene = Load(b);
    EXPECT_EQ(scene.materials[0].base_color_texture, 0);
    EXPECT_EQ(scene.materials[0].emission_texture, -1);
    EXPECT_EQ(scene.materials[0].emission, (Vec3f{0, 0, 0}));
    EXPECT_THAT(scene.stats.notes, ElementsAre(HasSubstr("material 0 does not glow")));
    EXPECT_EQ(scene.textures.size(), 1u);
  }
  {  // multiplied by 0: not needed
    Textured b;
    b.root["materials"] = json::array({glow});
    b.root["materials"][0].erase("emissiveFactor");
    b.Draw(0);
    const Scene scene = Load(b);
    EXPECT_TRUE(scene.textures.empty());
    EXPECT_TRUE(scene.uvs.empty());
  }
  {  // missing: all of it would glow
    Textured b;
    b.root["images"] = {{{"uri", "none.png"}}};
    b.root["materials"] = json::array({glow});
    b.Draw(0);
    const Scene scene = Load(b);
    EXPECT_EQ(scene.materials[0].emission, (Vec3f{0, 0, 0}));
    EXPECT_THAT(scene.stats.notes, ElementsAre(HasSubstr("none.png is missing")));
    EXPECT_TRUE(scene.uvs.empty());
  }
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
