// Vertices, origins, directions and t down to the smallest subnormal number: every structure keeps its claim,
// and answers what `brute` answers.
#include <gtest/gtest.h>

#include <cmath>

#include "harness/truth/oracle.h"
#include "tests/support/conformance.h"
#include "tests/support/effort.h"

namespace raybench::testing {
namespace {

/// +-2^e times a number in [1, 2), e drawn evenly.
float AnyMagnitude(Random& random, int lowest, int highest) {
  const int e = lowest + int(random.Below(uint64_t(highest - lowest + 1)));
  const double magnitude = std::ldexp(1 + random.NextDouble(), e);
  return float(random.Below(2) ? magnitude : -magnitude);
}
Vec3f AnyPoint(Random& random, int lowest, int highest) {
  Vec3f p;
  for (int a = 0; a < 3; ++a) p[a] = random.Below(5) == 0 ? 0 : AnyMagnitude(random, lowest, highest);
  return p;
}

/// The box [0, n]^3 times `unit`, whose faces at 0 have subnormal neighbours.
Mesh BoxAtZero(int n, float unit) {
  Mesh mesh{"box_at_zero", {}, {}};
  for (int axis = 0; axis < 3; ++axis) {
    for (int side = 0; side < 2; ++side) {
      const uint32_t base = uint32_t(mesh.positions.size()), row = uint32_t(n + 1);
      for (int i = 0; i <= n; ++i) {
        for (int j = 0; j <= n; ++j) {
          Vec3f v{0, 0, 0};
          v[axis] = float(side * n) * unit, v[(axis + 1) % 3] = float(i) * unit,
          v[(axis + 2) % 3] = float(j) * unit;
          mesh.positions.push_back(v);
        }
      }
      for (uint32_t i = 0; i + 1 < row; ++i) {
        for (uint32_t j = 0; j + 1 < row; ++j) {
          const uint32_t a = base + i * row + j;
          mesh.triangles.push_back({a, a + row, a + row + 1});
          mesh.triangles.push_back({a, a + row + 1, a + 1});
        }
      }
    }
  }
  return mesh;
}

/// A second mesh behind the first one's triangles. It keeps the scene from being rescaled.
Mesh With(Mesh mesh, const Mesh& other, const std::string& name) {
  const uint32_t base = uint32_t(mesh.positions.size());
  mesh.positions.insert(mesh.positions.end(), other.positions.begin(), other.positions.end());
  for (const auto& t : other.triangles) mesh.triangles.push_back({t[0] + base, t[1] + base, t[2] + base});
  mesh.name = name;
  return mesh;
}

Mesh Soup(int count, int lowest, int highest) {
  Mesh mesh{"soup", {}, {}};
  Random random(5);
  for (uint32_t i = 0; i < uint32_t(count); ++i) {
    const Vec3f at = AnyPoint(random, lowest, highest);
    for (int k = 0; k < 3; ++k)
      mesh.positions.push_back(random.Below(2) ? AnyPoint(random, lowest, highest)
                                               : at + AnyPoint(random, lowest, -40));
    mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  return mesh;
}

/// Spheres, cones and polygons of all sizes among triangles; the polygons are a box with a corner at 0.
Scene Procedural() {
  Scene scene;
  scene.name = "procedural";
  scene.provenance.source = "test";
  const Mesh ball = Ball(1);
  scene.positions = ball.positions, scene.triangles = ball.triangles;
  scene.triangle_material.assign(ball.triangles.size(), 0);
  for (uint32_t i = 0; i < ball.triangles.size(); ++i) scene.triangle_face.push_back(i);
  Random random(9);
  for (int i = 0; i < 30; ++i) {
    const int size = -149 + int(random.Below(150));
    scene.spheres.push_back({AnyPoint(random, -149, 0), AnyMagnitude(random, size, size)});
    const Vec3f base = random.Below(2) ? AnyPoint(random, -149, 0) : Vec3f{0, 0, 0},
                along = AnyPoint(random, size, size);
    if (!(base + along == base))
      scene.cones.push_back({base, std::fabs(AnyMagnitude(random, size, size)), base + along,
                             std::fabs(AnyMagnitude(random, size, size))});
  }
  for (const float unit : {1.0f, 0x1p-60f, 0x1p-140f, 0x1p-149f}) {
    const Mesh box = BoxAtZero(1, unit);
    const uint32_t first = uint32_t(scene.positions.size());
    scene.positions.insert(scene.positions.end(), box.positions.begin(), box.positions.end());
    for (uint32_t face = 0; face < 6; ++face) {
      scene.polygons.push_back({uint32_t(scene.polygon_vertices.size()), 4});
      for (uint32_t corner : {0u, 2u, 3u, 1u}) scene.polygon_vertices.push_back(first + 4 * face + corner);
    }
  }
  scene.sphere_material.assign(scene.spheres.size(), 0);
  scene.cone_material.assign(scene.cones.size(), 0);
  scene.polygon_material.assign(scene.polygons.size(), 0);
  scene.Finish();
  return scene;
}

/// Rays at what the scene has, and from beside it: everything subnormal that a ray can have.
std::vector<rb_ray> SubnormalRays(const Scene& scene, int count, uint64_t seed) {
  std::vector<rb_ray> rays;
  Random random(seed);
  const auto some_float = [&] {
    return random.Below(4) ? AnyMagnitude(random, -149, 30) : random.Below(2) ? 0.0f : -0.0f;
  };
  const rb_geometry geometry = scene.Geometry();
  while (int(rays.size()) < count) {
    const uint64_t prim = random.Below(scene.primitive_count());
    Vec3f target;
    if (prim < scene.triangles.size()) {
      const auto& t = scene.triangles[prim];
      const Vec3d a = ToDouble(scene.positions[t[0]]), b = ToDouble(scene.positions[t[1]]),
                  c = ToDouble(scene.positions[t[2]]);
      double u = random.NextDouble(), v = random.NextDouble() * (1 - u);
      const uint64_t where = random.Below(3);
      if (where > 0) v = 0;   // on an edge
      if (where == 2) u = 0;  // at a vertex
      target = ToFloat(a * (1 - u - v) + b * u + c * v);
    } else {
      float lo[3], hi[3];
      geometry.procedural_bounds(geometry.procedural_user, prim - scene.triangles.size(), lo, hi);
      for (int a = 0; a < 3; ++a) {
        const uint64_t where = random.Below(4);
        target[a] = where == 0   ? lo[a]
                    : where == 1 ? hi[a]
                                 : float(lo[a] + (double(hi[a]) - lo[a]) * random.NextDouble());
      }
    }
    Vec3f from = target, dir;
    switch (random.Below(4)) {
      case 0:  // from anywhere
        from = AnyPoint(random, -149, 2);
        dir = target - from;
        break;
      case 1:  // from beside the target, to anywhere
        from[int(random.Below(3))] += AnyMagnitude(random, -149, -100);
        dir = AnyPoint(random, -149, 2);
        break;
      case 2: {  // nearly in a plane of an axis through it
        const int axis = int(random.Below(3));
        from = AnyPoint(random, -20, 1);
        dir = target - from;
        const float h = AnyMagnitude(random, -149, -120);
        from[axis] = target[axis] + h,
        dir[axis] = random.Below(2) ? -h * float(random.Below(5)) : AnyMagnitude(random, -149, -120);
        break;
      }
      default:  // along an axis, nearly
        from = target;
        dir = {some_float(), some_float(), some_float()};
        for (int k = 0; k < 3; ++k) from[k] -= dir[k];
    }
    // Directions of any length, by powers of two as far as that is exact.
    if (random.Below(3) == 0) {
      const int e = int(random.Below(240)) - 120;
      for (int k = 0; k < 3; ++k) dir[k] = std::ldexp(dir[k], e);
    }
    rb_ray ray{{from.x, from.y, from.z}, 0, {dir.x, dir.y, dir.z}, std::numeric_limits<float>::infinity()};
    if (random.Below(8) == 0) ray.tnear = std::fabs(some_float());
    if (random.Below(8) == 0) ray.tfar = std::fabs(some_float());
    if (IsValidRay(ray)) rays.push_back(ray);
  }
  return rays;
}

struct SubnormalScene {
  Scene scene;
  std::vector<rb_ray> rays;
  std::unique_ptr<Oracle> oracle;
  std::vector<Truth> truth;

  explicit SubnormalScene(Scene given) : scene(std::move(given)) {
    rays = SubnormalRays(scene, int(Effort(2000)), 3);
    oracle = MakeOracle(scene);
    truth = oracle->Ask(rays, 0);
    oracle->Audit(rays, truth, 1, Effort(64));
  }
};

const std::vector<std::unique_ptr<const SubnormalScene>>& SubnormalScenes() {
  static const auto scenes = [] {
    const Mesh ball = Ball(2);
    std::vector<std::unique_ptr<const SubnormalScene>> all;
    for (const Mesh& mesh :
         {With(BoxAtZero(4, 1), {}, "box_at_zero"), With(BoxAtZero(4, 0x1p-149f), ball, "smallest_box"),
          With(Moved(ball, 0x1p-140f, {0, 0, 0}, ""), ball, "subnormal_ball"),
          With(Moved(ball, 0x1p-125f, {0, 0, 0}, ""), ball, "ball_at_the_end_of_normal"),
          With(Moved(ball, 0x1p-60f, {0, 0, 0}, ""), ball, "small_ball"),
          With(Soup(60, -149, 0), ball, "any_magnitude")})
      all.push_back(std::make_unique<const SubnormalScene>(SceneOf(mesh)));
    all.push_back(std::make_unique<const SubnormalScene>(Procedural()));
    return all;
  }();
  return scenes;
}

class Subnormal : public ::testing::TestWithParam<std::string> {};

TEST_P(Subnormal, EveryClaimIsKept) {
  for (const auto& known : SubnormalScenes()) {
    SCOPED_TRACE("scene " + known->scene.name);
    const Registry registry;
    if (known->scene.procedural_count() > 0 &&
        (ParseContestant(registry, GetParam()).structure->capabilities & RB_CAN_PROCEDURAL) == 0)
      continue;
    const Tree tree = Build(GetParam(), known->scene.Geometry());
    if (tree.Claims() != RB_CLAIM_WATERTIGHT && tree.Claims() != RB_CLAIM_EXACT) return;
    const std::vector<rb_hit> hits = Closest(tree, known->rays);
    const std::vector<uint8_t> occluded = Occluded(tree, known->rays);
    std::vector<Judged> judged;
    const VerdictCounts closest =
        JudgeAll(*known->oracle, RB_CLOSEST, known->rays, known->truth, hits, {}, 0, &judged);
    const VerdictCounts any = JudgeAll(*known->oracle, RB_ANY, known->rays, known->truth, {}, occluded, 0);
    EXPECT_FALSE(BreaksClaim(tree.Claims(), any))
        << any.leaks() << " leaks, " << any.plain_errors() << " plain errors";
    if (!BreaksClaim(tree.Claims(), closest)) continue;
    ADD_FAILURE() << closest.leaks() << " leaks, " << closest.plain_errors() << " plain errors, "
                  << closest.rays - closest.strict << " not exact, " << closest.uv_wrong << " u or v wrong";
    for (size_t i = 0, shown = 0; i < hits.size() && shown < 3; ++i) {
      if (!judged[i].Breaks(tree.Claims())) continue;
      ++shown;
      const rb_ray& r = known->rays[i];
      char text[400];
      std::snprintf(
          text, sizeof text, "%s: org %a %a %a dir %a %a %a in (%a, %a]: prim %d t %a; truth %d t %a",
          VerdictName(judged[i].verdict), r.org[0], r.org[1], r.org[2], r.dir[0], r.dir[1], r.dir[2], r.tnear,
          r.tfar, int(hits[i].prim), hits[i].t, int(known->truth[i].first), known->truth[i].t);
      ADD_FAILURE() << text;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Every, Subnormal, ::testing::ValuesIn(Specs()),
                         [](const auto& info) { return TestName(info.param); });

}  // namespace
}  // namespace raybench::testing
