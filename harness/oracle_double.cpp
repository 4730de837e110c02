// Truth by brute force in double: every ray against every triangle and sphere. It is independent of the code
// under test (no callback of the scene, no shared test), and slow. Double arithmetic errs by 2^-29 of what
// float tests err, so its truth differs from the exact one only where the verdict would call an answer
// marginal or a neighbour.
#include <algorithm>
#include <cmath>

#include "harness/exact.h"
#include "harness/verdict.h"

namespace raybench {
namespace {

/// Hits whose t differ by less than this, relatively, count as tied.
constexpr double kTie = 1e-12;
/// An edge function below this share of its terms counts as zero.
constexpr double kZero = 16 * exact::kEps;

struct Found {
  TrueHit hit;
  Feature feature;
};

class DoubleOracle final : public JudgingOracle {
 public:
  using JudgingOracle::JudgingOracle;

  std::vector<Truth> Ask(std::span<const rb_ray> rays, uint32_t threads) const override {
    std::vector<Truth> truth(rays.size());
    ParallelFor(rays.size(), threads, [&](size_t i) { truth[i] = AskOne(rays[i]); });
    return truth;
  }
  std::string Name() const override { return "brute force in double"; }
  bool Exact() const override { return false; }

 protected:
  std::vector<TrueHit> AllHits(const rb_ray& ray) const override {
    bool coplanar;
    std::vector<TrueHit> hits;
    for (const Found& found : Collect(ray, coplanar)) hits.push_back(found.hit);
    return hits;
  }
  bool AnyNear(const rb_ray&, const std::function<bool(uint32_t)>& accept) const override {
    for (uint64_t prim = 0; prim < scene_.primitive_count(); ++prim)
      if (accept(uint32_t(prim))) return true;
    return false;
  }

 private:
  Truth AskOne(const rb_ray& ray) const {
    Truth truth;
    const std::vector<Found> found = Collect(ray, truth.coplanar);
    if (found.empty()) return truth;
    const double nearest = std::min_element(found.begin(), found.end(), [](const Found& a, const Found& b) {
                             return a.hit.t < b.hit.t;
                           })->hit.t;
    truth.hit = true, truth.t = nearest;
    for (const Found& f : found) {
      if (f.hit.t > nearest + kTie * std::fabs(nearest)) continue;
      if (truth.tied.empty()) truth.feature = f.feature;
      if (truth.tied.empty() || truth.tied.back() != f.hit.prim) truth.tied.push_back(f.hit.prim);
    }
    return truth;
  }

  /// All hits of the interval, by ascending primitive.
  std::vector<Found> Collect(const rb_ray& ray, bool& coplanar) const {
    std::vector<Found> found;
    coplanar = false;
    if (!(ray.tnear < ray.tfar)) return found;
    const Vec3d o = ToDouble(LoadVec3(ray.org)), d = ToDouble(LoadVec3(ray.dir));
    const auto take = [&](uint32_t prim, double t, Feature feature) {
      if (t > ray.tnear && t <= ray.tfar) found.push_back({{prim, t}, feature});
    };
    for (uint32_t i = 0; i < scene_.triangles.size(); ++i) {
      Vec3d p[3];
      for (size_t k = 0; k < 3; ++k) p[k] = ToDouble(scene_.positions[scene_.triangles[i][k]]) - o;
      double edge[3];
      int positive = 0, negative = 0;
      for (int k = 0; k < 3; ++k) {
        const Vec3d a = p[(k + 1) % 3], b = p[(k + 2) % 3];
        edge[k] = Dot(d, Cross(a, b));
        double size = 0;
        for (int x = 0; x < 3; ++x) {
          const int y = (x + 1) % 3, z = (x + 2) % 3;
          size += std::fabs(d[x]) * (std::fabs(a[y] * b[z]) + std::fabs(a[z] * b[y]));
        }
        if (std::fabs(edge[k]) <= kZero * size) edge[k] = 0;
        positive += edge[k] > 0, negative += edge[k] < 0;
      }
      if (positive > 0 && negative > 0) continue;
      if (positive + negative == 0) {
        const exact::Line line(ray);
        const exact::Corners corners{p[0] + o, p[1] + o, p[2] + o};
        coplanar |= exact::Meet(line, corners) == exact::Meeting::kInPlane &&
                    exact::MeetsInPlane(line, corners, ray.tnear, ray.tfar);
        continue;
      }
      const Vec3d normal = Cross(p[1] - p[0], p[2] - p[0]);
      const int zeros = 3 - positive - negative;
      take(i, Dot(normal, p[0]) / Dot(normal, d),
           zeros == 0   ? Feature::kInterior
           : zeros == 1 ? Feature::kEdge
                        : Feature::kVertex);
    }
    for (size_t i = 0; i < scene_.spheres.size(); ++i) {
      // Roots about the foot of the perpendicular from the centre (Haines et al. 2019): no cancellation far
      // away.
      const Vec3d f = o - ToDouble(scene_.spheres[i].center);
      const double r = scene_.spheres[i].radius, square = Dot(d, d), middle = -Dot(f, d) / square;
      const Vec3d foot = f + middle * d;
      const double chord = r * r - Dot(foot, foot);
      if (chord < 0) continue;
      const double half = std::sqrt(chord / square);
      const uint32_t prim = uint32_t(scene_.triangles.size() + i);
      take(prim, middle - half, Feature::kInterior);
      take(prim, middle + half, Feature::kInterior);
    }
    return found;
  }
};

}  // namespace

std::unique_ptr<Oracle> MakeDoubleOracle(const Scene& scene) { return std::make_unique<DoubleOracle>(scene); }

}  // namespace raybench
