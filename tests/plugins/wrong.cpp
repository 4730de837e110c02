// Plugins that lie, each in one way: the verdict must catch them all.
#include "accel/contract/structure.h"

using namespace raybench;

namespace {

enum Lie {
  kMisses,
  kWrongIds,
  kBadIds,
  kCountsDifferently,
  kNanT,
  kInfiniteT,
  kEarlyT,  // at tnear, which is outside of the interval
  kMissT,   // a miss that does not say tfar
  kTwo,     // neither occluded nor free
  kUv,      // u for v, v for u
  kStaysHonest
};
constexpr const char* kNames[] = {"wrong_misses", "wrong_ids",        "wrong_bad_ids", "wrong_counts",
                                  "wrong_nan_t",  "wrong_infinite_t", "wrong_early_t", "wrong_miss_t",
                                  "wrong_two",    "wrong_uv",         "wrong_not"};

/// Every ray against every triangle in double, and then the lie.
template <Lie kLie>
class Liar {
 public:
  struct Config {
    uint32_t unused;
  };
  static constexpr const char* kName = kNames[kLie];
  static constexpr const char* kDoc = "a test of the verdict";
  static constexpr const char* kSource = "raybench's tests";
  static constexpr uint64_t kCapabilities = RB_CAN_COUNT | RB_DETERMINISTIC;
  static std::span<const rb_param> Params() { return {}; }

  Liar(const rb_geometry& geometry, const rb_build_options&, const Config&) : geometry_(geometry) {}

  template <class Counter>
  void Query(const rb_query& query) const {
    size_t index = 0;
    ForEachRay<Counter>(query, [&](auto, const RayQuery& q, rb_hit& best, Counter&) {
      for (uint64_t prim = 0; prim < geometry_.triangle_count; ++prim) Test(q, uint32_t(prim), best);
      const bool turn = index++ % 100 == 99;
      if (best.prim == RAYBENCH_NONE) return;
      const rb_hit miss{q.ray.tfar, 0, 0, RAYBENCH_NONE};
      if (kLie == kMisses && turn) best = miss;
      if (kLie == kWrongIds && turn)
        best.prim = uint32_t((best.prim + geometry_.triangle_count / 2) % geometry_.triangle_count);
      if (kLie == kBadIds && turn) best.prim = uint32_t(geometry_.triangle_count) + 7;
      if (kLie == kCountsDifferently && Counter::kCounts && turn) best = miss;
      if (kLie == kNanT && turn) best.t = std::numeric_limits<float>::quiet_NaN();
      if (kLie == kInfiniteT && turn) best.t = std::numeric_limits<float>::infinity();
      if (kLie == kEarlyT && turn) best.t = q.ray.tnear;
      if (kLie == kUv) std::swap(best.u, best.v);
      if (kLie == kMissT && turn) best = {0, 0, 0, RAYBENCH_NONE};
    });
    if (kLie == kTwo && query.kind == RB_ANY) query.occluded[query.n - 1] = 2;
  }
  uint32_t Claims() const { return RB_CLAIM_WATERTIGHT; }
  MemoryUse Memory() const { return {0, 0, true}; }

 private:
  /// Moeller, Trumbore 1997 in double, edges widened so that nothing slips through.
  void Test(const RayQuery& q, uint32_t prim, rb_hit& best) const {
    const Vec3d p0 = ToDouble(Vertex(geometry_, prim, 0)), e1 = ToDouble(Vertex(geometry_, prim, 1)) - p0,
                e2 = ToDouble(Vertex(geometry_, prim, 2)) - p0, dir = ToDouble(LoadVec3(q.ray.dir)),
                s = ToDouble(LoadVec3(q.ray.org)) - p0, h = Cross(dir, e2), r = Cross(s, e1);
    const double det = Dot(e1, h), u = Dot(s, h) / det, v = Dot(dir, r) / det;
    const float t = float(Dot(e2, r) / det);
    if (det != 0 && u >= -1e-12 && v >= -1e-12 && u + v <= 1 + 1e-12 && q.Accepts(t, prim, best)) {
      best = {t, float(u), float(v), prim};
    }
  }
  rb_geometry geometry_;
};

}  // namespace

RAYBENCH_PLUGIN(Liar<kMisses>, Liar<kWrongIds>, Liar<kBadIds>, Liar<kCountsDifferently>, Liar<kNanT>,
                Liar<kInfiniteT>, Liar<kEarlyT>, Liar<kMissT>, Liar<kTwo>, Liar<kUv>, Liar<kStaysHonest>)
