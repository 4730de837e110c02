#include "tracer/hemisphere.h"

#include <limits>

#include "accel/base/parallel.h"
#include "accel/base/random.h"
#include "tracer/surface.h"
#include "tracer/tracer.h"

namespace raybench {
namespace {

/// Fills `set` with `count` rays, `per_point` of them from each pick among the first hits of `camera`.
void FillHemispheres(RaySet& set, const Scene& scene, const Tree& tree, const RaySet& camera, uint64_t count,
                     uint64_t per_point, float tfar, uint64_t seed) {
  std::vector<rb_hit> hits(camera.rays.size());
  rb_query query{};
  query.struct_size = sizeof query;
  query.kind = RB_CLOSEST;
  query.n = camera.rays.size();
  query.rays = camera.rays.data();
  query.hits = hits.data();
  QueryParallel(tree, query, 0);
  std::vector<size_t> hit_rays;
  for (size_t i = 0; i < hits.size(); ++i)
    if (hits[i].prim < scene.primitive_count()) hit_rays.push_back(i);

  set.depth = 1;
  set.order = "traced";
  set.rays.resize(hit_rays.empty() ? 0 : count);
  const uint64_t points = (set.rays.size() + per_point - 1) / per_point;
  ParallelFor(uint64_t{0}, points, [&](uint64_t point) {
    // One pick from each of `points` equal strata, so that origins come in the order of the camera rays, as
    // they would in a wavefront path tracer.
    Random random(seed, point);
    const double stratum = (double(point) + random.NextDouble()) / double(points);
    const size_t pick = hit_rays[std::min(hit_rays.size() - 1, size_t(stratum * double(hit_rays.size())))];
    const rb_ray& ray = camera.rays[pick];
    const SurfacePoint surface = SurfaceAt(scene, ray, hits[pick]);
    const double side = Dot(surface.normal, ToDouble(LoadVec3(ray.dir))) > 0 ? -1 : 1;
    const Vec3f org = surface.Origin(side);
    for (uint64_t i = point * per_point; i < std::min(count, (point + 1) * per_point); ++i) {
      // The normal plus a uniform unit vector is cosine-distributed: the unit sphere through the surface
      // point, seen from there, has solid angle in proportion to the cosine.
      Vec3d dir;
      do dir = surface.normal * side + random.UnitVector();
      while (Dot(dir, dir) < 1e-12);
      const Vec3f unit = ToFloat(Normalize(dir));
      set.rays[i] = {{org.x, org.y, org.z}, 0, {unit.x, unit.y, unit.z}, tfar};
    }
  });
  Freeze(set, scene.bounds());
}

}  // namespace

RaySet DiffuseBounce(const Scene& scene, const Tree& tree, const RaySet& camera, uint64_t count,
                     uint64_t seed) {
  RaySet set;
  set.kind = "diffuse";
  set.query = RB_CLOSEST;
  FillHemispheres(set, scene, tree, camera, count, 1, std::numeric_limits<float>::infinity(), seed);
  return set;
}

RaySet AmbientOcclusion(const Scene& scene, const Tree& tree, const RaySet& camera, uint64_t count,
                        uint64_t seed) {
  RaySet set;
  set.kind = "ambient_occlusion";
  set.query = RB_ANY;
  const double diagonal = Length(ToDouble(scene.bounds().hi) - ToDouble(scene.bounds().lo));
  FillHemispheres(set, scene, tree, camera, count, kOcclusionRaysPerPoint, float(kOcclusionReach * diagonal),
                  seed);
  return set;
}

}  // namespace raybench
