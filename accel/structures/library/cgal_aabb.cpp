// cgal_aabb: CGAL's AABB tree as its users have it, the geometry processing world's contestant.
//
// The idea: a binary tree of boxes, split at the median along the longest axis (Alliez, Tayeb, Wormser,
// "3D Fast Intersection and Distance Computation", CGAL manual), whose boxes and primitives are tested by the
// predicates of a kernel. What a kernel costs and brings is the point here, so it is the parameter:
//
//   epick             doubles with exact predicates: a hit is never missed by rounding, but hit points, and so
//                     the order of t, are rounded, and Ray_3 rounds the second point on the ray
//   cartesian_double  doubles and nothing else
//   cartesian_float   floats and nothing else
//
// (Exact constructions are left to the oracle: their numbers change when read, so threads cannot share them.)
//
// Closest hits at tnear 0 come from first_intersection, which goes through the tree by distance and returns
// one of those tied, in its own order. It knows no interval: a hit outside of it, a ray that begins elsewhere
// or resumes, and any-hit queries take all primitives met, one by one, through the tree's own traversal. A
// ray in the plane of a triangle meets a segment, which is no hit here.
//
// Layout: CGAL's, one primitive a leaf. It copies triangles in the kernel's numbers. The build is CGAL's, on
// one thread. Invariants: every box encloses what stands below it; queries change nothing.
#include <CGAL/AABB_tree.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Simple_cartesian.h>
#include <CGAL/version.h>
#if CGAL_VERSION_NR >= 1060000000
#include <CGAL/AABB_traits_3.h>
#else
#include <CGAL/AABB_traits.h>
#endif

#include <algorithm>
#include <cmath>
#include <variant>
#include <vector>

#include "accel/bvh/build_records.h"
#include "accel/contract/structure.h"

namespace raybench {
namespace {

/// Of the tree that this thread builds. CGAL's build cannot be stopped; what it asks of a primitive
/// can throw.
thread_local const volatile int* building_cancel = nullptr;

template <class K>
class KernelTree {
  using Point = typename K::Point_3;
  using Ray = typename K::Ray_3;
  using Triangle = typename K::Triangle_3;
  static constexpr bool kExactPredicates =
      std::is_same_v<K, CGAL::Exact_predicates_inexact_constructions_kernel>;

  struct Primitive {
    using Id = const Triangle*;
    using Point = typename K::Point_3;
    using Datum = Triangle;

    Id triangle = nullptr;

    Primitive() = default;
    template <class Iterator>
    explicit Primitive(Iterator it) : triangle(&*it) {}
    Id id() const { return triangle; }
    const Datum& datum() const { return *triangle; }
    Point reference_point() const {
      CheckCancel(building_cancel);
      return triangle->vertex(0);
    }
  };
#if CGAL_VERSION_NR >= 1060000000
  using Traits = CGAL::AABB_traits_3<K, Primitive>;
#else
  using Traits = CGAL::AABB_traits<K, Primitive>;
#endif
  using Node = CGAL::AABB_node<Traits>;
  using Number = typename K::FT;

 public:
  KernelTree(const rb_geometry& geometry, const rb_build_options& options) {
    const uint64_t n = geometry.triangle_count;
    if (options.memory_limit > 0 && BytesOf(n).nodes + BytesOf(n).prims > options.memory_limit)
      throw std::runtime_error("the tree needs more than the memory limit");
    building_cancel = options.cancel;
    triangles_.reserve(geometry.triangle_count);
    for (uint32_t i = 0; i < geometry.triangle_count; ++i) {
      CheckCancel(building_cancel);
      triangles_.emplace_back(ToPoint(Vertex(geometry, i, 0)), ToPoint(Vertex(geometry, i, 1)),
                              ToPoint(Vertex(geometry, i, 2)));
    }
    tree_.do_not_accelerate_distance_queries();
    tree_.insert(triangles_.begin(), triangles_.end());
    tree_.build();
    building_cancel = nullptr;
  }

