// One point of a suite, for all contestants: built, judged, timed.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "harness/base/columns.h"
#include "harness/extremes/suite.h"

namespace raybench::extremes {

struct PointOptions {
  uint64_t rays = 2048, seed = 1;
  std::function<void(const std::string& what)> progress;  ///< may be empty
};

/// Rows for extremes.csv (kExtremesColumns), one a contestant. Throws InterruptedError soon after a Ctrl-C.
std::vector<Row> MeasurePoint(const Suite& suite, const Point& point,
                              const std::vector<Contestant>& contestants, const PointOptions& options);

}  // namespace raybench::extremes
