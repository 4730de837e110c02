// embree: Intel's Embree (Wald et al. 2014) behind the contract: single-ray calls, as an engine would use it first,
// or packets and streams.
//
// Triangles are one geometry, procedural primitives a user geometry. Vertex and index arrays are shared with
// the scene, not copied. Input that makes a packaged Embree abort is kept away from it: invalid rays, and
// such as start beyond 1.8e18, are answered here with a miss, directions shorter than 1e-9 or longer
// than 1.8e18 are scaled; geometry is clean by contract. Where there are two trees, one for triangles and one for the
// others, the first hands its t to the second, which aborts if that is NaN: such a hit is filtered out. It cannot count, resume or skip. Embree orders hits
// at equal t as it meets them; so ids at ties may differ from the lowest, which the verdict shows.
//
// Its answers are brought to the contract's interval (tnear, tfar]. The robust test takes the end tnear in,
// so it is asked from the next float on, which is the same. Where products of subnormal numbers make t NaN
// or put it outside, it is asked once more with a direction as long as it takes. If it finds nothing then, its hit
// stands, as any-hit queries see it, with the t of the triangle's plane.
#include "accel/structures/library/embree.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <memory>

#include "accel/base/error.h"
#include "accel/base/parallel.h"
#include "accel/contract/cancel.h"
#include "accel/contract/structure.h"
#include "accel/contract/valid_ray.h"
#include "accel/structures/library/embree_call.h"

namespace raybench {
namespace {

constexpr unsigned kTriangles = 0, kProcedural = 1;  // geometry ids
constexpr float kLongest = 1.844e18f;                // Embree's FLT_LARGE
constexpr float kInfinity = std::numeric_limits<float>::infinity();

struct Release {
  void operator()(RTCDevice d) const { rtcReleaseDevice(d); }
  void operator()(RTCScene s) const { rtcReleaseScene(s); }
};
template <class Handle>
using Owned = std::unique_ptr<std::remove_pointer_t<Handle>, Release>;

const char* const kQualities[] = {"low", "medium", "high", nullptr};
constexpr uint32_t kLow = 0;

enum class Packet : uint32_t { kOne, kFour, kEight, kSixteen, kStream };
#if RAYBENCH_EMBREE_MAJOR < 4
const char* const kPackets[] = {"1", "4", "8", "16", "stream", nullptr};
#else  // version 4 has no streams
const char* const kPackets[] = {"1", "4", "8", "16", nullptr};
#endif

class Embree {
 public:
  struct Config {
    uint32_t quality, robust, compact, flush_to_zero, packet, coherent;
  };
  static constexpr const char* kName = "embree";
  static constexpr const char* kDoc = "Intel Embree, by single-ray calls, or by packets and streams";
  static constexpr const char* kSource =
      "Wald, Woop, Benthin, Johnson, Ernst 2014: Embree, a kernel framework";
  // Embree promises the same tree only for one thread.
  static constexpr Kind kKind = {"library", "O(N log N)", "library"};
  static constexpr uint64_t kCapabilities = RB_CAN_PROCEDURAL | RB_NATIVE_BATCH;
  static std::span<const rb_param> Params() {
    static const rb_param params[] = {
        ChoiceParam("quality", "build quality: low (Morton), medium (binned SAH), high (spatial splits)",
                    offsetof(Config, quality), kQualities, 1),
        BoolParam("robust", "RTC_SCENE_FLAG_ROBUST: tests that avoid leaks at edges",
                  offsetof(Config, robust), 0, RB_PARAM_APPROXIMATE),
        BoolParam("compact", "RTC_SCENE_FLAG_COMPACT: less memory", offsetof(Config, compact), false),
        BoolParam("flush_to_zero", "trace with subnormal numbers taken for 0, as Embree's manual recommends",
                  offsetof(Config, flush_to_zero), 0, RB_PARAM_APPROXIMATE),
        ChoiceParam(
            "packet",
            "native batches: rays that Embree traces together, in packets of 4, 8 or 16 (rtcIntersect4 "
            "and so on) or, with Embree 3 only, in streams of 256 (rtcIntersect1M); ids at ties may differ",
            offsetof(Config, packet), kPackets, 0),
        BoolParam("coherent",
                  "tell Embree that the rays of a packet are coherent, where they go the same way: only then "
                  "it traces "
                  "them on one path",
                  offsetof(Config, coherent), false)};
    return params;
  }

