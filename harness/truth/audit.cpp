// The oracle orders ratios of polynomials, held as expansions (accel/ray/exact.h). Here the point where line
// and triangle meet is constructed by CGAL in rational numbers, and everything is read off that point.
#include "harness/truth/audit.h"

#include <CGAL/Bbox_3.h>
#include <CGAL/Exact_predicates_exact_constructions_kernel.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/intersections.h>
#include <CGAL/version.h>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <bit>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <utility>
#include <vector>

namespace raybench {
namespace {

using Epick = CGAL::Exact_predicates_inexact_constructions_kernel;
using Kernel = CGAL::Exact_predicates_exact_constructions_kernel;
using Number = Kernel::FT;
using Point = Kernel::Point_3;

template <class T, class Variant>
const T* GetIf(const Variant& variant) {
#if CGAL_VERSION_NR >= 1060000000
  return std::get_if<T>(&variant);
#else
  return boost::get<T>(&variant);
#endif
}

/// Where a line meets a triangle: from t to last, which differ only for a line in the triangle's plane.
struct Meeting {
  Number t, last;
  bool in_plane;
  Feature feature;
};

class ExactLine {
 public:
  explicit ExactLine(const rb_ray& ray)
      : org_(ray.org[0], ray.org[1], ray.org[2]),
        dir_(ray.dir[0], ray.dir[1], ray.dir[2]),
        line_(org_, dir_) {
    while (ray.dir[axis_] == 0) ++axis_;
  }

  std::optional<Meeting> Meet(const Point& a, const Point& b, const Point& c) const {
    const auto meeting = CGAL::intersection(line_, Kernel::Triangle_3(a, b, c));
    if (!meeting) return std::nullopt;
    const bool in_plane = CGAL::cross_product(b - a, c - a) * dir_ == 0;
    if (const Point* p = GetIf<Point>(*meeting)) {
      const Number t = At(*p);
      const bool vertex = *p == a || *p == b || *p == c;
      const bool edge = CGAL::collinear(a, b, *p) || CGAL::collinear(b, c, *p) || CGAL::collinear(c, a, *p);
      return Meeting{t, t, in_plane, vertex ? Feature::kVertex : edge ? Feature::kEdge : Feature::kInterior};
    }
    const auto* segment = GetIf<Kernel::Segment_3>(*meeting);
    const Number s = At(segment->source()), t = At(segment->target());
    return Meeting{s < t ? s : t, s < t ? t : s, in_plane, Feature::kInterior};
  }

 private:
  Number At(const Point& p) const { return (p[axis_] - org_[axis_]) / dir_[axis_]; }

