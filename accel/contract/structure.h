// From a C++ class to the plugin contract.
//
// A structure is a class T with
//
//   struct Config { ... };                            plain data, described by kParams
//   static constexpr const char *kName, *kDoc, *kSource;
//   static constexpr uint64_t kCapabilities;          RB_CAN_* and flags
//   static std::span<const rb_param> Params();
//   T(const rb_geometry&, const rb_build_options&, const Config&);    builds; throws std::exception on failure
//   template <class Counter> void Query(const rb_query&) const;       usually one call of ForEachRay
//   uint32_t Claims() const;                          RB_CLAIM_*
//   MemoryUse Memory() const;
//   template <class Fn> int Visit(Fn&& node) const;   optional: node(const rb_node&) -> non-zero stops
//   rb_device Device() const;  static const char* Unavailable();      optional, with RB_DEVICE
//   static constexpr Kind kKind;                      built-in ones; their base class may have it
//
// and, as the last line of its file, RAYBENCH_STRUCTURE(stem, T). This header depends on nothing but the
// contract, so plugins outside the tree use it too (then with RAYBENCH_PLUGIN(T...) as the last line).
#pragma once

#include <cmath>
#include <cstdio>
#include <exception>
#include <limits>
#include <new>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>

#include "accel/base/float_state.h"
#include "accel/base/vec3.h"
#include "accel/contract/counting.h"
#include "accel/contract/parameters.h"
#include "accel/contract/raybench.h"
#include "accel/contract/valid_ray.h"

namespace raybench {

struct MemoryUse {
  uint64_t nodes = 0, prims = 0;  ///< bytes of nodes, bytes of copied primitives
  bool needs_geometry = false;    ///< queries still read the borrowed geometry
};

/// What a structure is, beside what its table says: for a list, not for any decision.
struct Kind {
  const char* family;
  const char* build;  ///< how build time grows with the primitives
  const char*
      trace;  ///< what tests primitives: one by one (scalar), four at a time (SIMD leaves), or a library
};
struct Builtin {
  const rb_structure* table;
  Kind kind;
};

/// Vertex `corner` (0..2) of triangle `prim`.
inline Vec3f Vertex(const rb_geometry& g, uint32_t prim, int corner) {
  return LoadVec3(g.positions[g.triangles[prim][corner]]);
}

inline uint64_t PrimCount(const rb_geometry& g) { return g.triangle_count + g.procedural_count; }

/// Bounds of any primitive. Adding +0 turns -0 into +0, so that min and max do not depend on the order
/// of operands.
inline Bounds3 PrimBounds(const rb_geometry& g, uint32_t prim) {
  Bounds3 b;
  if (prim < g.triangle_count) {
    for (int k = 0; k < 3; ++k) b.Extend(Vertex(g, prim, k) + Vec3f{0, 0, 0});
  } else {
    float lo[3], hi[3];
    g.procedural_bounds(g.procedural_user, prim - g.triangle_count, lo, hi);
    b = {LoadVec3(lo) + Vec3f{0, 0, 0}, LoadVec3(hi) + Vec3f{0, 0, 0}};
  }
  return b;
}

/// For builders: throws if a tree, or building it, takes more bytes than the options allow.
inline void RequireWithinLimit(uint64_t bytes, const rb_build_options& options) {
  if (options.memory_limit > 0 && bytes > options.memory_limit)
    throw std::runtime_error("building needs " + std::to_string(bytes >> 10) +
                             " KiB or more, over the memory limit");
}

/// One ray of a query, with what it skips and behind which hit it resumes.
struct RayQuery {
  rb_ray ray;
  uint32_t skip = RAYBENCH_NONE;
  uint32_t after = RAYBENCH_NONE;  ///< RAYBENCH_NONE: no hit at t == tnear counts

