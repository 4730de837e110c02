// Where t meets the ends of what a float is: truth, audit and both oracles keep to one rule.
#include <gtest/gtest.h>

#include <cmath>

#include "harness/truth/oracle.h"
#include "tests/support/meshes.h"
#include "tests/support/rays.h"

namespace raybench::testing {
namespace {

constexpr float kTop = std::numeric_limits<float>::max(), kLeast = std::numeric_limits<float>::denorm_min(),
                kEndless = std::numeric_limits<float>::infinity();

TEST(OracleLimits, AHitIsOneOnlyAtAFiniteFloat) {
  // The plane z = 0 seen from z = h along (0, 0, -d): t = h / d, exactly.
  const Scene scene = [] {
    Scene s;
    s.provenance.source = "test";
    s.positions = {{-1, -1, 0}, {3, -1, 0}, {-1, 3, 0}};
    s.triangles = {{0, 1, 2}};
    s.Finish();
    return s;
  }();
  const auto ray = [](float h, float d, float tnear, float tfar) {
    return rb_ray{{0.25f, 0.25f, h}, tnear, {0, 0, -d}, tfar};
  };
  struct Case {
    float h, d, tnear, tfar;
    bool hit;
  };
  const float up = std::nextafter(1.0f, 2.0f);
  const Case cases[] = {
      {kTop, 1, 0, kEndless, true},  // t = FLT_MAX
      {kTop, 1, 0, kTop, true},
      {kTop, 1, kTop, kEndless, false},  // nothing lies behind
      {kTop, 1, std::nextafter(kTop, 0.0f), kEndless, true},
      {kTop, 0.5f, 0, kEndless, false},                        // 2^128
      {kTop, std::nextafter(1.0f, 0.0f), 0, kEndless, false},  // half an ulp above FLT_MAX, and more
      {0x1p127f, 0x1p-1f, 0, kEndless, false},
      {0x1p-20f, kLeast, 0, kEndless, false},  // 2^129
      {0x1p-30f, kLeast, 0, kEndless, true},   // 2^119
      {1, 0x1p-128f, 0, kEndless, false},      // 2^128
      {1, 0x1p-127f, 0, kEndless, true},
      {1, 0x1p-127f, 0, kTop, true},
      {kLeast, 1, 0, kEndless, true},        // the least t
      {kLeast, 2, 0, kEndless, true},        // half of it: no 0
      {kLeast, 0x1p30f, 0, kEndless, true},  // far less; still behind the origin
      {kLeast, 1, kLeast, kEndless, false},
      {kLeast, 0.5f, kLeast, kEndless, true},
      {0, 1, 0, kEndless, false},
      {up, 1, 1, kEndless, true},
      {up, 1, up, kEndless, false},
      {1, 1, 0, 1, true},
      {up, 1, 0, 1, false},
      {1, 1, 0, -kEndless, false}};
  std::vector<rb_ray> rays;
  for (const Case& c : cases) rays.push_back(ray(c.h, c.d, c.tnear, c.tfar));
  const auto oracle = MakeOracle(scene), boxes = MakeBoxOracle(scene);
  const std::vector<Truth> truth = oracle->Ask(rays, 1), other = boxes->Ask(rays, 1);
  for (size_t i = 0; i < rays.size(); ++i) {
    const Case& c = cases[i];
    SCOPED_TRACE(std::to_string(i));
    EXPECT_EQ(truth[i].hit, c.hit);
    EXPECT_EQ(other[i].hit, c.hit);
    if (!c.hit) continue;
    EXPECT_EQ(truth[i].t, double(c.h) / double(c.d));
    for (const Truth& t : {truth[i], other[i]})
      EXPECT_TRUE(t.t_rounded > c.tnear && t.t_rounded <= c.tfar && std::isfinite(t.t_rounded))
          << t.t_rounded;
  }
  EXPECT_NO_THROW(oracle->Audit(rays, truth, 1, rays.size()));
}

TEST(OracleLimits, SoItIsForProceduralPrimitives) {
  Scene scene;
  scene.provenance.source = "test";
  scene.spheres = {{{0, 0, 0}, 1}};
  scene.polygons = {{0, 4}};
  scene.positions = {{-1, -1, -2}, {1, -1, -2}, {1, 1, -2}, {-1, 1, -2}};
  scene.polygon_vertices = {0, 1, 2, 3};
  scene.Finish();
  const auto oracle = MakeOracle(scene);
  // t is 2^126, 2^127 or 2^128 at the sphere's near side, 3/2 of it at the far one, 2^128 at most at
  // the polygon.
  const std::vector<rb_ray> rays = {
      {{0, 0, 2}, 0, {0, 0, -0x1p-126f}, kEndless},       {{0, 0, 2}, 0, {0, 0, -0x1p-127f}, kEndless},
      {{0, 0, 2}, 0, {0, 0, -0x1p-128f}, kEndless},       {{0, 0, 0}, 0, {0, 0, -0x1p-127f}, kEndless},
      {{0.9f, 0.9f, 0}, 0, {0, 0, -0x1p-127f}, kEndless}, {{0.9f, 0.9f, 0}, 0, {0, 0, -0x1p-126f}, kEndless}};
  const bool hit[] = {true, true, false, true, false, true};
  const std::vector<Truth> truth = oracle->Ask(rays, 1);
  for (size_t i = 0; i < rays.size(); ++i) {
    EXPECT_EQ(truth[i].hit, hit[i]) << i;
    if (truth[i].hit) {
      EXPECT_TRUE(std::isfinite(truth[i].t_rounded)) << i;
    }
  }
}

}  // namespace
}  // namespace raybench::testing