  Embree(const rb_geometry& geometry, const rb_build_options& options, const Config& config)
      : geometry_(geometry), config_(config), cancel_(options.cancel), limit_(options.memory_limit) {
    // Embree builds in a oneTBB arena of its own, so only a process-wide limit binds it. Given to the
    // device it would hold as long as the tree lives, for other structures' builds too; so it is set for
    // the commit alone.
    device_.reset(rtcNewDevice(nullptr));
    if (!device_) throw BuildError("Embree gives no device");
    rtcSetDeviceMemoryMonitorFunction(device_.get(), &CountMemory, this);
    scene_.reset(rtcNewScene(device_.get()));
    const RTCBuildQuality qualities[] = {RTC_BUILD_QUALITY_LOW, RTC_BUILD_QUALITY_MEDIUM,
                                         RTC_BUILD_QUALITY_HIGH};
    rtcSetSceneBuildQuality(scene_.get(), qualities[config.quality]);
    rtcSetSceneFlags(scene_.get(),
                     RTCSceneFlags((config.robust ? RTC_SCENE_FLAG_ROBUST : RTC_SCENE_FLAG_NONE) |
                                   (config.compact ? RTC_SCENE_FLAG_COMPACT : RTC_SCENE_FLAG_NONE)));
    rtcSetSceneProgressMonitorFunction(scene_.get(), &KeepGoing, this);
    if (geometry.triangle_count > 0) AttachTriangles();
    if (geometry.procedural_count > 0) AttachProcedural();
    {
      const ThreadLimit threads(options.threads);
      rtcCommitScene(scene_.get());
    }
    if (RTCError error = rtcGetDeviceError(device_.get()); error != RTC_ERROR_NONE) {
      if (error == RTC_ERROR_CANCELLED) throw BuildError("cancelled");
      if (error == RTC_ERROR_OUT_OF_MEMORY) throw BuildError("over the memory limit");
      throw BuildError(fmt::format("Embree reports error {}", int(error)));
    }
    cancel_ = nullptr;
  }

  template <class Counter>
  void Query(const rb_query& query) const {
    const FloatState state(config_.flush_to_zero != 0 ? FloatState::kFlushing : FloatState::kIeee);
    EmbreeCall call(scene_.get(), config_.coherent != 0);
    const Asking asking(*this, call);
    switch (Packet(config_.packet)) {
      case Packet::kOne:
        return QueryOneByOne(asking, query);
      case Packet::kFour:
        return QueryInPackets<4>(asking, query);
      case Packet::kEight:
        return QueryInPackets<8>(asking, query);
      case Packet::kSixteen:
        return QueryInPackets<16>(asking, query);
      case Packet::kStream:
        return QueryInStreams(asking, query);
    }
  }

  uint32_t Claims() const { return RB_CLAIM_INEXACT; }
  // Embree's monitor does not tell nodes from primitives. Single triangles are read from the scene's arrays.
  MemoryUse Memory() const { return {uint64_t(std::max<int64_t>(0, bytes_.load())), 0, true}; }
  RTCScene scene() const { return scene_.get(); }

