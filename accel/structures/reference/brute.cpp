// brute: every ray against every primitive, in the order of their ids. No tree, nothing to lose: the in-tree
// reference for every structure at the same `numerics`, and, with `triangle`, a ray-triangle test alone.
#include <cstring>

#include "accel/ray/primitive.h"
#include "accel/ray/study.h"

namespace raybench {
namespace {

class Brute {
 public:
  struct Config {
    uint32_t numerics, triangle, fma;
  };
  static constexpr const char* kName = "brute";
  static constexpr const char* kDoc = "every ray against every primitive: the reference, linear in both";
  static constexpr const char* kSource = "raybench";
  static constexpr Kind kKind = {"no hierarchy", "none", "scalar"};
  static constexpr uint64_t kCapabilities =
      RB_CAN_COUNT | RB_CAN_PROCEDURAL | RB_CAN_AFTER | RB_CAN_SKIP | RB_DETERMINISTIC | RB_LINEAR;
  static std::span<const rb_param> Params() {
    static const rb_param params[] = {NumericsParam(offsetof(Config, numerics)),
                                      TriangleParam(offsetof(Config, triangle)),
                                      FmaParam(offsetof(Config, fma))};
    return params;
  }

  Brute(const rb_geometry& geometry, const rb_build_options& options, const Config& config)
      : geometry_(geometry),
        config_(config),
        study_(config.numerics, config.triangle, config.fma != 0, /*rules=*/false) {
    study_.Precompute(
        geometry, PrimCount(geometry), [](size_t i) { return uint32_t(i); }, 0, options);
  }

  template <class Counter>
  void Query(const rb_query& query) const {
    if (study_.on()) return QueryStudy<Counter>(query);
    WithNumerics(config_.numerics, [&]<class Test>() {
      ForEachRay<Counter>(query, [&](auto any, const RayQuery& q, rb_hit& best, Counter& counter) {
        const RayState<Test> ray(q);
        const uint64_t n = PrimCount(geometry_);
        for (uint64_t i = 0; i < n; ++i) {
          counter.Prims(1, sizeof(uint32_t[3]) + sizeof(float[3][3]));
          if (ray.Primitive(geometry_, uint32_t(i), best) && any.value) return;
        }
      });
    });
  }
  uint32_t Claims() const {
    return study_.on() ? study_.Claim(geometry_) : ClaimOf(config_.numerics, geometry_);
  }
  MemoryUse Memory() const { return {0, study_.bytes(), true}; }

 private:
  template <class Counter>
  void QueryStudy(const rb_query& query) const {
    ForEachRay<Counter>(query, [&](auto any, const RayQuery& q, rb_hit& best, Counter& counter) {
      const RayState<StudyTest> ray(study_, q, SlabRay(q.ray, Slack::kNone));
      const uint64_t n = PrimCount(geometry_);
      for (uint32_t i = 0; i < n; ++i) {
        counter.Prims(1, study_.BytesTested(1, sizeof(uint32_t[3]) + sizeof(float[3][3])));
        float v[3][3] = {};
        if (i < geometry_.triangle_count)
          for (int c = 0; c < 3; ++c)
            std::memcpy(v[c], geometry_.positions[geometry_.triangles[i][c]], sizeof v[c]);
        if (ray.Take(geometry_, {v[0], &i, 1, 1, study_.maps(i)}, any.value, best) && any.value) return;
      }
    });
  }

  rb_geometry geometry_;
  Config config_;
  Study study_;
};

}  // namespace

RAYBENCH_STRUCTURE(brute, Brute)

}  // namespace raybench
