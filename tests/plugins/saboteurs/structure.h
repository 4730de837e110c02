// Honest structures, small and slow, with hooks for one fault each. A saboteur is a struct that derives from
// the honest one of its structure and hides what it does wrong; the twins honest_* hide nothing.
#pragma once

#include <stdexcept>
#include <vector>

#include "accel/contract/cancel.h"
#include "accel/ray/primitive.h"

namespace raybench::saboteurs {

/// What all structures do right.
struct Honest {
  static constexpr uint64_t kCapabilities =
      RB_CAN_COUNT | RB_CAN_PROCEDURAL | RB_CAN_AFTER | RB_CAN_SKIP | RB_DETERMINISTIC;
  static constexpr int64_t kLeafSize = 1, kLargestLeaf = 64;
  static constexpr bool kShowsNodes = true;
  static constexpr bool kKeepsMemoryLimit = true;
  static constexpr uint64_t kWastePerPrim = 0;  ///< bytes
  static constexpr uint32_t kLanes = 4;         ///< tested of each block of four

  using Test = WatertightTest;
  template <class Counter>
  using Counts = Counter;

  /// The batch as it is worked through.
  static rb_query Asked(const rb_query& query) { return query; }
  /// The ray as it is traced.
  static RayQuery Heard(const RayQuery& q, bool /*any*/) { return q; }
  /// Takes the primitive into `best` if it is hit and comes before it.
  template <bool kAny, class Ray>
  static bool Take(const Ray& ray, const rb_geometry& geometry, uint32_t prim, rb_hit& best) {
    return ray.Primitive(geometry, prim, best);
  }
  /// What becomes of an answer, and of all answers of a batch.
  static void Answer(const RayQuery&, rb_hit&) {}
  static void Answered(const rb_query&) {}
};

/// Throws if the build shall stop or needs more bytes than it may take.
template <class Fault>
void CheckBuild(const rb_build_options& options, uint64_t bytes) {
  CheckCancel(options.cancel);
  if (Fault::kKeepsMemoryLimit && options.memory_limit > 0 && bytes > options.memory_limit)
    throw std::runtime_error("the tree does not fit into the memory limit");
}

/// What Derived does not say itself. It has Trace<kAny>(ray, best, counter) and VisitNodes(node).
template <class Fault, class Derived>
class Structure {
 public:
  struct Config {
    int64_t leaf_size;
  };
  static constexpr const char* kName = Fault::kName;
  static constexpr const char* kDoc = Fault::kDoc;
  static constexpr const char* kSource = "raybench's tests";
  static constexpr uint64_t kCapabilities = Fault::kCapabilities;
  static std::span<const rb_param> Params() {
    static const rb_param params[] = {IntParam("leaf_size", "primitives in a leaf at most",
                                               offsetof(Config, leaf_size), 1, Fault::kLargestLeaf,
                                               Fault::kLeafSize)};
    return params;
  }

  template <class Counter>
  void Query(const rb_query& query) const {
    using Test = typename Fault::Test;
    ForEachRay<typename Fault::template Counts<Counter>>(
        Fault::Asked(query), [&](auto any, const RayQuery& q, rb_hit& best, auto& counter) {
          const RayQuery heard = Fault::Heard(q, any.value);
          best.t = heard.ray.tfar;
          self().template Trace<any.value>(RayState<Test>(heard), best, counter);
          if (best.prim == RAYBENCH_NONE) best.t = q.ray.tfar;
          Fault::Answer(q, best);
        });
    Fault::Answered(query);
  }
  uint32_t Claims() const { return RB_CLAIM_WATERTIGHT; }
  template <class Fn>
  int Visit(Fn&& node) const {
    return Fault::kShowsNodes ? self().VisitNodes(node) : 0;
  }

 protected:
  explicit Structure(const rb_geometry& geometry) : geometry_(geometry) {}

  /// Tests primitives in blocks of four. True if `best` changed; any-hit queries end there.
  template <bool kAny, class Ray, class Counter>
  bool TestPrims(const Ray& ray, const uint32_t* prims, uint32_t count, rb_hit& best,
                 Counter& counter) const {
    bool changed = false;
    for (uint32_t i = 0; i < count; ++i) {
      if (i % 4 >= Fault::kLanes) continue;
      counter.Prims(1, sizeof(float[3][3]) + sizeof(uint32_t[3]));
      changed |= Fault::template Take<kAny>(ray, geometry_, prims[i], best);
      if (kAny && changed) return true;
    }
    return changed;
  }

  rb_geometry geometry_;

 private:
  const Derived& self() const { return static_cast<const Derived&>(*this); }
};

}  // namespace raybench::saboteurs
