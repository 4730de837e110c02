// bounds_flat: one bound around each primitive, and no tree.
//
// The idea: before anybody built trees, a bound around each object saved the dear test by a cheap one
// (Whitted 1980). It stays linear in the number of primitives; what it shows is the bound itself. The share
// of tested primitives that are hit is P(primitive hit | bound hit), how tight a bound is (Weghorst, Hooper,
// Greenberg 1984: the void area), without any influence of a hierarchy.
//
// Bounds stand in the order of the primitives: box 24 bytes, sphere 16, 14-DOP 56.
#include <stdexcept>
#include <variant>
#include <vector>

#include "accel/bvh/bounds/kdop.h"
#include "accel/bvh/bounds/sphere.h"
#include "accel/contract/cancel.h"
#include "accel/ray/primitive.h"

namespace raybench {
namespace {

class BoundsFlat {
 public:
  struct Config {
    uint32_t bound, numerics;
  };
  static constexpr const char* kName = "bounds_flat";
  static constexpr const char* kDoc = "one bound per primitive, no tree: linear, shows how tight a bound is";
  static constexpr const char* kSource =
      "Weghorst, Hooper, Greenberg 1984: Improved computational methods for ray tracing";
  static constexpr Kind kKind = {"no hierarchy", "O(N)", "scalar"};
  static constexpr uint64_t kCapabilities =
      RB_CAN_COUNT | RB_CAN_PROCEDURAL | RB_CAN_AFTER | RB_CAN_SKIP | RB_DETERMINISTIC | RB_LINEAR;
  static std::span<const rb_param> Params() {
    static const char* const kBounds[] = {"sphere", "box", "kdop14", "kdop26", nullptr};
    static const rb_param params[] = {
        ChoiceParam("bound", "kind of bound", offsetof(Config, bound), kBounds, 1),
        NumericsParam(offsetof(Config, numerics))};
    return params;
  }

  BoundsFlat(const rb_geometry& geometry, const rb_build_options& options, const Config& config)
      : geometry_(geometry), numerics_(config.numerics) {
    if (config.bound == 0) Fill<SphereBound>(options);
    if (config.bound == 1) Fill<BoxBound>(options);
    if (config.bound == 2) Fill<KdopBound<14>>(options);
    if (config.bound == 3) Fill<KdopBound<26>>(options);
  }

  template <class Counter>
  void Query(const rb_query& query) const {
    std::visit(
        [&]<class Bound>(const std::vector<Bound>& bounds) {
          WithNumerics(numerics_, [&]<class Test>() {
            ForEachRay<Counter>(query, [&](auto any, const RayQuery& q, rb_hit& best, Counter& counter) {
              const RayState<Test> state(q);
              const typename Bound::Ray ray(state.slab, q.ray, Test::kSlack);
              for (uint32_t i = 0; i < bounds.size(); ++i) {
                counter.Step(sizeof(Bound));
                counter.Bounds(1);
                float entry;
                if (!ray.Meets(bounds[i], best.t, entry)) continue;
                counter.Leaf(false);
                counter.Prims(1, sizeof(uint32_t[3]) + sizeof(float[3][3]));
                if (state.Primitive(geometry_, i, best) && any.value) return;
              }
            });
          });
        },
        bounds_);
  }
  uint32_t Claims() const { return ClaimOf(numerics_, geometry_); }
  MemoryUse Memory() const {
    return std::visit([](const auto& b) { return MemoryUse{b.size() * sizeof(b[0]), 0, true}; }, bounds_);
  }
  /// A forest of leaves under a root that bounds all.
  template <class Fn>
  int Visit(Fn&& node) const {
    return std::visit(
        [&]<class Bound>(const std::vector<Bound>& bounds) {
          if (bounds.empty()) return 0;
          std::vector<uint32_t> all(bounds.size());
          for (uint32_t i = 0; i < all.size(); ++i) all[i] = i;
          float floats[Bound::kFloats];
          const bool padded = IsConservative(numerics_);
          Bound::Around(geometry_, all.data(), all.size(), padded).CopyTo(floats);
          if (int stop = node(rb_node{0, 0, 0, Bound::kShape, floats, Bound::kFloats, 0, nullptr}))
            return stop;
          for (uint32_t i = 0; i < bounds.size(); ++i) {
            bounds[i].CopyTo(floats);
            if (int stop = node(rb_node{1, 1, 0, Bound::kShape, floats, Bound::kFloats, 1, &i})) return stop;
          }
          return 0;
        },
        bounds_);
  }

 private:
  template <class Bound>
  void Fill(const rb_build_options& options) {
    const uint64_t n = PrimCount(geometry_);
    if (options.memory_limit > 0 && n * sizeof(Bound) > options.memory_limit)
      throw std::runtime_error("the bounds need more than the memory limit");
    std::vector<Bound> bounds;
    bounds.reserve(n);
    for (uint32_t i = 0; i < n; ++i) {
      if (i % 4096 == 0) CheckCancel(options.cancel);
      bounds.push_back(Bound::Around(geometry_, &i, 1, IsConservative(numerics_)));
    }
    bounds_ = std::move(bounds);
  }

  rb_geometry geometry_;
  uint32_t numerics_;
  std::variant<std::vector<SphereBound>, std::vector<BoxBound>, std::vector<KdopBound<14>>,
               std::vector<KdopBound<26>>>
      bounds_;
};

}  // namespace

RAYBENCH_STRUCTURE(bounds_flat, BoundsFlat)

}  // namespace raybench
