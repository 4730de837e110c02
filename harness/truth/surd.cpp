#include "harness/truth/surd.h"

#include <cmath>
#include <limits>

namespace raybench {
namespace {

/// Sign of a + b sqrt(p) + c sqrt(q).
int SignOfTwo(const Int& a, const Int& b, const Int& p, const Int& c, const Int& q) {
  const int first = SignOf(a, b, p), second = q.is_zero() ? 0 : c.sign();
  if (second == 0 || first == second) return first;
  if (first == 0) return second;
  // Of different sign: the larger square decides.
  return first * SignOf(Int(a * a + b * b * p - c * c * q), Int(2 * a * b), p);
}

/// To within 2^-63, relatively. Exponents of long double hold degree 12 in floats.
long double ToLongDouble(const Int& x) {
  if (x.is_zero()) return 0;
  const Int size = abs(x);
  const int shift = std::max(0, int(msb(size)) - 63);
  const long double value = std::ldexp((long double)(uint64_t(size >> shift)), shift);
  return x.sign() < 0 ? -value : value;
}

/// To within 2^-59, relatively: of the two forms of a root the one that does not cancel.
long double Evaluate(const Surd& x) {
  const long double h = ToLongDouble(x.h), a = ToLongDouble(x.a),
                    root = (long double)(x.s) * std::sqrt(ToLongDouble(x.q));
  if (h * root >= 0) return (h + root) / a;
  return ToLongDouble(Int(x.h * x.h - x.q)) / (a * (h - root));
}

}  // namespace

int LowestBit(double x) {
  if (x == 0) return std::numeric_limits<int>::max();
  int exponent;
  const auto mantissa = uint64_t(std::ldexp(std::fabs(std::frexp(x, &exponent)), 53));
  return exponent - 53 + __builtin_ctzll(mantissa);
}

Int ToInt(double x, int shift) {
  if (x == 0) return 0;
  int exponent;
  const Int mantissa = int64_t(std::ldexp(std::frexp(x, &exponent), 53));
  shift += exponent - 53;
  return shift >= 0 ? Int(mantissa << shift) : Int(mantissa >> -shift);
}

Surd::Surd(Int h_, int s_, Int q_, Int a_) : h(std::move(h_)), s(s_), q(std::move(q_)), a(std::move(a_)) {
  if (a.sign() < 0) {
    h = -h;
    a = -a;
    s = -s;
  }
}

Surd::Surd(double value) : s(0), q(0) {
  const int shift = value == 0 ? 0 : std::max(0, -LowestBit(value));
  h = ToInt(value, shift);
  a = Int(1) << shift;
}

Surd::Surd(const exact::Ratio& ratio) : s(0), q(0) {
  int low = 0;
  for (const auto* e : {&ratio.numerator, &ratio.denominator})
    for (int i = 0; i < e->size; ++i) low = std::min(low, LowestBit(e->term[i]));
  const auto sum = [&](const exact::Expansion<24>& e) {
    Int total = 0;
    for (int i = 0; i < e.size; ++i) total += ToInt(e.term[i], -low);
    return total;
  };
  h = sum(ratio.numerator);
  a = sum(ratio.denominator);
}

int SignOf(const Int& a, const Int& b, const Int& q) {
  const int first = a.sign(), second = q.is_zero() ? 0 : b.sign();
  if (second == 0 || first == second) return first;
  if (first == 0) return second;
  return first * Int(a * a - b * b * q).sign();
}

int Compare(const Surd& x, const Surd& y) {
  return SignOfTwo(Int(x.h * y.a - y.h * x.a), Int(x.s * y.a), x.q, Int(-y.s * x.a), y.q);
}

template <class T>
T Round(const Surd& x) {
  const long double value = Evaluate(x);
  const T nearest = T(value);
  if (std::isinf(nearest)) return nearest;
  // Only next to the middle between two numbers can the value have been rounded to the wrong one.
  constexpr T infinity = std::numeric_limits<T>::infinity();
  for (const T limit : {-infinity, infinity}) {
    const T other = std::nextafter(nearest, limit);
    if (std::isinf(other)) continue;
    const long double middle = ((long double)(nearest) + other) / 2;
    if (std::fabs(value - middle) > 0x1p-58L * std::fabs(value)) continue;
    const int shift = std::max(0, -std::min(LowestBit(nearest), LowestBit(other)));
    const int side = Compare(x, Surd(Int(ToInt(nearest, shift) + ToInt(other, shift)), Int(Int(2) << shift)));
    // Of two neighbours the even one has the higher lowest bit.
    if (side == 0 ? LowestBit(other) > LowestBit(nearest) : (side > 0) == (limit > 0)) return other;
  }
  return nearest;
}
template float Round<float>(const Surd&);
template double Round<double>(const Surd&);

}  // namespace raybench
