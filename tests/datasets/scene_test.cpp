// Scene::Finish(): exact degeneracy, rescaling, checks, automatic camera and lights; procedural spheres.

#include <gmock/gmock.h>

#include <cmath>
#include <cstring>

#include "accel/base/random.h"
#include "datasets/scene/orientation.h"
#include "tests/support/datasets.h"

namespace raybench {
namespace {

using ::testing::HasSubstr;

/// Collinearity by 128-bit integers, for coordinates that are multiples of 2^-20 below 2^24.
bool IsDegenerateInteger(Vec3f a, Vec3f b, Vec3f c) {
  __int128 u[3], v[3];
  for (int i = 0; i < 3; ++i) {
    u[i] = __int128(std::ldexp(double(b[i]), 20)) - __int128(std::ldexp(double(a[i]), 20));
    v[i] = __int128(std::ldexp(double(c[i]), 20)) - __int128(std::ldexp(double(a[i]), 20));
  }
  for (int i = 0; i < 3; ++i)
    if (u[i] * v[(i + 1) % 3] != u[(i + 1) % 3] * v[i]) return false;
  return true;
}

TEST(DegenerateTest, AgreesWithIntegerArithmeticOnNearlyCollinearTriples) {
  Random random(7);
  int degenerate = 0;
  for (int n = 0; n < 200000; ++n) {
    auto coordinate = [&](int bits) { return float(std::ldexp(double(random.Below(1u << bits)), -4)); };
    Vec3f a{coordinate(20), coordinate(12), coordinate(4)};
    Vec3f step{coordinate(8), coordinate(6), coordinate(4)};
    float k = float(random.Below(64)), m = float(random.Below(64));
    Vec3f b = a + step * k, c = a + step * m;
    if (n % 2 == 1) {  // off the line by one unit in the last place, in one coordinate
      int axis = int(random.Below(3));
      c[axis] = std::nextafter(c[axis], 1e9f);
      if (c[axis] < 8) continue;  // not a multiple of 2^-20 any more
    }
    bool expected = IsDegenerateInteger(a, b, c);
    degenerate += expected;
    ASSERT_EQ(IsDegenerate(a, b, c), expected) << n;
    ASSERT_EQ(IsDegenerate(c, a, b), expected) << n;
    ASSERT_EQ(IsDegenerate(b, a, c), expected) << n;
  }
  EXPECT_GT(degenerate, 50000);
  EXPECT_LT(degenerate, 150000);
}

TEST(DegenerateTest, IsExactAcrossTheWholeRangeOfFloat) {
  const float tiny = std::numeric_limits<float>::denorm_min(), huge = std::numeric_limits<float>::max();
  // On the diagonal x = y = z everything is collinear, whatever the exponents; one unit off it nothing is.
  for (float s : {tiny, 0x1p-126f, 0x1p-60f, 1.0f, 0x1p60f, huge / 2}) {
    Vec3f o{-tiny, -tiny, -tiny}, p{s, s, s}, q{huge, huge, huge};
    EXPECT_TRUE(IsDegenerate(o, p, q)) << s;
    p.x = std::nextafter(p.x, huge);
    EXPECT_FALSE(IsDegenerate(o, p, q)) << s;
    EXPECT_FALSE(IsDegenerate(q, o, p)) << s;
    q.y = std::nextafter(q.y, 0.0f);
    EXPECT_FALSE(IsDegenerate(o, {s, s, s}, q)) << s;
  }
  EXPECT_TRUE(IsDegenerate({1, 2, 3}, {1, 2, 3}, {4, 5, 7}));
  EXPECT_TRUE(IsDegenerate({0.1f, 0.1f, 0}, {0.1f, 0.1f, 0}, {0.1f, 0.1f, 0}));
  EXPECT_FALSE(IsDegenerate({0, 0, 0}, {tiny, 0, 0}, {0, tiny, 0}));
  EXPECT_FALSE(IsDegenerate({huge, huge, huge}, {-huge, huge, huge}, {huge, -huge, huge}));
}

Scene Tetrahedron(float s) {
  Scene scene;
  scene.provenance.source = "test.obj";
  scene.positions = {{0, 0, 0}, {s, 0, 0}, {0, s, 0}, {0, 0, s}};
  scene.triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  return scene;
}

TEST(FinishTest, ShadingAttributesGoWithPositions) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  Scene scene = Tetrahedron(1);
  scene.normals = {{0, 0, 1}, {nan, 0, 1}, {3, 4, 0}, {0, INFINITY, 0}};
  scene.uvs = {{0, 0}, {1, 0}, {0.5f, -7}, {0, nan}};
  scene.materials.resize(1);
  scene.materials[0].base_color_texture = 0;
  scene.textures.push_back({"t", "t.png", "image/png", std::make_shared<std::string>("x")});
  Scene plain = Tetrahedron(1);
  scene.Finish(), plain.Finish();
  EXPECT_EQ(scene.normals, (std::vector<Vec3f>{{0, 0, 1}, {0, 0, 0}, {3, 4, 0}, {0, 0, 0}}));
  EXPECT_EQ(scene.uvs, (std::vector<Vec2f>{{0, 0}, {1, 0}, {0.5f, -7}, {0, 0}}));
  EXPECT_THAT(scene.stats.notes,
              ::testing::ElementsAre("2 shading normals are not finite and count as 0",
                                     "1 texture coordinates are not finite and count as 0"));
  EXPECT_EQ(scene.hash(), plain.hash());  // looks are no geometry
  Scene uneven = Tetrahedron(1);
  uneven.normals.resize(3);
  EXPECT_THROW(uneven.Finish(), std::logic_error);
  Scene broken = Tetrahedron(1);
  broken.materials.resize(1);
  broken.materials[0].base_color_texture = 0;
  try {
    broken.Finish();
    FAIL();
  } catch (const InputError& e) {
    EXPECT_THAT(e.what(), HasSubstr("test.obj: material 0 has texture 0; there are 0"));
  }
}

TEST(FinishTest, LeavesOutDegenerateTrianglesAndKeepsTheRestTogether) {
  Scene scene = Tetrahedron(1);
  scene.materials.resize(5);
  scene.triangles.insert(scene.triangles.begin() + 1, {1, 1, 2});
  scene.triangle_material = {4, 3, 2, 1, 0};
  scene.triangle_face = {10, 11, 12, 13, 14};
  scene.Finish();
  EXPECT_EQ(scene.stats.degenerate_triangles, 1u);
  EXPECT_EQ(scene.triangle_material, (std::vector<uint32_t>{4, 2, 1, 0}));
  EXPECT_EQ(scene.triangle_face, (std::vector<uint32_t>{10, 12, 13, 14}));
  EXPECT_EQ(scene.triangles[1], (std::array<uint32_t, 3>{0, 1, 3}));
}

std::string FinishError(Scene& scene) {
  try {
    scene.Finish();
  } catch (const InputError& e) {
    std::string text = e.what();
    EXPECT_EQ(text.find('\n'), text.npos);
    EXPECT_TRUE(text.starts_with("test.obj: ")) << text;
    return text;
  }
  return {};
}

TEST(FinishTest, NamesWhatIsBad) {
  Scene scene = Tetrahedron(1);
  scene.positions[2].y = std::nanf("");
  EXPECT_THAT(FinishError(scene), HasSubstr("vertex 2 is (0, nan, 0)"));
  scene = Tetrahedron(1);
  scene.triangles[3][1] = 4;
  EXPECT_THAT(FinishError(scene), HasSubstr("face 3 refers to vertices 1, 4, 3; allowed are 0 to 3"));
  scene = Tetrahedron(1);
  scene.spheres = {{{0, 0, 0}, 0}};
  EXPECT_THAT(FinishError(scene), HasSubstr("sphere 0"));
  scene = Tetrahedron(1);
  scene.cameras.push_back({{1, 1, 1}, {1, 1, 1}, {0, 1, 0}, 1});
  EXPECT_THAT(FinishError(scene), HasSubstr("camera 0"));
  scene = Tetrahedron(1);
  scene.environment = 0;
  EXPECT_THAT(FinishError(scene), HasSubstr("the environment is texture 0; there are 0"));
  scene = Tetrahedron(1);
  scene.materials.resize(2);
  scene.materials[1].emission_texture = 2;
  EXPECT_THAT(FinishError(scene), HasSubstr("material 1 has texture 2; there are 0"));
}

TEST(FinishTest, NamesBadLights) {
  const auto error = [](Light light) {
    Scene scene = Tetrahedron(1);
    scene.lights = {Light{}, light};
    return FinishError(scene);
  };
  Light light;
  light.intensity.y = NAN;
  EXPECT_THAT(error(light), HasSubstr("light 1 is not finite"));
  light = {};
  light.range = 0;
  EXPECT_THAT(error(light), HasSubstr("light 1 has the range 0; more than 0 is needed"));
  for (LightKind kind : {LightKind::kDirectional, LightKind::kSpot})
    for (Vec3f direction : {Vec3f{0, 0, 0}, Vec3f{0, NAN, 1}, Vec3f{INFINITY, 0, 0}}) {
      light = {};
      light.kind = kind, light.direction = direction;
      EXPECT_THAT(error(light), HasSubstr("light 1 has the direction ("));
      light.kind = LightKind::kPoint;
      EXPECT_EQ(error(light), "") << "a point light has none";
    }
  for (const auto& [inner, outer] :
       {std::pair{0.5f, 0.6f}, {1.5f, 0.5f}, {0.5f, -1.5f}, {NAN, 0.5f}, {1.0f, NAN}}) {
    light = {};
    light.kind = LightKind::kSpot, light.cos_inner = inner, light.cos_outer = outer;
    EXPECT_THAT(error(light), HasSubstr("light 1 has cones of the cosines"));
  }
}

TEST(FinishTest, DirectionsOfLightsBecomeUnit) {
  Scene scene = Tetrahedron(1);
  Light light;
  light.direction = {0, 3e-20f, -4e-20f}, light.falloff = true;
  for (LightKind kind : {LightKind::kDirectional, LightKind::kSpot}) {
    light.kind = kind;
    scene.lights.push_back(light);
  }
  scene.Finish();
  for (const Light& l : scene.lights) {
    EXPECT_FLOAT_EQ(l.direction.y, 0.6f);
    EXPECT_FLOAT_EQ(l.direction.z, -0.8f);
  }
  EXPECT_FALSE(scene.lights[0].falloff) << "there is no distance to the sun";
  EXPECT_TRUE(scene.lights[1].falloff);
}

TEST(FinishTest, DropsBadTrianglesWhenAsked) {
  Scene scene = Tetrahedron(1);
  scene.positions.push_back({0, INFINITY, 0});
  scene.triangles.push_back({0, 1, 4});
  scene.triangles.push_back({0, 1, 99});
  scene.spheres = {{{0, 0, 0}, 0}};
  scene.Finish(true);
  EXPECT_EQ(scene.triangles.size(), 4u);
  EXPECT_EQ(scene.spheres.size(), 0u);
  EXPECT_EQ(scene.stats.dropped_triangles, 3u);
  for (Vec3f p : scene.positions) EXPECT_TRUE(std::isfinite(p.x + p.y + p.z));
}

TEST(FinishTest, RescalesByAPowerOfTwoAndLosesNothing) {
  Random random(3);
  for (int exponent : {-120, -60, -31, -30, 0, 29, 31, 60, 120}) {
    Scene scene = Tetrahedron(1);
    for (int i = 0; i < 1000; ++i) {
      auto x = [&] { return std::ldexp(random.NextFloat() - 0.5f, exponent); };
      scene.positions.push_back({x(), x(), x()});
      scene.triangles.push_back({0, uint32_t(i + 3), uint32_t(i + 4)});
    }
    for (int i = 0; i < 4; ++i)
      scene.positions[size_t(i)] = scene.positions[size_t(i)] * std::ldexp(1.0f, exponent);
    scene.cameras.push_back({{0, 0, std::ldexp(3.0f, exponent)}, {0, 0, 0}, {0, 1, 0}, 0.5f});
    scene.lights.push_back({{0, std::ldexp(5.0f, exponent), 0}, {1, 1, 1}, false});
    std::vector<Vec3f> before = scene.positions;
    scene.Finish();
    bool in_range = exponent >= -30 && exponent <= 30;
    EXPECT_EQ(scene.scale_exponent != 0, !in_range) << exponent;
    float largest = 0;
    for (size_t i = 0; i < before.size(); ++i)
      for (int k = 0; k < 3; ++k) {
        ASSERT_EQ(std::ldexp(scene.positions[i][k], -scene.scale_exponent), before[i][k]);
        largest = std::max(largest, std::abs(scene.positions[i][k]));
      }
    EXPECT_GE(largest, 0x1p-30f);
    EXPECT_LE(largest, 0x1p30f);
    EXPECT_EQ(std::ldexp(scene.cameras[0].eye.z, -scene.scale_exponent), std::ldexp(3.0f, exponent));
    EXPECT_EQ(std::ldexp(scene.lights[0].position.y, -scene.scale_exponent), std::ldexp(5.0f, exponent));
  }
}

TEST(FinishTest, KeepsTheLightThatArrivesWhenItRescales) {
  Scene scene = Tetrahedron(0x1p40f);
  scene.lights.push_back({{0, 0x1p41f, 0}, {0x1p80f, 0x1p81f, 0}, true});
  scene.Finish();
  ASSERT_EQ(scene.scale_exponent, -40);
  EXPECT_EQ(scene.lights[0].intensity, (Vec3f{1, 2, 0}));
  EXPECT_EQ(scene.lights[0].position.y, 2.0f);
}

TEST(FinishTest, RescalesRangesAndLeavesTheSunAlone) {
  Scene scene = Tetrahedron(0x1p40f);
  Light lamp, sun, faint, huge;
  lamp.range = 0x1p42f;
  sun.kind = LightKind::kDirectional, sun.intensity = {3, 2, 1}, sun.falloff = true;
  faint.range = 0x1p-140f;
  scene.lights = {lamp, sun, faint};
  scene.Finish();
  ASSERT_EQ(scene.scale_exponent, -40);
  EXPECT_EQ(scene.lights[0].range, 4);
  EXPECT_EQ(scene.lights[1].range, INFINITY);
  EXPECT_EQ(scene.lights[1].intensity, (Vec3f{3, 2, 1}));
  EXPECT_GT(scene.lights[2].range, 0) << "rounded to 0 it would be refused another time";
  Scene dust = Tetrahedron(0x1p-60f);
  huge.range = 0x1p100f;
  dust.lights = {huge};
  dust.Finish();
  EXPECT_EQ(dust.lights[0].range, std::numeric_limits<float>::max());
}

TEST(FinishTest, RefusesToRescaleWithLoss) {
  Scene scene = Tetrahedron(0x1p100f);
  scene.positions[0] = {0x1.234566p-60f, 0, 0};
  EXPECT_THAT(FinishError(scene), HasSubstr("vertex 0"));
}

TEST(FinishTest, ScalesByUsedVerticesOnly) {
  Scene scene = Tetrahedron(1);
  scene.positions.push_back({1e38f, 0, 0});
  scene.Finish();
  EXPECT_EQ(scene.scale_exponent, 0);
  EXPECT_EQ(scene.bounds().hi, (Vec3f{1, 1, 1}));
}

TEST(FinishTest, MakesACameraThatSeesTheWholeBox) {
  for (Vec3f size : {Vec3f{1, 1, 1}, Vec3f{100, 1, 1}, Vec3f{1, 50, 2}, Vec3f{1e-4f, 3, 1000}})
    for (float offset : {0.0f, 1e5f}) {
      Scene scene = Tetrahedron(1);
      for (Vec3f& p : scene.positions) p = p * size + Vec3f{offset, 0, 0};
      scene.Finish();
      ASSERT_TRUE(scene.automatic_camera && scene.automatic_lights);
      const Camera& c = scene.cameras.front();
      Vec3d forward = Normalize(ToDouble(c.at) - ToDouble(c.eye)),
            right = Normalize(Cross(forward, ToDouble(c.up)));
      Vec3d up = Cross(right, forward);
      for (Vec3f q : scene.positions) {
        Vec3d p = ToDouble(q) - ToDouble(c.eye);
        double depth = Dot(p, forward);
        EXPECT_GT(depth, 0);
        EXPECT_LE(std::abs(Dot(p, right)), c.tan_half_fov * depth);
        EXPECT_LE(std::abs(Dot(p, up)), c.tan_half_fov * depth);
      }
      for (const Light& light : scene.lights) {
        Bounds3 at;
        at.Extend(light.position);
        EXPECT_FALSE(scene.bounds().Contains(at));
      }
    }
}

TEST(FinishTest, AcceptsAnEmptyScene) {
  Scene scene;
  scene.Finish();
  EXPECT_TRUE(scene.bounds().Empty());
  EXPECT_EQ(scene.primitive_count(), 0u);
  EXPECT_EQ(scene.cameras.size(), 1u);
  EXPECT_FALSE(scene.lights.empty());
  EXPECT_EQ(scene.Geometry().triangle_count, 0u);
}

TEST(FinishTest, HashIsOfTheGeometryAlone) {
  Scene a = Tetrahedron(1), b = Tetrahedron(1), c = Tetrahedron(1);
  b.name = "other";
  b.materials.resize(3);
  c.positions[3].z = std::nextafter(1.0f, 2.0f);
  a.Finish(), b.Finish(), c.Finish();
  EXPECT_EQ(a.hash().size(), 16u);
  EXPECT_EQ(a.hash(), b.hash());
  EXPECT_NE(a.hash(), c.hash());
}

/// The algorithm of tracer/rays/RAYS.md, byte by byte.
class DocumentedHash {
 public:
  void Array(const void* data, size_t size) {
    const auto* bytes = static_cast<const unsigned char*>(data);
    for (size_t i = 0; i < size; i += 8) {
      uint64_t word = 0;
      for (size_t k = 0; k < 8 && i + k < size; ++k) word += uint64_t{bytes[i + k]} << (8 * k);
      state_ = (state_ ^ word) * 0x9FB21C651E98DF25u;
      state_ ^= state_ >> 29;
    }
  }
  std::string Hex() const {
    uint64_t h = (state_ ^ (state_ >> 32)) * 0xD6E8FEB86659FD93u;
    h ^= h >> 32;
    char text[17];
    std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(h));
    return text;
  }

