// The sweep over all planes that bound a primitive: Wald and Havran (2006), "On building fast kd-trees for
// ray tracing, and on doing that in O(N log N)".
//
// A primitive's box makes two events on each axis, its start and its end, or one if it lies in a plane. Lists
// are sorted once, at the root; a split keeps the order of those that stay and merges in those of clipped
// primitives. An event is one number that sorts in a total order, so lists do not depend on who sorted them:
//
//     coordinate, its bits mapped so that they compare as unsigned : 32 | type : 2 | primitive : 30
#pragma once

#include <bit>
#include <cstdint>
#include <span>

#include "accel/kd/split.h"

namespace raybench {

using KdEvent = uint64_t;
enum class KdEventType : uint32_t { kEnd, kPlanar, kStart };  ///< in the order in which the sweep meets them

/// Primitives of a cell are told apart by their place in its list, below 2^30.
inline constexpr uint32_t kMaxKdRefs = (1u << 30) - 1;

inline KdEvent MakeKdEvent(float pos, KdEventType type, uint32_t ref) {
  const uint32_t bits = std::bit_cast<uint32_t>(pos);
  const uint32_t ordered = (bits & 0x80000000u) != 0 ? ~bits : bits | 0x80000000u;
  return uint64_t(ordered) << 32 | uint32_t(type) << 30 | ref;
}
inline float PosOf(KdEvent e) {
  const uint32_t ordered = uint32_t(e >> 32);
  return std::bit_cast<float>((ordered & 0x80000000u) != 0 ? ordered & 0x7FFFFFFFu : ~ordered);
}
inline uint32_t TypeOf(KdEvent e) { return uint32_t(e) >> 30; }
inline uint32_t RefOf(KdEvent e) { return uint32_t(e) & kMaxKdRefs; }

/// Writes the events of a box and returns how many there are, 1 or 2.
inline uint32_t WriteKdEvents(const Bounds3& box, int axis, uint32_t ref, KdEvent* out) {
  const float lo = box.lo[axis], hi = box.hi[axis];
  if (lo == hi) {
    out[0] = MakeKdEvent(lo, KdEventType::kPlanar, ref);
    return 1;
  }
  out[0] = MakeKdEvent(lo, KdEventType::kStart, ref);
  out[1] = MakeKdEvent(hi, KdEventType::kEnd, ref);
  return 2;
}

/// The cheapest plane across an axis among all events of n primitives; the first of equal ones.
KdPlane SweepKdEvents(std::span<const KdEvent> events, uint32_t n, const KdAxisCost& cost);

/// Where a split puts a primitive of the parent: its place in the left child's list or in the right one's;
/// or, if the plane cuts it, into either or both of them anew, with other events.
class KdPlace {
 public:
  static KdPlace Left(uint32_t place) { return KdPlace{place}; }
  static KdPlace Right(uint32_t place) { return KdPlace{place | kRight}; }
  static KdPlace Anew() { return KdPlace{kAnew}; }
  bool IsLeft() const { return (bits_ & (kRight | kAnew)) == 0; }
  bool IsRight() const { return (bits_ & kRight) != 0; }
  uint32_t place() const { return bits_ & kMaxKdRefs; }

 private:
  static constexpr uint32_t kRight = 1u << 30, kAnew = 1u << 31;
  explicit KdPlace(uint32_t bits) : bits_(bits) {}
  uint32_t bits_;
};

/// Sends the parent's events to where their primitives go, in order, and merges in those of primitives that
/// stand in a child anew, which it sorts. `left` and `right` have room for one event more than they get.
/// Returns how many that is.
struct KdEventCounts {
  size_t left, right;
};
KdEventCounts SplitKdEvents(std::span<const KdEvent> events, std::span<const KdPlace> places,
                            std::span<KdEvent> fresh_left, std::span<KdEvent> fresh_right, KdEvent* left,
                            KdEvent* right);

}  // namespace raybench
