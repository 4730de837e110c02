// Procedural cones and polygons against long double, exact cases and each other; spheres stand
// in tests/datasets/scene_test.cpp.
#include "datasets/scene/procedural.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "accel/ray/triangle.h"
#include "tests/support/datasets.h"
#include "tests/support/rays.h"

namespace raybench {
namespace {

using ::testing::HasSubstr;
using testing::kInf;
using testing::MakeRay;

/// t of primitive `prim` of a scene's procedurals, or -1.
float Meet(const Scene& scene, uint64_t i, const rb_ray& ray) {
  const rb_geometry g = scene.Geometry();
  rb_hit hit{};
  return g.procedural_intersect(g.procedural_user, i, 0, &ray, &hit) ? hit.t : -1;
}

Scene SceneWith(const Cone& cone) {
  Scene scene;
  scene.provenance.source = "cone";
  scene.cones = {cone};
  scene.Finish();
  return scene;
}

/// One polygon over its own vertices.
void AddPolygon(Scene& scene, const std::vector<Vec3f>& corners) {
  scene.polygons.push_back({uint32_t(scene.polygon_vertices.size()), uint32_t(corners.size())});
  for (Vec3f p : corners) {
    scene.polygon_vertices.push_back(uint32_t(scene.positions.size()));
    scene.positions.push_back(p);
  }
}

Scene SceneWith(const std::vector<Vec3f>& corners) {
  Scene scene;
  scene.provenance.source = "polygon";
  AddPolygon(scene, corners);
  scene.Finish();
  return scene;
}

TEST(Cone, ExactCasesOfACylinder) {
  const Scene scene = SceneWith({{0, 0, 0}, 1, {0, 0, 4}, 1});
  for (float zero : {0.0f, -0.0f}) {
    EXPECT_EQ(Meet(scene, 0, MakeRay({-3, 0, 2}, {1, zero, zero})), 2);
    EXPECT_EQ(Meet(scene, 0, MakeRay({-3, 0, 0}, {1, zero, zero})), 2) << "the rim is part of it";
    EXPECT_EQ(Meet(scene, 0, MakeRay({-3, 0, 4}, {1, zero, zero})), 2);
    EXPECT_EQ(Meet(scene, 0, MakeRay({-3, 0, 4.001f}, {1, zero, zero})), -1);
    EXPECT_EQ(Meet(scene, 0, MakeRay({-3, 1, 2}, {1, zero, zero})), 3) << "a tangent touches";
    EXPECT_EQ(Meet(scene, 0, MakeRay({-3, std::nextafter(1.0f, 2.0f), 2}, {1, zero, zero})), -1);
    EXPECT_EQ(Meet(scene, 0, MakeRay({0, 0, 2}, {zero, -2, zero})), 0.5f) << "from inside";
    EXPECT_EQ(Meet(scene, 0, MakeRay({0.5f, 0, -9}, {zero, zero, 1})), -1) << "no end caps";
    EXPECT_EQ(Meet(scene, 0, MakeRay({2, 0, -9}, {zero, zero, 1})), -1);
  }
  // Leaves the near side, finds the far one, and nothing after that.
  EXPECT_EQ(Meet(scene, 0, MakeRay({-1, 0, 2}, {1, 0, 0})), 2);
  EXPECT_EQ(Meet(scene, 0, MakeRay({-3, 0, 2}, {1, 0, 0}, 2)), 4);
  EXPECT_EQ(Meet(scene, 0, MakeRay({-3, 0, 2}, {1, 0, 0}, 4)), -1);
  EXPECT_EQ(Meet(scene, 0, MakeRay({-3, 0, 2}, {1, 0, 0}, 0, 2)), 2);
  EXPECT_EQ(Meet(scene, 0, MakeRay({-3, 0, 2}, {1, 0, 0}, 2, 3)), -1);
  // In at the open end, out through the side.
  EXPECT_EQ(Meet(scene, 0, MakeRay({0, 0, -1}, {0.5f, 0, 1})), 2);
}

TEST(Cone, ExactCasesOfAnApex) {
  const Scene scene = SceneWith({{0, 0, 0}, 2, {0, 0, 2}, 0});  // 45 degrees
  EXPECT_EQ(Meet(scene, 0, MakeRay({-5, 0, 1}, {1, 0, 0})), 4);
  EXPECT_EQ(Meet(scene, 0, MakeRay({-5, 0, 2}, {1, 0, 0})), 5) << "through the apex";
  EXPECT_EQ(Meet(scene, 0, MakeRay({-5, 0, 3}, {1, 0, 0})), -1) << "not the mirrored half";
  EXPECT_EQ(Meet(scene, 0, MakeRay({0.5f, 0, 9}, {0, 0, -1})), 7.5f) << "along the axis, from above";
  EXPECT_EQ(Meet(scene, 0, MakeRay({0.5f, 0, -1}, {0, 0, 1})), 2.5f) << "and from inside";
  EXPECT_EQ(Meet(scene, 0, MakeRay({3.5f, 0, 1}, {-1, 0, -1})), -1) << "parallel to a side, outside";
  EXPECT_EQ(Meet(scene, 0, MakeRay({-0.5f, 0, 0.5f}, {1, 0, 1})), 1) << "parallel to a side, inside";
}

TEST(Cone, NegativeRadiiShowTheInsideOnly) {
  for (const auto& [r0, r1] : {std::pair{-1.0f, -1.0f}, {-1.0f, -0.5f}, {-1.0f, 0.0f}, {0.0f, -1.0f}}) {
    const Scene inside = SceneWith({{0, 0, 0}, r0, {0, 0, 4}, r1}),
                both = SceneWith({{0, 0, 0}, -r0, {0, 0, 4}, -r1});
    const rb_ray ray = MakeRay({-3, 0.1f, 2}, {1, 0, 0});
    const float near = Meet(both, 0, ray);
    ASSERT_GT(near, 0);
    const float far = Meet(both, 0, MakeRay({-3, 0.1f, 2}, {1, 0, 0}, near));
    ASSERT_GT(far, near);
    EXPECT_EQ(Meet(inside, 0, ray), far);
    EXPECT_NEAR(Meet(inside, 0, MakeRay({0, 0.1f, 2}, {1, 0, 0})), far - 3, 1e-6);
    EXPECT_EQ(Meet(inside, 0, MakeRay({-3, 0.1f, 2}, {1, 0, 0}, 0, near + 0.01f)), -1);
  }
  Scene scene;
  scene.spheres = {{{0, 0, 0}, -1}};
  scene.Finish();
  EXPECT_EQ(Meet(scene, 0, MakeRay({-3, 0, 0}, {1, 0, 0})), 4);
  EXPECT_EQ(Meet(scene, 0, MakeRay({0, 0, 0}, {1, 0, 0})), 1);
  EXPECT_EQ(scene.bounds().hi.x, 1);
}

/// |distance of the point from the cone's surface|, up to second order, in long double.
long double DistanceFrom(const Cone& c, const rb_ray& ray, float t, long double& beyond_rim) {
  const auto wide = [](const float* v) { return Vec3<long double>{v[0], v[1], v[2]}; };
  const Vec3<long double> base{c.base.x, c.base.y, c.base.z}, apex{c.apex.x, c.apex.y, c.apex.z};
  const Vec3<long double> p = wide(ray.org) + wide(ray.dir) * (long double)(t)-base, axis = apex - base;
  const long double height = Length(axis), h = Dot(p, axis) / height;
  const long double slope = (c.apex_radius - (long double)(c.base_radius)) / height;
  const long double across = Length(p - axis * (h / height)), radius = c.base_radius + slope * h;
  beyond_rim = std::max(-h, h - height);
  return std::fabs(across - radius) / std::sqrt(1 + slope * slope);
}

TEST(Cone, RandomHitsLieOnItAndMissesAreMisses) {
  int hits = 0, misses = 0;
  for (uint64_t n = 0; n < 60000; ++n) {
    Random random(31, n);
    // Centres up to 1e6 sizes away, shapes from needles to nearly discs, apexes and cylinders.
    const double far = n % 3 == 0 ? 0 : std::ldexp(1.0, int(random.Below(20)));
    const Vec3d middle = random.UnitVector() * far, axis = random.UnitVector() * (0.1 + random.NextDouble());
    const float r0 = n % 5 == 0 ? 0 : std::ldexp(0.5f + random.NextFloat(), -int(random.Below(6)));
    const float r1 = n % 7 == 0 ? r0 : std::ldexp(0.5f + random.NextFloat(), -int(random.Below(6)));
    const Cone cone{ToFloat(middle - axis), r0, ToFloat(middle + axis), r1};
    if (!Flaw(cone).empty()) continue;
    // A point on the surface, by hand, and a ray to it from somewhere.
    const Vec3d a = ToDouble(cone.base), b = ToDouble(cone.apex), along = b - a;
    if (Length(along) < 0.05) continue;
    const double s = random.NextDouble();
    Vec3d across = Cross(along, random.UnitVector());
    if (Length(across) < 1e-3) continue;
    const Vec3d on = a + along * s + Normalize(across) * (r0 + (r1 - r0) * s);
    const Vec3f org = ToFloat(on + random.UnitVector() * std::ldexp(1.0, int(random.Below(20)) - 4));
    const Vec3f dir = ToFloat((on - ToDouble(org)) * std::ldexp(1.0, int(random.Below(40)) - 20));
    if (dir == Vec3f{0, 0, 0}) continue;
    const rb_ray ray = MakeRay(org, dir);
    const double distance = Length(on - ToDouble(org)) + Length(ToDouble(cone.base) - ToDouble(org));
    float t;
    if (!Intersect(cone, ray, t)) {
      ++misses;  // excused below
      continue;
    }
    ++hits;
    long double beyond;
    const double error = 3e-7 * distance;  // t and dir are floats
    ASSERT_LT(DistanceFrom(cone, ray, t, beyond), error) << n;
    ASSERT_LT(beyond, error) << n;
    const double expected = Length(on - ToDouble(org)) / Length(ToDouble(dir));
    EXPECT_LE(t, expected * (1 + 1e-6) + 4 * error / Length(ToDouble(dir)) + 1e-3 * expected) << n;
    const Bounds3 box = BoundsOf(cone);
    const Vec3d p = ToDouble(org) + ToDouble(dir) * double(t);
    for (int k = 0; k < 3; ++k) {
      ASSERT_GE(p[k], box.lo[k] - error) << n;
      ASSERT_LE(p[k], box.hi[k] + error) << n;
    }
  }
  // Rays aim at the surface exactly, so only rounding at rims and silhouettes makes them miss.
  EXPECT_GT(hits, 50000);
  EXPECT_LT(misses, hits / 20);
}

TEST(Cone, BoundsAreTight) {
  for (uint64_t n = 0; n < 300; ++n) {
    Random random(32, n);
    const Cone cone{ToFloat(random.UnitVector() * 10.0), 0.1f + random.NextFloat(),
                    ToFloat(random.UnitVector() * 10.0), random.NextFloat()};
    const Bounds3 box = BoundsOf(cone);
    const Vec3d a = ToDouble(cone.base), b = ToDouble(cone.apex), along = Normalize(b - a);
    Bounds3 seen;
    // Points of both rims; the tangent half-angle gives sine and cosine without libm.
    const Vec3d u = Normalize(Cross(along, random.UnitVector())), v = Cross(along, u);
    for (int i = -2000; i <= 2000; ++i) {
      const double f = i / 2001.0, h = f / (1 - f * f), cosine = (1 - h * h) / (1 + h * h),
                   sine = 2 * h / (1 + h * h);
      for (const auto& [end, r] : {std::pair{a, cone.base_radius}, {b, cone.apex_radius}})
        seen.Extend(ToFloat(end + (u * cosine + v * sine) * double(r)));
    }
    ASSERT_TRUE(box.Contains(seen)) << n;
    for (int k = 0; k < 3; ++k) {
      ASSERT_GT(box.lo[k], seen.lo[k] - 2e-5) << n;
      ASSERT_LT(box.hi[k], seen.hi[k] + 2e-5) << n;
    }
  }
}

TEST(Cone, NoSlitBetweenConesThatShareARim) {
  // A lathed body; rays from inside that meet its rims exactly. The axis (1, 2, 2) has length 3, and so have
  // these vectors across it: everything is exact in float.
  const Vec3f along{1, 2, 2}, across[] = {{2, 1, -2}, {-2, -1, 2}, {2, -2, 1}, {-2, 2, -1}};
  const float radius[] = {0, 15, 24, 24, 9, 12, 0};
  Scene scene;
  scene.provenance.source = "lathe";
  for (int i = 0; i < 6; ++i)
    scene.cones.push_back({along * (5.0f * (i - 3)), radius[i], along * (5.0f * (i - 2)), radius[i + 1]});
  scene.Finish();
  uint64_t leaks = 0, rims = 0;
  for (uint64_t n = 0; n < 50000; ++n) {
    Random random(34, n);
    const int rim = 1 + int(random.Below(5));
    const Vec3f target = along * (5.0f * (rim - 3)) + across[random.Below(4)] * (radius[rim] / 3);
    const Vec3f org = {float(random.Below(9)) - 4, float(random.Below(9)) - 4, float(random.Below(9)) - 4};
    const float stretch = 1 + float(random.Below(63));
    const rb_ray ray = MakeRay(org, (target - org) * stretch);
    float nearest = kInf;
    for (uint64_t i = 0; i < 6; ++i)
      if (const float t = Meet(scene, i, ray); t > 0) nearest = std::min(nearest, t);
    leaks += nearest == kInf;
    rims += std::fabs(nearest * stretch - 1) < 1e-6f;
  }
  EXPECT_EQ(leaks, 0u);
  EXPECT_GT(rims, 20000u);
}

TEST(Cone, NormalIsAcross) {
  const Cone cone{{1, 2, 3}, 0.5f, {4, 3, 1}, 2};
  Random random(35);
  for (int i = 0; i < 100; ++i) {
    const Vec3d a = ToDouble(cone.base), along = ToDouble(cone.apex) - a;
    const Vec3d aside = Normalize(Cross(along, random.UnitVector())), around = Cross(Normalize(along), aside);
    const double s = random.NextDouble();
    const Vec3d p = a + along * s + aside * (0.5 + 1.5 * s), normal = Normalize(NormalAt(cone, p));
    EXPECT_NEAR(Dot(normal, around), 0, 1e-12);
    EXPECT_NEAR(Dot(normal, along + aside * 1.5), 0, 1e-12) << "along the side";
    EXPECT_GT(Dot(normal, aside), 0);
  }
}

std::string NffFinishError(Scene scene) {
  scene.provenance.source = "test.nff";
  try {
    scene.Finish();
  } catch (const InputError& e) {
    return e.what();
  }
  return "no error";
}

TEST(Procedural, FinishNamesWhatIsBadOrDropsIt) {
  const auto with_cone = [](const Cone& c) {
    Scene scene;
    scene.cones = {{{0, 0, 0}, 1, {0, 0, 1}, 1}, c};
    return scene;
  };
  for (const Cone& c :
       {Cone{{0, 0, 0}, 1, {0, 0, 0}, 1}, Cone{{0, 0, 0}, 0, {0, 0, 1}, 0}, Cone{{0, 0, 0}, -1, {0, 0, 1}, 1},
        Cone{{NAN, 0, 0}, 1, {0, 0, 1}, 1}, Cone{{3e38f, 0, 0}, 3e38f, {0, 0, 1}, 1}}) {
    EXPECT_THAT(NffFinishError(with_cone(c)), HasSubstr("test.nff: cone 1 goes from")) << c.base.x;
    Scene scene = with_cone(c);
    scene.Finish(true);
    EXPECT_EQ(scene.cones.size(), 1u);
    EXPECT_EQ(scene.stats.dropped_triangles, 1u);
  }
  Scene scene;
  AddPolygon(scene, {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}});
  Scene bad = scene;
  bad.polygon_vertices[2] = 9;
  EXPECT_THAT(NffFinishError(bad),
              HasSubstr("polygon 0 refers to vertex 9; allowed are finite ones, 0 to 3"));
  bad = scene;
  bad.polygons[0].count = 2;
  EXPECT_THAT(NffFinishError(bad), HasSubstr("polygon 0 has 2 corners"));
  bad = scene;
  bad.polygons[0].first = 3;
  EXPECT_THAT(NffFinishError(bad), HasSubstr("polygon 0 has corners 3 to 6 of 4"));
  bad = scene;
  bad.positions[1].y = kInf;
  bad.Finish(true);
  EXPECT_EQ(bad.polygons.size(), 0u);
  EXPECT_EQ(bad.stats.dropped_triangles, 1u);
  // Without area: left out and counted, as triangles are.
  for (const auto& corners : {std::vector<Vec3f>{{0, 0, 0}, {1, 1, 1}, {3, 3, 3}, {2, 2, 2}},
                              std::vector<Vec3f>{{0.1f, 0.2f, 0.3f}, {0.2f, 0.4f, 0.6f}, {0.1f, 0.2f, 0.3f}},
                              std::vector<Vec3f>(5, Vec3f{1, 2, 3})}) {
    Scene flat;
    AddPolygon(flat, corners);
    flat.Finish();
    EXPECT_EQ(flat.polygons.size(), 0u);
    EXPECT_EQ(flat.stats.degenerate_triangles, 1u);
  }
}

TEST(Procedural, RescalesExactlyAndHitsTheSame) {
  for (int exponent : {-100, -40, 40, 100}) {
    const float k = std::ldexp(1.0f, exponent);
    Scene one, scaled;
    for (auto& [scene, s] : {std::pair<Scene&, float>{one, 1.0f}, {scaled, k}}) {
      scene.cones = {{Vec3f{-1, 0, 0.5f} * s, 1 * s, Vec3f{2, 1, 0} * s, 0.25f * s}};
      AddPolygon(scene, {Vec3f{-1, -1, 0} * s, Vec3f{1, -1, 0} * s, Vec3f{1, 1, 0} * s, Vec3f{-1, 1, 0} * s});
      scene.Finish();
    }
    ASSERT_NE(scaled.scale_exponent, 0);
    const float back = std::ldexp(1.0f, exponent + scaled.scale_exponent);
    EXPECT_EQ(scaled.cones[0].apex_radius, 0.25f * back);
    EXPECT_EQ(scaled.bounds().hi.x, one.bounds().hi.x * back);
    for (uint64_t i : {0, 1})
      EXPECT_EQ(Meet(scaled, i, MakeRay(Vec3f{0.25f, 0.125f, 9} * back, Vec3f{0, 0, -1} * back)),
                Meet(one, i, MakeRay({0.25f, 0.125f, 9}, {0, 0, -1})));
  }
}

TEST(Procedural, IdsAndMaterialsFollowTheKinds) {
  Scene scene;
  scene.materials.resize(5);
  scene.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  scene.triangles = {{0, 1, 2}}, scene.triangle_material = {1};
  scene.spheres = {{{0, 0, 0}, 1}, {{1, 0, 0}, 1}}, scene.sphere_material = {2, 0};
  scene.cones = {{{0, 0, 0}, 1, {0, 0, 1}, 1}}, scene.cone_material = {3};
  AddPolygon(scene, {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}});
  scene.polygon_material = {4};
  scene.Finish();
  ASSERT_EQ(scene.primitive_count(), 5u);
  EXPECT_EQ(scene.procedural_count(), 4u);
  const uint32_t expected[] = {1, 2, 0, 3, 4};
  for (uint32_t i = 0; i < 5; ++i) EXPECT_EQ(scene.MaterialOf(i), expected[i]) << i;
  EXPECT_EQ(scene.Locate(4).kind, PrimKind::kPolygon);
  EXPECT_EQ(scene.Locate(2).index, 1u);
  EXPECT_EQ(scene.GeometricNormal(4, {}), (Vec3d{0, 0, 2}));
  Scene other = scene;
  other.cones[0].apex_radius = 0.5f;
  other.Finish();
  EXPECT_NE(other.hash(), scene.hash());
  other = scene;
  std::swap(other.polygon_vertices[1], other.polygon_vertices[3]);
  other.Finish();
  EXPECT_NE(other.hash(), scene.hash());
}