  Point org_;
  Kernel::Vector_3 dir_;
  Kernel::Line_3 line_;
  int axis_ = 0;
};

/// True if f is t rounded to nearest, ties to even.
bool RoundsTo(const Number& t, float f) {
  constexpr double beyond = 0x1p128;  // the float that would follow the largest
  const auto value = [](float x) { return std::isinf(x) ? std::copysign(beyond, x) : double(x); };
  const bool even = (std::bit_cast<uint32_t>(f) & 1) == 0;
  const float below = std::nextafterf(f, -std::numeric_limits<float>::infinity()),
              above = std::nextafterf(f, std::numeric_limits<float>::infinity());
  const Number lo(0.5 * (value(below) + value(f))), hi(0.5 * (value(f) + value(above)));
  return (even ? t >= lo : t > lo) && (std::isinf(f) || (even ? t <= hi : t < hi));
}

/// True if f is what an answer has to say of t.
bool IsAnswer(const Number& t, float f, const rb_ray& ray) {
  const float least = std::nextafterf(ray.tnear, std::numeric_limits<float>::infinity());
  return f != ray.tnear && (RoundsTo(t, f) || (f == least && RoundsTo(t, ray.tnear)));
}

struct Hit {
  uint32_t prim;
  const Meeting* meeting;
};

}  // namespace

std::string AuditTruth(const Scene& scene, const rb_ray& ray, const Truth& truth,
                       std::span<const uint32_t> near) {
  std::vector<Hit> hits;
  bool coplanar = false;
  // Copies of a triangle are looked at once.
  std::map<std::array<float, 9>, std::optional<Meeting>> known;
  if (ray.tnear < LastT(ray)) {
    const ExactLine line(ray);
    const Number tnear(ray.tnear), tfar(LastT(ray));
    // Seen from afar, a line is near all triangles; constructing every point would take a minute.
    const Epick::Line_3 cheap_line(Epick::Point_3(ray.org[0], ray.org[1], ray.org[2]),
                                   Epick::Vector_3(ray.dir[0], ray.dir[1], ray.dir[2]));
    for (const uint32_t prim : near) {
      std::array<float, 9> key;
      std::optional<Point> corners[3];
      CGAL::Bbox_3 box;
      for (size_t k = 0; k < 3; ++k) {
        const Vec3f p = scene.positions[scene.triangles[prim][k]];
        key[3 * k] = p.x;
        key[3 * k + 1] = p.y;
        key[3 * k + 2] = p.z;
        box += CGAL::Bbox_3(p.x, p.y, p.z, p.x, p.y, p.z);
      }
      if (!CGAL::do_intersect(cheap_line, box)) continue;
      for (size_t k = 0; k < 3; ++k) corners[k].emplace(key[3 * k], key[3 * k + 1], key[3 * k + 2]);
      const auto [at, fresh] = known.try_emplace(key);
      if (fresh) at->second = line.Meet(*corners[0], *corners[1], *corners[2]);
      if (!at->second) continue;
      const Meeting& meeting = *at->second;
      const bool inside = meeting.last > tnear && meeting.t <= tfar;
      if (meeting.in_plane) {
        coplanar = coplanar || inside;
      } else if (inside) {
        hits.push_back({prim, &meeting});
      }
    }
  }
  std::sort(hits.begin(), hits.end(), [](const Hit& a, const Hit& b) { return a.prim < b.prim; });

  if (truth.coplanar != coplanar) return fmt::format("coplanar {}, audit {}", truth.coplanar, coplanar);
  if (truth.hit != !hits.empty()) return fmt::format("hit {}, audit {}", truth.hit, !hits.empty());
  if (hits.empty()) return truth.tied.empty() ? "" : "primitives tied at a miss";
  const Hit* nearest = &hits[0];
  for (const Hit& hit : hits)
    if (hit.meeting->t < nearest->meeting->t) nearest = &hit;
  const Number& t = nearest->meeting->t;
  std::vector<uint32_t> tied;
  for (const Hit& hit : hits)
    if (hit.meeting->t == t) tied.push_back(hit.prim);
  if (truth.tied != tied) return fmt::format("tied {}, audit {}", truth.tied, tied);
  if (truth.feature != nearest->meeting->feature)
    return fmt::format("feature {}, audit {}", int(truth.feature), int(nearest->meeting->feature));
  // The double is the nearest, or next to it where t lies in the middle of two.
  const double infinity = std::numeric_limits<double>::infinity();
  if (!(t > Number(std::nextafter(truth.t, -infinity)) && t < Number(std::nextafter(truth.t, infinity))))
    return fmt::format("t {:a}, audit {:a}", truth.t, CGAL::to_double(t));
  if (!IsAnswer(t, truth.t_rounded, ray))
    return fmt::format("t as float {:a}, audit {:a}", truth.t_rounded, CGAL::to_double(t));
  const auto first = std::find_if(hits.begin(), hits.end(), [&](const Hit& hit) {
    return IsAnswer(hit.meeting->t, truth.t_rounded, ray);
  });
  if (truth.first != first->prim) return fmt::format("first {}, audit {}", truth.first, first->prim);
  return {};
}

}  // namespace raybench