  template <bool kAnyHit>
  void Trace(const RayQuery& q, rb_hit& best) const {
    // A ray is kept as two points, which must not fall together: a direction that is short beside the origin is
    // made longer.
    Vec3d d = ToDouble(LoadVec3(q.ray.dir));
    const double distance = MaxAbs(ToDouble(LoadVec3(q.ray.org))), length = MaxAbs(d);
    if (length < 0x1p-20 * distance) d = d * std::ldexp(1.0, std::ilogb(distance) - std::ilogb(length));
    const Ray ray(ToPoint(LoadVec3(q.ray.org)), typename K::Vector_3(Number(d.x), Number(d.y), Number(d.z)));
    // On a tree of one primitive first_intersection does not look at what shall be skipped.
    // Where predicates are not exact it may find another answer than the traversal that any-hit queries take.
    if (kExactPredicates && !kAnyHit && q.ray.tnear == 0 && q.after == RAYBENCH_NONE &&
        triangles_.size() > 1) {
      const auto first = tree_.first_intersection(ray, [&](const Triangle* t) { return IdOf(t) == q.skip; });
      if (!first) return;
      if (const Point* at = AsPoint(first->first)) {
        const float t = Along(q.ray, *at);
        if (t > q.ray.tfar) return;
        if (t > 0) return Take(q, *at, first->second, best);
      }
    }
    Everything<kAnyHit> traits{*this, q, best};
    tree_.traversal(ray, traits);
  }

  MemoryUse Memory() const { return BytesOf(triangles_.size()); }
  static MemoryUse BytesOf(uint64_t n) {
    return {(n > 0 ? n - 1 : 0) * sizeof(Node), n * (sizeof(Triangle) + sizeof(Primitive)), false};
  }

  template <class Fn>
  int Visit(const rb_geometry& geometry, Fn& node) const {
    const size_t n = triangles_.size();
    if (n == 0) return 0;
    return n == 1 ? ShowLeaf(geometry, &triangles_[0], 0, node)
                  : Show(geometry, *tree_.root_node(), n, 0, node);
  }

 private:
  /// CGAL's traversal traits: looks at every primitive that the ray meets, or until one blocks it.
  template <bool kAnyHit>
  struct Everything {
    const KernelTree& self;
    const RayQuery& q;
    rb_hit& best;

    bool go_further() const { return !kAnyHit || best.prim == RAYBENCH_NONE; }
    bool do_intersect(const Ray& ray, const Node& node) const {
      return self.tree_.traits().do_intersect_object()(ray, node.bbox());
    }
    void intersection(const Ray& ray, const Primitive& primitive) const {
      try {
        const auto met = K().intersect_3_object()(ray, primitive.datum());
        if (!met) return;
        if (const Point* at = AsPoint(*met)) self.Take(q, *at, primitive.id(), best);
      } catch (const CGAL::Failure_exception&) {
        // A triangle that float makes of no area is not hit; what the ray meets besides counts.
      }
    }
  };

  static double MaxAbs(Vec3d v) { return std::max({std::fabs(v.x), std::fabs(v.y), std::fabs(v.z)}); }
  static Point ToPoint(Vec3f p) { return Point(Number(p.x), Number(p.y), Number(p.z)); }
  template <class Met>
  static const Point* AsPoint(const Met& met) {
#if CGAL_VERSION_NR >= 1060000000
    return std::get_if<Point>(&met);
#else
    return boost::get<Point>(&met);
#endif
  }
  uint32_t IdOf(const Triangle* triangle) const { return uint32_t(triangle - triangles_.data()); }

  /// t of a point on the ray, along the ray's main axis.
  static float Along(const rb_ray& ray, const Point& at) {
    int axis = 0;
    for (int a = 1; a < 3; ++a)
      if (std::fabs(ray.dir[a]) > std::fabs(ray.dir[axis])) axis = a;
    return float((double(at[axis]) - ray.org[axis]) / ray.dir[axis]);
  }

  void Take(const RayQuery& q, const Point& at, const Triangle* triangle, rb_hit& best) const {
    const float t = Along(q.ray, at);
    const uint32_t prim = IdOf(triangle);
    if (!q.Accepts(t, prim, best)) return;
    const auto corner = [&](int i) {
      const Point& p = triangle->vertex(i);
      return Vec3d{double(p.x()), double(p.y()), double(p.z())};
    };
    const Vec3d e1 = corner(1) - corner(0), e2 = corner(2) - corner(0),
                to = Vec3d{double(at.x()), double(at.y()), double(at.z())} - corner(0),
                normal = Cross(e1, e2);
    const double square = Dot(normal, normal);
    best = {t, float(Dot(Cross(to, e2), normal) / square), float(Dot(Cross(e1, to), normal) / square), prim};
  }