TEST(Polygon, ExactCases) {
  // A U, counter-clockwise.
  const Scene u =
      SceneWith({{0, 0, 0}, {3, 0, 0}, {3, 3, 0}, {2, 3, 0}, {2, 1, 0}, {1, 1, 0}, {1, 3, 0}, {0, 3, 0}});
  for (float zero : {0.0f, -0.0f})
    for (float side : {1.0f, -1.0f}) {
      const auto meet = [&](float x, float y) {
        return Meet(u, 0, MakeRay({x, y, 2 * side}, {zero, zero, -side}));
      };
      EXPECT_EQ(meet(0.5f, 2), 2);
      EXPECT_EQ(meet(2.5f, 2), 2);
      EXPECT_EQ(meet(1.5f, 0.5f), 2);
      EXPECT_EQ(meet(1.5f, 2), -1) << "between the arms";
      EXPECT_EQ(meet(-0.5f, 1), -1);
      EXPECT_EQ(meet(3.5f, 1), -1);
      EXPECT_EQ(meet(1.5f, 3), -1) << "level with the ends of the arms";
    }
  EXPECT_EQ(Meet(u, 0, MakeRay({0.5f, 2, 2}, {0, 0, -1}, 2)), -1);
  EXPECT_EQ(Meet(u, 0, MakeRay({0.5f, 2, 2}, {0, 0, -1}, 0, 2)), 2);
  EXPECT_EQ(Meet(u, 0, MakeRay({0.5f, 2, 2}, {0, 0, -1}, 0, 1.5f)), -1);
  EXPECT_EQ(Meet(u, 0, MakeRay({0.5f, 2, 0}, {0, 0, -1})), -1) << "leaves the plane";
  // A frame: the hole is cut by a bridge.
  const Scene frame = SceneWith({{0, 0, 1},
                                 {4, 0, 1},
                                 {4, 4, 1},
                                 {0, 4, 1},
                                 {0, 0, 1},
                                 {1, 1, 1},
                                 {1, 3, 1},
                                 {3, 3, 1},
                                 {3, 1, 1},
                                 {1, 1, 1}});
  EXPECT_EQ(Meet(frame, 0, MakeRay({2, 2, 0}, {0, 0, 1})), -1);
  EXPECT_EQ(Meet(frame, 0, MakeRay({0.5f, 2, 0}, {0, 0, 1})), 1);
  EXPECT_EQ(Meet(frame, 0, MakeRay({0.5f, 0.5f, 0}, {0, 0, 1})), 1) << "across the bridge";
}

