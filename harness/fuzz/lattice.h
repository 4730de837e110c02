// What is true of rays and triangles whose coordinates are small integers, by integers: the whole list of
// hits, and only where no float test may answer otherwise. It shares nothing with the oracles.
#pragma once

#include <optional>
#include <vector>

#include "harness/fuzz/case.h"

namespace raybench::fuzz {

/// Coordinates of vertices and directions are integers of at most this, those of origins of twice as much. The
/// edge functions of a ray that misses an edge are then at least 1/8, and err in float by less than 2^-11
/// (VERDICTS.md): nothing but the integers' answer is right.
inline constexpr int kLattice = 8;

/// A hit at t = num / den, den > 0.
struct LatticeHit {
  int64_t num, den;
  uint32_t prim;

  double t() const { return double(num) / double(den); }
  /// What a float test's t may be off: it divides the sum of the edge functions times distances along an axis,
  /// at most 3 kLattice each, by the sum of the edge functions times the direction's length along it, at most
  /// kLattice. Three edge functions err by less than 2^-11 each; the rest is rounding of the quotient.
  double FloatError() const {
    constexpr double kSum = 3 * 0x1p-11;
    return kLattice * (3 + t()) * kSum / double(den) + 0x1p-20 * t();
  }
  bool IsAt(const LatticeHit& other) const { return num * other.den == other.num * den; }
};

/// Every triangle that the ray's line meets at t > 0, by t, then number, whatever its interval. Nothing where
/// the line touches an edge, a vertex or a plane that it lies in, or starts on a triangle; and for a case
/// whose numbers are no small integers.
std::optional<std::vector<LatticeHit>> LatticeHits(const Case& c, const rb_ray& ray);

}  // namespace raybench::fuzz