  /// Whether a hit at (t, prim) counts and comes before `best` in (t, prim) order. False for NaN.
  bool Accepts(float t, uint32_t prim, const rb_hit& best) const {
    return (t < best.t || (t == best.t && prim < best.prim)) &&
           (t > ray.tnear || (t == ray.tnear && prim > after && after != RAYBENCH_NONE)) && prim != skip &&
           t <= std::numeric_limits<float>::max();
  }
};

/// For libraries that want directions of ordinary length: traces the ray with its direction scaled by a power
/// of two to a length of about 1.
/// A t that is no finite float in the ray's own units does not count; one that its interval's ends round onto
/// stays inside.
template <class Trace>
void TraceRescaled(RayQuery q, rb_hit& hit, Trace&& trace) {
  constexpr float kMax = std::numeric_limits<float>::max(),
                  kInfinity = std::numeric_limits<float>::infinity();
  const float tnear = q.ray.tnear, tfar = q.ray.tfar;
  int e = 0;
  const float* const d = q.ray.dir;
  std::frexp(std::fmax(std::fabs(d[0]), std::fmax(std::fabs(d[1]), std::fabs(d[2]))), &e);
  for (float& x : q.ray.dir) x = std::ldexp(x, -e);
  q.ray.tnear = std::ldexp(tnear, e), q.ray.tfar = hit.t = std::ldexp(std::fmin(tfar, kMax), e);
  trace(q);
  if (hit.prim == RAYBENCH_NONE) {
    hit.t = tfar;
  } else {
    const float first = q.after == RAYBENCH_NONE ? std::nextafter(tnear, kInfinity) : tnear;
    hit.t = std::fmin(std::fmax(std::ldexp(hit.t, -e), first), tfar);
  }
}

/// Loops a per-ray function over a batch: trace(any, ray, hit, counter), where `any` is std::true_type for
/// RB_ANY. `hit` arrives as a miss at tfar. Invalid rays, which the host should not ask about, miss without
/// being traced. Directions have any length: 1/dir may over- and underflow (ray/bounds.h allows for it). A trace that
/// takes the caller's rb_ray, too, can read it at once: the copy in `ray` was written as a whole a moment ago, and to read it
/// in other pieces waits for that.
template <class Counter, class Trace>
void ForEachRay(const rb_query& query, Trace&& trace) {
  auto run = [&](auto any) {
    for (size_t i = 0; i < query.n; ++i) {
      const rb_ray& ray = query.rays[i];
      const RayQuery q{ray, query.skip != nullptr ? query.skip[i] : RAYBENCH_NONE,
                       query.after != nullptr ? query.after[i] : RAYBENCH_NONE};
      Counter counter;
      rb_hit hit{ray.tfar, 0, 0, RAYBENCH_NONE};
      if (IsValidRay(ray)) [[likely]] {
        if constexpr (std::is_invocable_v<Trace&, decltype(any), const RayQuery&, rb_hit&, Counter&,
                                          const rb_ray&>) {
          trace(any, q, hit, counter, ray);
        } else {
          trace(any, q, hit, counter);
        }
      }
      if constexpr (any.value) {
        query.occluded[i] = hit.prim != RAYBENCH_NONE;
      } else {
        query.hits[i] = hit;
      }
      if constexpr (Counter::kCounts) query.counts[i] = counter.counts();
    }
  };
  if (query.kind == RB_ANY) {
    run(std::true_type{});
  } else {
    run(std::false_type{});
  }
}

/// The contract's table for T.
template <class T>
const rb_structure* StructureTable() {
  struct Stamp {
    static int Build(const rb_geometry* g, const rb_build_options* o, const void* config, rb_tree** tree,
                     char* error, size_t error_size) {
      FloatState ieee;
      try {
        *tree = reinterpret_cast<rb_tree*>(new T(*g, *o, *static_cast<const typename T::Config*>(config)));
        return 0;
      } catch (const std::bad_alloc&) {
        std::snprintf(error, error_size, "out of memory");
      } catch (const std::exception& e) {
        std::snprintf(error, error_size, "%s", e.what());
      }
      return 1;
    }
    static const T& Of(const rb_tree* tree) { return *reinterpret_cast<const T*>(tree); }
    static void Destroy(rb_tree* tree) { delete reinterpret_cast<T*>(tree); }
    static void Query(const rb_tree* tree, const rb_query* query) {
      FloatState ieee;
      Of(tree).template Query<NoCounting>(*query);
    }
    static void QueryCounted(const rb_tree* tree, const rb_query* query) {
      FloatState ieee;
      if constexpr ((T::kCapabilities & RB_CAN_COUNT) != 0) Of(tree).template Query<Counting>(*query);
    }
    static uint32_t Claims(const rb_tree* tree) { return Of(tree).Claims(); }
    static void Memory(const rb_tree* tree, uint64_t* nodes, uint64_t* prims, int* needs_geometry) {
      MemoryUse use = Of(tree).Memory();
      *nodes = use.nodes, *prims = use.prims, *needs_geometry = use.needs_geometry;
    }
    static int Visit(const rb_tree* tree, int (*node)(void*, const rb_node*), void* ctx) {
      auto call = [&](const rb_node& n) { return node(ctx, &n); };
      if constexpr (requires { Of(tree).Visit(call); }) return Of(tree).Visit(call);
      return 0;
    }
    static const char* Unavailable() {
      if constexpr (requires { T::Unavailable(); }) return T::Unavailable();
      return nullptr;
    }
    static void Device(const rb_tree* tree, rb_device* device) {
      if constexpr (requires { Of(tree).Device(); }) *device = Of(tree).Device();
    }
  };
  constexpr bool kIsDevice = (T::kCapabilities & RB_DEVICE) != 0;
  constexpr auto ignore = [](const rb_node&) { return 0; };
  constexpr bool kVisits = requires(const T& t) { t.Visit(ignore); };
  constexpr bool kCounts = (T::kCapabilities & RB_CAN_COUNT) != 0;
  static const rb_structure table = {RAYBENCH_ABI_VERSION,
                                     sizeof(rb_structure),
                                     T::kName,
                                     T::kDoc,
                                     T::kSource,
                                     T::kCapabilities,
                                     T::Params().data(),
                                     uint32_t(T::Params().size()),
                                     sizeof(typename T::Config),
                                     &Stamp::Build,
                                     &Stamp::Destroy,
                                     &Stamp::Query,
                                     kCounts ? &Stamp::QueryCounted : nullptr,
                                     &Stamp::Claims,
                                     &Stamp::Memory,
                                     kVisits ? &Stamp::Visit : nullptr,
                                     kIsDevice ? &Stamp::Unavailable : nullptr,
                                     kIsDevice ? &Stamp::Device : nullptr};
  return &table;
}

}  // namespace raybench

/// Registers a built-in structure; `stem` is the name of its file and its registered name.
#define RAYBENCH_STRUCTURE(stem, T)                     \
  Builtin RaybenchStructure_##stem() {                  \
    static_assert(std::string_view(T::kName) == #stem); \
    return {StructureTable<T>(), T::kKind};             \
  }

/// Exports the structures of a plugin library; stands at namespace scope outside of any namespace.
#define RAYBENCH_PLUGIN(...)                                                                    \
  extern "C" __attribute__((visibility("default"))) const rb_structure* const* raybench_plugin( \
      uint32_t abi, size_t* count) {                                                            \
    return raybench::PluginTables<__VA_ARGS__>(abi, count);                                     \
  }

namespace raybench {
template <class... T>
const rb_structure* const* PluginTables(uint32_t host_abi, size_t* count) {
  static const rb_structure* const tables[] = {StructureTable<T>()...};
  *count = sizeof...(T);
  return host_abi == RAYBENCH_ABI_VERSION ? tables : nullptr;
}
}  // namespace raybench
