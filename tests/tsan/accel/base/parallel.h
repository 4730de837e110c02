// Stands for accel/base/parallel.h in builds with ThreadSanitizer, which finds this one first.
//
// The oneTBB that distributions package is not instrumented: ThreadSanitizer sees neither the order in which
// it hands out tasks nor that a loop waits for them, and reports thousands of races that are none. Here the
// same loops run on threads of the standard library, whose start and end it sees. So every report is about
// our own code, none has to be suppressed, and the loops' bodies run concurrently with no order between them
// but the one that the program may rely on: a loop begins after what stands before it and ends before what
// follows. Each thread gets one contiguous part, always the same, whatever the grain: a race between
// neighbouring iterations is met in every run. oneTBB's own work is not under test.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <thread>
#include <utility>
#include <vector>

namespace raybench {
namespace stand_in {

/// Threads that nested loops may still start. Relaxed: must not order what the loops do.
inline std::atomic<int> spare{12};
/// Of the arena that this thread works in; 0: of none.
inline thread_local int arena_limit = 0;

/// Of ThreadLimit; 0: none.
inline std::atomic<int> thread_limit{0};

inline size_t Allowed() {
  const int limit = thread_limit.load(std::memory_order_relaxed), most = limit > 0 ? limit : 4;
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

template <class Index>
class Range {
 public:
  Range(Index begin, Index end, size_t = 1) : begin_(begin), end_(end) {}
  Index begin() const { return begin_; }
  Index end() const { return end_; }
  size_t size() const { return size_t(end_ - begin_); }
  bool empty() const { return !(begin_ < end_); }

 private:
  Index begin_, end_;
};

template <class Index, class Body>
void ParallelFor(Index begin, Index end, const Body& body) {
  if (begin >= end) return;
  stand_in::ForParts(size_t(end - begin), [&](size_t, size_t first, size_t last) {
    for (size_t i = first; i < last; ++i) body(Index(begin + Index(i)));
  });
}

template <class Index, class Body>
void ParallelFor(const Range<Index>& range, const Body& body) {
  if (range.empty()) return;
  stand_in::ForParts(range.size(), [&](size_t, size_t first, size_t last) {
    body(Range<Index>(range.begin() + Index(first), range.begin() + Index(last)));
  });
}

template <class Index, class Value, class Body, class Join>
Value ParallelReduce(const Range<Index>& range, const Value& identity, const Body& body, const Join& join) {
  struct Slot {  // of its own, also if it is a bool
    Value value;
  };
  if (range.empty()) return identity;
  std::vector<Slot> results(stand_in::Allowed(), Slot{identity});
  stand_in::ForParts(range.size(), [&](size_t k, size_t first, size_t last) {
    results[k].value =
        body(Range<Index>(range.begin() + Index(first), range.begin() + Index(last)), identity);
  });
  Value sum = results[0].value;
  for (size_t k = 1; k < results.size(); ++k) sum = join(sum, results[k].value);
  return sum;
}

template <class First, class Second>
void ParallelInvoke(const First& first, const Second& second) {
  stand_in::ForParts(2, [&](size_t, size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) i == 0 ? first() : second();
  });
}

template <class Iterator, class... Less>
void ParallelSort(Iterator begin, Iterator end, const Less&... less) {
  std::sort(begin, end, less...);
}

inline uint32_t Processors() { return std::max(1u, std::thread::hardware_concurrency()); }
inline uint32_t MostThreads() {
  const int limit = stand_in::thread_limit.load(std::memory_order_relaxed);
  return limit > 0 ? uint32_t(limit) : std::max(4u, Processors());
}

class Arena {
 public:
  explicit Arena(uint32_t threads = 0) : limit_(int(threads)) {}
  template <class Fn>
  auto Run(Fn&& fn) {
    struct Enter {
      int saved;
      ~Enter() { stand_in::arena_limit = saved; }
    } enter{std::exchange(stand_in::arena_limit, limit_)};
    return fn();
  }

 private:
  int limit_;
};

class ThreadLimit {
 public:
  explicit ThreadLimit(uint32_t threads)
      : saved_(stand_in::thread_limit.exchange(int(std::max(1u, threads)), std::memory_order_relaxed)) {}
  ~ThreadLimit() { stand_in::thread_limit.store(saved_, std::memory_order_relaxed); }
  ThreadLimit(const ThreadLimit&) = delete;

 private:
  int saved_;
};

}  // namespace raybench
