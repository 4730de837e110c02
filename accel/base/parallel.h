// Loops on threads: the one place that names oneTBB. Builds with ThreadSanitizer have another one of the same
// name and shape (tests/tsan/accel/base/parallel.h), since it cannot see into oneTBB.
//
// Nothing here may decide a result: which thread does what, and how a range is cut, changes from run to run.
// So bodies write to places of their own, and joins give the same in any order.
#pragma once

#include <tbb/blocked_range.h>
#include <tbb/global_control.h>
#include <tbb/info.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>
#include <tbb/parallel_reduce.h>
#include <tbb/parallel_sort.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>

namespace raybench {

/// Half-open, cut into pieces no smaller than about half a grain.
template <class Index>
using Range = tbb::blocked_range<Index>;

/// body(i) for each i of [begin, end).
template <class Index, class Body>
void ParallelFor(Index begin, Index end, const Body& body) {
  tbb::parallel_for(begin, end, body);
}

/// body(piece) for pieces that together are the range.
template <class Index, class Body>
void ParallelFor(const Range<Index>& range, const Body& body) {
  tbb::parallel_for(range, body);
}

/// value = body(piece, value) over pieces, from `identity` on; join(value, value) adds up.
template <class Index, class Value, class Body, class Join>
Value ParallelReduce(const Range<Index>& range, const Value& identity, const Body& body, const Join& join) {
  return tbb::parallel_reduce(range, identity, body, join);
}

template <class First, class Second>
void ParallelInvoke(const First& first, const Second& second) {
  tbb::parallel_invoke(first, second);
}

/// Not stable: sort by a total order.
template <class Iterator, class... Less>
void ParallelSort(Iterator begin, Iterator end, const Less&... less) {
  tbb::parallel_sort(begin, end, less...);
}

/// Threads that this process may use, at least 1; no more than a ThreadLimit allows.
inline uint32_t MostThreads() {
  return uint32_t(tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism));
}

/// Processors that this process may run on, at least 1.
inline uint32_t Processors() { return uint32_t(std::max(1, tbb::info::default_concurrency())); }

/// Loops of a call run on at most so many threads, the calling one included.
class Arena {
 public:
  /// 0: as many as there are.
  explicit Arena(uint32_t threads = 0) : arena_(threads == 0 ? tbb::task_arena::automatic : int(threads)) {}
  template <class Fn>
  auto Run(Fn&& fn) {
    return arena_.execute(std::forward<Fn>(fn));
  }

 private:
  tbb::task_arena arena_;
};

/// While it lives, nothing in this process runs on more threads, libraries over oneTBB included.
class ThreadLimit {
 public:
  explicit ThreadLimit(uint32_t threads)
      : control_(tbb::global_control::max_allowed_parallelism, std::max(1u, threads)) {}

 private:
  tbb::global_control control_;
};

}  // namespace raybench