 private:
  /// By how many floats an interval begins after tnear, and the least bits of its beginning.
  struct OpenEnd {
    uint32_t steps, least;
  };
  static RTCRay ToEmbree(const rb_ray& in, OpenEnd open_end) {
    RTCRay ray;
    ray.org_x = in.org[0], ray.org_y = in.org[1], ray.org_z = in.org[2];
    ray.tnear = std::bit_cast<float>(
        std::max((std::bit_cast<uint32_t>(in.tnear) & 0x7FFFFFFF) + open_end.steps, open_end.least));
    ray.dir_x = in.dir[0], ray.dir_y = in.dir[1], ray.dir_z = in.dir[2], ray.time = 0;
    ray.tfar = in.tfar, ray.mask = unsigned(-1), ray.id = 0, ray.flags = 0;
    return ray;
  }

  /// What the rays of a query have in common. Its numbers are copies: the compiler must take it that the library
  /// changes whatever it can reach.
  class Asking {
   public:
    Asking(const Embree& tree, EmbreeCall& call)
        : call(call),
          tree_(tree),
          triangles_(uint32_t(tree.geometry_.triangle_count)),
          // The robust test takes tnear in: its interval begins at the next float, which where subnormals are
          // flushed is the smallest normal one.
          open_end_{tree.config_.robust != 0,
                    tree.config_.robust != 0 && tree.config_.flush_to_zero != 0 ? 0x00800000u : 0} {}

    EmbreeCall& call;

    RTCRay Ray(const rb_ray& ray) const { return ToEmbree(ray, open_end_); }
    RTCRayHit RayHit(const rb_ray& ray) const {
      RTCRayHit asked;
      asked.ray = Ray(ray);
      asked.hit.geomID = asked.hit.primID = asked.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
      return asked;
    }
    rb_hit Hit(const rb_ray& ray, float t, float u, float v, unsigned prim, unsigned geometry) const {
      if (geometry == RTC_INVALID_GEOMETRY_ID) return {ray.tfar, 0, 0, RAYBENCH_NONE};
      return {t, u, v, prim + (geometry == kTriangles ? 0 : triangles_)};
    }
    rb_hit Hit(const rb_ray& ray, const RTCRayHit& found) const {
      return Hit(ray, found.ray.tfar, found.hit.u, found.hit.v, found.hit.primID, found.hit.geomID);
    }
    /// The hit, brought into the ray's interval.
    rb_hit Inside(const rb_ray& ray, rb_hit hit) const {
      if (hit.t > ray.tnear && hit.t <= ray.tfar) return hit;
      const FloatState ieee;
      // What it took by its own measure may have been rounded out of the interval; any-hit sees no t.
      const float inside = std::min(std::max(hit.t, std::nextafter(ray.tnear, kInfinity)), ray.tfar);
      if (std::fabs(hit.t - inside) <= 0x1p-20f * inside) return hit.t = inside, hit;
      return tree_.AskAgain(ray, hit, [this](const rb_ray& longer) { return Closest(longer); });
    }
    rb_hit Closest(const rb_ray& ray) const {
      RTCRayHit asked = RayHit(ray);
      call.Closest(asked);
      return Hit(ray, asked);
    }
    rb_hit ClosestInside(const rb_ray& ray) const { return Inside(ray, Closest(ray)); }
    /// Of a ray that is not taken as it is.
    rb_hit Unusual(const rb_ray& ray) const {
      return TraceUnusual(ray, [this](const rb_ray& scaled) { return ClosestInside(scaled); });
    }

   private:
    const Embree& tree_;
    uint32_t triangles_;
    OpenEnd open_end_;
  };

  static void QueryOneByOne(const Asking& asking, const rb_query& query) {
    const rb_ray* const rays = query.rays;
    const size_t n = query.n;
    if (query.kind == RB_ANY) {
      uint8_t* const occluded = query.occluded;
      for (size_t i = 0; i < n; ++i) {
        if (!IsTaken(rays[i])) [[unlikely]] {
          occluded[i] = asking.Unusual(rays[i]).prim != RAYBENCH_NONE;
          continue;
        }
        RTCRay ray = asking.Ray(rays[i]);
        const bool asked = ray.tfar >= 0;
        if (asked) [[likely]]
          asking.call.Any(ray);
        occluded[i] = asked && ray.tfar < 0;
      }
      return;
    }
    rb_hit* const hits = query.hits;
    for (size_t i = 0; i < n; ++i)
      hits[i] = IsTaken(rays[i]) ? asking.ClosestInside(rays[i]) : asking.Unusual(rays[i]);
  }

