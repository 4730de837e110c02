// Memory of one recursive task, given back in the order opposite to its taking. Not initialised.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <type_traits>
#include <vector>

#include "accel/base/huge_array.h"

namespace raybench {

/// Counts what a build takes, from all of its threads, against its limit.
class MemoryMeter {
 public:
  explicit MemoryMeter(uint64_t limit) : limit_(limit) {}
  /// Throws std::runtime_error if that is more than the limit (0: none) allows.
  void Take(uint64_t bytes) {
    if (used_.fetch_add(bytes) + bytes > limit_ && limit_ > 0)
      throw std::runtime_error("building exceeds the memory limit");
  }
  void GiveBack(uint64_t bytes) { used_ -= bytes; }

 private:
  uint64_t limit_;
  std::atomic<uint64_t> used_{0};
};

class LifoMemory {
 public:
  explicit LifoMemory(MemoryMeter& meter) : meter_(meter) {}
  LifoMemory(const LifoMemory&) = delete;
  LifoMemory& operator=(const LifoMemory&) = delete;
  ~LifoMemory() {
    for (const HugeArray<std::byte>& chunk : chunks_) meter_.GiveBack(chunk.bytes());
  }

  template <class T>
  std::span<T> Take(size_t n) {
    static_assert(std::is_trivially_copyable_v<T> && alignof(T) <= kAlign);
    const size_t bytes = (n * sizeof(T) + kAlign - 1) / kAlign * kAlign;
    while (chunk_ < chunks_.size() && chunks_[chunk_].size() - used_ < bytes) ++chunk_, used_ = 0;
    if (chunk_ == chunks_.size()) {
      const size_t size = std::max(bytes, kChunk);
      meter_.Take(size);
      chunks_.emplace_back(size);
    }
    T* data = reinterpret_cast<T*>(chunks_[chunk_].data() + used_);
    used_ += bytes;
    return {data, n};
  }

  /// Gives back, at the end of its life, whatever was taken since its beginning.
  class Frame {
   public:
    explicit Frame(LifoMemory& memory) : memory_(memory), chunk_(memory.chunk_), used_(memory.used_) {}
    Frame(const Frame&) = delete;
    Frame& operator=(const Frame&) = delete;
    ~Frame() { memory_.chunk_ = chunk_, memory_.used_ = used_; }

   private:
    LifoMemory& memory_;
    size_t chunk_, used_;
  };

 private:
  static constexpr size_t kAlign = 16, kChunk = size_t{1} << 18;

  MemoryMeter& meter_;
  std::vector<HugeArray<std::byte>> chunks_;
  size_t chunk_ = 0, used_ = 0;
};

}  // namespace raybench