 private:
  uint64_t state_ = 0xCBF29CE484222325u;
};

TEST(FinishTest, HashIsOfTheGeometryAsGiven) {
  Scene scene = Tetrahedron(0x1p40f);                          // is rescaled
  scene.positions.push_back({7, -0.0f, 0x1p41f});              // used by nobody: becomes 0
  scene.triangles.insert(scene.triangles.begin(), {1, 1, 2});  // degenerate: is left out
  scene.spheres.push_back({{1, 2, 3}, 0x1p39f});
  DocumentedHash hash;
  const uint64_t counts[] = {scene.positions.size(), scene.triangles.size(), scene.spheres.size()};
  hash.Array(counts, sizeof counts);
  hash.Array(scene.positions.data(), scene.positions.size() * sizeof(Vec3f));
  hash.Array(scene.triangles.data(), scene.triangles.size() * sizeof scene.triangles[0]);
  hash.Array(scene.spheres.data(), scene.spheres.size() * sizeof(Sphere));
  scene.Finish();
  EXPECT_EQ(scene.stats.degenerate_triangles, 1u);
  EXPECT_NE(scene.scale_exponent, 0);
  EXPECT_EQ(scene.hash(), hash.Hex());
}

TEST(GeometryTest, HasReadableBytesAfterTheLastPosition) {
  Scene scene = Tetrahedron(1);
  EXPECT_THROW(scene.Geometry(), std::logic_error);
  scene.Finish();
  rb_geometry g = scene.Geometry();
  EXPECT_EQ(g.struct_size, sizeof(rb_geometry));
  ASSERT_EQ(g.vertex_count, 4u);
  EXPECT_GE(scene.positions.capacity(), 6u);
  EXPECT_EQ(scene.GeometricNormal(0, {}), (Vec3d{0, 0, -1}));
}

