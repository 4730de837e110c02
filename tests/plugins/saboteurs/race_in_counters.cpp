#include <atomic>

#include "tests/plugins/saboteurs/bvh.h"

using namespace raybench;
using namespace raybench::saboteurs;

namespace {

/// Additions that other threads' additions get lost in. Atomic loads and stores apart: the race is one of
/// logic, which no sanitizer objects to.
class SharedCounting {
 public:
  static constexpr bool kCounts = true;
  SharedCounting() {
    for (auto* count : {&steps_, &leaves_, &bounds_, &prims_, &bytes_}) count->store(0, kRelaxed);
  }
  void Step(uint64_t bytes) { Add(steps_, 1), Add(bytes_, bytes); }
  void Bounds(uint64_t n) { Add(bounds_, n); }
  void Leaf(bool) { Add(leaves_, 1); }
  void Prims(uint64_t n, uint64_t bytes) { Add(prims_, n), Add(bytes_, bytes); }
  rb_counts counts() const { return {steps_, leaves_, 0, bounds_, prims_, bytes_}; }

 private:
  static constexpr auto kRelaxed = std::memory_order_relaxed;
  using Count = std::atomic<uint64_t>;
  static void Add(Count& count, uint64_t n) { count.store(count.load(kRelaxed) + n, kRelaxed); }

  static inline Count steps_, leaves_, bounds_, prims_, bytes_;
};

struct Fault : HonestBvh {
  static constexpr const char* kName = "race_in_counters";
  static constexpr const char* kDoc = "all threads that count count in the same place";
  template <class Counter>
  using Counts = std::conditional_t<Counter::kCounts, SharedCounting, Counter>;
};

}  // namespace

RAYBENCH_PLUGIN(Bvh<Fault>)