  /// A ray that a packet or stream leaves out: an unusual one is asked alone, and none ends before 0.
  static bool IsTogether(const rb_ray& ray) { return IsTaken(ray) && ray.tfar >= 0; }
  static rb_hit Alone(const Asking& asking, const rb_ray& ray) {
    return IsTaken(ray) ? rb_hit{ray.tfar, 0, 0, RAYBENCH_NONE} : asking.Unusual(ray);
  }

  template <int kSize>
  static void QueryInPackets(const Asking& asking, const rb_query& query) {
    const size_t n = query.n;
    for (size_t first = 0; first < n; first += kSize) {
      const rb_ray* const rays = query.rays + first;
      const int here = int(std::min<size_t>(kSize, n - first));
      EmbreePacket<kSize> packet;
      for (int k = 0; k < here; ++k)
        if (IsTogether(rays[k])) [[likely]]
          packet.Set(k, asking.Ray(rays[k]));
      if (query.kind == RB_ANY) {
        asking.call.Any(packet);
        for (int k = 0; k < here; ++k)
          query.occluded[first + size_t(k)] =
              packet.Has(k) ? packet.IsOccluded(k) : Alone(asking, rays[k]).prim != RAYBENCH_NONE;
        continue;
      }
      asking.call.Closest(packet);
      for (int k = 0; k < here; ++k) {
        const auto& p = packet.rays;
        query.hits[first + size_t(k)] =
            packet.Has(k) ? asking.Inside(rays[k], asking.Hit(rays[k], p.ray.tfar[k], p.hit.u[k], p.hit.v[k],
                                                              p.hit.primID[k], p.hit.geomID[k]))
                          : Alone(asking, rays[k]);
      }
    }
  }

  static void QueryInStreams([[maybe_unused]] const Asking& asking, [[maybe_unused]] const rb_query& query) {
#if RAYBENCH_EMBREE_MAJOR < 4
    constexpr size_t kRays = 256;
    RTCRayHit stream[kRays];
    for (size_t first = 0; first < query.n; first += kRays) {
      const rb_ray* const rays = query.rays + first;
      const size_t here = std::min(kRays, query.n - first);
      SameWay same_way;
      for (size_t k = 0; k < here; ++k) {
        stream[k] = asking.RayHit(rays[k]);
        if (IsTogether(rays[k])) {
          same_way.Add(stream[k].ray);
        } else {
          stream[k].ray = EmbreeCall::NoRay();
        }
      }
      const unsigned count = unsigned(here);
      query.kind == RB_ANY ? asking.call.AnyStream(stream, count, same_way)
                           : asking.call.ClosestStream(stream, count, same_way);
      for (size_t k = 0; k < here; ++k) {
        const bool alone = !IsTogether(rays[k]);
        if (query.kind == RB_ANY) {
          query.occluded[first + k] =
              alone ? Alone(asking, rays[k]).prim != RAYBENCH_NONE : stream[k].ray.tfar < 0;
        } else {
          query.hits[first + k] =
              alone ? Alone(asking, rays[k]) : asking.Inside(rays[k], asking.Hit(rays[k], stream[k]));
        }
      }
    }
#endif
  }

  /// What Embree takes without an assertion (components up to its FLT_LARGE), and without t = NaN for triangles
  /// that are not far smaller than the scene: its test multiplies the direction with their area, and the reciprocal
  /// of a subnormal number is NaN by its Newton step. (In boxes it takes no reciprocal of less than 1e-18.)
  static bool IsTaken(const rb_ray& ray) { return IsRayWithin(ray, kLongest, kLongest, 1e-9f); }