class SphereTest : public ::testing::Test {
 protected:
  SphereTest() {
    Random random(11);
    for (int i = 0; i < 200; ++i) {
      double far = std::ldexp(1.0, int(random.Below(20)));
      Vec3f center = ToFloat(random.UnitVector() * far);
      scene_.spheres.push_back({center, std::ldexp(0.5f + random.NextFloat(), int(random.Below(12)) - 6)});
    }
    scene_.provenance.source = "spheres";
    scene_.Finish();
    geometry_ = scene_.Geometry();
  }
  bool Intersect(uint64_t i, Vec3f org, Vec3f dir, float tnear, float tfar, rb_hit& hit) const {
    rb_ray ray{{org.x, org.y, org.z}, tnear, {dir.x, dir.y, dir.z}, tfar};
    hit = {tfar, 0, 0, 77};
    return geometry_.procedural_intersect(geometry_.procedural_user, i, 0, &ray, &hit) != 0;
  }
  Scene scene_;
  rb_geometry geometry_;
};

TEST_F(SphereTest, BoundsEncloseInDouble) {
  for (size_t i = 0; i < scene_.spheres.size(); ++i) {
    float lo[3], hi[3];
    geometry_.procedural_bounds(geometry_.procedural_user, i, lo, hi);
    for (int k = 0; k < 3; ++k) {
      double c = scene_.spheres[i].center[k], r = scene_.spheres[i].radius;
      EXPECT_LE(double(lo[k]), c - r);
      EXPECT_GE(double(hi[k]), c + r);
      EXPECT_GE(double(std::nextafter(lo[k], INFINITY)), c - r);
    }
  }
}

