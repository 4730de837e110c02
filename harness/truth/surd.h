// Exact numbers of the form that rays meet quadrics at.
//
// Floats are integers times a power of two, so integers of any length hold every quantity without error and
// no precision has to be guessed. How long they get: a float has 24 bits, and those of one ray and one
// primitive span S binary places more. A cone's radicand is of degree 12 in them, the comparison of two such
// roots of degree 48, so numbers have some 48 (24 + S) bits: 2,000 in an ordinary scene, 14,000 when
// exponents span all that float has. A filter in double (harness/truth/approx.h) leaves few cases for these.
#pragma once

#include <boost/multiprecision/cpp_int.hpp>

#include "accel/ray/exact.h"

namespace raybench {

/// Integer of any length; the first 512 bits need no memory from the heap.
using Int =
    boost::multiprecision::number<boost::multiprecision::cpp_int_backend<512>, boost::multiprecision::et_off>;

/// Exponent of the lowest bit set in a finite x; a large number for 0.
int LowestBit(double x);
/// x 2^shift, which must be an integer.
Int ToInt(double x, int shift);

/// (h + s sqrt(q)) / a with a > 0, q >= 0 and s one of -1, 0, 1.
struct Surd {
  Int h;
  int s;
  Int q, a;

  /// Divides by any a but 0.
  Surd(Int h, int s, Int q, Int a);
  explicit Surd(Int numerator, Int denominator = 1)
      : Surd(std::move(numerator), 0, 0, std::move(denominator)) {}
  explicit Surd(double value);
  explicit Surd(const exact::Ratio& ratio);
};

/// Sign of a + b sqrt(q), q >= 0.
int SignOf(const Int& a, const Int& b, const Int& q);
/// Sign of x - y.
int Compare(const Surd& x, const Surd& y);

/// Correctly rounded to nearest, ties to even; T is float or double.
template <class T>
T Round(const Surd& x);

}  // namespace raybench
