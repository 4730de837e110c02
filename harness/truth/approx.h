// Double arithmetic that carries a bound of its error: the filter in front of exact arithmetic.
#pragma once

#include <cmath>
#include <limits>

#include "accel/base/vec3.h"
#include "accel/ray/exact.h"

namespace raybench {

/// A number that lies within e of v. An overflow leaves a bound that is infinite or NaN, and then no
/// comparison with it holds.
struct Approx {
  double v = 0, e = 0;

  /// With what the double v lost to rounding, underflow included. `bound` is itself a result of no more than
  /// eight roundings, which the factor covers.
  static Approx Rounded(double v, double bound) {
    return {v, (bound + exact::kEps * std::fabs(v)) * (1 + 0x1p-49) + 0x1p-1074};
  }
  /// a - b for exact a and b.
  static Approx Difference(double a, double b) {
    double error;
    const double v = exact::TwoSum(a, -b, error);
    return {v, std::fabs(error)};
  }
  double lo() const { return v - e; }
  double hi() const { return v + e; }
  /// 0: unknown.
  int Sign() const { return v > e ? 1 : v < -e ? -1 : 0; }
};

inline Approx operator+(Approx a, Approx b) { return Approx::Rounded(a.v + b.v, a.e + b.e); }
inline Approx operator-(Approx a) { return {-a.v, a.e}; }
inline Approx operator-(Approx a, Approx b) { return a + -b; }
inline Approx operator*(Approx a, Approx b) {
  return Approx::Rounded(a.v * b.v, std::fabs(a.v) * b.e + std::fabs(b.v) * a.e + a.e * b.e);
}
inline Approx operator/(Approx a, Approx b) {
  const double rest = std::fabs(b.v) - b.e, v = a.v / b.v;
  if (!(rest > 0)) return {0, std::numeric_limits<double>::infinity()};
  return Approx::Rounded(v, (a.e + std::fabs(v) * b.e) / rest + exact::kEps * std::fabs(v));
}
/// Of a positive number, a.Sign() > 0.
inline Approx Sqrt(Approx a) {
  // sqrt(v) - sqrt(v - e) = e / (sqrt(v) + sqrt(v - e))
  const double v = std::sqrt(a.v);
  return Approx::Rounded(v, a.e / v);
}

}  // namespace raybench
