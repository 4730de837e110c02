// Rays that leave a surface where a tree's own ray has hit it, with the tracer's cure against hitting that
// surface again and with those that are in use elsewhere (tracer/surface.h).
#include <fmt/format.h>

#include "harness/extremes/make.h"
#include "tracer/surface.h"

namespace raybench::extremes {
namespace {

constexpr const char *kNone = "no cure", *kTnear = "tnear = 1e-4", *kSkip = "skip the last primitive",
                     *kOffset = "error-bound offset (the tracer's)";
constexpr uint32_t kSteps = 8, kInner = 20 * kSteps * kSteps;

/// A ball and, 1 % larger, one that blocks what leaves it. Rays start near the middle; they leave outwards.
Workload MakeLeaving(const Suite& suite, const Point& point, double scale, Vec3d at, uint64_t rays,
                     uint64_t seed) {
  Mesh mesh = Ball(kSteps, seed);
  const uint32_t first = uint32_t(mesh.positions.size());
  const Mesh outer = mesh;
  for (Vec3d p : outer.positions) mesh.Add(p * 1.01);
  for (auto [a, b, c] : outer.triangles) mesh.triangles.push_back({first + a, first + b, first + c});
  for (Vec3d& p : mesh.positions) p = at + p * scale;
  Workload work;
  work.scene = ToScene(mesh, suite, point);
  // Every contestant has rays of its own, and so a truth of its own.
  work.rays = MakeRays(std::max<uint64_t>(rays / 4, 64), seed, [&](uint64_t, Random& r) {
    return MakeRay(ToFloat(at + InBall(r) * (0.3 * scale)), ToFloat(r.UnitVector()));
  });
  work.fails = [](const Truth&, const rb_hit& hit) { return hit.prim < kInner; };
  work.second = [](const Truth&, const rb_hit& hit) { return hit.prim == RAYBENCH_NONE; };
  work.leave = [cure = point.variant, seed](const Scene& leaving, std::span<const rb_hit> hits,
                                            std::vector<rb_ray>& lead, std::vector<uint32_t>& skip) {
    std::vector<rb_ray> left;
    for (size_t i = 0; i < lead.size(); ++i) {
      if (hits[i].prim >= kInner) continue;  // slipped through
      const rb_ray& ray = lead[i];
      const SurfacePoint s = SurfaceAt(leaving, ray, hits[i]);
      Random random(seed, ~uint64_t{i});
      Vec3d dir = random.UnitVector();
      if (Dot(dir, s.normal) < 0) dir = -dir;
      Vec3f org = LoadVec3(ray.org) + LoadVec3(ray.dir) * hits[i].t;
      if (cure == kOffset) org = s.Origin(1);
      rb_ray next = MakeRay(org, ToFloat(dir));
      if (cure == kTnear) next.tnear = 1e-4f;
      if (cure == kSkip) skip.push_back(hits[i].prim);
      left.push_back(next);
    }
    lead = std::move(left);
  };
  return work;
}

Workload MakeSelfHit(const Point& point, uint64_t rays, uint64_t seed) {
  return MakeLeaving(kSelfHit, point, point.magnitude, {0, 0, 0}, rays, seed);
}

Workload MakeSelfHitFar(const Point& point, uint64_t rays, uint64_t seed) {
  Random random(seed, 1);
  return MakeLeaving(kSelfHitFar, point, 0.5, random.UnitVector() * point.magnitude, rays, seed);
}

}  // namespace

const Suite kSelfHit = {"self_hit",
                        "rays that leave a ball where a ray has hit it, towards a blocker 1 % farther out",
                        "radius of the ball",
                        Axis::kLogarithmic,
                        "hits the surface that it leaves",
                        "slips through the blocker",
                        "all, where no primitive is skipped",
                        [] {
                          return Times(Decades(-3, 6), {kOffset, kSkip, kTnear, kNone});
                        },
                        MakeSelfHit};

const Suite kSelfHitFar = {"self_hit_far",
                           "the same with a ball far from the coordinate origin",
                           "distance from the coordinate origin, in sizes of the ball",
                           Axis::kLogarithmic,
                           "hits the surface that it leaves",
                           "slips through the blocker",
                           "all, where no primitive is skipped",
                           [] {
                             return Times(Decades(0, 4), {kOffset, kSkip, kTnear, kNone});
                           },
                           MakeSelfHitFar};

}  // namespace raybench::extremes
