#include "harness/measure/statistics.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace raybench {

double UpperRate(uint64_t events, uint64_t trials) {
  if (events >= trials) return 1;
  const double k = double(events), n = double(trials);
  // P(X <= k) at rate p: the largest term, and the others by their ratios, downward.
  const double log_choose = std::lgamma(n + 1) - std::lgamma(k + 1) - std::lgamma(n - k + 1);
  const auto at_most = [&](double p) {
    double sum = 1, ratio = 1;
    for (double j = k; j > 0 && ratio > 1e-17 * sum; --j) {
      ratio *= j / (n - j + 1) * (1 - p) / p;
      sum += ratio;
    }
    return std::exp(log_choose + k * std::log(p) + (n - k) * std::log1p(-p)) * sum;
  };
  double lo = k / n, hi = 1;
  for (int i = 0; i < 200 && lo < hi; ++i) {
    const double middle = lo == 0 ? hi * 0.5 : std::sqrt(lo * hi);
    if (middle <= lo || middle >= hi) break;
    (at_most(middle) > 0.05 ? lo : hi) = middle;
  }
  return hi;
}

MedianInterval MedianOf(std::span<const double> values) {
  std::vector<double> sorted(values.begin(), values.end());
  std::sort(sorted.begin(), sorted.end());
  const size_t n = sorted.size();
  MedianInterval result;
  result.median = n % 2 == 1 ? sorted[n / 2] : 0.5 * (sorted[n / 2 - 1] + sorted[n / 2]);
  // The median lies below the k-th smallest value with probability P(Bin(n, 1/2) <= k - 1).
  double probability = std::exp2(-double(n)), tail = 0;
  for (size_t k = 1; 2 * k <= n; ++k) {
    tail += probability;
    if (1 - 2 * tail < 0.95) break;
    result.lo = sorted[k - 1];
    result.hi = sorted[n - k];
    result.coverage = 1 - 2 * tail;
    probability *= double(n - k + 1) / double(k);
  }
  return result;
}

}  // namespace raybench