  /// `n` primitives stand below `node`: with two both children are leaves, with three the left one is.
  template <class Fn>
  int Show(const rb_geometry& geometry, const Node& node, size_t n, uint32_t depth, Fn& fn) const {
    const CGAL::Bbox_3& box = node.bbox();
    const float bounds[6] = {float(box.xmin()), float(box.ymin()), float(box.zmin()),
                             float(box.xmax()), float(box.ymax()), float(box.zmax())};
    if (int stop = fn(rb_node{depth, 0, 0, RB_SHAPE_BOX, bounds, 6, 0, nullptr})) return stop;
    const int left = n <= 3 ? ShowLeaf(geometry, node.left_data().id(), depth + 1, fn)
                            : Show(geometry, node.left_child(), n / 2, depth + 1, fn);
    if (left != 0) return left;
    return n == 2 ? ShowLeaf(geometry, node.right_data().id(), depth + 1, fn)
                  : Show(geometry, node.right_child(), n - n / 2, depth + 1, fn);
  }
  template <class Fn>
  int ShowLeaf(const rb_geometry& geometry, const Triangle* triangle, uint32_t depth, Fn& fn) const {
    const uint32_t prim = IdOf(triangle);
    const Bounds3 box = PrimBounds(geometry, prim);
    const float bounds[6] = {box.lo.x, box.lo.y, box.lo.z, box.hi.x, box.hi.y, box.hi.z};
    return fn(rb_node{depth, 1, 0, RB_SHAPE_BOX, bounds, 6, 1, &prim});
  }

  std::vector<Triangle> triangles_;
  CGAL::AABB_tree<Traits> tree_;
};

class CgalAabb {
  template <class Fn>
  auto WithTree(Fn&& fn) const {
    return tree_.index() == 1   ? fn(std::get<1>(tree_))
           : tree_.index() == 2 ? fn(std::get<2>(tree_))
                                : fn(std::get<3>(tree_));
  }

 public:
  struct Config {
    uint32_t kernel;
  };
  static constexpr const char* kName = "cgal_aabb";
  static constexpr const char* kDoc = "CGAL's AABB tree, as its users have it";
  static constexpr const char* kSource =
      "Alliez, Tayeb, Wormser: 3D Fast Intersection and Distance, CGAL manual";
  static constexpr Kind kKind = {"library", "O(N log N)", "library"};
  static constexpr uint64_t kCapabilities = RB_CAN_AFTER | RB_CAN_SKIP | RB_DETERMINISTIC;
  static std::span<const rb_param> Params() {
    static const char* const kKernels[] = {"epick", "cartesian_double", "cartesian_float", nullptr};
    static const rb_param params[] = {ChoiceParam(
        "kernel",
        "numbers and predicates: epick (double, exact predicates), cartesian_double, cartesian_float",
        offsetof(Config, kernel), kKernels, 0, RB_PARAM_APPROXIMATE)};
    return params;
  }

  CgalAabb(const rb_geometry& geometry, const rb_build_options& options, const Config& config)
      : geometry_(geometry) {
    switch (config.kernel) {
      case 0:
        tree_.emplace<1>(geometry, options);
        break;
      case 1:
        tree_.emplace<2>(geometry, options);
        break;
      default:
        tree_.emplace<3>(geometry, options);
    }
  }

  template <class Counter>
  void Query(const rb_query& query) const {
    WithTree([&](const auto& tree) {
      ForEachRay<Counter>(query, [&](auto any, const RayQuery& q, rb_hit& best, Counter&) {
        try {
          if (IsRayWithin(q.ray, std::numeric_limits<float>::max(), 0x1p60f, 0x1p-60f)) [[likely]] {
            tree.template Trace<any.value>(q, best);
          } else {
            TraceRescaled(q, best,
                          [&](const RayQuery& scaled) { tree.template Trace<any.value>(scaled, best); });
          }
        } catch (const CGAL::Failure_exception&) {
          // A ray that float makes of no length.
          best = {q.ray.tfar, 0, 0, RAYBENCH_NONE};
        }
      });
      return 0;
    });
  }
  uint32_t Claims() const { return RB_CLAIM_INEXACT; }
  MemoryUse Memory() const {
    return WithTree([](const auto& tree) { return tree.Memory(); });
  }
  template <class Fn>
  int Visit(Fn&& node) const {
    return WithTree([&](const auto& tree) { return tree.Visit(geometry_, node); });
  }

 private:
  rb_geometry geometry_;
  std::variant<std::monostate, KernelTree<CGAL::Exact_predicates_inexact_constructions_kernel>,
               KernelTree<CGAL::Simple_cartesian<double>>, KernelTree<CGAL::Simple_cartesian<float>>>
      tree_;
};

}  // namespace

RAYBENCH_STRUCTURE(cgal_aabb, CgalAabb)

}  // namespace raybench
