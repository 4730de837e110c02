// What samples say, as columns of cases.csv.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "harness/base/columns.h"
#include "harness/measure/measure.h"

namespace raybench {

/// Seconds of a sample on the clock that counts: CPU time at one thread, wall time at more.
double TimeOf(const Sample& sample, uint64_t threads);

/// The same of many, by session.
std::map<uint64_t, std::vector<double>> TimesOf(std::span<const Sample> samples, uint64_t threads);

/// Fills status, samples, sessions, median and interval, rate. The row has its threads, primitives and query,
/// and timed_rays unless it is a build; at least one sample.
void AddTimes(Row& row, std::span<const Sample> samples);

}  // namespace raybench
