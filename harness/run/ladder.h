// The ladder of one scene's ray sets (harness/plan/time_budget.h): on which part of a set a tree is timed.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "accel/host/registry.h"
#include "harness/base/row.h"
#include "harness/measure/measure.h"
#include "harness/plan/time_budget.h"
#include "harness/run/prepared_set.h"

namespace raybench {

/// The smallest part of a set that is timed on one thread has at least so many rays.
inline constexpr uint64_t kLeastRays = 1024;

/// Where on the ladder a set is timed by so many threads.
struct Part {
  size_t set = 0;
  uint32_t threads = 1, step = 0;
  auto operator<=>(const Part&) const = default;
};

/// The sets and `answers`, which hold as many rays as any of them, must outlive it.
class Ladder {
 public:
  /// `min_time`: seconds that a sample takes at least, whatever the budget says.
  Ladder(const std::vector<PreparedSet>& sets, Answers& answers, const TimeBudget& budget, double min_time,
         uint64_t seed)
      : sets_(sets), answers_(answers), budget_(budget), min_time_(min_time), seed_(seed) {}

  const RaySet& RaysOf(const Part& part);

  /// The step at which a pass of this tree fits into its budget. Tried on the smallest part and on larger
  /// ones only while a pass says nothing yet; the shorter of two passes counts, since what disturbs only
  /// makes them longer.
  uint32_t ChooseStep(const Tree& tree, size_t set, uint32_t threads);

  /// The step whose part has so many rays; none if no step has.
  std::optional<uint32_t> StepOf(Part part, uint64_t rays);

  /// The length of a sample follows from the shorter of the first two passes; `cold` is the first one.
  SamplePlan Plan(const Tree& tree, const Part& part, Seconds& cold);
  /// Passes of the tree over the part. The tree must outlive the task.
  TimedTask Task(const Tree& tree, const Part& part, const SamplePlan& plan);
  /// By the clock of the tree's device, if it has one: the medians of five passes more.
  void AddDeviceTimes(const Tree& tree, const Part& part, Row& row);

 private:
  uint32_t Last(size_t set, uint32_t threads) const;
  std::function<void()> PassOver(const Tree& tree, const Part& part);

  const std::vector<PreparedSet>& sets_;
  Answers& answers_;
  const TimeBudget& budget_;
  const double min_time_;
  const uint64_t seed_;
  std::map<std::pair<size_t, uint32_t>, std::unique_ptr<RaySet>> parts_;  ///< by set and step
};

}  // namespace raybench