/// A jagged star of n corners around a centre in a random plane, moved and with float rounding.
std::vector<Vec3f> Star(Random& random, int n, double far) {
  const Vec3d u = random.UnitVector(), w = Normalize(Cross(u, random.UnitVector())), v = Cross(w, u);
  const Vec3d center = random.UnitVector() * far;
  std::vector<Vec3f> corners;
  for (int i = 0; i < n; ++i) {
    // Around a square rather than a circle: no sine needed.
    const double s = 4.0 * i / n, side = std::floor(s), f = 2 * (s - side) - 1;
    const Vec3d p = side == 0 ? u + v * f : side == 1 ? v - u * f : side == 2 ? -u - v * f : -v + u * f;
    corners.push_back(ToFloat(center + p * (0.2 + random.NextDouble())));
  }
  return corners;
}

TEST(Polygon, RandomOnesAgreeWithLongDouble) {
  int hits = 0, misses = 0, unsure = 0;
  for (uint64_t n = 0; n < 3000; ++n) {
    Random random(41, n);
    const double far = n % 2 ? 0 : std::ldexp(1.0, int(random.Below(20)));
    const auto corners = Star(random, 4 + int(random.Below(141)), far);
    const Scene scene = SceneWith(corners);
    if (scene.polygons.empty()) continue;  // rounded to a line
    Vec3d center{0, 0, 0};
    for (Vec3f p : corners) center = center + ToDouble(p) * (1.0 / double(corners.size()));
    for (int k = 0; k < 20; ++k) {
      const Vec3f org = ToFloat(center + random.UnitVector() * std::ldexp(1.0, int(random.Below(12)) - 3));
      const Vec3f dir = ToFloat(center + random.UnitVector() * (1.5 * random.NextDouble()) - ToDouble(org));
      const rb_ray ray = MakeRay(org, dir);
      // In long double: the sum of signed angles' quadrants, from the crossings of the ray's
      // right half-plane.
      const Vec3<long double> d{dir.x, dir.y, dir.z}, o{org.x, org.y, org.z};
      const auto wide = [&](Vec3f p) { return Vec3<long double>{p.x, p.y, p.z} - o; };
      const Vec3<long double> right = Cross(d, Vec3<long double>{0.48L, 0.6L, 0.64L}), up = Cross(d, right);
      bool inside = false;
      long double nearest = 1e9L, reach = 0;
      for (size_t i = 0; i < corners.size(); ++i) {
        const auto a = wide(corners[i]), b = wide(corners[(i + 1) % corners.size()]);
        const long double ax = Dot(a, right), ay = Dot(a, up), bx = Dot(b, right), by = Dot(b, up);
        const long double s = (ax - bx) == 0 && (ay - by) == 0
                                  ? 0
                                  : std::clamp((ax * (ax - bx) + ay * (ay - by)) /
                                                   ((ax - bx) * (ax - bx) + (ay - by) * (ay - by)),
                                               0.0L, 1.0L);
        const long double x = ax + s * (bx - ax), y = ay + s * (by - ay);
        nearest = std::min(nearest, std::sqrt(x * x / Dot(right, right) + y * y / Dot(up, up)));
        reach = std::max(reach, Length(a));
        if ((ay > 0) != (by > 0) && (ax * (by - ay) - ay * (bx - ax) > 0) == (by > ay)) inside = !inside;
      }
      const PolygonPlane& plane = scene.PlaneOfPolygon(0);
      const double t = Dot(plane.normal, plane.center - ToDouble(org)) / Dot(plane.normal, ToDouble(dir));
      const float found = Meet(scene, 0, ray);
      if (nearest < 1e-6L * reach) {
        ++unsure;
        continue;
      }
      if (inside && t > 0) {
        ++hits;
        ASSERT_GE(found, 0) << n << " " << k;
        const double cosine =
            std::fabs(Dot(plane.normal, ToDouble(dir))) / Length(plane.normal) / Length(dir);
        if (cosine > 0.01) {
          ASSERT_NEAR(found, t, 1e-6 * t + 1e-6 * double(reach) / cosine) << n << " " << k;
        }
      } else {
        ++misses;
        ASSERT_EQ(found, -1) << n << " " << k << " t " << t;
      }
    }
  }
  EXPECT_GT(hits, 5000);
  EXPECT_GT(misses, 5000);
  EXPECT_LT(unsure, 20000);
}

