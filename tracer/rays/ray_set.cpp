#include "tracer/rays/ray_set.h"

#include <cstring>
#include <utility>

#include "accel/base/hash.h"
#include "accel/base/parallel.h"
#include "accel/base/random.h"
#include "accel/host/registry.h"

namespace raybench {
namespace {

constexpr uint64_t kRun = 64;  // rays of a run that Thin() keeps together: an 8 x 8 tile

/// True only if no t in [tnear, tfar] lies in the closed box. Double over float input, with slack for
/// its roundings.
bool MissesBounds(const rb_ray& ray, const Bounds3& bounds) {
  if (bounds.Empty()) return true;
  double enter = ray.tnear, leave = ray.tfar;
  for (int i = 0; i < 3; ++i) {
    const double o = ray.org[i], d = ray.dir[i], lo = bounds.lo[i], hi = bounds.hi[i];
    if (d == 0) {
      if (o < lo || o > hi) return true;
      continue;
    }
    const double t0 = (lo - o) / d, t1 = (hi - o) / d;
    const double t_near = std::min(t0, t1), t_far = std::max(t0, t1);
    enter = std::max(enter, t_near - std::abs(t_near) * 0x1p-50);
    leave = std::min(leave, t_far + std::abs(t_far) * 0x1p-50);
  }
  return enter > leave;
}

}  // namespace

std::string RaySet::Label() const {
  if (!name.empty()) return name;
  const bool several = kind == "shadow" || kind == "reflection" || kind == "refraction";
  return several ? kind + "." + std::to_string(depth) : kind;
}

void Freeze(RaySet& set, const Bounds3& bounds) {
  const rb_ray stand_in = InvalidRayStandIn();
  set.invalid_rays = set.outside_rays = 0;
  for (rb_ray& ray : set.rays) {
    // A stand-in put there earlier (by the tracer, or before thinning and shuffling) still counts.
    if (!IsValidRay(ray) || std::memcmp(&ray, &stand_in, sizeof ray) == 0) {
      ray = stand_in;
      ++set.invalid_rays;
    } else if (MissesBounds(ray, bounds)) {
      ++set.outside_rays;
    }
  }
  Hash64 hash;
  hash.Add(set.kind);
  hash.AddValue(set.depth);
  hash.Add(set.order);
  hash.AddValue(set.query);
  hash.AddValue(uint64_t{set.rays.size()});
  hash.Add(set.rays.data(), set.rays.size() * sizeof(rb_ray));
  set.hash = hash.Hex();
}

RaySet Thin(const RaySet& set, uint64_t limit, const Bounds3& bounds) {
  const uint64_t n = set.rays.size();
  if (limit == 0 || limit > n) limit = n;
  RaySet thin{.kind = set.kind,
              .depth = set.depth,
              .order = set.order,
              .query = set.query,
              .rays = {},
              .hash = {},
              .name = set.name};
  thin.rays.reserve(limit);
  // Run j of m is preceded by its share of the rays left out, half a share at either end, and starts at a
  // multiple of the run's length, so that whole tiles are kept.
  const uint64_t runs = (limit + kRun - 1) / kRun, left_out = n - limit;
  for (uint64_t j = 0; j < runs; ++j) {
    const uint64_t gap = (left_out * j + left_out / 2) / runs;
    const uint64_t begin = j * kRun + gap / kRun * kRun, count = std::min(kRun, limit - j * kRun);
    thin.rays.insert(thin.rays.end(), set.rays.begin() + ptrdiff_t(begin),
                     set.rays.begin() + ptrdiff_t(begin + count));
  }
  Freeze(thin, bounds);
  return thin;
}

RaySet Shuffle(const RaySet& set, uint64_t seed, const Bounds3& bounds) {
  RaySet shuffled = set;
  shuffled.order = "shuffled";
  Random random(seed);
  for (uint64_t i = shuffled.rays.size(); i > 1; --i)
    std::swap(shuffled.rays[i - 1], shuffled.rays[random.Below(i)]);
  Freeze(shuffled, bounds);
  return shuffled;
}

// Two independent uniform points on a sphere span a chord with the measure of uniformly random lines through
// it (Solomon, Geometric Probability, 1978): isotropic direction, mean length 4/3 of the radius.
rb_ray RandomRay(const Bounds3& bounds, Random& random) {
  Vec3d center{0, 0, 0};
  double radius = 1;
  if (const Bounds3& b = bounds; !b.Empty()) {
    center = (ToDouble(b.lo) + ToDouble(b.hi)) * 0.5;
    radius = 0.5 * Length(ToDouble(b.hi) - ToDouble(b.lo));
  }
  Vec3d from = random.UnitVector(), chord;
  do chord = random.UnitVector() - from;
  while (Dot(chord, chord) < 1e-12);
  const Vec3f org = ToFloat(center + from * radius), dir = ToFloat(Normalize(chord));
  return {{org.x, org.y, org.z}, 0, {dir.x, dir.y, dir.z}, std::numeric_limits<float>::infinity()};
}

RaySet RandomRays(const Scene& scene, uint64_t count, uint64_t seed) {
  RaySet set{.kind = "random", .order = "traced", .query = RB_CLOSEST, .rays = {}, .hash = {}};
  set.rays.resize(count);
  ParallelFor(uint64_t{0}, count, [&](uint64_t i) {
    Random random(seed, i);
    set.rays[i] = RandomRay(scene.bounds(), random);
  });
  Freeze(set, scene.bounds());
  return set;
}

}  // namespace raybench
