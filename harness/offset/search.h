// The search for safe offsets.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "harness/offset/departures.h"

namespace raybench {

/// What was seen at one offset; what was not looked at is absent.
struct Seen {
  float offset = 0;  ///< in units of the scene's file; of no meaning where the cure has none
  uint64_t rays = 0;
  std::optional<uint64_t> self_hits = {}, lost = {};

  bool Safe() const { return self_hits == uint64_t{0} && lost == uint64_t{0}; }
};

/// What is known of one cure.
struct CureFindings {
  SelfIntersection cure;
  bool sized = false;           ///< it has an offset to choose
  std::vector<Seen> scan = {};  ///< over some of the rays, offsets ascending; sized cures only
  /// Around the safe range, over some of the rays (Seen::rays). Absent: none of the offsets tried is such a one.
  std::optional<Seen> below = {}, smallest_safe = {}, largest_safe = {}, above = {};
  Seen named = {};  ///< over all rays: the offset to take, or where none is safe the one that fails least
  double shortest = 0, longest = 0;  ///< way to the begin at `named`, in units of the scene's file
  std::optional<double> ns_per_ray = {};

  /// Some offset is safe, as far as the rays that searched tell.
  bool HasRange() const {
    return smallest_safe && largest_safe && smallest_safe->offset <= largest_safe->offset;
  }
};

class OffsetSearch {
 public:
  /// All must outlive it, unmoved. `work` is told how many rays have been looked at, now and then.
  OffsetSearch(const Scene& scene, const Tree& tree, const LeavingTruth& truth,
               std::span<const Departing> departing, uint32_t threads, std::function<void(uint64_t)> work);

  /// Without the time.
  CureFindings Find(SelfIntersection cure) const;
  /// How many rays Find() looks at, about.
  uint64_t Work(SelfIntersection cure) const;
  /// Fills ns_per_ray: passes over some of the rays that take turns over the cures, on one pinned thread.
  void Time(std::span<CureFindings> findings) const;

  /// Self-hits and lost hits among `rays` rays, evenly picked.
  Seen Look(SelfIntersection cure, float offset, uint64_t rays) const;

 private:
  enum class Fault { kSelfHit, kLost };
  uint64_t Count(SelfIntersection cure, float offset, Fault fault, uint64_t rays, bool first_only) const;
  void FindRange(CureFindings& found, Fault fault, uint64_t rays) const;
  void Name(CureFindings& found) const;
  void MeasureWays(CureFindings& found) const;
  double InScene(float offset) const;
  /// The i-th of `rays` that are evenly picked: they stand in the order of primitives.
  const Departing& Picked(uint64_t i, uint64_t rays) const {
    return departing_[i * departing_.size() / rays];
  }

  const Scene& scene_;
  const Tree& tree_;
  const LeavingTruth& truth_;
  const std::span<const Departing> departing_;
  const uint32_t threads_;
  const std::function<void(uint64_t)> work_;
};

}  // namespace raybench