/// A closed solid of n-gons: the cells of a rough prism, side faces split into quads and hexagons that share
/// edges; vertices moved at random, so that no face is flat. Some faces become triangles if asked.
Scene Solid(uint64_t seed, bool with_triangles, double far) {
  Random random(seed);
  Scene scene;
  scene.provenance.source = "solid";
  constexpr int kAround = 24, kLayers = 9;
  const Vec3d center = random.UnitVector() * far;
  const Vec3d u = random.UnitVector(), w = Normalize(Cross(u, random.UnitVector())), v = Cross(w, u);
  for (int layer = 0; layer <= kLayers; ++layer)
    for (int i = 0; i < kAround; ++i) {
      const double s = 4.0 * i / kAround, side = std::floor(s), f = 2 * (s - side) - 1;
      const Vec3d p = side == 0 ? u + v * f : side == 1 ? v - u * f : side == 2 ? -u - v * f : -v + u * f;
      scene.positions.push_back(ToFloat(center + Normalize(p) * (1 + 0.1 * random.NextDouble()) +
                                        w * (2.0 * layer / kLayers - 1) + random.UnitVector() * 0.03));
    }
  const auto add = [&](const std::vector<uint32_t>& corners) {
    if (with_triangles && random.Below(2)) {
      for (size_t i = 2; i < corners.size(); ++i)
        scene.triangles.push_back({corners[0], corners[i - 1], corners[i]});
      return;
    }
    scene.polygons.push_back({uint32_t(scene.polygon_vertices.size()), uint32_t(corners.size())});
    scene.polygon_vertices.insert(scene.polygon_vertices.end(), corners.begin(), corners.end());
  };
  const auto at = [&](int layer, int i) { return uint32_t(layer * kAround + i % kAround); };
  std::vector<uint32_t> bottom, top;
  for (int i = 0; i < kAround; ++i) bottom.push_back(at(0, kAround - 1 - i)), top.push_back(at(kLayers, i));
  add(bottom), add(top);
  for (int layer = 0; layer < kLayers; ++layer)
    for (int i = 0; i < kAround; i += 2) {
      if (layer % 2) {  // a hexagon two cells wide
        add({at(layer, i), at(layer, i + 1), at(layer, i + 2), at(layer + 1, i + 2), at(layer + 1, i + 1),
             at(layer + 1, i)});
      } else {
        add({at(layer, i), at(layer, i + 1), at(layer + 1, i + 1), at(layer + 1, i)});
        add({at(layer, i + 1), at(layer, i + 2), at(layer + 1, i + 2), at(layer + 1, i + 1)});
      }
    }
  scene.Finish();
  return scene;
}

