#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <ostream>
#include <string>

#include "tests/tracer_testing.h"
#include "tracer/surface.h"

namespace raybench {
namespace {

using testing::AddTriangle;
using testing::BuildTree;

constexpr float kInf = std::numeric_limits<float>::infinity();

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

}  // namespace
}  // namespace raybench
