#include "harness/offset/departures.h"

#include <fmt/format.h>

#include <algorithm>

#include "accel/base/parallel.h"
#include "accel/base/random.h"
#include "harness/judge/ask.h"
#include "harness/plan/build_options.h"
#include "harness/terminal/interrupt.h"
#include "tracer/camera_rays.h"
#include "tracer/self_intersection.h"

namespace raybench {
namespace {

constexpr uint64_t kPaths = 1024;  // of a block
constexpr int kDepth = 6;
/// Blocks of a round, whatever the number of threads; after so many rounds without a hit there is no surface.
constexpr uint64_t kRound = 16, kIdleRounds = 4;
constexpr uint32_t kPicture = 4096;

rb_hit HitOf(const Departing& d) { return {0, d.u, d.v, d.prim}; }

class Paths {
 public:
  Paths(const Registry& registry, const Scene& scene, const LeavingTruth& truth,
        const DepartureOptions& options)
      : scene_(scene),
        truth_(truth),
        options_(options),
        camera_(scene, kPicture, kPicture),
        tree_(ParseContestant(registry, "bvh_wide"), scene.Geometry(),
              BuildOptions(options.threads, options.seed)) {
    const Vec3d lo = ToDouble(scene.bounds().lo), hi = ToDouble(scene.bounds().hi);
    center_ = (lo + hi) * 0.5;
    radius_ = Length(hi - lo) * 0.5;
  }

  std::vector<Departing> Block(uint64_t block) const {
    std::vector<Departing> made;
    std::vector<Random> random;
    std::vector<rb_ray> rays;
    for (uint64_t i = 0; i < kPaths; ++i) {
      random.emplace_back(options_.seed, block * kPaths + i);
      rays.push_back(EyeRay(i, random.back()));
    }
    Answers answers(kPaths);
    for (int depth = 0; depth < kDepth && !rays.empty(); ++depth) {
      Ask(tree_, {RB_CLOSEST, rays}, answers, 1);
      size_t left = 0;
      for (size_t i = 0; i < rays.size(); ++i) {
        const rb_hit& hit = answers.hits[i];
        if (hit.prim == RAYBENCH_NONE) continue;
        const Departing departing = Turn(rays[i], hit, random[i]);
        made.push_back(departing);
        rays[left] = Depart(scene_, departing, SelfIntersection::kErrorBound, 0).ray;
        random[left++] = random[i];
      }
      rays.resize(left);
      random.resize(left, Random(0));
    }
    return made;
  }

 private:
  rb_ray EyeRay(uint64_t i, Random& random) const {
    const bool from_camera = i % 2 == 0;
    if (from_camera && !options_.aimed)
      return camera_.Through(random.NextDouble() * kPicture, random.NextDouble() * kPicture);
    const Vec3f eye =
        from_camera ? scene_.cameras.front().eye : ToFloat(center_ + random.UnitVector() * radius_);
    const Vec3d to = Target(random) - ToDouble(eye);
    return MakeRay(eye, 0, ToFloat(to * (1 / Length(to))), std::numeric_limits<float>::infinity());
  }

  Vec3d Target(Random& random) const {
    const Bounds3& box = scene_.bounds();
    if (!options_.aimed) {
      Vec3d at;
      for (int k = 0; k < 3; ++k) at[k] = box.lo[k] + random.NextDouble() * (double(box.hi[k]) - box.lo[k]);
      return at;
    }
    const auto& corners = scene_.triangles[random.Below(scene_.triangles.size())];
    const uint64_t k = random.Below(3);
    const Vec3d a = ToDouble(scene_.positions[corners[k]]),
                b = ToDouble(scene_.positions[corners[(k + 1) % 3]]);
    const uint64_t place = random.Below(4);  // one vertex, one middle, two anywhere on the edge
    return a + (b - a) * (place == 0 ? 0 : place == 1 ? 0.5 : random.NextDouble());
  }

  /// What leaves where `ray` has arrived.
  Departing Turn(const rb_ray& ray, const rb_hit& hit, Random& random) const {
    Departing departing{hit.prim, hit.u, hit.v, 1, {}};
    const Vec3d normal = SurfaceAt(scene_, ray, hit).normal;
    if (Dot(normal, ToDouble(LoadVec3(ray.dir))) > 0) departing.side = -1;
    const Material& material = scene_.materials[scene_.MaterialOf(hit.prim)];
    if (!IsBlack(material.transmit) && (random.NextBits() & 1) != 0) departing.side = -departing.side;
    do {
      const Vec3d dir = random.UnitVector();
      departing.dir = ToFloat(Dot(dir, normal) * departing.side < 0 ? -dir : dir);
    } while (!truth_.Leaves(departing.At(), departing.dir));
    return departing;
  }

  const Scene& scene_;
  const LeavingTruth& truth_;
  const DepartureOptions& options_;
  const CameraRays camera_;
  const Tree tree_;
  Vec3d center_{};
  double radius_ = 0;
};

}  // namespace

std::vector<Departing> MakeDepartures(const Registry& registry, const Scene& scene, const LeavingTruth& truth,
                                      const DepartureOptions& options) {
  const Paths paths(registry, scene, truth, options);
  Arena arena(options.threads);
  std::vector<Departing> all;
  for (uint64_t round = 0; all.size() < options.count; ++round) {
    ThrowIfInterrupted();
    if (round == kIdleRounds && all.empty())
      throw InputError(fmt::format("scene '{}': none of {} rays finds a surface", scene.name,
                                   kIdleRounds * kRound * kPaths));
    std::vector<Departing> blocks[kRound];
    arena.Run([&] {
      ParallelFor(uint64_t{0}, kRound, [&](uint64_t b) { blocks[b] = paths.Block(round * kRound + b); });
    });
    for (const auto& block : blocks) all.insert(all.end(), block.begin(), block.end());
    if (options.progress) options.progress(std::min(1.0, double(all.size()) / double(options.count)));
  }
  all.resize(options.count);
  // Rays of one place look at the same memory.
  std::stable_sort(all.begin(), all.end(),
                   [](const Departing& a, const Departing& b) { return a.prim < b.prim; });
  return all;
}

Departed Depart(const Scene& scene, const Departing& departing, SelfIntersection cure, double size) {
  const SurfacePoint surface = SurfaceAt(scene, {}, HitOf(departing));
  const Departure departure = Depart(surface, departing.side, cure, size, departing.prim, true);
  const Vec3d dir = ToDouble(departing.dir);
  const auto tnear = float(departure.distance / Length(dir));
  return {{{departure.org.x, departure.org.y, departure.org.z},
           tnear,
           {departing.dir.x, departing.dir.y, departing.dir.z},
           std::numeric_limits<float>::infinity()},
          departure.skip,
          ToDouble(departure.org) + dir * double(tnear)};
}

}  // namespace raybench
