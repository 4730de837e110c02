#include "harness/rays/from_inside.h"

#include "accel/base/random.h"

namespace raybench {

RaySet AimedRays(const Scene& scene, uint64_t count, uint64_t seed, std::optional<Bounds3> origins) {
  if (scene.triangles.empty())
    throw InputError(scene.name + ": aimed rays need triangles, and there are none");
  if (!origins) {
    const Vec3d lo = ToDouble(scene.bounds().lo), hi = ToDouble(scene.bounds().hi);
    const Vec3d center = (lo + hi) * 0.5, half = (hi - lo) * 0.025;
    origins = Bounds3{ToFloat(center - half), ToFloat(center + half)};
  }
  RaySet set;
  set.kind = "aimed";
  set.order = "traced";
  set.rays.reserve(count);
  for (uint64_t i = 0; i < count; ++i) {
    Random random(seed, i);
    const auto& triangle = scene.triangles[random.Below(scene.triangles.size())];
    const size_t corner = random.Below(3);
    Vec3f target = scene.positions[triangle[corner]];
    if (i % 2 == 0)
      target = ToFloat((ToDouble(target) + ToDouble(scene.positions[triangle[(corner + 1) % 3]])) * 0.5);
    Vec3f org;
    for (int k = 0; k < 3; ++k)
      org[k] = float(origins->lo[k] + random.NextDouble() * (double(origins->hi[k]) - origins->lo[k]));
    const Vec3f dir = target - org;
    set.rays.push_back(
        {{org.x, org.y, org.z}, 0, {dir.x, dir.y, dir.z}, std::numeric_limits<float>::infinity()});
  }
  Freeze(set, scene.bounds());
  return set;
}

}  // namespace raybench
