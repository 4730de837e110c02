// Rays aimed at edges: from inside a closed ball, of ever more triangles and of ever thinner ones; and from
// outside, past the silhouette.
#include <fmt/format.h>

#include <map>

#include "harness/extremes/make.h"
#include "harness/rays/from_inside.h"

namespace raybench::extremes {
namespace {

Workload MakeEdgeAim(const Point& point, uint64_t rays, uint64_t seed) {
  Workload work;
  work.scene = ToScene(Ball(uint32_t(std::lround(std::sqrt(point.magnitude / 20))), seed), kEdgeAim, point);
  work.rays = AimedRays(work.scene, rays, seed).rays;
  return work;
}

/// A ball pulled along one direction, off the axes: its triangles become as slim as it is. Aspect: length
/// over width, for the median triangle.
Workload MakeSliver(const Point& point, uint64_t rays, uint64_t seed) {
  Mesh mesh = Ball(8, seed);
  Random random(seed, 1);
  const Vec3d along = random.UnitVector();
  const double squeeze = 1 / point.magnitude;  // across, so that the scene keeps its size
  const auto squeezed = [&](Vec3d p) {
    const Vec3d part = along * Dot(p, along);
    return part + (p - part) * squeeze;
  };
  for (Vec3d& p : mesh.positions) p = squeezed(p);
  Workload work;
  work.scene = ToScene(mesh, kSliver, point);
  work.rays = MakeRays(rays, seed, [&](uint64_t i, Random& r) {
    const Vec3f org = ToFloat(squeezed(InBall(r) * 0.3));
    return Towards(org, EdgeTarget(work.scene, i, r));
  });
  return work;
}

/// Edges between a triangle that faces `eye` and one that does not.
std::vector<std::array<uint32_t, 2>> SilhouetteEdges(const Scene& scene, Vec3d eye) {
  std::map<std::array<uint32_t, 2>, bool> facing;
  std::vector<std::array<uint32_t, 2>> edges;
  for (uint32_t t = 0; t < scene.triangles.size(); ++t) {
    const auto& v = scene.triangles[t];
    const Vec3d p = ToDouble(scene.positions[v[0]]);
    const bool faces = Dot(scene.GeometricNormal(t, p), eye - p) > 0;
    for (size_t i = 0; i < 3; ++i) {
      const auto edge = std::minmax(v[i], v[(i + 1) % 3]);
      const auto [it, is_new] = facing.try_emplace({edge.first, edge.second}, faces);
      if (!is_new && it->second != faces) edges.push_back(it->first);
    }
  }
  return edges;
}

Workload MakeSilhouette(const Point& point, uint64_t rays, uint64_t seed) {
  Workload work;
  work.scene = ToScene(Ball(8, seed), kSilhouette, point);
  const double ulp = 0x1p-24;  // of coordinates just below 1, the ball's radius
  constexpr uint64_t kRaysFromOneEye = 64;
  std::vector<std::array<uint32_t, 2>> edges;
  Vec3f eye;
  work.rays = MakeRays(rays, seed, [&](uint64_t i, Random& r) {
    if (i % kRaysFromOneEye == 0) {
      Random place(seed, ~i);
      eye = ToFloat(place.UnitVector() * (1.5 + 2 * place.NextDouble()));
      edges = SilhouetteEdges(work.scene, ToDouble(eye));
    }
    const auto& [a, b] = edges[r.Below(edges.size())];
    const Vec3d p = ToDouble(work.scene.positions[a]), q = ToDouble(work.scene.positions[b]);
    const Vec3d on_edge = p + (q - p) * r.NextDouble(), dir = on_edge - ToDouble(eye);
    Vec3d outward = Normalize(Cross(q - p, dir));
    if (Dot(outward, on_edge) < 0) outward = -outward;
    const Vec3d beside = on_edge + outward * (point.magnitude * ulp);
    return MakeRay(eye, ToFloat(Normalize(beside - ToDouble(eye))));
  });
  work.second = HitOrMissDiffers;
  return work;
}

}  // namespace

const Suite kEdgeAim = {"edge_aim",
                        "from inside a closed ball at rounded midpoints of its edges and at its vertices",
                        "triangles of the ball",
                        Axis::kLogarithmic,
                        "leak or plain error",
                        nullptr,
                        "all",
                        [] {
                          return Along({20, 80, 320, 1280, 5120, 20480, 81920});
                        },
                        MakeEdgeAim};

const Suite kSliver = {"sliver",
                       "the same inside a ball pulled into a needle, whose triangles are as slim",
                       "aspect of the triangles (length : width)",
                       Axis::kLogarithmic,
                       "leak or plain error",
                       nullptr,
                       "up to 1e6; a needle of 1e7 is two float steps thick",
                       [] { return Decades(0, 7, 1e6); },
                       MakeSliver};

const Suite kSilhouette = {"silhouette",
                           "from outside, beside the silhouette edges of a ball",
                           "distance from the silhouette, in ulp of the ball's coordinates",
                           Axis::kLogarithmic,
                           "leak or plain error",
                           "hit instead of miss or the reverse, excused or not",
                           "all",
                           [] {
                             return Along({0, 1, 2, 4, 8, 16, 32, 64});
                           },
                           MakeSilhouette};

}  // namespace raybench::extremes
