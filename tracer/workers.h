// Work in chunks of fixed size, so that results do not depend on the number of threads.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "accel/base/parallel.h"

namespace raybench {

class Workers {
 public:
  static constexpr size_t kChunk = 4096;  // rays of a task

  /// 0: as many as may be started.
  explicit Workers(uint32_t threads)
      : threads_(threads == 0 ? MostThreads() : std::min(threads, MostThreads())), arena_(threads_) {}
  uint32_t threads() const { return threads_; }

  /// Calls work(chunk, begin, end) for every chunk of [0, n), in parallel.
  template <class Work>
  void ForChunks(size_t n, const Work& work) {
    arena_.Run([&] {
      ParallelFor(size_t{0}, ChunkCount(n),
                  [&](size_t chunk) { work(chunk, chunk * kChunk, std::min(n, (chunk + 1) * kChunk)); });
    });
  }
  template <class Work>
  void ForEach(size_t n, const Work& work) {
    arena_.Run([&] { ParallelFor(size_t{0}, n, work); });
  }
  static size_t ChunkCount(size_t n) { return (n + kChunk - 1) / kChunk; }

 private:
  uint32_t threads_;
  Arena arena_;
};

/// Fills `all` with the parts, in order. `part(i)` is the i-th vector, `copy(i, from, to)` copies
/// with fix-ups.
template <class T, class Part, class Copy>
void Concatenate(Workers& workers, size_t count, std::vector<T>& all, const Part& part, const Copy& copy) {
  std::vector<size_t> begin(count + 1, 0);
  for (size_t i = 0; i < count; ++i) begin[i + 1] = begin[i] + part(i).size();
  all.resize(begin[count]);
  workers.ForEach(count, [&](size_t i) { copy(i, part(i), all.data() + begin[i]); });
}

template <class T, class Part>
void Concatenate(Workers& workers, size_t count, std::vector<T>& all, const Part& part) {
  Concatenate(workers, count, all, part,
              [](size_t, const std::vector<T>& from, T* to) { std::copy(from.begin(), from.end(), to); });
}

}  // namespace raybench
