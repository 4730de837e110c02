// What a scene needs, each need both ways, with its reason; what is left out because nothing reads it.
#include "datasets/scene/needs.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "datasets/scene/facts.h"
#include "tests/support/datasets.h"

namespace raybench {
namespace {

using ::testing::HasSubstr;

const Material kMatte{.name = "matte"};
const Material kGlass{.name = "glass", .transmit = {1, 1, 1}};
const Material kMirror{.name = "mirror", .reflect = {0.5f, 0.5f, 0.5f}};

/// Two triangles of a square of the first material; the others belong to nothing.
Scene Square(const std::vector<Material>& materials, bool finish = true) {
  Scene scene;
  scene.provenance.source = "test";
  scene.positions = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  scene.triangles = {{0, 1, 2}, {0, 2, 3}};
  scene.materials = materials;
  if (finish) scene.Finish();
  return scene;
}

Scene Ball(const Material& material) {
  Scene scene;
  scene.spheres = {{{0, 0, 0}, 1}};
  scene.materials = {material};
  scene.Finish();
  return scene;
}

void AddTexture(Scene& scene, const char* name = "t") {
  scene.textures.push_back({name, "t.png", "image/png", std::make_shared<std::string>("0123456789")});
}

/// The square with coordinates and a texture that materials may name.
Scene TexturedSquare(const std::vector<Material>& materials) {
  Scene scene = Square(materials, false);
  scene.uvs = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  AddTexture(scene);
  scene.Finish();
  return scene;
}

std::string Why(const SceneNeeds& needs, const std::string& name) {
  for (const Need& need : needs.list)
    if (need.name == name) return need.why;
  ADD_FAILURE() << "no need " << name;
  return {};
}

TEST(SceneNeeds, AMatteSquareNeedsShadowsAndCoordinatesOfHitsAlone) {
  const SceneNeeds needs = NeedsOf(Square({kMatte, kGlass, kMirror}));  // two that nothing uses
  EXPECT_TRUE(needs.shadow_rays);
  EXPECT_TRUE(needs.uv);
  std::string names;
  for (const Need& need : needs.list) {
    EXPECT_EQ(need.needed, std::string(need.name) == "shadow_rays" || std::string(need.name) == "uv")
        << need.name;
    EXPECT_FALSE(need.why.empty()) << need.name;
    EXPECT_EQ(need.why.find('\n'), std::string::npos);
    names += std::string(need.name) + " ";
  }
  EXPECT_EQ(names,
            "shadow_rays reflection_rays refraction_rays transmittance uv textures smooth_normals alpha "
            "dispersion environment ");
  EXPECT_EQ(needs.BuildNeeds(), uint64_t(RB_NEED_UV | RB_NEED_ANY));
  EXPECT_EQ(Why(needs, "shadow_rays"), "2 lights; 1 of 1 materials in use scatters light");
  EXPECT_EQ(Why(needs, "refraction_rays"), "no material in use transmits");
}

TEST(SceneNeeds, NoShadowRaysWithoutLightOrWithoutWhatScattersIt) {
  Scene dark = Square({kMatte}, false);
  dark.lights = {{.position = {0, 0, 1}, .intensity = {0, 0, 0}}};
  dark.Finish();
  EXPECT_FALSE(NeedsOf(dark).shadow_rays);
  EXPECT_EQ(NeedsOf(dark).BuildNeeds(), uint64_t(RB_NEED_UV));
  EXPECT_EQ(Why(NeedsOf(dark), "shadow_rays"), "no light shines");

  Material clear = kGlass;
  clear.diffuse = {0, 0, 0};
  const SceneNeeds needs = NeedsOf(Square({clear}));
  EXPECT_FALSE(needs.shadow_rays);
  EXPECT_FALSE(needs.transmittance) << "there is no shadow ray to gather it";
  EXPECT_EQ(needs.BuildNeeds(), uint64_t(RB_NEED_UV));
  clear.specular = {1, 1, 1};
  EXPECT_TRUE(NeedsOf(Square({clear})).shadow_rays) << "a highlight is light that is scattered";
}

TEST(SceneNeeds, MirrorsReflectAndGlassMayReflectTotally) {
  EXPECT_TRUE(NeedsOf(Square({kMirror})).reflection_rays);
  EXPECT_FALSE(NeedsOf(Square({kMirror})).refraction_rays);
  EXPECT_TRUE(NeedsOf(Square({kGlass})).reflection_rays);
  Material pane = kGlass;
  pane.thin = true;
  EXPECT_FALSE(NeedsOf(Square({pane})).reflection_rays) << "what goes straight on is never reflected totally";
  pane.fresnel = true;
  EXPECT_TRUE(NeedsOf(Square({pane})).reflection_rays);
  Material air = kGlass;
  air.ior = 1;
  EXPECT_FALSE(NeedsOf(Square({air})).reflection_rays);
  EXPECT_TRUE(NeedsOf(Square({air})).refraction_rays);
}

TEST(SceneNeeds, WhatTransmitsMakesShadowRaysGoOn) {
  const SceneNeeds needs = NeedsOf(Square({kGlass, kMatte}));
  EXPECT_TRUE(needs.refraction_rays);
  EXPECT_TRUE(needs.transmittance);
  EXPECT_FALSE(needs.alpha);
  EXPECT_EQ(needs.BuildNeeds(), uint64_t(RB_NEED_UV | RB_NEED_AFTER));
  EXPECT_EQ(Why(needs, "refraction_rays"), "1 of 1 materials in use transmits");
  Material blend{.name = "blend", .transmit = {0.5f, 0.5f, 0.5f}, .ior = 1, .alpha = 0.5f};
  blend.alpha_mode = AlphaMode::kBlend;
  EXPECT_TRUE(NeedsOf(Square({blend})).transmittance);
  EXPECT_FALSE(NeedsOf(Square({blend})).alpha) << "readers say by `transmit` what blends";
  blend.transmit = {0, 0, 0};
  EXPECT_FALSE(NeedsOf(Square({blend})).transmittance);
}

TEST(SceneNeeds, AlphaCutsOutWhereItCanFallBelowTheCutoff) {
  Material mask{.name = "mask", .alpha = 0.75f, .alpha_mode = AlphaMode::kMask, .alpha_cutoff = 0.5f};
  EXPECT_FALSE(NeedsOf(Square({mask})).alpha) << "0.75 everywhere";
  mask.base_color_texture = 0;
  const SceneNeeds needs = NeedsOf(TexturedSquare({mask}));
  EXPECT_TRUE(needs.alpha);
  EXPECT_TRUE(needs.transmittance);
  EXPECT_EQ(needs.BuildNeeds(), uint64_t(RB_NEED_UV | RB_NEED_AFTER));
  Material gone = mask;
  gone.base_color_texture = -1, gone.alpha = 0.25f;
  EXPECT_TRUE(NeedsOf(Square({gone})).alpha);
  mask.alpha_mode = AlphaMode::kOpaque;
  EXPECT_FALSE(NeedsOf(TexturedSquare({mask})).alpha);
}

TEST(SceneNeeds, AlphaNeedsResumingWithoutLightsToo) {
  Material gone{.name = "gone", .alpha = 0, .alpha_mode = AlphaMode::kMask};
  Scene dark = Square({gone}, false);
  dark.lights = {{.position = {0, 0, 1}, .intensity = {0, 0, 0}}};
  dark.Finish();
  EXPECT_EQ(NeedsOf(dark).BuildNeeds(), uint64_t(RB_NEED_UV | RB_NEED_AFTER)) << "camera rays go on";
}

TEST(SceneNeeds, SpheresHaveNoBarycentricsNorTextures) {
  Material painted = kMatte;
  painted.base_color_texture = 0;
  Scene ball;
  ball.spheres = {{{0, 0, 0}, 1}};
  ball.materials = {painted};
  AddTexture(ball);
  ball.Finish();
  const SceneNeeds needs = NeedsOf(ball);
  EXPECT_FALSE(needs.uv);
  EXPECT_FALSE(needs.textures);
  EXPECT_EQ(needs.BuildNeeds(), uint64_t(RB_NEED_ANY));
}

TEST(SceneNeeds, TexturesOfMaterialsInUse) {
  Material painted = kMatte, glowing = kMatte;
  painted.base_color_texture = 0, glowing.emission_texture = 0;
  EXPECT_TRUE(NeedsOf(TexturedSquare({painted})).textures);
  EXPECT_TRUE(NeedsOf(TexturedSquare({glowing})).textures);
  EXPECT_FALSE(NeedsOf(TexturedSquare({kMatte, painted, glowing})).textures) << "nothing uses them";
}

TEST(SceneNeeds, NothingIsCutOutBelowZero) {
  Material painted = kMatte;
  painted.base_color_texture = 0, painted.alpha_mode = AlphaMode::kMask;
  EXPECT_TRUE(NeedsOf(TexturedSquare({painted})).alpha);
  painted.alpha_cutoff = 0;
  EXPECT_FALSE(NeedsOf(TexturedSquare({painted})).alpha);
}

TEST(SceneNeeds, DispersionOfWhatBends) {
  Material prism = kGlass;
  prism.dispersion = {-0.01f, 0, 0.01f};
  EXPECT_TRUE(NeedsOf(Square({prism})).dispersion);
  EXPECT_FALSE(NeedsOf(Square({kGlass})).dispersion);
  EXPECT_FALSE(NeedsOf(Square({kMatte, prism})).dispersion);
  Material pane = prism;
  pane.thin = true;
  EXPECT_FALSE(NeedsOf(Square({pane})).dispersion);
  Material opaque = prism;
  opaque.transmit = {0, 0, 0};
  EXPECT_FALSE(NeedsOf(Square({opaque})).dispersion);
}

TEST(SceneNeeds, EnvironmentWhereThereIsAMap) {
  Scene scene = Square({kMatte});
  EXPECT_FALSE(NeedsOf(scene).environment);
  AddTexture(scene), scene.environment = 0;
  EXPECT_TRUE(NeedsOf(scene).environment);
}

TEST(SceneNeeds, SmoothNormalsAreThoseThatDiffer) {
  Scene scene = Square({kMatte}, false);
  scene.normals = {{0, 0, 1}, {0, 0, 7}, {0, 0, 0}, {1e-7f, 0, 1}};  // any length, none, rounded
  scene.Finish();
  EXPECT_FALSE(NeedsOf(scene).smooth_normals);
  EXPECT_THAT(Why(NeedsOf(scene), "smooth_normals"), HasSubstr("are the geometric ones"));
  scene.normals[3] = {1e-4f, 0, 1};
  EXPECT_TRUE(NeedsOf(scene).smooth_normals);
  scene.normals[3] = {0, 0, -1};
  EXPECT_TRUE(NeedsOf(scene).smooth_normals) << "the other side";

  Scene polygon;
  polygon.positions = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  polygon.polygon_vertices = {0, 1, 2, 3};
  polygon.polygons = {{0, 4}};
  polygon.normals.resize(4, Vec3f{0, 0, 1});
  polygon.Finish();
  EXPECT_FALSE(NeedsOf(polygon).smooth_normals);
  polygon.normals[2] = {0, 1, 1};
  EXPECT_TRUE(NeedsOf(polygon).smooth_normals);
}

TEST(DropUnread, LeavesOutWhatNothingReadsAndKeepsTheHash) {
  Material painted = kMatte;
  painted.base_color_texture = 0;
  Scene scene = TexturedSquare({kMatte, painted});
  scene.normals.resize(4, Vec3f{0, 0, 1});
  AddTexture(scene, "sky");
  scene.environment = 1;
  const std::string hash = scene.hash();
  DropUnread(scene);
  EXPECT_TRUE(scene.uvs.empty());
  EXPECT_TRUE(scene.normals.empty());
  ASSERT_EQ(scene.textures.size(), 1u);
  EXPECT_EQ(scene.textures[size_t(scene.environment)].name, "sky");
  EXPECT_EQ(scene.materials[1].base_color_texture, -1);
  EXPECT_EQ(scene.stats.saved_bytes, 4 * sizeof(Vec2f) + 4 * sizeof(Vec3f) + 10);
  EXPECT_EQ(scene.hash(), hash);
}

TEST(DropUnread, KeepsWhatIsRead) {
  Material painted = kMatte;
  painted.base_color_texture = 0;
  Scene scene = TexturedSquare({painted});
  scene.normals.resize(4, Vec3f{0, 1, 1});
  DropUnread(scene);
  EXPECT_EQ(scene.uvs.size(), 4u);
  EXPECT_EQ(scene.normals.size(), 4u);
  EXPECT_EQ(scene.textures.size(), 1u);
  EXPECT_EQ(scene.materials[0].base_color_texture, 0);
  EXPECT_EQ(scene.stats.saved_bytes, 0u);
}

TEST(DropUnread, RunsOnLoading) {
  ScratchDirectory files;
  const std::string file = files.Write("flat.nff", "pp 3 0 0 0 0 0 1 1 0 0 0 0 1 0 1 0 0 0 1\n");
  const Scene flat = LoadScene(file);
  EXPECT_TRUE(flat.normals.empty());
  EXPECT_EQ(flat.stats.saved_bytes, 3 * sizeof(Vec3f));
  const Scene round = LoadScene(files.Write("round.nff", "pp 3 0 0 0 0 0 1 1 0 0 0 1 1 0 1 0 0 0 1\n"));
  EXPECT_EQ(round.normals.size(), 3u);
  EXPECT_EQ(round.stats.saved_bytes, 0u);
  EXPECT_EQ(flat.hash(), round.hash());
  LoadOptions keep;
  keep.keep_unread = true;
  const Scene kept = LoadScene(file, keep);
  EXPECT_EQ(kept.normals.size(), 3u);
  EXPECT_EQ(kept.stats.saved_bytes, 0u);
}

TEST(SceneFacts, MeasuresTheSmallestFeatureAndTheSpreadOfSizes) {
  Scene scene = Square({kMatte});
  SceneFacts facts = Examine(scene);
  EXPECT_EQ(facts.smallest_feature_ulp, 0x1p23) << "edges of 1 beside a coordinate of 1";
  EXPECT_EQ(facts.size_spread(), 1);
  scene = Square({kMatte}, false);
  scene.positions = {{1024, 0, 0}, {1024.5f, 0, 0}, {1024, 0.5f, 0}, {1032, 8, 0}};
  scene.Finish();
  facts = Examine(scene);
  EXPECT_EQ(facts.smallest_feature_ulp, 0.5 * 0x1p13) << "an ulp of 1024 is 2^-13";
  EXPECT_EQ(facts.size_spread(), 1) << "of two the 99th percentile is the first";
  const SceneFacts ball = Examine(Ball(kMatte));
  EXPECT_EQ(ball.size_spread(), 0);
  EXPECT_NEAR(ball.smallest_feature_ulp, 0x1p23, 0x1p22);
}

}  // namespace
}  // namespace raybench
