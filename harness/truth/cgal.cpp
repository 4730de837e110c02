// The exact oracle: CGAL's AABB tree finds every triangle that a ray meets, exact.h orders them.
//
// CGAL (EPICK: doubles with exact predicates) lists candidates by all_intersected_primitives. It is not asked
// which is nearest: first_intersection compares constructed, inexact points and breaks ties in the order of
// traversal. For each candidate t is a ratio of polynomials in the input floats; doubles with an error bound
// decide the interval and the order where they can, expansions elsewhere. What CGAL calls an intersection is
// confirmed by predicates that share no code with it; a disagreement stops the run.
//
// Ray_3(p, v) stores p and p + v, and in doubles that sum may be rounded. v may be scaled by any power of two
// without changing the ray, and usually some power makes all three sums exact. Where none does, a second tree
// over EPECK, whose sums are always exact, answers. Its lazy numbers are shared between threads and update
// themselves when read, so it is built on first use and asked under a lock.
#include <CGAL/AABB_tree.h>
#include <CGAL/Exact_predicates_exact_constructions_kernel.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/version.h>
#if CGAL_VERSION_NR >= 1060000000
#include <CGAL/AABB_traits_3.h>
#else
#include <CGAL/AABB_traits.h>
#endif

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <mutex>
#include <stdexcept>

#include "accel/base/float_state.h"
#include "accel/base/random.h"
#include "accel/ray/exact.h"
#include "datasets/scene/orientation.h"
#include "harness/truth/audit.h"
#include "harness/truth/verdict.h"

namespace raybench {
namespace {

using exact::Meeting;

/// Powers k for which p + 2^k v is exact in double, as one interval; empty if lo > hi. Per component, all
/// bits of p and of 2^k v must lie within 53 places, one of them kept for a carry.
struct Powers {
  int lo = -1000, hi = 1000;

  Powers(const float* p, const float* v) {
    for (int i = 0; i < 3; ++i) {
      if (p[i] == 0 || v[i] == 0) continue;
      lo = std::max(lo, High(p[i]) - 51 - Low(v[i]));
      hi = std::min(hi, Low(p[i]) + 51 - High(v[i]));
    }
  }

 private:
  static int High(double x) { return std::ilogb(x); }
  /// Exponent of the lowest bit set.
  static int Low(double x) {
    int exponent;
    const auto mantissa = uint64_t(std::ldexp(std::fabs(std::frexp(x, &exponent)), 53));
    return exponent - 53 + __builtin_ctzll(mantissa);
  }
};

/// Fat line for near misses: boxes are widened by more than the float tests' bound (see verdict.cpp), which
/// is 4u(|A.x| + |A.z|) <= 2^-21 times the largest component of A, a vertex relative to the origin.
struct FatLine {
  Vec3d org, dir;

  bool Meets(const CGAL::Bbox_3& box) const {
    double reach = 0;
    for (int k = 0; k < 3; ++k)
      reach = std::max({reach, std::fabs(box.min(k) - org[k]), std::fabs(box.max(k) - org[k])});
    const double pad = 0x1p-19 * reach + 0x1p-140;
    double lo = -std::numeric_limits<double>::infinity(), hi = -lo;
    for (int k = 0; k < 3; ++k) {
      const double a = box.min(k) - org[k] - pad, b = box.max(k) - org[k] + pad;
      if (dir[k] == 0) {
        if (a > 0 || b < 0) return false;
        continue;
      }
      lo = std::max(lo, std::min(a / dir[k], b / dir[k]));
      hi = std::min(hi, std::max(a / dir[k], b / dir[k]));
    }
    return lo <= hi;
  }
};

template <class Kernel>
class TriangleTree {
  using Point = typename Kernel::Point_3;
  using Triangle = typename Kernel::Triangle_3;

  struct Primitive {
    using Id = const Triangle*;
    using Point = typename Kernel::Point_3;
    using Datum = Triangle;

    Id triangle = nullptr;

    Primitive() = default;
    template <class Iterator>
    explicit Primitive(Iterator it) : triangle(&*it) {}
    Id id() const { return triangle; }
    const Datum& datum() const { return *triangle; }
    Point reference_point() const { return triangle->vertex(0); }
  };
#if CGAL_VERSION_NR >= 1060000000
  using Traits = CGAL::AABB_traits_3<Kernel, Primitive>;
#else
  using Traits = CGAL::AABB_traits<Kernel, Primitive>;
#endif
  using Tree = CGAL::AABB_tree<Traits>;

 public:
  explicit TriangleTree(const Scene& scene) {
    const auto point = [&](uint32_t vertex) {
      const Vec3f p = scene.positions[vertex];
      return Point(double(p.x), double(p.y), double(p.z));
    };
    triangles_.reserve(scene.triangles.size());
    ids_.reserve(scene.triangles.size());
    for (uint32_t i = 0; i < scene.triangles.size(); ++i) {
      const auto& v = scene.triangles[i];
      if (IsDegenerate(scene.positions[v[0]], scene.positions[v[1]], scene.positions[v[2]])) continue;
      triangles_.emplace_back(point(v[0]), point(v[1]), point(v[2]));
      ids_.push_back(i);
    }
    tree_.do_not_accelerate_distance_queries();
    tree_.insert(triangles_.begin(), triangles_.end());
    tree_.build();
  }

