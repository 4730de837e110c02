// One point of a suite, for all contestants: built, judged, timed.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "harness/base/json.h"
#include "harness/extremes/suite.h"

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

}  // namespace raybench::extremes
