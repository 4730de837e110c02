// Counting is a template policy: the timing instantiation of a traversal uses NoCounting, whose functions
// are empty.
#pragma once

#include <cstdint>

#include "accel/contract/raybench.h"

namespace raybench {

struct NoCounting {
  static constexpr bool kCounts = false;
  void Step(uint64_t /*bytes*/) {}
  void Bounds(uint64_t /*n*/) {}
  void Leaf(bool /*empty*/) {}
  void Prims(uint64_t /*n*/, uint64_t /*bytes*/) {}
};

/// Per-ray counters with Havran's meanings (see rb_counts).
class Counting {
 public:
  static constexpr bool kCounts = true;
  void Step(uint64_t bytes) { ++counts_.steps, counts_.bytes += bytes; }
  void Bounds(uint64_t n) { counts_.bounds += n; }
  void Leaf(bool empty) { ++counts_.leaves, counts_.empty_leaves += empty; }
  void Prims(uint64_t n, uint64_t bytes) { counts_.prims += n, counts_.bytes += bytes; }
  const rb_counts& counts() const { return counts_; }

 private:
  rb_counts counts_{};
};

}  // namespace raybench