  /// Appends the triangles that the closed segment, or ray, from o along `length` v meets.
  void Candidates(const rb_ray& ray, double length, bool segment, std::vector<uint32_t>& prims) const {
    if (triangles_.empty()) return;
    const Point p(double(ray.org[0]), double(ray.org[1]), double(ray.org[2]));
    const typename Kernel::Vector_3 v(ray.dir[0] * length, ray.dir[1] * length, ray.dir[2] * length);
    std::vector<const Triangle*> found;
    if (segment) {
      tree_.all_intersected_primitives(typename Kernel::Segment_3(p, p + v), std::back_inserter(found));
    } else {
      tree_.all_intersected_primitives(typename Kernel::Ray_3(p, v), std::back_inserter(found));
    }
    for (const Triangle* triangle : found) prims.push_back(ids_[size_t(triangle - triangles_.data())]);
  }

  bool AnyNear(const FatLine& line, const std::function<bool(uint32_t)>& accept) const {
    struct Visit {
      const TriangleTree& self;
      const std::function<bool(uint32_t)>& accept;
      bool found = false;

      bool go_further() const { return !found; }
      void intersection(const FatLine&, const Primitive& p) {
        found = found || accept(self.ids_[size_t(p.id() - self.triangles_.data())]);
      }
      bool do_intersect(const FatLine& query, const CGAL::AABB_node<Traits>& node) const {
        return query.Meets(node.bbox());
      }
    } visit{*this, accept};
    tree_.traversal(line, visit);
    return visit.found;
  }

 private:
  std::vector<Triangle> triangles_;
  std::vector<uint32_t> ids_;
  Tree tree_;
};

class CgalOracle final : public JudgingOracle {
 public:
  explicit CgalOracle(const Scene& scene)
      : JudgingOracle(scene, uint32_t(scene.triangles.size())), tree_(scene) {}

  std::string Name() const override {
    return "cgal " CGAL_VERSION_STR " (epick, exact order)" +
           std::string(scene_.procedural_count() > 0 ? "; procedural primitives in integers" : "");
  }
  uint64_t Audit(std::span<const rb_ray> rays, std::span<const Truth> truth, uint64_t seed,
                 uint64_t count) const override {
    if (truth.size() != rays.size()) throw InputError("audit: rays and truth differ in number");
    const FloatState ieee;
    count = scene_.triangles.empty() ? 0 : std::min<uint64_t>(count, rays.size());
    Random random(seed);
    uint64_t wanted = count;
    for (size_t i = 0; wanted > 0; ++i) {
      // Each subset is equally likely (Knuth, TAOCP 3.4.2, algorithm S).
      if (random.Below(rays.size() - i) >= wanted) continue;
      --wanted;
      std::vector<uint32_t> near;
      AnyTriangleNear(rays[i], [&](uint32_t prim) {
        near.push_back(prim);
        return false;
      });
      const std::string difference =
          AuditTruth(scene_, rays[i], scene_.procedural_count() > 0 ? AskTriangles(rays[i]) : truth[i], near);
      if (difference.empty()) continue;
      const rb_ray& r = rays[i];
      throw std::logic_error(
          fmt::format("oracle and audit disagree on ray {} of {}: {}; org {:a} {:a} {:a} dir {:a} {:a} {:a} "
                      "tnear {:a} tfar {:a}",
                      i, rays.size(), difference, r.org[0], r.org[1], r.org[2], r.dir[0], r.dir[1], r.dir[2],
                      r.tnear, r.tfar));
    }
    return count;
  }

 protected:
  std::vector<TrueHit> TriangleHits(const rb_ray& ray) const override {
    bool coplanar;
    std::vector<TrueHit> hits;
    for (const Crossing& c : Crossings(ray, coplanar)) {
      const double t = std::isfinite(c.error) ? c.t : Ratio(ray, c.prim).Value();
      hits.push_back({c.prim, t});
    }
    return hits;
  }
  bool AnyTriangleNear(const rb_ray& ray, const std::function<bool(uint32_t)>& accept) const override {
    return tree_.AnyNear({ToDouble(LoadVec3(ray.org)), ToDouble(LoadVec3(ray.dir))}, accept);
  }

 private:
  using EpickTree = TriangleTree<CGAL::Exact_predicates_inexact_constructions_kernel>;
  using EpeckTree = TriangleTree<CGAL::Exact_predicates_exact_constructions_kernel>;

  struct Crossing {
    uint32_t prim;
    Meeting meeting;
    double t, error;
  };

  exact::Corners Corners(uint32_t prim) const {
    const auto& v = scene_.triangles[prim];
    return {ToDouble(scene_.positions[v[0]]), ToDouble(scene_.positions[v[1]]),
            ToDouble(scene_.positions[v[2]])};
  }
  exact::Ratio Ratio(const rb_ray& ray, uint32_t prim) const {
    return exact::PlaneRatio(exact::Line(ray), Corners(prim));
  }

