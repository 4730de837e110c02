// Many primitives where a structure cannot divide them: copies, points and lines, and the teapot in
// a stadium.
#include <fmt/format.h>

#include "harness/extremes/make.h"

namespace raybench::extremes {
namespace {

/// Every answer costs a test of each copy, so few rays where there are many.
uint64_t AffordableRays(uint64_t rays, double copies) {
  return std::max<uint64_t>(4, std::min(rays, uint64_t(0x1p21 / copies)));
}

Workload MakeCoincident(const Point& point, uint64_t rays, uint64_t seed) {
  const Vec3d a{0.131, 0.017, -0.423}, b{0.911, -0.371, 0.219}, c{-0.277, 0.853, 0.471};
  Mesh mesh;
  mesh.positions = {a, b, c};
  mesh.triangles.assign(size_t(point.magnitude), {0, 1, 2});
  Workload work;
  work.scene = ToScene(mesh, kCoincident, point);
  work.rays = MakeRays(AffordableRays(rays, point.magnitude), seed, [&](uint64_t, Random& r) {
    double u = r.NextDouble(), v = r.NextDouble();
    if (u + v > 1) {
      u = 1 - u;
      v = 1 - v;
    }
    const Vec3d target = a + (b - a) * (0.02 + 0.94 * u) + (c - a) * (0.02 + 0.94 * v);
    return Towards(ToFloat(target + r.UnitVector()), ToFloat(target));
  });
  work.fails = [](const Truth& truth, const rb_hit& hit) {
    return hit.prim != truth.first;  // both RAYBENCH_NONE on a miss
  };
  return work;
}

/// Points and lines, exactly collinear on a lattice, between the triangles of a ball and in its inside; even
/// rays aim at the ball's edges, odd ones at what is degenerate.
Workload MakeDegenerate(const Point& point, uint64_t rays, uint64_t seed) {
  const Mesh ball = Ball(4, seed);
  const size_t flawed =
      size_t(std::llround(double(ball.triangles.size()) * point.magnitude / (1 - point.magnitude)));
  Mesh mesh;
  mesh.positions = ball.positions;
  std::vector<Vec3f> targets;
  Random random(seed, 1);
  const auto lattice = [&] { return Vec3d(ToDouble(ToFloat(InBall(random) * 0.5))); };
  size_t made = 0;
  for (size_t t = 0; t < ball.triangles.size(); ++t) {
    for (; made < flawed * (t + 1) / ball.triangles.size(); ++made) {
      const Vec3d from = lattice();
      // A step of few bits, so that p, p + s, p + 2 s are collinear after rounding too.
      Vec3d step;
      for (int k = 0; k < 3; ++k) step[k] = double(int64_t(random.Below(257)) - 128) * 0x1p-9;
      Vec3d p;
      for (int k = 0; k < 3; ++k) p[k] = std::round(from[k] * 0x1p12) * 0x1p-12;
      const uint32_t first = mesh.Add(p);
      targets.push_back(ToFloat(p + step * 0.37));
      if (made % 3 == 0) {
        mesh.triangles.push_back({first, first, first});  // a point
      } else if (made % 3 == 1) {
        mesh.triangles.push_back({first, mesh.Add(p + step), first});  // a line of two vertices
      } else {
        const uint32_t middle = mesh.Add(p + step);
        mesh.triangles.push_back({first, middle, mesh.Add(p + step * 2.0)});
      }
    }
    mesh.triangles.push_back(ball.triangles[t]);
  }
  Workload work;
  work.scene = ToScene(mesh, kDegenerate, point);
  if (work.scene.stats.degenerate_triangles != flawed || work.scene.triangles.size() != ball.triangles.size())
    throw std::logic_error("degenerate: not all points and lines were left out at load");
  work.note =
      fmt::format("{} of {} triangles are points or lines, left out at load", flawed, mesh.triangles.size());
  work.rays = MakeRays(rays, seed, [&](uint64_t i, Random& r) {
    const Vec3f org = ToFloat(InBall(r) * 0.3);
    const bool at_flawed = i % 2 != 0 && !targets.empty();
    return Towards(org, at_flawed ? targets[r.Below(targets.size())] : EdgeTarget(work.scene, i / 2, r));
  });
  return work;
}

/// Even rays go to the object, odd ones anywhere.
Workload MakeTeapot(const Point& point, uint64_t rays, uint64_t seed) {
  LoadOptions load;
  load.seed = seed;
  Workload work;
  work.scene = LoadScene(fmt::format("stadium(size=20000,ratio={})", point.magnitude), load);
  const double half = point.magnitude / 2;
  work.rays = MakeRays(rays, seed, [&](uint64_t i, Random& r) {
    const Vec3d p = InBall(r);
    const Vec3f org = ToFloat(Vec3d{0.4 * p.x, 0.15 * std::fabs(p.y) + 0.01, 0.3 * p.z} * half);
    if (i % 2 != 0) return MakeRay(org, ToFloat(r.UnitVector()));
    return Towards(org, ToFloat(InBall(r) * 0.5 + Vec3d{0, 0.5, 0}));  // the object: size 1, feet at y = 0
  });
  return work;
}

}  // namespace

const Suite kCoincident = {"coincident",
                           "copies of one triangle, rays that hit it",
                           "copies",
                           Axis::kLogarithmic,
                           "names another copy than the lowest id, or errs",
                           nullptr,
                           "all",
                           [] { return Decades(0, 6); },
                           MakeCoincident};

const Suite kDegenerate = {"degenerate",
                           "a ball among triangles that are points or lines; they must never be hit",
                           "share of points and lines among the file's triangles",
                           Axis::kLinear,
                           "leak or plain error (points and lines have no id to be named by)",
                           nullptr,
                           "all",
                           [] {
                             return Along({0, 0.1, 0.25, 0.5, 0.75, 0.9, 0.99});
                           },
                           MakeDegenerate};

const Suite kTeapotInStadium = {"teapot_in_stadium",
                                "a small object of 20,000 triangles in an ever larger arena of 9,504",
                                "size of the arena over size of the object",
                                Axis::kLogarithmic,
                                "leak or plain error",
                                nullptr,
                                "all",
                                [] {
                                  return Along({5, 10, 100, 1e3, 1e4, 1e5, 1e6});
                                },
                                MakeTeapot};

}  // namespace raybench::extremes
