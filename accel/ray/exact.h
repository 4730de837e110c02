// Exact ray-triangle geometry on float input, without an arithmetic library.
//
// A value is held as an expansion: a sum of doubles that do not overlap (Shewchuk, "Adaptive Precision
// Floating-Point Arithmetic and Fast Robust Geometric Predicates", 1997). Floats are multiples of 2^-149
// below 2^128, and nothing here has more than degree 6 in them, so all bits lie between 2^-894 and 2^790: no
// operation can overflow or underflow, and every result is exact. Each predicate first tries doubles with a
// forward error bound and falls back to expansions only when that cannot decide.
//
// Needs round-to-nearest, subnormals kept, and no fast-math.
#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>

#include "accel/base/vec3.h"
#include "accel/contract/raybench.h"

namespace raybench::exact {

/// A sum of at most N non-overlapping doubles of increasing magnitude, none of them zero.
template <int N>
struct Expansion {
  int size = 0;
  double term[N];

  Expansion() {}
  explicit Expansion(double value) { Push(value); }
  Expansion(const Expansion& other) { Take(other); }
  template <int M>
  requires(M < N) Expansion(const Expansion<M>& other) { Take(other); }
  Expansion& operator=(const Expansion& other) {
    Take(other);
    return *this;
  }

  /// Becomes `other`, whose terms must fit.
  template <int M>
  void Take(const Expansion<M>& other) {
    size = other.size;
    for (int i = 0; i < size; ++i) term[i] = other.term[i];
  }
  void Push(double value) {
    if (value != 0) term[size++] = value;
  }
  int Sign() const { return size == 0 ? 0 : term[size - 1] > 0 ? 1 : -1; }
  void Negate() {
    for (int i = 0; i < size; ++i) term[i] = -term[i];
  }
};

/// a + b = sum + error, exactly (Knuth).
inline double TwoSum(double a, double b, double& error) {
  const double sum = a + b, part = sum - a;
  error = (a - (sum - part)) + (b - part);
  return sum;
}

/// a - b.
inline Expansion<2> Difference(double a, double b) {
  Expansion<2> result;
  double error;
  const double sum = TwoSum(a, -b, error);
  result.Push(error);
  result.Push(sum);
  return result;
}

/// Shewchuk's grow-expansion, once for each term of f.
template <int N, int M>
Expansion<N + M> operator+(const Expansion<N>& e, const Expansion<M>& f) {
  Expansion<N + M> sum;
  double merged[N + M];
  int i = 0, j = 0, n = 0;
  while (i < e.size || j < f.size)
    merged[n++] = j == f.size || (i < e.size && std::fabs(e.term[i]) < std::fabs(f.term[j])) ? e.term[i++]
                                                                                             : f.term[j++];
  if (n == 0) return sum;
  double carry = merged[0], error;
  for (int k = 1; k < n; ++k) {
    carry = TwoSum(carry, merged[k], error);
    sum.Push(error);
  }
  sum.Push(carry);
  return sum;
}

template <int N, int M>
Expansion<N + M> operator-(const Expansion<N>& e, Expansion<M> f) {
  f.Negate();
  return e + f;
}

template <int N>
Expansion<2 * N> operator*(const Expansion<N>& e, double factor) {
  Expansion<2 * N> product;
  if (e.size == 0 || factor == 0) return product;
  double carry = e.term[0] * factor, error;
  product.Push(std::fma(e.term[0], factor, -carry));
  for (int i = 1; i < e.size; ++i) {
    const double high = e.term[i] * factor, low = std::fma(e.term[i], factor, -high);
    carry = TwoSum(carry, low, error);
    product.Push(error);
    const double sum = high + carry;  // |high| >= |carry|: fast two-sum
    product.Push(carry - (sum - high));
    carry = sum;
  }
  product.Push(carry);
  return product;
}

template <int N, int M>
Expansion<2 * N * M> operator*(const Expansion<N>& e, const Expansion<M>& f) {
  Expansion<2 * N * M> product;
  for (int i = 0; i < f.size; ++i) {
    product.Take(product + e * f.term[i]);
  }
  return product;
}

/// Renormalised (Shewchuk's compress): the last term is the value rounded to within an ulp, and so on down.
/// All bits of a value of degree <= 4 lie in a range of 1,110 bits, hence at most 24 terms.
template <int N>
Expansion<24> Compressed(const Expansion<N>& e) {
  Expansion<24> result;
  if (e.size == 0) return result;
  double work[N], error;
  int bottom = e.size - 1;
  double carry = e.term[bottom];
  for (int i = e.size - 2; i >= 0; --i) {
    carry = TwoSum(carry, e.term[i], error);
    if (error != 0) work[bottom--] = carry, carry = error;
  }
  work[bottom] = carry;
  for (int i = bottom + 1; i < e.size; ++i) {
    carry = TwoSum(work[i], carry, error);
    result.Push(error);
  }
  result.Push(carry);
  return result;
}

/// t = numerator / denominator of a ray's meeting with a plane; denominator > 0.
struct Ratio {
  Expansion<24> numerator, denominator;

