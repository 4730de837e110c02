// Truth by brute force: every ray against every primitive, triangles and spheres in double, cones and
// polygons in long double. It is independent of the code under test (no callback of the scene, no shared
// test), and slow. Its arithmetic errs by 2^-29 of what float tests err, so its truth differs from the exact
// one only where the verdict would call an answer marginal or a neighbour.
#include <algorithm>
#include <cmath>

#include "accel/exact.h"
#include "harness/verdict.h"

namespace raybench {
namespace {

/// Hits whose t differ by less than this, relatively, count as tied.
constexpr double kTie = 1e-12;
/// An edge function below this share of its terms counts as zero.
constexpr double kZero = 16 * exact::kEps;

using Vec3l = Vec3<long double>;
Vec3l ToLong(Vec3f v) { return {v.x, v.y, v.z}; }

/// A ball around a cone or polygon, so that most rays are done with at once.
struct Ball {
  Vec3d center;
  double radius;

  bool MayMeet(Vec3d o, Vec3d d) const {
    const Vec3d f = o - center;
    const Vec3d foot = f - d * (Dot(f, d) / Dot(d, d));
    return Dot(foot, foot) <= radius * radius * (1 + 1e-6) + 1e-12 * Dot(f, f);
  }
};

/// A cone as the set of p with |p - base|^2 = (s |axis|)^2 + r(s)^2, s the share of the way to the apex.
struct TrueCone {
  Ball ball;
  Vec3l base, axis;
  long double square, r, widening;
  bool inside_only;

  explicit TrueCone(const Cone& c)
      : base(ToLong(c.base)),
        axis(ToLong(c.apex) - base),
        square(Dot(axis, axis)),
        r(std::fabs(c.base_radius)),
        widening(std::fabs(c.apex_radius) - r),
        inside_only(c.base_radius < 0 || c.apex_radius < 0) {
    const double reach = double(std::max(r, r + widening));
    ball = {(ToDouble(c.base) + ToDouble(c.apex)) * 0.5, double(std::sqrt(square)) / 2 + reach};
  }

  /// Calls take(t) for each root between the rims.
  template <class Take>
  void Meet(Vec3d org, Vec3d dir, const Take& take) const {
    if (!ball.MayMeet(org, dir)) return;
    const auto wide = [](Vec3d v) { return Vec3l{v.x, v.y, v.z}; };
    const Vec3l d = wide(dir), center = wide(ball.center);
    // Start where the ray passes the middle, at t = start.
    const long double start = Dot(center - wide(org), d) / Dot(d, d);
    const Vec3l f = wide(org) + d * start - base;
    const long double s = Dot(f, axis) / square, ds = Dot(d, axis) / square;
    const long double radius = r + widening * s, change = widening * ds;
    const long double a = Dot(d, d) - ds * ds * square - change * change;
    const long double b = Dot(f, d) - s * ds * square - radius * change;
    const long double c = Dot(f, f) - s * s * square - radius * radius;
    const auto at = [&](long double t) {
      const long double share = s + t * ds;
      if (share >= 0 && share <= 1 && (!inside_only || a * t + b >= 0)) take(double(start + t));
    };
    if (std::fabs(a) <= 1e-18L * Dot(d, d)) {
      if (b != 0) at(-c / (2 * b));
      return;
    }
    const long double discriminant = b * b - a * c;
    if (discriminant < 0) return;
    const long double root = std::sqrt(discriminant);
    // Whichever form does not cancel, of each root.
    at(b > 0 ? (-b - root) / a : c / (-b + root));
    at(b > 0 ? c / (-b - root) : (-b + root) / a);
  }
};

/// A polygon as the area that its corners' outline encloses an odd number of times, seen along the ray, in
/// the plane through the corners' mean with Newell's normal, but nowhere outside the box of its corners.
struct TruePolygon {
  Ball ball;
  std::vector<Vec3l> corners;
  Vec3l center{0, 0, 0}, normal{0, 0, 0}, lo, hi;

  TruePolygon(const Scene& scene, const Polygon& polygon) {
    for (uint32_t v : scene.CornersOf(polygon)) corners.push_back(ToLong(scene.positions[v]));
    lo = hi = corners[0];
    for (const Vec3l& p : corners) center = center + p, lo = Min(lo, p), hi = Max(hi, p);
    center = center * (1.0L / (long double)(corners.size()));
    // Newell's sums of trapezoids under each edge, on the three coordinate planes.
    for (size_t i = 0; i < corners.size(); ++i) {
      const Vec3l a = corners[i] - center, b = corners[(i + 1) % corners.size()] - center;
      normal.x += (a.y - b.y) * (a.z + b.z);
      normal.y += (a.z - b.z) * (a.x + b.x);
      normal.z += (a.x - b.x) * (a.y + b.y);
    }
    ball = {{double(center.x), double(center.y), double(center.z)}, 0};
    for (const Vec3l& p : corners) ball.radius = std::max(ball.radius, double(Length(p - center)));
  }

