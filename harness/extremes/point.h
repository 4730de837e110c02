// One point of a suite, for all contestants: built, judged, timed.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "harness/extremes/suite.h"
#include "harness/results.h"

namespace raybench::extremes {

/// The columns of extremes.csv in order (reports/README.md).
std::span<const char* const> Columns();

struct PointOptions {
  uint64_t rays = 2048, seed = 1;
  std::function<void(const std::string& what)> progress;  ///< may be empty
};

/// Rows for extremes.csv, one a contestant, all columns present. Throws InterruptedError soon after a Ctrl-C.
std::vector<Json> MeasurePoint(const Suite& suite, const Point& point,
                               const std::vector<Contestant>& contestants, const PointOptions& options);

/// The rate p for which `events` or fewer of n happen with a probability of 5 %: a one-sided upper bound of
/// 95 % (Clopper, Pearson 1934). About 3/n where there are none (the rule of three). 1 where n is 0.
double UpperBound(uint64_t events, uint64_t n);

}  // namespace raybench::extremes