TEST_F(SphereTest, HitsLieOnTheSphere) {
  Random random(12);
  int hits = 0;
  for (int n = 0; n < 20000; ++n) {
    size_t i = random.Below(scene_.spheres.size());
    const Sphere& s = scene_.spheres[i];
    Vec3d c = ToDouble(s.center), r = random.UnitVector() * double(s.radius);
    Vec3f org = ToFloat(c + random.UnitVector() * (s.radius * std::ldexp(1.0, int(random.Below(8)) - 1)));
    Vec3f dir = ToFloat((c + r - ToDouble(org)) * std::ldexp(1.0, int(random.Below(20)) - 10));
    rb_hit hit;
    if (!Intersect(i, org, dir, 0, INFINITY, hit)) continue;
    ++hits;
    ASSERT_GT(hit.t, 0);
    ASSERT_EQ(hit.prim, 77u);
    Vec3d p = ToDouble(org) + ToDouble(dir) * double(hit.t);
    double allowed = 2e-7 * hit.t * Length(ToDouble(dir)) + 1e-12 * Length(c);
    ASSERT_NEAR(Length(p - c), s.radius, allowed) << n;
  }
  EXPECT_GT(hits, 15000);
}

TEST_F(SphereTest, IntervalIsOpenAtTheNearEndAndClosedAtTheFarEnd) {
  Scene scene;
  scene.spheres = {{{0, 0, 0}, 1}};
  scene.Finish();
  rb_geometry g = scene.Geometry();
  auto t_of = [&](float tnear, float tfar) {
    rb_ray ray{{0, 0, -3}, tnear, {0, 0, 1}, tfar};
    rb_hit hit{};
    return g.procedural_intersect(g.procedural_user, 0, 0, &ray, &hit) ? hit.t : -1.0f;
  };
  EXPECT_EQ(t_of(0, INFINITY), 2.0f);
  EXPECT_EQ(t_of(0, 2), 2.0f);
  EXPECT_EQ(t_of(0, std::nextafter(2.0f, 0.0f)), -1.0f);
  EXPECT_EQ(t_of(2, INFINITY), 4.0f);  // leaves the near side: finds the far one
  EXPECT_EQ(t_of(std::nextafter(2.0f, 0.0f), INFINITY), 2.0f);
  EXPECT_EQ(t_of(4, INFINITY), -1.0f);
  EXPECT_EQ(t_of(2, 3), -1.0f);
  // A tangent ray touches, one beside it does not.
  rb_ray tangent{{1, 0, -3}, 0, {0, 0, 1}, INFINITY}, beside = tangent;
  beside.org[0] = std::nextafter(1.0f, 2.0f);
  rb_hit hit{};
  ASSERT_TRUE(g.procedural_intersect(g.procedural_user, 0, 0, &tangent, &hit));
  EXPECT_EQ(hit.t, 3.0f);
  EXPECT_FALSE(g.procedural_intersect(g.procedural_user, 0, 0, &beside, &hit));
  EXPECT_EQ(scene.GeometricNormal(0, {0, 2, 0}), (Vec3d{0, 2, 0}));
}

TEST_F(SphereTest, SmallSpheresFarAwayAreHitRightly) {
  Scene scene;
  scene.spheres = {{{0, 0, 100000}, 0.001f}};
  scene.Finish();
  rb_geometry g = scene.Geometry();
  rb_hit hit{};
  rb_ray center{{0, 0, 0}, 0, {0, 0, 1}, INFINITY}, aside{{0.00101f, 0, 0}, 0, {0, 0, 1}, INFINITY};
  EXPECT_TRUE(g.procedural_intersect(g.procedural_user, 0, 0, &center, &hit));
  EXPECT_FALSE(g.procedural_intersect(g.procedural_user, 0, 0, &aside, &hit));
}

}  // namespace
}  // namespace raybench
