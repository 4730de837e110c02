// Embree's calls for single rays, packets and streams, alike for its versions 3 and 4.
#pragma once

#include <cmath>
#include <cstring>
#include <limits>
#include <type_traits>

#include "accel/structures/library/embree.h"

namespace raybench {

/// Whether rays go the same way: along each axis all forwards or all backwards, none parallel. Told that others
/// were coherent, Embree 3.13.5 was seen not to return (rtcOccluded16, robust and compact).
class SameWay {
 public:
  void Add(const RTCRay& ray) {
    constexpr float kParallel = 1e-18f;  // where Embree's boxes take no reciprocal
    for (int a = 0; const float d : {ray.dir_x, ray.dir_y, ray.dir_z})
      seen_ |= (std::fabs(d) < kParallel ? 3u : d > 0 ? 1u : 2u) << 2 * a++;
  }
  explicit operator bool() const { return seen_ != 0 && (seen_ & seen_ >> 1 & 0b010101) == 0; }

 private:
  unsigned seen_ = 0;  // two bits an axis
};

/// Up to kSize rays, a number a lane. Lanes that were not set hold no ray.
template <int kSize>
struct EmbreePacket {
  std::conditional_t<kSize == 4, RTCRayHit4, std::conditional_t<kSize == 8, RTCRayHit8, RTCRayHit16>> rays;
  alignas(64) int valid[kSize];
  SameWay same_way;

  EmbreePacket() {
    std::memset(&rays, 0, sizeof rays);
    for (int k = 0; k < kSize; ++k)
      valid[k] = 0, rays.hit.geomID[k] = rays.hit.primID[k] = rays.hit.instID[0][k] = RTC_INVALID_GEOMETRY_ID;
  }
  /// A packet has the numbers of a ray in its order.
  void Set(int k, const RTCRay& ray) {
    constexpr size_t kNumber = sizeof(float), kNumbers = 12;
    static_assert(sizeof rays.ray == kSize * kNumbers * kNumber);
    char* const lane = reinterpret_cast<char*>(&rays.ray) + size_t(k) * kNumber;
    for (size_t i = 0; i < kNumbers; ++i)
      std::memcpy(lane + i * kSize * kNumber, reinterpret_cast<const char*>(&ray) + i * kNumber, kNumber);
    valid[k] = -1;
    same_way.Add(ray);
  }
  bool Has(int k) const { return valid[k] != 0; }
  bool IsOccluded(int k) const { return rays.ray.tfar[k] < 0; }
};

/// What every call takes beside the rays.
class EmbreeCall {
 public:
  EmbreeCall(RTCScene scene, bool coherent) : scene_(scene) {
#if RAYBENCH_EMBREE_MAJOR >= 4
    for (int same_way : {0, 1}) {
      rtcInitIntersectArguments(&closest_[same_way]);
      rtcInitOccludedArguments(&any_[same_way]);
      if (coherent && same_way != 0)
        closest_[same_way].flags = any_[same_way].flags = RTC_RAY_QUERY_FLAG_COHERENT;
    }
#else
    for (int same_way : {0, 1}) {
      rtcInitIntersectContext(&context_[same_way]);
      if (coherent && same_way != 0) context_[same_way].flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    }
#endif
  }

#if RAYBENCH_EMBREE_MAJOR >= 4
  void Closest(RTCRayHit& ray) { rtcIntersect1(scene_, &ray, &closest_[0]); }
  void Closest(EmbreePacket<4>& p) { rtcIntersect4(p.valid, scene_, &p.rays, &closest_[bool(p.same_way)]); }
  void Closest(EmbreePacket<8>& p) { rtcIntersect8(p.valid, scene_, &p.rays, &closest_[bool(p.same_way)]); }
  void Closest(EmbreePacket<16>& p) { rtcIntersect16(p.valid, scene_, &p.rays, &closest_[bool(p.same_way)]); }
  void Any(RTCRay& ray) { rtcOccluded1(scene_, &ray, &any_[0]); }
  void Any(EmbreePacket<4>& p) { rtcOccluded4(p.valid, scene_, &p.rays.ray, &any_[bool(p.same_way)]); }
  void Any(EmbreePacket<8>& p) { rtcOccluded8(p.valid, scene_, &p.rays.ray, &any_[bool(p.same_way)]); }
  void Any(EmbreePacket<16>& p) { rtcOccluded16(p.valid, scene_, &p.rays.ray, &any_[bool(p.same_way)]); }
#else
  void Closest(RTCRayHit& ray) { rtcIntersect1(scene_, &context_[0], &ray); }
  void Closest(EmbreePacket<4>& p) { rtcIntersect4(p.valid, scene_, &context_[bool(p.same_way)], &p.rays); }
  void Closest(EmbreePacket<8>& p) { rtcIntersect8(p.valid, scene_, &context_[bool(p.same_way)], &p.rays); }
  void Closest(EmbreePacket<16>& p) { rtcIntersect16(p.valid, scene_, &context_[bool(p.same_way)], &p.rays); }
  void Any(RTCRay& ray) { rtcOccluded1(scene_, &context_[0], &ray); }
  void Any(EmbreePacket<4>& p) { rtcOccluded4(p.valid, scene_, &context_[bool(p.same_way)], &p.rays.ray); }
  void Any(EmbreePacket<8>& p) { rtcOccluded8(p.valid, scene_, &context_[bool(p.same_way)], &p.rays.ray); }
  void Any(EmbreePacket<16>& p) { rtcOccluded16(p.valid, scene_, &context_[bool(p.same_way)], &p.rays.ray); }

  void ClosestStream(RTCRayHit* rays, unsigned n, SameWay same_way) {
    rtcIntersect1M(scene_, &context_[bool(same_way)], rays, n, sizeof *rays);
  }
  void AnyStream(RTCRayHit* rays, unsigned n, SameWay same_way) {
    rtcOccluded1M(scene_, &context_[bool(same_way)], &rays->ray, n, sizeof *rays);
  }
#endif

  /// What a stream leaves out.
  static RTCRay NoRay() {
    RTCRay ray{};
    ray.dir_x = ray.dir_y = ray.dir_z = 1;
    ray.tfar = -std::numeric_limits<float>::infinity();
    return ray;
  }

 private:
  RTCScene scene_;
#if RAYBENCH_EMBREE_MAJOR >= 4
  RTCIntersectArguments closest_[2];  // of any rays, and of those that go the same way
  RTCOccludedArguments any_[2];
#else
  RTCIntersectContext context_[2];  // of any rays, and of those that go the same way
#endif
};

}  // namespace raybench
