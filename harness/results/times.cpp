#include "harness/results/times.h"

#include "harness/measure/statistics.h"

namespace raybench {

double TimeOf(const Sample& sample, uint64_t threads) {
  return threads == 1 ? sample.time.cpu : sample.time.wall;
}

std::map<uint64_t, std::vector<double>> TimesOf(std::span<const Sample> samples, uint64_t threads) {
  std::map<uint64_t, std::vector<double>> times;
  for (const Sample& s : samples) times[s.session].push_back(TimeOf(s, threads));
  return times;
}

void AddTimes(Row& row, std::span<const Sample> samples) {
  std::vector<std::vector<double>> sessions;
  for (auto& [session, times] : TimesOf(samples, row.Get(column::threads).value()))
    sessions.push_back(std::move(times));
  const MedianInterval interval = MedianOfGroups(sessions);
  const bool build = row.Get(column::query) == "build";
  const uint64_t items = build ? row.Get(column::primitives).value() : row.Get(column::timed_rays).value();
  const double to_ns = build ? 1e9 : 1e9 / double(items);
  row[column::status] = "timed";
  row[column::samples] = samples.size();
  row[column::sessions] = sessions.size();
  row[column::median_ns] = interval.median * to_ns;
  const auto scaled = [&](const std::optional<double>& x) { return x ? std::optional(*x * to_ns) : x; };
  row[column::lo_ns] = scaled(interval.lo);
  row[column::hi_ns] = scaled(interval.hi);
  if (interval.median > 0) row[column::rate] = double(items) / interval.median;
}

}  // namespace raybench
