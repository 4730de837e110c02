#include "harness/measure/statistics.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "accel/base/random.h"

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

MedianInterval MedianOfGroups(std::span<const std::vector<double>> groups) {
  constexpr uint64_t kResamples = 1000;
  std::vector<double> all;
  for (const std::vector<double>& group : groups) all.insert(all.end(), group.begin(), group.end());
  MedianInterval result = MedianOf(all);
  if (groups.size() < 2) return result;
  result.lo = result.hi = std::nullopt;
  result.coverage = 0;
  if (all.size() < 6) return result;
  Random random(1, 0);
  std::vector<double> medians, drawn;
  for (uint64_t i = 0; i < kResamples; ++i) {
    drawn.clear();
    for (size_t g = 0; g < groups.size(); ++g) {
      const std::vector<double>& group = groups[random.Below(groups.size())];
      for (size_t j = 0; j < group.size(); ++j) drawn.push_back(group[random.Below(group.size())]);
    }
    const auto middle = drawn.begin() + ptrdiff_t(drawn.size() / 2);
    std::nth_element(drawn.begin(), middle, drawn.end());
    medians.push_back(drawn.size() % 2 == 1 ? *middle
                                            : 0.5 * (*middle + *std::max_element(drawn.begin(), middle)));
  }
  std::sort(medians.begin(), medians.end());
  result.lo = medians[kResamples / 40];
  result.hi = medians[kResamples - 1 - kResamples / 40];
  result.coverage = 0.95;
  return result;
}

double WeightedMedian(std::vector<std::pair<double, double>> values) {
  std::sort(values.begin(), values.end());
  double total = 0, below = 0;
  for (const auto& [value, weight] : values) total += weight;
  for (size_t i = 0; i < values.size(); ++i) {
    below += values[i].second;
    // Sums of weights such as 1/3 meet the half but for rounding.
    if (std::fabs(below - total / 2) < 1e-9 * total && i + 1 < values.size())
      return 0.5 * (values[i].first + values[i + 1].first);
    if (below > total / 2) return values[i].first;
  }
  return values.back().first;
}

}  // namespace raybench