  /// The others: what is valid, with a direction of length about 1, if Embree takes that; else a miss.
  template <class Trace>
  static rb_hit TraceUnusual(const rb_ray& ray, const Trace& trace) {
    rb_hit hit{ray.tfar, 0, 0, RAYBENCH_NONE};
    if (!IsValidRay(ray)) return hit;
    const FloatState ieee;  // a t below the normal floats is no 0
    TraceRescaled(RayQuery{ray}, hit, [&](const RayQuery& scaled) {
      if (IsTaken(scaled.ray)) hit = trace(scaled.ray);
    });
    return hit;
  }

  /// After an answer whose t is NaN or lies outside the ray's interval; a miss at tfar is no such answer.
  template <class Trace>
  rb_hit AskAgain(const rb_ray& ray, const rb_hit& answer, const Trace& trace) const {
    if (answer.prim == RAYBENCH_NONE) return answer;
    const FloatState ieee;
    constexpr float kMax = std::numeric_limits<float>::max();
    const float* const d = ray.dir;
    const int e =
        std::ilogb(kLongest) - 1 - std::ilogb(std::max({std::fabs(d[0]), std::fabs(d[1]), std::fabs(d[2])}));
    rb_ray longer = ray;
    for (float& x : longer.dir) x = std::ldexp(x, e);
    longer.tnear = std::ldexp(ray.tnear, -e), longer.tfar = std::ldexp(std::min(ray.tfar, kMax), -e);
    rb_hit hit = trace(longer);
    hit.t = std::ldexp(hit.t, e);
    const bool is_inside = hit.prim != RAYBENCH_NONE && hit.t > ray.tnear && hit.t <= ray.tfar;
    return is_inside ? hit : OnPlane(ray, answer);
  }
  /// The hit with t divided in double, within the interval.
  rb_hit OnPlane(const rb_ray& ray, rb_hit hit) const {
    if (hit.prim >= geometry_.triangle_count) return {ray.tfar, 0, 0, RAYBENCH_NONE};
    const auto corner = [&](int k) { return ToDouble(Vertex(geometry_, hit.prim, k)); };
    const Vec3d p = corner(0), normal = Cross(corner(1) - p, corner(2) - p);
    const double t = Dot(normal, p - ToDouble(LoadVec3(ray.org))) / Dot(normal, ToDouble(LoadVec3(ray.dir)));
    const float from = std::nextafter(ray.tnear, kInfinity);
    constexpr float kMax = std::numeric_limits<float>::max();
    hit.t = std::min({std::isfinite(t) ? std::max(float(t), from) : from, ray.tfar, kMax});
    hit.u = std::isfinite(hit.u) ? hit.u : 0, hit.v = std::isfinite(hit.v) ? hit.v : 0;
    return hit;
  }

  void AttachTriangles() {
    RTCGeometry g = rtcNewGeometry(device_.get(), RTC_GEOMETRY_TYPE_TRIANGLE);
    rtcSetSharedGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, geometry_.positions, 0, 12,
                               geometry_.vertex_count);
    rtcSetSharedGeometryBuffer(g, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, geometry_.triangles, 0, 12,
                               geometry_.triangle_count);
    if (geometry_.procedural_count > 0) {
      rtcSetGeometryIntersectFilterFunction(g, [](const RTCFilterFunctionNArguments* args) {
        for (unsigned i = 0; i < args->N; ++i)
          if (std::isnan(RTCRayN_tfar(args->ray, args->N, i))) args->valid[i] = 0;
      });
    }
    Attach(g, kTriangles);
  }

