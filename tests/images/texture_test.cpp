#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <memory>

#include "tests/support/tracer.h"
#include "tracer/texture_map.h"

namespace raybench {
namespace {

using testing::AddFloor;
using testing::AddMaterial;
using testing::AddQuad;
using testing::BuildTree;
using testing::kBlack;
using testing::kWhite;

/// Encodes width x height x channels numbers in the format of `name`'s ending.
template <class T>
Texture Encode(const char* name, int width, int height, int channels, const std::vector<T>& pixels,
               OIIO::TypeDesc type) {
  std::vector<unsigned char> bytes;
  OIIO::Filesystem::IOVecOutput memory(bytes);
  const auto output = OIIO::ImageOutput::create(name, &memory);
  OIIO::ImageSpec spec(width, height, channels, type);
  spec["oiio:UnassociatedAlpha"] = 1;
  EXPECT_TRUE(output && output->open(name, spec) && output->write_image(type, pixels.data()) &&
              output->close());
  Texture texture;
  texture.source = name;
  texture.bytes = std::make_shared<const std::string>(bytes.begin(), bytes.end());
  texture.filter = TextureFilter::kNearest;
  return texture;
}

Texture Png(int width, int height, int channels, const std::vector<uint8_t>& pixels) {
  return Encode("t.png", width, height, channels, pixels, OIIO::TypeDesc::UINT8);
}

double Linear(int srgb) {
  const double x = srgb / 255.0;
  return x <= 0.04045 ? x / 12.92 : std::pow((x + 0.055) / 1.055, 2.4);
}

TEST(TracerTexture, PngIsSrgbWithAlphaApart) {
  // Half-covered red must stay red: alpha is not multiplied in.
  const TextureMap map(Png(2, 2, 4, {255, 0, 0, 128, 10, 20, 30, 255, 40, 50, 60, 0, 200, 210, 220, 64}));
  EXPECT_EQ(map.width(), 2u);
  const Texel a = map.At({0.25f, 0.25f}), b = map.At({0.75f, 0.25f}), c = map.At({0.25f, 0.75f});
  EXPECT_EQ(a.color, (Vec3f{1, 0, 0}));
  EXPECT_NEAR(a.alpha, 128 / 255.0, 1e-7);
  EXPECT_NEAR(b.color.x, Linear(10), 1e-8);
  EXPECT_NEAR(b.color.y, Linear(20), 1e-8);
  EXPECT_NEAR(b.color.z, Linear(30), 1e-8);
  EXPECT_NEAR(c.color.z, Linear(60), 1e-7);
  EXPECT_EQ(c.alpha, 0);
}

TEST(TracerTexture, GreyAndSixteenBitsAndFloats) {
  const Texel grey = TextureMap(Png(1, 1, 1, {100})).At({0.5f, 0.5f});
  EXPECT_NEAR(grey.color.y, Linear(100), 1e-7);
  EXPECT_EQ(grey.alpha, 1);
  const Texel grey_alpha = TextureMap(Png(1, 1, 2, {100, 51})).At({0.5f, 0.5f});
  EXPECT_NEAR(grey_alpha.color.z, Linear(100), 1e-7);
  EXPECT_NEAR(grey_alpha.alpha, 0.2, 1e-7);
  const Texel deep = TextureMap(Encode<uint16_t>("t.png", 1, 1, 3, {25700, 0, 65535}, OIIO::TypeDesc::UINT16))
                         .At({0.5f, 0.5f});
  EXPECT_NEAR(deep.color.x, Linear(100), 1e-6);  // 25700 = 100 * 257
  EXPECT_EQ(deep.color.z, 1);
  const Texel exr =
      TextureMap(Encode<float>("t.exr", 1, 1, 3, {7.5f, 0.25f, 0}, OIIO::TypeDesc::FLOAT)).At({0, 0});
  EXPECT_EQ(exr.color, (Vec3f{7.5f, 0.25f, 0})) << "linear, and brighter than white";
  const Texel hdr =
      TextureMap(Encode<float>("t.hdr", 1, 1, 3, {4, 0.25f, 1}, OIIO::TypeDesc::FLOAT)).At({0, 0});
  EXPECT_NEAR(hdr.color.x, 4, 4 / 128.0);  // 8 bits of mantissa
  const Texel jpeg =
      TextureMap(Encode<uint8_t>("t.jpg", 8, 8, 3, std::vector<uint8_t>(192, 128), OIIO::TypeDesc::UINT8))
          .At({0.5f, 0.5f});
  EXPECT_NEAR(jpeg.color.y, Linear(128), 0.02);  // it loses
}

TEST(TracerTexture, WrapsAndFilters) {
  // Four texels in a row: 0, 85, 170, 255, linear by .exr.
  Texture texture =
      Encode<float>("t.exr", 4, 1, 3, {0, 0, 0, 1, 1, 1, 2, 2, 2, 3, 3, 3}, OIIO::TypeDesc::FLOAT);
  const auto at = [&](TextureWrap wrap, TextureFilter filter, float u) {
    texture.wrap_u = wrap, texture.filter = filter;
    return TextureMap(texture).At({u, 0.5f}).color.x;
  };
  const auto nearest = TextureFilter::kNearest, linear = TextureFilter::kLinear;
  for (auto wrap : {TextureWrap::kRepeat, TextureWrap::kClampToEdge, TextureWrap::kMirroredRepeat}) {
    EXPECT_EQ(at(wrap, nearest, 0.3f), 1);
    EXPECT_EQ(at(wrap, linear, 0.375f), 1);  // a texel's middle
    EXPECT_NEAR(at(wrap, linear, 0.5f), 1.5, 1e-6);
    EXPECT_EQ(at(wrap, nearest, std::nanf("")), 0);
    EXPECT_EQ(at(wrap, linear, 1e30f), at(wrap, linear, 0));
  }
  EXPECT_EQ(at(TextureWrap::kRepeat, nearest, 1.3f), 1);
  EXPECT_EQ(at(TextureWrap::kRepeat, nearest, -0.1f), 3);
  EXPECT_NEAR(at(TextureWrap::kRepeat, linear, 1.0f), 1.5, 1e-6) << "between the last and the first";
  EXPECT_EQ(at(TextureWrap::kClampToEdge, nearest, 1.3f), 3);
  EXPECT_EQ(at(TextureWrap::kClampToEdge, linear, 1.0f), 3);
  EXPECT_EQ(at(TextureWrap::kClampToEdge, linear, -5), 0);
  EXPECT_EQ(at(TextureWrap::kMirroredRepeat, nearest, 1.3f), 2);
  EXPECT_EQ(at(TextureWrap::kMirroredRepeat, nearest, -0.3f), 1);
  EXPECT_EQ(at(TextureWrap::kMirroredRepeat, linear, 1.0f), 3);
  EXPECT_EQ(at(TextureWrap::kMirroredRepeat, nearest, 2.1f), 0);
}

TEST(TracerTexture, WhatIsNoImageIsAnError) {
  for (const char* bytes : {"no image", "\x89PNG\r\n\x1a\n", "\xFF\xD8\xFF", "#?RADIANCE\n"}) {
    Texture texture;
    texture.source = "scene.glb: image 3";
    texture.bytes = std::make_shared<const std::string>(bytes);
    try {
      TextureMap map(texture);
      ADD_FAILURE() << bytes;
    } catch (const InputError& e) {
      const std::string text = e.what();
      EXPECT_NE(text.find("scene.glb: image 3"), text.npos) << text;
      EXPECT_EQ(text.find('\n'), text.npos) << text;
    }
  }
}

/// A floor of side 2 whose texture runs from (0, 0) at its far left corner to (1, 1); looked down on at
/// (x, z).
Scene TexturedFloor(const Material& material, const Texture& texture, float x, float z) {
  Scene scene;
  scene.ambient = {1, 1, 1};
  scene.background = {0.25f, 0.5f, 0.75f};
  AddMaterial(scene, material);
  AddFloor(scene, {0, 0, 0}, 1);  // corners (-1,1), (1,1), (1,-1); (-1,1), (1,-1), (-1,-1)
  scene.uvs = {{0, 1}, {1, 1}, {1, 0}, {0, 1}, {1, 0}, {0, 0}};
  scene.textures = {texture};
  scene.lights = {{.position = {0, 9, 0}, .intensity = kBlack}};
  scene.cameras = {{.eye = {x, 1, z}, .at = {x, 0, z}, .up = {0, 0, -1}, .tan_half_fov = 1e-3f}};
  scene.Finish();
  return scene;
}

Vec3f PixelOf(const Scene& scene) {
  return Trace(scene, BuildTree(scene), {.width = 1, .height = 1}).image.pixels[0];
}

TEST(TracerTexture, MultipliesDiffuseMirrorAndTransmission) {
  const Texture texture =
      Encode<float>("t.exr", 2, 2, 3, {0.5f, 0.25f, 1, 1, 0, 0, 0, 1, 0, 0, 0, 1}, OIIO::TypeDesc::FLOAT);
  Material m{.name = "m", .diffuse = {0.5f, 1, 1}, .base_color_texture = 0};
  EXPECT_EQ(PixelOf(TexturedFloor(m, texture, -0.5f, -0.5f)), (Vec3f{0.25f, 0.25f, 1})) << "upper left";
  EXPECT_EQ(PixelOf(TexturedFloor(m, texture, 0.5f, -0.5f)), (Vec3f{0.5f, 0, 0}));
  EXPECT_EQ(PixelOf(TexturedFloor(m, texture, -0.5f, 0.5f)), (Vec3f{0, 1, 0}));
  EXPECT_EQ(PixelOf(TexturedFloor(m, texture, 0.5f, 0.5f)), (Vec3f{0, 0, 1}));
  m.diffuse = kBlack, m.reflect = kWhite;
  EXPECT_EQ(PixelOf(TexturedFloor(m, texture, -0.5f, -0.5f)), (Vec3f{0.125f, 0.125f, 0.75f}));
  m.reflect = kBlack, m.transmit = kWhite;
  EXPECT_EQ(PixelOf(TexturedFloor(m, texture, -0.5f, -0.5f)), (Vec3f{0.125f, 0.125f, 0.75f}));
  Material glowing{.name = "m", .diffuse = kBlack, .emission = {2, 2, 2}, .emission_texture = 0};
  EXPECT_EQ(PixelOf(TexturedFloor(glowing, texture, -0.5f, -0.5f)), (Vec3f{1, 0.5f, 2}));
}

TEST(TracerTexture, AreDecodedOnlyWhereTheyAreRead) {
  Texture broken;
  broken.source = "broken", broken.bytes = std::make_shared<const std::string>("no image");
  Scene scene = TexturedFloor({.name = "m", .diffuse = kWhite}, broken, 0.3f, 0.3f);
  EXPECT_EQ(PixelOf(scene), kWhite);
  scene.materials.push_back({.name = "unused", .base_color_texture = 0});
  EXPECT_EQ(PixelOf(scene), kWhite);
  scene.materials[0].base_color_texture = 0;
  EXPECT_THROW(PixelOf(scene), InputError);
  scene.uvs.clear();
  EXPECT_EQ(PixelOf(scene), kWhite);
}

TEST(TracerAlpha, HolesAreSeenThroughAndLetLightThrough) {
  // The left half is cut out. Below, a grey floor; above, a light.
  const Texture texture = Png(2, 1, 4, {255, 255, 255, 127, 255, 255, 255, 128});
  Material m{.name = "leaf", .diffuse = kWhite, .base_color_texture = 0, .alpha_mode = AlphaMode::kMask};
  for (const float x : {-0.5f, 0.5f}) {
    Scene scene = TexturedFloor(m, texture, x, 0.25f);
    scene.ambient = kBlack;
    const uint32_t grey = AddMaterial(scene, {.name = "grey", .diffuse = {0.5f, 0.5f, 0.5f}});
    AddFloor(scene, {0, -2, 0}, 5, true, grey);
    scene.uvs.resize(scene.positions.size());
    scene.triangle_face.clear();
    scene.lights = {{.position = {x, 9, 0.25f}}};
    scene.Finish();
    // Alpha 127/255 is below 1/2: the floor is seen, and lit through the hole.
    const TraceResult result = Trace(scene, BuildTree(scene), {.width = 1, .height = 1});
    EXPECT_EQ(result.image.pixels[0], x < 0 ? (Vec3f{0.5f, 0.5f, 0.5f}) : kWhite);
    EXPECT_EQ(result.shadow_resumed, x < 0 ? 1u : 0u);
    EXPECT_EQ(result.camera_hits, 1u);
    // From below, where it is not cut out it throws a shadow.
    scene.cameras = {{.eye = {x, -1, 0.25f}, .at = {x, -2, 0.25f}, .up = {0, 0, -1}, .tan_half_fov = 1e-3f}};
    scene.Finish();
    const TraceResult below = Trace(scene, BuildTree(scene), {.width = 1, .height = 1});
    EXPECT_EQ(below.image.pixels[0].x, x < 0 ? 0.5f : 0);
    EXPECT_EQ(below.shadow_blocked, x < 0 ? 0u : 1u);
    // Without a mask alpha does nothing.
    scene.materials[0].alpha_mode = AlphaMode::kOpaque;
    EXPECT_EQ(PixelOf(scene), kBlack);
  }
}

TEST(TracerAlpha, ManyHolesInARowAndInOnePlace) {
  Scene scene;
  scene.background = {0.25f, 0.5f, 0.75f};
  AddMaterial(scene, {.name = "gone", .alpha = 0.2f, .alpha_mode = AlphaMode::kMask});
  for (int i = 0; i < 10; ++i) AddFloor(scene, {0, -float(i / 2), 0}, 3);
  scene.cameras = {{.eye = {0.1f, 1, 0.2f}, .at = {0, -9, 0}, .tan_half_fov = 0.1f}};
  scene.Finish();
  const TraceResult result = Trace(scene, BuildTree(scene), {.width = 5, .height = 5, .capture = true});
  for (const Vec3f& pixel : result.image.pixels) EXPECT_EQ(pixel, scene.background);
  EXPECT_EQ(result.camera_hits, 0u);
  EXPECT_EQ(testing::FindSet(result, "camera")->rays.size(), 25u) << "each ray once";
}

TEST(TracerEnvironment, LooksUpByDirection) {
  // Columns of a 4 x 2 map are quarters of the horizon, from the left: behind to the left, before to the
  // left, before to the right, behind to the right.
  std::vector<float> pixels;
  for (int y = 0; y < 2; ++y)
    for (int x = 0; x < 4; ++x) pixels.insert(pixels.end(), {float(x), float(y), 9});
  Scene scene;
  scene.textures = {Encode<float>("t.exr", 4, 2, 3, pixels, OIIO::TypeDesc::FLOAT)};
  scene.environment = 0;
  AddMaterial(scene, {.name = "m"});
  AddFloor(scene, {0, -100, 0}, 0.001f);
  scene.Finish();
  const TextureMaps maps(scene, {});
  const auto column = [&](Vec3d direction) { return maps.Environment(direction).x; };
  EXPECT_EQ(column({-0.1, 0.2, 1}), 0);
  EXPECT_EQ(column({0.1, 0.2, 1}), 3);
  EXPECT_EQ(column({-1, 0.2, -0.1}), 1);
  EXPECT_EQ(column({0.1, 0.2, -1}), 2);
  EXPECT_EQ(column({1, 0.2, -0.1}), 2);
  EXPECT_EQ(column({1, 0.2, 0.1}), 3);
  EXPECT_EQ(maps.Environment({0.3, 0.01, -0.4}).y, 0) << "row 0 is above";
  EXPECT_EQ(maps.Environment({0.3, -0.01, -0.4}).y, 1);
  EXPECT_EQ(maps.Environment({0, 1, 0}).y, 0);
  // In a picture it takes the place of the background.
  scene.cameras = {{.eye = {0, 0, 0}, .at = {1, 0.2f, 0.2f}, .tan_half_fov = 1e-3f}};
  EXPECT_EQ(PixelOf(scene), (Vec3f{3, 0, 9}));
}

TEST(TracerDeterminism, EverythingAtOnceDependsOnNeitherThreadsNorBands) {
  Scene scene = testing::MixedScene(41);
  scene.materials[0].alpha_mode = AlphaMode::kMask, scene.materials[0].base_color_texture = 0;
  scene.materials[2].dispersion = {-0.01f, 0, 0.02f}, scene.materials[2].fresnel = true;
  std::vector<uint8_t> pixels;
  Random random(5);
  for (int i = 0; i < 16 * 16 * 4; ++i) pixels.push_back(uint8_t(random.Below(256)));
  scene.textures = {Png(16, 16, 4, pixels)};
  for (const Vec3f& p : scene.positions) {
    scene.uvs.push_back({p.x, p.z});
    scene.normals.push_back(Normalize(p + Vec3f{0.1f, 0.2f, 0.3f}));
  }
  scene.lights.push_back({.kind = LightKind::kDirectional, .direction = {0, -1, 0}});
  scene.Finish();
  const Tree tree = BuildTree(scene, "bvh_sah");
  for (SelfIntersection cure : {SelfIntersection::kErrorBound, SelfIntersection::kSkip}) {
    TraceOptions options{.width = 60,
                         .height = 50,
                         .sampling = {.pattern = SamplePattern::kLowDiscrepancy,
                                      .grid = 2,
                                      .filter = ReconstructionFilter::kMitchell},
                         .self_intersection = cure,
                         .threads = 1,
                         .capture = true};
    const TraceResult reference = Trace(scene, tree, options);
    EXPECT_GT(reference.shadow_resumed, 1000u);
    EXPECT_GT(reference.refraction_hits, 100u);
    for (uint32_t band : {1u << 20, 777u}) {
      options.threads = 0, options.band_rays = band;
      const TraceResult other = Trace(scene, tree, options);
      EXPECT_EQ(other.image.pixels, reference.image.pixels);
      EXPECT_EQ(other.shadow_blocked, reference.shadow_blocked);
      EXPECT_EQ(other.shadow_resumed, reference.shadow_resumed);
      ASSERT_EQ(other.ray_sets.size(), reference.ray_sets.size());
      for (size_t i = 0; i < other.ray_sets.size(); ++i)
        EXPECT_EQ(other.ray_sets[i].hash, reference.ray_sets[i].hash) << other.ray_sets[i].Label();
    }
  }
}

}  // namespace
}  // namespace raybench
