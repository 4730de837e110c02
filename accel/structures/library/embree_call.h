// Embree's calls for single rays, packets and streams, alike for its versions 3 and 4.
#pragma once

#include <cstring>
#include <limits>
#include <type_traits>

#include "accel/structures/library/embree.h"

namespace raybench {

/// Up to kSize rays, a number a lane. Lanes that were not set hold no ray.
template <int kSize>
struct EmbreePacket {
  std::conditional_t<kSize == 4, RTCRayHit4, std::conditional_t<kSize == 8, RTCRayHit8, RTCRayHit16>> rays;
  alignas(64) int valid[kSize];

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
  }
  bool Has(int k) const { return valid[k] != 0; }
  bool IsOccluded(int k) const { return rays.ray.tfar[k] < 0; }
};

/// What every call takes beside the rays.
class EmbreeCall {
 public:
  EmbreeCall(RTCScene scene, bool coherent) : scene_(scene) {
#if RAYBENCH_EMBREE_MAJOR >= 4
    rtcInitIntersectArguments(&closest_);
    rtcInitOccludedArguments(&any_);
    if (coherent) closest_.flags = any_.flags = RTC_RAY_QUERY_FLAG_COHERENT;
#else
    rtcInitIntersectContext(&context_);
    if (coherent) context_.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
#endif
  }

#if RAYBENCH_EMBREE_MAJOR >= 4
  void Closest(RTCRayHit& ray) { rtcIntersect1(scene_, &ray, &closest_); }
  void Closest(EmbreePacket<4>& p) { rtcIntersect4(p.valid, scene_, &p.rays, &closest_); }
  void Closest(EmbreePacket<8>& p) { rtcIntersect8(p.valid, scene_, &p.rays, &closest_); }
  void Closest(EmbreePacket<16>& p) { rtcIntersect16(p.valid, scene_, &p.rays, &closest_); }
  void Any(RTCRay& ray) { rtcOccluded1(scene_, &ray, &any_); }
  void Any(EmbreePacket<4>& p) { rtcOccluded4(p.valid, scene_, &p.rays.ray, &any_); }
  void Any(EmbreePacket<8>& p) { rtcOccluded8(p.valid, scene_, &p.rays.ray, &any_); }
  void Any(EmbreePacket<16>& p) { rtcOccluded16(p.valid, scene_, &p.rays.ray, &any_); }
#else
  void Closest(RTCRayHit& ray) { rtcIntersect1(scene_, &context_, &ray); }
  void Closest(EmbreePacket<4>& p) { rtcIntersect4(p.valid, scene_, &context_, &p.rays); }
  void Closest(EmbreePacket<8>& p) { rtcIntersect8(p.valid, scene_, &context_, &p.rays); }
  void Closest(EmbreePacket<16>& p) { rtcIntersect16(p.valid, scene_, &context_, &p.rays); }
  void Any(RTCRay& ray) { rtcOccluded1(scene_, &context_, &ray); }
  void Any(EmbreePacket<4>& p) { rtcOccluded4(p.valid, scene_, &context_, &p.rays.ray); }
  void Any(EmbreePacket<8>& p) { rtcOccluded8(p.valid, scene_, &context_, &p.rays.ray); }
  void Any(EmbreePacket<16>& p) { rtcOccluded16(p.valid, scene_, &context_, &p.rays.ray); }

  void ClosestStream(RTCRayHit* rays, unsigned n) {
    rtcIntersect1M(scene_, &context_, rays, n, sizeof *rays);
  }
  void AnyStream(RTCRayHit* rays, unsigned n) {
    rtcOccluded1M(scene_, &context_, &rays->ray, n, sizeof *rays);
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
  RTCIntersectArguments closest_;
  RTCOccludedArguments any_;
#else
  RTCIntersectContext context_;
#endif
};

}  // namespace raybench