  /// The quotient rounded to double (the error is below 0.5 ulp + 2^-50 ulp).
  double Value() const {
    if (numerator.size == 0) return 0;
    const auto head = [](const Expansion<24>& e) { return e.term[e.size - 1]; };
    const auto tail = [](const Expansion<24>& e) { return e.size > 1 ? e.term[e.size - 2] : 0.0; };
    const double n = head(numerator), d = head(denominator), q = n / d;
    const double rest = std::fma(-q, d, n) + tail(numerator) - q * tail(denominator);
    return q + rest / d;
  }
};

/// Sign of a - b.
inline int Compare(const Ratio& a, const Ratio& b) {
  return (a.numerator * b.denominator - b.numerator * a.denominator).Sign();
}
/// Sign of a - t, for a t that a float or the middle of two floats can be.
inline int Compare(const Ratio& a, double t) { return (a.numerator - a.denominator * t).Sign(); }

/// The quotient correctly rounded to float, ties to even; infinite beyond the range of float.
inline float RoundToFloat(const Ratio& a) {
  // Rounding twice errs by one float at most, and only beside the middle of two floats.
  const float guess = float(a.Value());
  if (!(std::fabs(guess) < std::numeric_limits<float>::max())) return guess;
  for (const float away : {-std::numeric_limits<float>::infinity(), std::numeric_limits<float>::infinity()}) {
    const float other = std::nextafterf(guess, away);
    const int beyond = Compare(a, 0.5 * (double(guess) + double(other))) * (away > 0 ? 1 : -1);
    const bool guess_is_odd = (std::bit_cast<uint32_t>(guess) & 1u) != 0;
    if (beyond > 0 || (beyond == 0 && guess_is_odd)) return other;
  }
  return guess;
}

template <class T>
using Triple = std::array<T, 3>;
using Difference3 = Triple<Expansion<2>>;

inline Difference3 Subtract(Vec3d a, Vec3d b) {
  return {Difference(a.x, b.x), Difference(a.y, b.y), Difference(a.z, b.z)};
}
inline Triple<Expansion<16>> Cross(const Difference3& a, const Difference3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

/// A ray and a triangle in double: the float values, unchanged.
struct Line {
  Vec3d org, dir;
  explicit Line(const rb_ray& ray) : org(ToDouble(LoadVec3(ray.org))), dir(ToDouble(LoadVec3(ray.dir))) {}
};
using Corners = Triple<Vec3d>;

inline constexpr double kEps = 0x1p-53;

/// Sign of d . (p x q) in double; 0 where that cannot tell. Relative errors of each product's path, where p and
/// q are differences of two: 2 subtractions, product, difference, product, 2 sums = 7.
inline int SureSign(Vec3d d, Vec3d p, Vec3d q) {
  const Vec3d yz{p.y * q.z, p.z * q.x, p.x * q.y}, zy{p.z * q.y, p.x * q.z, p.y * q.x};
  const double value = Dot(d, yz - zy);
  double size = 0;
  for (int i = 0; i < 3; ++i) size += std::fabs(d[i]) * (std::fabs(yz[i]) + std::fabs(zy[i]));
  return std::fabs(value) > 12 * kEps * size ? (value > 0 ? 1 : -1) : 0;
}

/// Sign of dir . ((a - org) x (b - org)): on which side of the line the directed segment a -> b passes.
/// 0 exactly if the line and the segment's line are coplanar.
inline int SideOf(const Line& line, Vec3d a, Vec3d b) {
  const Vec3d p = a - line.org;
  // The same number by the segment itself: seen from far away it is shorter than the way to its end, and so is
  // the error.
  if (const int sign = SureSign(line.dir, p, b - a)) return sign;
  if (const int sign = SureSign(line.dir, p, b - line.org)) return sign;
  const Vec3d d = line.dir;
  const auto n = Cross(Subtract(a, line.org), Subtract(b, line.org));
  return (n[0] * d.x + n[1] * d.y + n[2] * d.z).Sign();
}

/// t of the line's meeting with the triangle's plane, exact. The line is not parallel to the plane.
inline Ratio PlaneRatio(const Line& line, const Corners& p) {
  const auto n = Cross(Subtract(p[1], p[0]), Subtract(p[2], p[0]));
  const auto r = Subtract(p[0], line.org);
  Ratio t{Compressed(n[0] * r[0] + n[1] * r[1] + n[2] * r[2]),
          Compressed(n[0] * line.dir.x + n[1] * line.dir.y + n[2] * line.dir.z)};
  if (t.denominator.Sign() < 0) t.numerator.Negate(), t.denominator.Negate();
  return t;
}

/// The same in double, with a bound of its error; infinite where double cannot tell.
struct Approximate {
  double t, error;
};
inline Approximate PlaneApproximate(const Line& line, const Corners& p) {
  const Vec3d a = p[1] - p[0], b = p[2] - p[0], r = p[0] - line.org, d = line.dir;
  const Vec3d yz{a.y * b.z, a.z * b.x, a.x * b.y}, zy{a.z * b.y, a.x * b.z, a.y * b.x};
  const Vec3d n = yz - zy;
  double size_n = 0, size_d = 0;
  for (int i = 0; i < 3; ++i) {
    const double s = std::fabs(yz[i]) + std::fabs(zy[i]);
    size_n += s * std::fabs(r[i]), size_d += s * std::fabs(d[i]);
  }
  const double numerator = Dot(n, r), denominator = Dot(n, d);
  const double error_n = 16 * kEps * size_n, error_d = 16 * kEps * size_d;
  const double rest = std::fabs(denominator) - error_d;
  if (!(rest > 0)) return {0, std::numeric_limits<double>::infinity()};
  const double t = numerator / denominator;
  return {t, (error_n + std::fabs(t) * error_d) / rest * 1.001 + 4 * kEps * std::fabs(t)};
}

/// How a line meets a closed triangle. The triangle is not degenerate.
enum class Meeting : uint8_t { kNone, kInterior, kEdge, kVertex, kInPlane };

/// kInPlane: the line lies in the triangle's plane (whether it meets the triangle is told by MeetsInPlane).
inline Meeting Meet(const Line& line, const Corners& p) {
  int zeros = 0, sum = 0;
  for (int i = 0; i < 3; ++i) {
    const int side = SideOf(line, p[size_t(i)], p[size_t((i + 1) % 3)]);
    zeros += side == 0, sum += side;
  }
  if (std::abs(sum) + zeros < 3) return Meeting::kNone;
  // The three edge functions add up to n . dir, so all of them are zero exactly if the line is in the plane.
  return zeros == 0   ? Meeting::kInterior
         : zeros == 1 ? Meeting::kEdge
         : zeros == 2 ? Meeting::kVertex
                      : Meeting::kInPlane;
}

/// For a line in the triangle's plane: does it meet the triangle at some t in (tnear, tfar]? Exact.
inline bool MeetsInPlane(const Line& line, const Corners& p, float tnear, float tfar) {
  if (!(tnear < tfar)) return false;
  const auto n = Cross(Subtract(p[1], p[0]), Subtract(p[2], p[0]));
  const int drop = n[0].Sign() != 0 ? 0 : n[1].Sign() != 0 ? 1 : 2;
  const int x = (drop + 1) % 3, y = (drop + 2) % 3, turn = n[size_t(drop)].Sign();
  // Inside edge i: constant + t slope >= 0. Each edge bounds t from below or above, or decides at once. The
  // interval is empty exactly if some lower bound exceeds some upper one.
  std::array<Ratio, 3> lower, upper;
  int lowers = 0, uppers = 0;
  for (size_t i = 0; i < 3; ++i) {
    const Vec3d a = p[i], b = p[(i + 1) % 3];
    const auto ex = Difference(b[x], a[x]), ey = Difference(b[y], a[y]);
    auto constant = Compressed(ex * Difference(line.org[y], a[y]) - ey * Difference(line.org[x], a[x]));
    auto slope = Compressed(ex * line.dir[y] - ey * line.dir[x]);
    if (turn < 0) constant.Negate(), slope.Negate();
    if (slope.Sign() == 0) {
      if (constant.Sign() < 0) return false;
    } else if (slope.Sign() > 0) {
      constant.Negate();
      lower[size_t(lowers++)] = {constant, slope};
    } else {
      slope.Negate();
      upper[size_t(uppers++)] = {constant, slope};
    }
  }
  for (int j = 0; j < uppers; ++j) {
    if (Compare(upper[size_t(j)], tnear) <= 0) return false;
    for (int i = 0; i < lowers; ++i)
      if (Compare(lower[size_t(i)], upper[size_t(j)]) > 0) return false;
  }
  for (int i = 0; i < lowers; ++i)
    if (tfar < std::numeric_limits<float>::infinity() && Compare(lower[size_t(i)], tfar) > 0) return false;
  return true;
}

}  // namespace raybench::exact
