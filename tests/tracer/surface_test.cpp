#include "tracer/surface.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <ostream>
#include <string>

#include "tests/support/tracer.h"

namespace raybench {
namespace {

using testing::AddTriangle;
using testing::BuildTree;
using testing::kInf;

rb_ray RayFrom(Vec3f org, Vec3d dir) {
  const Vec3f d = ToFloat(dir);
  return {{org.x, org.y, org.z}, 0, {d.x, d.y, d.z}, kInf};
}

struct OffsetCase {
  const char* name;
  double scale, distance;  ///< size of the triangle; distance from the origin in such sizes

  friend void PrintTo(const OffsetCase& c, std::ostream* out) { *out << c.name; }
};

class TracerErrorBoundOffset : public ::testing::TestWithParam<OffsetCase> {
 protected:
  /// Random direction on the positive side of `normal`; half of them graze.
  static Vec3d Leaving(Random& random, Vec3d normal) {
    Vec3d d = random.UnitVector();
    if (random.NextFloat() < 0.5f) {
      const double g = random.NextDouble();
      d = Normalize(d - normal * Dot(d, normal)) + normal * (g * g * g);
    }
    return Normalize(Dot(d, normal) < 0 ? d - normal * (2 * Dot(d, normal)) : d);
  }
};

TEST_P(TracerErrorBoundOffset, RaysNeverHitTheTriangleTheyLeave) {
  const auto [name, scale, distance] = GetParam();
  uint64_t rays = 0, hits = 0, naive_hits = 0;
  double longest_step = 0;  // in ulps (2^-23) of the larger of coordinates and size
  for (uint64_t i = 0; i < 400; ++i) {
    Random random(17, i);
    const Vec3d center = random.UnitVector() * (scale * distance);
    const double thinness = i % 4 == 0 ? std::pow(10, -3 * random.NextDouble()) : 1;
    Scene scene;
    const Vec3d a = random.UnitVector(), b = random.UnitVector(),
                c = a + (random.UnitVector() - a) * thinness;
    AddTriangle(scene, ToFloat(center + a * scale), ToFloat(center + b * scale), ToFloat(center + c * scale));
    scene.Finish();
    if (scene.triangles.empty()) continue;  // rounded to collinear
    ASSERT_EQ(scene.scale_exponent, 0);
    const Vec3d p0 = ToDouble(scene.positions[0]), p1 = ToDouble(scene.positions[1]),
                p2 = ToDouble(scene.positions[2]);
    const double area = Length(Cross(p1 - p0, p2 - p0));
    const double longest = std::max({Length(p1 - p0), Length(p2 - p0), Length(p2 - p1)});
    for (const char* structure : {"brute", "brute(numerics=fast)"}) {
      const Tree tree = BuildTree(scene, structure);
      std::vector<rb_ray> batch, naive;
      for (int k = 0; k < 100; ++k) {
        double u = random.NextDouble(), v = random.NextDouble();
        if (u + v > 1) u = 1 - u, v = 1 - v;
        const rb_hit hit{1, float(u), float(v), 0};
        const SurfacePoint surface = SurfaceAt(scene, rb_ray{}, hit);
        const double side = k % 2 ? 1 : -1;
        const Vec3d dir = Leaving(random, surface.normal * side);
        batch.push_back(RayFrom(surface.Origin(side), dir));
        naive.push_back(RayFrom(ToFloat(surface.point), dir));
        if (longest * longest < 4 * area) {
          const double size = std::max(longest, Length(surface.point));
          longest_step =
              std::max(longest_step, Length(ToDouble(surface.Origin(side)) - surface.point) / size / 0x1p-23);
        }
      }
      auto count_hits = [&](const std::vector<rb_ray>& set) {
        std::vector<uint8_t> occluded(set.size());
        rb_query query{};
        query.struct_size = sizeof query, query.kind = RB_ANY;
        query.n = set.size(), query.rays = set.data(), query.occluded = occluded.data();
        tree.Query(query);
        return uint64_t(std::count(occluded.begin(), occluded.end(), 1));
      };
      rays += batch.size(), hits += count_hits(batch), naive_hits += count_hits(naive);
    }
  }
  EXPECT_GT(rays, 70000u);
  EXPECT_EQ(hits, 0u) << name;
  EXPECT_GT(naive_hits, rays / 20) << "the test must see self-hits where there is no offset";
  EXPECT_LT(longest_step, 6);
}

INSTANTIATE_TEST_SUITE_P(ScalesAndDistances, TracerErrorBoundOffset,
                         ::testing::Values(OffsetCase{"small", 1e-3, 0},
                                           OffsetCase{"small_far_1e3", 1e-3, 1e3}, OffsetCase{"unit", 1, 0},
                                           OffsetCase{"unit_far_10", 1, 10},
                                           OffsetCase{"unit_far_1e3", 1, 1e3}, OffsetCase{"large", 1e3, 0},
                                           OffsetCase{"large_far_1e3", 1e3, 1e3}, OffsetCase{"huge", 1e6, 0},
                                           OffsetCase{"huge_far_1e3", 1e6, 1e3}),
                         [](const auto& info) { return std::string(info.param.name); });

TEST(TracerSurface, AThinBlockerCloseToTheSurfaceStillBlocks) {
  // A second triangle 1e-2 sizes above: the offset must not leap over it.
  for (double scale : {1e-3, 1.0, 1e3, 1e6}) {
    Scene scene;
    const auto s = float(scale);
    AddTriangle(scene, {0, 0, 0}, {s, 0, 0}, {0, s, 0});
    AddTriangle(scene, {-s, -s, s / 100}, {3 * s, -s, s / 100}, {-s, 3 * s, s / 100});
    scene.Finish();
    const Tree tree = BuildTree(scene);
    for (uint64_t i = 0; i < 1000; ++i) {
      Random random(3, i);
      const double u = random.NextDouble() / 2, v = random.NextDouble() / 2;
      const SurfacePoint surface = SurfaceAt(scene, rb_ray{}, {1, float(u), float(v), 0});
      const rb_ray ray = RayFrom(surface.Origin(1), Normalize(Vec3d{0, 0, 1} + random.UnitVector() * 0.7));
      rb_hit hit;
      rb_query query{};
      query.struct_size = sizeof query, query.n = 1, query.rays = &ray, query.hits = &hit;
      tree.Query(query);
      ASSERT_EQ(hit.prim, 1u) << "scale " << scale << " ray " << i;
    }
  }
}

TEST(TracerSurface, RaysLeaveSpheresOnEitherSide) {
  for (double scale : {1e-3, 1.0, 1e3}) {
    for (double distance : {0.0, 10.0, 1e3}) {
      Random random(5, uint64_t(distance));
      Scene scene;
      scene.spheres.push_back({ToFloat(random.UnitVector() * (scale * distance)), float(scale)});
      scene.Finish();
      const Tree tree = BuildTree(scene);
      const Vec3d center = ToDouble(scene.spheres[0].center);
      for (uint64_t i = 0; i < 2000; ++i) {
        const Vec3d normal = random.UnitVector();
        const rb_ray arriving = RayFrom(ToFloat(center + normal * (3 * scale)), -normal);
        rb_hit hit;
        rb_query query{};
        query.struct_size = sizeof query, query.n = 1, query.rays = &arriving, query.hits = &hit;
        tree.Query(query);
        ASSERT_EQ(hit.prim, 0u);
        const SurfacePoint surface = SurfaceAt(scene, arriving, hit);
        EXPECT_NEAR(Length(surface.point - center), double(scene.spheres[0].radius), scale * 1e-12);
        EXPECT_GT(Dot(surface.normal, normal), 0.99);
        Vec3d dir = random.UnitVector();
        if (Dot(dir, surface.normal) < 0) dir = -dir;
        const rb_ray out = RayFrom(surface.Origin(1), dir), in = RayFrom(surface.Origin(-1), -dir);
        query.rays = &out;
        tree.Query(query);
        ASSERT_EQ(hit.prim, RAYBENCH_NONE) << "self-hit outside";
        query.rays = &in;
        tree.Query(query);
        ASSERT_EQ(hit.prim, 0u) << "the far side was lost";
        // Chord through the sphere: 2 r cos, up to the offset and, far away, to coarse floats.
        const double cosine = Dot(dir, surface.normal);
        if (cosine > 0.2) {
          EXPECT_NEAR(hit.t, 2 * scale * cosine, scale * (1e-4 + distance * 1e-5));
        }
      }
    }
  }
}

/// Rays at the primitive from a shell around it, from inside too; after each hit one ray away from the
/// surface on either side. `convex`: no such ray outside may come back.
void ExpectNoSelfHits(const Scene& scene, double scale, bool convex, uint64_t seed) {
  const Tree tree = BuildTree(scene);
  const Bounds3 box = scene.bounds();
  const Vec3d center = (ToDouble(box.lo) + ToDouble(box.hi)) * 0.5;
  uint64_t hits = 0;
  for (uint64_t i = 0; i < 4000; ++i) {
    Random random(seed, i);
    const Vec3f org = ToFloat(center + random.UnitVector() * (scale * (i % 2 ? 3.0 : 0.3)));
    const Vec3d target = center + random.UnitVector() * (scale * random.NextDouble());
    const rb_ray arriving = RayFrom(org, target - ToDouble(org));
    if (!IsValidRay(arriving)) continue;
    rb_hit hit;
    rb_query query{};
    query.struct_size = sizeof query, query.n = 1, query.rays = &arriving, query.hits = &hit;
    tree.Query(query);
    if (hit.prim == RAYBENCH_NONE) continue;
    ++hits;
    const SurfacePoint surface = SurfaceAt(scene, arriving, hit);
    ASSERT_NEAR(Length(surface.normal), 1, 1e-12);
    const Vec3d expected = testing::Org(arriving) + testing::Dir(arriving) * double(hit.t);
    ASSERT_LT(Length(surface.point - expected),
              1e-6 * (Length(expected) + Length(testing::Org(arriving)) + scale))
        << i;
    ASSERT_GT(std::abs(Dot(Normalize(scene.GeometricNormal(0, surface.point)), surface.normal)), 1 - 1e-9)
        << i;
    for (double side : {1.0, -1.0}) {
      // Hardly above the surface up to straight away.
      Vec3d dir = random.UnitVector();
      dir = dir - surface.normal * Dot(dir, surface.normal);
      dir = Normalize(dir) + surface.normal * (side * std::ldexp(1.0, -int(random.Below(12))));
      const rb_ray away = RayFrom(surface.Origin(side), dir);
      query.rays = &away;
      tree.Query(query);
      if (convex && side > 0) {
        ASSERT_EQ(hit.prim, RAYBENCH_NONE) << "self-hit at t " << hit.t << ", ray " << i;
      } else if (hit.prim != RAYBENCH_NONE && !convex) {
        ADD_FAILURE() << "a flat primitive hit itself at t " << hit.t << ", ray " << i;
      } else if (hit.prim != RAYBENCH_NONE) {
        // The far side, not the near one: the chord is as long as the angle makes it.
        ASSERT_GT(hit.t * Length(dir), scale * 1e-5) << i;
      }
    }
  }
  EXPECT_GT(hits, 300u);
}

TEST(TracerSurface, RaysLeaveCones) {
  for (double scale : {1e-3, 1.0, 1e3})
    for (double distance : {0.0, 10.0, 1e3})
      for (const auto& [r0, r1] : {std::pair{0.8, 0.8}, {0.5, 1.0}, {1.0, 0.0}}) {
        Random random(6, uint64_t(distance));
        const Vec3d center = random.UnitVector() * (scale * distance),
                    half = random.UnitVector() * (0.8 * scale);
        Scene scene;
        scene.cones.push_back(
            {ToFloat(center - half), float(r0 * scale), ToFloat(center + half), float(r1 * scale)});
        scene.Finish();
        ExpectNoSelfHits(scene, scale, true, 7);
      }
}

TEST(TracerSurface, RaysLeavePolygons) {
  for (double scale : {1e-3, 1.0, 1e3})
    for (double distance : {0.0, 10.0, 1e3}) {
      Random random(8, uint64_t(distance));
      const Vec3d center = random.UnitVector() * (scale * distance), u = random.UnitVector(),
                  v = Normalize(Cross(u, random.UnitVector()));
      Scene scene;
      scene.polygons = {{0, 6}};
      for (const auto& [x, y] :
           {std::pair{-1.0, -1.0}, {1.0, -1.0}, {1.0, 1.0}, {0.2, 0.1}, {-0.7, 1.0}, {-0.9, 0.2}}) {
        scene.polygon_vertices.push_back(uint32_t(scene.positions.size()));
        scene.positions.push_back(ToFloat(center + (u * x + v * y) * scale));
      }
      scene.Finish();
      ExpectNoSelfHits(scene, scale, false, 9);
    }
}

TEST(TracerSurface, AnApexHasANormal) {
  Scene scene;
  scene.cones = {{{0, 0, 0}, 1, {0, 0, 1}, 0}};
  scene.Finish();
  for (const Vec3f& dir : {Vec3f{0, 0, -1}, Vec3f{1, 0, 0}, Vec3f{0.5f, 0.5f, -1}}) {
    const rb_ray ray = RayFrom(Vec3f{0, 0, 1} - dir, ToDouble(dir));
    const SurfacePoint surface = SurfaceAt(scene, ray, {1, 0, 0, 0});
    EXPECT_NEAR(Length(surface.normal), 1, 1e-12);
    EXPECT_EQ(surface.point, (Vec3d{0, 0, 1}));
  }
}

}  // namespace
}  // namespace raybench
