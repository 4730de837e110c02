// Seeded random numbers that are the same on every machine: no std:: distributions, no libm transcendentals.
#pragma once

#include <cstdint>

#include "accel/base/vec3.h"

namespace raybench {

/// SplitMix64 (Steele, Lea, Flood 2014). Any (seed, stream) pair starts an independent sequence, so parallel
/// work takes one stream an item and does not depend on the thread count.
class Random {
 public:
  explicit Random(uint64_t seed, uint64_t stream = 0) : state_(Scramble(seed) ^ Scramble(~stream)) {}

  uint64_t NextBits() {
    state_ += 0x9E3779B97F4A7C15u;
    return Scramble(state_);
  }
  /// Uniform in [0, 1), 53 bits.
  double NextDouble() { return double(NextBits() >> 11) * 0x1p-53; }
  /// Uniform in [0, 1), 24 bits.
  float NextFloat() { return float(NextBits() >> 40) * 0x1p-24f; }
  /// Uniform in [0, n), n > 0; the bias of the multiply method is below n / 2^64.
  uint64_t Below(uint64_t n) { return uint64_t(((static_cast<unsigned __int128>(NextBits()) * n) >> 64)); }
  /// Uniform on the unit sphere, by rejection.
  Vec3d UnitVector() {
    for (;;) {
      Vec3d v{2 * NextDouble() - 1, 2 * NextDouble() - 1, 2 * NextDouble() - 1};
      double q = Dot(v, v);
      if (q > 1e-4 && q <= 1) return v * (1 / std::sqrt(q));
    }
  }

 private:
  static uint64_t Scramble(uint64_t z) {
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return z ^ (z >> 31);
  }
  uint64_t state_;
};

}  // namespace raybench