  /// The t that an exact answer has.
  float RoundedT(const rb_ray& ray, const Crossing& c) const {
    const float lo = float(c.t - c.error), hi = float(c.t + c.error);
    return AnswerableT(lo == hi ? lo : exact::RoundToFloat(Ratio(ray, c.prim)), ray);
  }

  /// Every triangle whose t may lie in the interval, at least.
  std::vector<uint32_t> Candidates(const rb_ray& ray) const {
    std::vector<uint32_t> prims;
    const Powers powers(ray.org, ray.dir);
    if (powers.lo > powers.hi) {
      const std::lock_guard lock(epeck_mutex_);
      if (!epeck_) epeck_ = std::make_unique<EpeckTree>(scene_);
      epeck_->Candidates(ray, 1, false, prims);
      return prims;
    }
    // A segment that ends beyond tfar, else the whole ray. The sum's magnitude stays within a float's.
    if (ray.tfar < 0x1p100f) {
      const int power = std::max(powers.lo, ray.tfar <= 0x1p-100f ? -100 : std::ilogb(ray.tfar) + 1);
      if (power <= powers.hi) {
        tree_.Candidates(ray, std::ldexp(1.0, power), true, prims);
        return prims;
      }
    }
    tree_.Candidates(ray, std::ldexp(1.0, std::clamp(0, powers.lo, powers.hi)), false, prims);
    return prims;
  }

  std::vector<Crossing> Crossings(const rb_ray& ray, bool& coplanar) const {
    std::vector<Crossing> crossings;
    coplanar = false;
    const float tfar = LastT(ray);
    if (!(ray.tnear < tfar)) return crossings;
    const exact::Line line(ray);
    for (const uint32_t prim : Candidates(ray)) {
      const exact::Corners p = Corners(prim);
      const Meeting meeting = exact::Meet(line, p);
      if (meeting == Meeting::kNone)
        throw std::logic_error("oracle: CGAL meets triangle " + std::to_string(prim) +
                               " where the exact signs do not");
      if (meeting == Meeting::kInPlane) {
        coplanar = coplanar || exact::MeetsInPlane(line, p, ray.tnear, tfar);
        continue;
      }
      const auto [t, error] = exact::PlaneApproximate(line, p);
      bool inside = t - error > ray.tnear && t + error <= tfar;
      if (!inside && t + error > ray.tnear && t - error <= tfar) {
        const exact::Ratio ratio = exact::PlaneRatio(line, p);
        inside = exact::Compare(ratio, ray.tnear) > 0 && exact::Compare(ratio, tfar) <= 0;
      }
      if (inside) crossings.push_back({prim, meeting, t, error});
    }
    return crossings;
  }

  Truth AskTriangles(const rb_ray& ray) const override {
    Truth truth;
    std::vector<Crossing> crossings = Crossings(ray, truth.coplanar);
    if (crossings.empty()) return truth;
    // Keeps all that may round to the same float as the nearest.
    float latest = std::numeric_limits<float>::infinity();
    for (const Crossing& c : crossings) latest = std::min(latest, AnswerableT(float(c.t + c.error), ray));
    std::erase_if(crossings, [&](const Crossing& c) { return float(c.t - c.error) > latest; });
    std::sort(crossings.begin(), crossings.end(),
              [](const Crossing& a, const Crossing& b) { return a.prim < b.prim; });

    exact::Ratio best = Ratio(ray, crossings[0].prim);
    truth.hit = true;
    truth.tied = {crossings[0].prim};
    Meeting meeting = crossings[0].meeting;
    for (size_t i = 1; i < crossings.size(); ++i) {
      const uint32_t prim = crossings[i].prim;
      int order = 0;
      // Copies of one triangle have one t.
      if (adjacency_.Representative(prim) != adjacency_.Representative(truth.tied.back())) {
        const exact::Ratio ratio = Ratio(ray, prim);
        order = exact::Compare(ratio, best);
        if (order < 0) {
          best = ratio;
          truth.tied.clear();
          meeting = crossings[i].meeting;
        }
      }
      if (order <= 0) truth.tied.push_back(prim);
    }
    truth.t = best.Value();
    truth.t_rounded = AnswerableT(exact::RoundToFloat(best), ray);
    for (size_t i = 0; truth.first == RAYBENCH_NONE; ++i) {
      if (crossings[i].prim == truth.tied.front() || RoundedT(ray, crossings[i]) == truth.t_rounded)
        truth.first = crossings[i].prim;
    }
    truth.feature = meeting == Meeting::kInterior ? Feature::kInterior
                    : meeting == Meeting::kEdge   ? Feature::kEdge
                                                  : Feature::kVertex;
    return truth;
  }

  const EpickTree tree_;
  mutable std::mutex epeck_mutex_;
  mutable std::unique_ptr<EpeckTree> epeck_;
};

}  // namespace

std::unique_ptr<Oracle> MakeCgalOracle(const Scene& scene) { return std::make_unique<CgalOracle>(scene); }

}  // namespace raybench
