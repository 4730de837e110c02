#include "accel/kd/events.h"

#include <algorithm>

namespace raybench {

KdPlane SweepKdEvents(std::span<const KdEvent> events, uint32_t n, const KdAxisCost& cost) {
  KdPlane best;
  uint32_t left = 0, right = n;  // primitives that begin before, or end behind, the plane
  for (size_t i = 0; i < events.size();) {
    const uint64_t pos = events[i] >> 32;
    uint32_t here[3] = {0, 0, 0};
    do {
      ++here[TypeOf(events[i])];
    } while (++i < events.size() && events[i] >> 32 == pos);
    const uint32_t planar = here[uint32_t(KdEventType::kPlanar)];
    right -= here[uint32_t(KdEventType::kEnd)] + planar;
    if (const float p = PosOf(events[i - 1]); cost.Splits(p)) {
      best.Take(cost(p, left + planar, right));
      if (planar > 0) best.Take(cost(p, left, right + planar, false));
    }
    left += here[uint32_t(KdEventType::kStart)] + planar;
  }
  return best;
}

namespace {

/// out holds `old` sorted events behind room for the fresh ones; merges both from the front.
size_t MergeInPlace(std::span<const KdEvent> fresh, size_t old, KdEvent* out) {
  const size_t size = fresh.size() + old;
  size_t i = fresh.size();
  for (size_t j = 0, k = 0; j < fresh.size(); ++k)
    out[k] = i < size && out[i] < fresh[j] ? out[i++] : fresh[j++];  // k never passes i
  return size;
}

}  // namespace

KdEventCounts SplitKdEvents(std::span<const KdEvent> events, std::span<const KdPlace> places,
                            std::span<KdEvent> fresh_left, std::span<KdEvent> fresh_right, KdEvent* left,
                            KdEvent* right) {
  KdEvent *l = left + fresh_left.size(), *r = right + fresh_right.size();
  for (const KdEvent e : events) {
    const KdPlace place = places[RefOf(e)];
    *l = *r = (e & ~KdEvent{kMaxKdRefs}) | place.place();
    l += place.IsLeft();
    r += place.IsRight();
  }
  const size_t old_left = size_t(l - left) - fresh_left.size();
  const size_t old_right = size_t(r - right) - fresh_right.size();
  std::sort(fresh_left.begin(), fresh_left.end());
  std::sort(fresh_right.begin(), fresh_right.end());
  return {MergeInPlace(fresh_left, old_left, left), MergeInPlace(fresh_right, old_right, right)};
}

}  // namespace raybench