/// How many of `count` rays from inside, aimed at points of edges and at vertices, hit nothing.
uint64_t CountLeaks(const Scene& scene, uint64_t count, uint64_t seed) {
  std::vector<std::array<uint32_t, 2>> edges;
  for (const Polygon& p : scene.polygons) {
    const auto corners = scene.CornersOf(p);
    for (size_t i = 0; i < corners.size(); ++i)
      edges.push_back({corners[i], corners[(i + 1) % corners.size()]});
  }
  const Bounds3 box = scene.bounds();
  const Vec3d center = (ToDouble(box.lo) + ToDouble(box.hi)) * 0.5;
  const rb_geometry g = scene.Geometry();
  uint64_t leaks = 0;
  for (uint64_t n = 0; n < count; ++n) {
    Random random(seed, n);
    const auto& [a, b] = edges[random.Below(edges.size())];
    const float s = n % 4 == 0 ? 0 : n % 4 == 1 ? 0.5f : random.NextFloat();
    const Vec3f target = scene.positions[a] * (1 - s) + scene.positions[b] * s;
    const Vec3f org = ToFloat(center + random.UnitVector() * (0.5 * random.NextDouble()));
    const rb_ray ray = MakeRay(org, target - org);
    bool hit = false;
    for (uint64_t i = 0; i < g.procedural_count && !hit; ++i) {
      rb_hit found;
      hit = g.procedural_intersect(g.procedural_user, i, 1, &ray, &found) != 0;
    }
    const WatertightTest test(ray);
    for (size_t i = 0; i < scene.triangles.size() && !hit; ++i) {
      const auto p = CornersOf(scene, i);
      PrimHit found;
      hit = test.Intersect(p[0], p[1], p[2], found) && found.t > 0;
    }
    leaks += !hit;
  }
  return leaks;
}

TEST(Polygon, ASolidOfPolygonsDoesNotLeak) {
  EXPECT_EQ(CountLeaks(Solid(51, false, 0), 100000, 52), 0u);
  EXPECT_EQ(CountLeaks(Solid(53, false, 1000), 30000, 54), 0u);
}

TEST(Polygon, NorDoesOneOfPolygonsAndTriangles) {
  const Scene scene = Solid(55, true, 0);
  ASSERT_GT(scene.triangles.size(), 50u);
  ASSERT_GT(scene.polygons.size(), 50u);
  EXPECT_EQ(CountLeaks(scene, 100000, 56), 0u);
  EXPECT_EQ(CountLeaks(Solid(57, true, 1000), 30000, 58), 0u);
}

}  // namespace
}  // namespace raybench
