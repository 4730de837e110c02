// Error-free transformations (Dekker 1971, Knuth 1969) and expansions (Shewchuk 1997). Differences of
// floats and products of two such differences lie between 2^-298 and 2^260, so nothing over- or underflows
// in double.

#include "datasets/scene/orientation.h"

#include <cmath>

namespace raybench {
namespace {

struct TwoTerms {
  double high, low;  // exact value: high + low, |low| <= ulp(high) / 2
};

TwoTerms TwoSum(double a, double b) {
  double sum = a + b, b_part = sum - a, a_part = sum - b_part;
  return {sum, (a - a_part) + (b - b_part)};
}

TwoTerms TwoProduct(double a, double b) {
  double product = a * b;
  return {product, std::fma(a, b, -product)};
}

/// A sum of doubles kept without error. The parts do not overlap and grow, so the last that is not zero has
/// the sign of the sum.
class Expansion {
 public:
  void Add(double term) {
    for (int i = 0; i < size_; ++i) {
      TwoTerms t = TwoSum(term, parts_[i]);
      parts_[i] = t.low;
      term = t.high;
    }
    parts_[size_++] = term;
  }
  void AddProduct(TwoTerms a, TwoTerms b, double sign) {
    for (double x : {a.high, a.low})
      for (double y : {b.high, b.low}) {
        TwoTerms p = TwoProduct(x, y);
        Add(sign * p.high);
        Add(sign * p.low);
      }
  }
  int Sign() const {
    for (int i = size_ - 1; i >= 0; --i)
      if (parts_[i] != 0) return parts_[i] > 0 ? 1 : -1;
    return 0;
  }

 private:
  double parts_[16];
  int size_ = 0;
};

}  // namespace

int Orientation(Vec3f a, Vec3f b, Vec3f c, int axis) {
  const int j = (axis + 1) % 3, k = (axis + 2) % 3;
  // Filter: each difference, product and sum is off by at most 2^-53 of itself.
  const double p = (double(b[j]) - a[j]) * (double(c[k]) - a[k]);
  const double q = (double(b[k]) - a[k]) * (double(c[j]) - a[j]);
  if (std::abs(p - q) > 0x1p-50 * (std::abs(p) + std::abs(q))) return p > q ? 1 : -1;
  Expansion determinant;
  determinant.AddProduct(TwoSum(b[j], -double(a[j])), TwoSum(c[k], -double(a[k])), 1);
  determinant.AddProduct(TwoSum(b[k], -double(a[k])), TwoSum(c[j], -double(a[j])), -1);
  return determinant.Sign();
}

bool IsDegenerate(Vec3f a, Vec3f b, Vec3f c) {
  for (int axis = 0; axis < 3; ++axis)
    if (Orientation(a, b, c, axis) != 0) return false;
  return true;
}

}  // namespace raybench
