// What samples of time and counts of rare events say.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

namespace raybench {

/// The upper bound at 95 % of the rate of something seen `events` times in `trials` independent trials: the
/// rate at which so few come with probability 5 % (Clopper and Pearson 1934, one-sided). For no event this is
/// the rule of three, 3 / trials (Hanley and Lippman-Hand 1983). 1 for no trials.
double UpperRate(uint64_t events, uint64_t trials);

/// Median and its distribution-free confidence interval between two order statistics (David, Nagaraja
/// 2003, 7.1).
struct MedianInterval {
  double median = 0;
  std::optional<double> lo, hi;  ///< absent below 6 samples: no interval of 95 % exists then
  double coverage = 0;           ///< confidence of the interval, at least 0.95; 0 without one
};

/// `values` in any order, at least one. The interval is the narrowest symmetric one with a confidence of at
/// least 95 %.
MedianInterval MedianOf(std::span<const double> values);

/// The median of all values, and an interval of 95 % that knows that values of one group, such as the samples
/// of one process, are more alike than others: from 1,000 resamples of groups and, within each, of its values,
/// with a fixed seed (hierarchical bootstrap; Kalibera, Jones 2013). As MedianOf() for a single group; no
/// interval below 6 values. Each group has a value at least. With fewer than 5 groups the interval is too narrow.
MedianInterval MedianOfGroups(std::span<const std::vector<double>> groups);

/// The median of values with weights above 0, at least one: half of the weight lies on each side. With equal
/// weights the median.
double WeightedMedian(std::vector<std::pair<double, double>> values_and_weights);

}  // namespace raybench