  /// Calls take(t, on the outline); `in_plane` is set for a ray that lies in the plane and meets the ball.
  template <class Take>
  void Meet(Vec3d org, Vec3d dir, bool& in_plane, const Take& take) const {
    if (!ball.MayMeet(org, dir)) return;
    const Vec3l o{org.x, org.y, org.z}, d{dir.x, dir.y, dir.z};
    const long double toward = Dot(normal, d), away = Dot(normal, center - o);
    const long double size = Length(normal) * Length(d);
    if (std::fabs(toward) <= 1e-9L * size && std::fabs(away) <= 1e-9L * Length(normal) * Length(center - o)) {
      in_plane = true;
      return;
    }
    // Two directions across the ray span a picture of the outline; its crossings of the v axis are counted.
    const Vec3l aside = std::fabs(d.x) < std::fabs(d.y)
                            ? (std::fabs(d.x) < std::fabs(d.z) ? Vec3l{1, 0, 0} : Vec3l{0, 0, 1})
                            : (std::fabs(d.y) < std::fabs(d.z) ? Vec3l{0, 1, 0} : Vec3l{0, 0, 1});
    const Vec3l u_axis = Cross(d, aside), v_axis = Cross(d, u_axis);
    bool inside = false, on_outline = false;
    for (size_t i = 0; i < corners.size(); ++i) {
      const Vec3l a = corners[i] - o, b = corners[(i + 1) % corners.size()] - o;
      const long double au = Dot(a, u_axis), av = Dot(a, v_axis), bu = Dot(b, u_axis), bv = Dot(b, v_axis);
      const long double cross = au * bv - av * bu, terms = std::fabs(au * bv) + std::fabs(av * bu);
      if (std::fabs(cross) <= (long double)(kZero)*terms && au * bu + av * bv <= 0) on_outline = true;
      if ((au >= 0) == (bu >= 0)) continue;
      // v > 0 where the edge meets u = 0.
      if ((cross > 0) == (au >= 0)) inside = !inside;
    }
    if (!inside && !on_outline) return;
    long double near = -std::numeric_limits<long double>::infinity(), far = -near;
    for (int k = 0; k < 3; ++k) {
      if (d[k] == 0) continue;
      const long double t0 = (lo[k] - o[k]) / d[k], t1 = (hi[k] - o[k]) / d[k];
      near = std::max(near, std::min(t0, t1)), far = std::min(far, std::max(t0, t1));
    }
    long double t = away / toward;
    if (near <= far && !(t >= near && t <= far)) t = t > far ? far : near;
    if (std::isfinite(t)) take(double(t), on_outline);
  }
};

struct Found {
  TrueHit hit;
  Feature feature;
};

class DoubleOracle final : public JudgingOracle {
 public:
  explicit DoubleOracle(const Scene& scene) : JudgingOracle(scene) {
    cones_.reserve(scene.cones.size());
    for (const Cone& cone : scene.cones) cones_.emplace_back(cone);
    polygons_.reserve(scene.polygons.size());
    for (const Polygon& polygon : scene.polygons) polygons_.emplace_back(scene, polygon);
  }

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
    const float tfar = LastT(ray);
    if (!(ray.tnear < tfar)) return found;
    const Vec3d o = ToDouble(LoadVec3(ray.org)), d = ToDouble(LoadVec3(ray.dir));
    const auto take = [&](uint32_t prim, double t, Feature feature) {
      if (t > ray.tnear && t <= tfar) found.push_back({{prim, t}, feature});
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
                    exact::MeetsInPlane(line, corners, ray.tnear, tfar);
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
      const double r = std::fabs(scene_.spheres[i].radius), square = Dot(d, d), middle = -Dot(f, d) / square;
      const Vec3d foot = f + middle * d;
      const double chord = r * r - Dot(foot, foot);
      if (chord < 0) continue;
      const double half = std::sqrt(chord / square);
      const uint32_t prim = uint32_t(scene_.triangles.size() + i);
      if (scene_.spheres[i].radius > 0) take(prim, middle - half, Feature::kInterior);
      take(prim, middle + half, Feature::kInterior);
    }
    uint32_t prim = uint32_t(scene_.triangles.size() + scene_.spheres.size());
    for (const TrueCone& cone : cones_) {
      cone.Meet(o, d, [&](double t) { take(prim, t, Feature::kInterior); });
      ++prim;
    }
    for (const TruePolygon& polygon : polygons_) {
      polygon.Meet(o, d, coplanar, [&](double t, bool on_outline) {
        take(prim, t, on_outline ? Feature::kEdge : Feature::kInterior);
      });
      ++prim;
    }
    return found;
  }

  std::vector<TrueCone> cones_;
  std::vector<TruePolygon> polygons_;
};

}  // namespace

std::unique_ptr<Oracle> MakeDoubleOracle(const Scene& scene) { return std::make_unique<DoubleOracle>(scene); }

}  // namespace raybench
