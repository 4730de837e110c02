// Stands for oneTBB's algorithms in builds with ThreadSanitizer, which finds these headers first.
//
// The oneTBB that distributions package is not instrumented: ThreadSanitizer sees neither the order in which
// it hands out tasks nor that a loop waits for them, and reports thousands of races that are none. Here the
// same loops run on threads of the standard library, whose start and end it sees. So every report is about
// our own code, none has to be suppressed, and the loops' bodies run concurrently with no order between them
// but the one that the program may rely on: a loop begins after what stands before it and ends before what
// follows. Each thread gets one contiguous part, always the same, whatever the grain: a race between
// neighbouring iterations is met in every run. oneTBB's own work is not under test.
//
// Only what raybench uses is here; what it may use beside it (blocked_range, global_control, info) are
// oneTBB's own headers.
#pragma once

#include <tbb/blocked_range.h>
#include <tbb/global_control.h>
#include <tbb/info.h>

#include <algorithm>
#include <atomic>
#include <exception>
#include <thread>
#include <utility>
#include <vector>

namespace tbb {
namespace stand_in {

/// Threads that nested loops may still start. Relaxed: must not order what the loops do.
inline std::atomic<int> spare{12};
/// Of the arena that this thread works in; 0: of none.
inline thread_local int arena_limit = 0;

inline size_t Allowed() {
  const int limit = int(global_control::active_value(global_control::max_allowed_parallelism));
  const int most = limit < info::default_concurrency() ? limit : 4;
  return size_t(arena_limit > 0 ? std::min(arena_limit, most) : most);
}

/// Takes up to `wanted` threads from those to spare, for its lifetime.
class Taken {
 public:
  explicit Taken(int wanted) {
    int left = spare.load(std::memory_order_relaxed);
    do count_ = std::clamp(left, 0, wanted);
    while (!spare.compare_exchange_weak(left, left - count_, std::memory_order_relaxed));
  }
  ~Taken() { spare.fetch_add(count_, std::memory_order_relaxed); }
  Taken(const Taken&) = delete;
  size_t count() const { return size_t(count_); }

 private:
  int count_;
};

/// Calls part(k, begin, end) for a share of [0, n) on each of several threads, this one included. What is
/// thrown first in the order of the parts is thrown on.
template <class Part>
void ForParts(size_t n, const Part& part) {
  if (n == 0) return;
  const Taken threads(int(std::min(n, Allowed()) - 1));
  const size_t parts = threads.count() + 1;
  std::vector<std::exception_ptr> thrown(parts);
  const auto run = [&](size_t k) {
    try {
      part(k, n * k / parts, n * (k + 1) / parts);
    } catch (...) {
      thrown[k] = std::current_exception();
    }
  };
  std::vector<std::thread> others;
  for (size_t k = 1; k < parts; ++k)
    others.emplace_back([&run, k, limit = arena_limit] { arena_limit = limit, run(k); });
  run(0);
  for (std::thread& t : others) t.join();
  for (const std::exception_ptr& e : thrown)
    if (e) std::rethrow_exception(e);
}

}  // namespace stand_in

template <class Index, class Body>
void parallel_for(Index begin, Index end, const Body& body) {
  if (begin >= end) return;
  stand_in::ForParts(size_t(end - begin), [&](size_t, size_t first, size_t last) {
    for (size_t i = first; i < last; ++i) body(Index(begin + Index(i)));
  });
}

struct simple_partitioner {};

/// Pieces are as large as a thread's part, whatever the partitioner.
template <class Value, class Body, class... Partitioner>
void parallel_for(const blocked_range<Value>& range, const Body& body, const Partitioner&...) {
  stand_in::ForParts(range.size(), [&](size_t, size_t first, size_t last) {
    body(blocked_range<Value>(range.begin() + Value(first), range.begin() + Value(last), range.grainsize()));
  });
}

template <class Index, class Result, class Body, class Join>
Result parallel_reduce(const blocked_range<Index>& range, const Result& identity, const Body& body,
                       const Join& join) {
  struct Slot {  // of its own, also if it is a bool
    Result value;
  };
  std::vector<Slot> results(stand_in::Allowed(), Slot{identity});
  stand_in::ForParts(range.size(), [&](size_t k, size_t first, size_t last) {
    results[k].value = body(
        blocked_range<Index>(range.begin() + Index(first), range.begin() + Index(last), range.grainsize()),
        identity);
  });
  Result sum = results[0].value;
  for (size_t k = 1; k < results.size(); ++k) sum = join(sum, results[k].value);
  return sum;
}

template <class First, class Second>
void parallel_invoke(const First& first, const Second& second) {
  stand_in::ForParts(2, [&](size_t, size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) i == 0 ? first() : second();
  });
}

template <class Iterator, class... Compare>
void parallel_sort(Iterator begin, Iterator end, const Compare&... less) {
  std::sort(begin, end, less...);
}

class task_arena {
 public:
  static constexpr int automatic = -1;
  explicit task_arena(int limit = automatic) : limit_(limit) {}
  void initialize(int limit) { limit_ = limit; }
  template <class Fn>
  auto execute(Fn&& fn) {
    struct Enter {
      int saved;
      ~Enter() { stand_in::arena_limit = saved; }
    } enter{std::exchange(stand_in::arena_limit, std::max(limit_, 0))};
    return fn();
  }

 private:
  int limit_;
};

}  // namespace tbb