  void AttachProcedural() {
    RTCGeometry g = rtcNewGeometry(device_.get(), RTC_GEOMETRY_TYPE_USER);
    rtcSetGeometryUserPrimitiveCount(g, unsigned(geometry_.procedural_count));
    rtcSetGeometryUserData(g, this);
    rtcSetGeometryBoundsFunction(
        g,
        [](const RTCBoundsFunctionArguments* args) {
          const rb_geometry& geometry = static_cast<const Embree*>(args->geometryUserPtr)->geometry_;
          float lo[3], hi[3];
          geometry.procedural_bounds(geometry.procedural_user, args->primID, lo, hi);
          *args->bounds_o = {lo[0], lo[1], lo[2], 0, hi[0], hi[1], hi[2], 0};
        },
        nullptr);
    rtcSetGeometryIntersectFunction(g, [](const RTCIntersectFunctionNArguments* args) {
      const unsigned n = args->N;
      RTCRayN* const rays = RTCRayHitN_RayN(args->rayhit, n);
      RTCHitN* const hits = RTCRayHitN_HitN(args->rayhit, n);
      for (unsigned i = 0; i < n; ++i) {
        rb_hit hit;
        if (args->valid[i] == 0 ||
            !IntersectProcedural(args->geometryUserPtr, args->primID, rtcGetRayFromRayN(rays, n, i), hit))
          continue;
        RTCRayN_tfar(rays, n, i) = hit.t;
        RTCHitN_u(hits, n, i) = hit.u, RTCHitN_v(hits, n, i) = hit.v;
        RTCHitN_primID(hits, n, i) = args->primID, RTCHitN_geomID(hits, n, i) = args->geomID;
        RTCHitN_instID(hits, n, i, 0) = args->context->instID[0];
      }
    });
    rtcSetGeometryOccludedFunction(g, [](const RTCOccludedFunctionNArguments* args) {
      for (unsigned i = 0; i < args->N; ++i) {
        rb_hit hit;
        if (args->valid[i] != 0 && IntersectProcedural(args->geometryUserPtr, args->primID,
                                                       rtcGetRayFromRayN(args->ray, args->N, i), hit))
          RTCRayN_tfar(args->ray, args->N, i) = -kInfinity;
      }
    });
    Attach(g, kProcedural);
  }

  static bool IntersectProcedural(const void* user, unsigned prim, const RTCRay& ray, rb_hit& hit) {
    const auto& self = *static_cast<const Embree*>(user);
    const rb_geometry& geometry = self.geometry_;
    // This test leaves tnear out by itself.
    const float tnear = std::bit_cast<float>(std::bit_cast<uint32_t>(ray.tnear) - (self.config_.robust != 0));
    const rb_ray query{{ray.org_x, ray.org_y, ray.org_z}, tnear, {ray.dir_x, ray.dir_y, ray.dir_z}, ray.tfar};
    constexpr uint32_t kFast = 0;
    return geometry.procedural_intersect(geometry.procedural_user, prim, kFast, &query, &hit) != 0;
  }

  void Attach(RTCGeometry g, unsigned id) {
    // A scene of low quality has a tree for each geometry, which is of medium quality unless told.
    if (config_.quality == kLow) rtcSetGeometryBuildQuality(g, RTC_BUILD_QUALITY_LOW);
    rtcCommitGeometry(g);
    rtcAttachGeometryByID(scene_.get(), g, id);
    rtcReleaseGeometry(g);
  }

  static bool CountMemory(void* self, ssize_t bytes, bool) {
    auto& e = *static_cast<Embree*>(self);
    const int64_t now = e.bytes_.fetch_add(bytes) + bytes;
    return bytes <= 0 || e.limit_ == 0 || now <= int64_t(e.limit_);
  }
  static bool KeepGoing(void* self, double) { return !IsCancelled(static_cast<Embree*>(self)->cancel_); }

  rb_geometry geometry_;
  Config config_;
  const volatile int* cancel_;
  uint64_t limit_;
  std::atomic<int64_t> bytes_{0};
  Owned<RTCDevice> device_;
  Owned<RTCScene> scene_;
};

}  // namespace

RTCScene EmbreeSceneOf(const rb_tree* tree) { return reinterpret_cast<const Embree*>(tree)->scene(); }

RAYBENCH_STRUCTURE(embree, Embree)

}  // namespace raybench
