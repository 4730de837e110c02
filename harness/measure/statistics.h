// What samples of time and counts of rare events say.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

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

}  // namespace raybench
