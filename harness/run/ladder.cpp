#include "harness/run/ladder.h"

#include <algorithm>

#include "harness/base/columns.h"

namespace raybench {
namespace {

/// With more threads, the smallest part gives each of them a few chunks.
constexpr uint64_t kLeastChunks = 4 * 4096;
/// A pass that lasts this long says how long a longer one takes.
constexpr double kProbeSeconds = 0.002;

Seconds TimeOf(const Tree& tree, const std::function<void()>& pass, uint32_t threads) {
  const bool device = IsOnDevice(tree.structure());
  Pinned pinned(threads == 1 && !device);
  const Stopwatch watch(threads > 1);
  pass();
  const Seconds seconds = watch.Elapsed();
  return device ? Seconds{seconds.wall, seconds.wall} : seconds;
}

}  // namespace

const RaySet& Ladder::RaysOf(const Part& part) {
  if (part.step == 0) return sets_[part.set].set;
  auto& kept = parts_[{part.set, part.step}];
  if (!kept) kept = std::make_unique<RaySet>(PartOf(sets_[part.set].set, part.step, seed_));
  return *kept;
}

std::function<void()> Ladder::PassOver(const Tree& tree, const Part& part) {
  const RaySet& set = RaysOf(part);
  return [&tree, question = Question{set.query, set.rays}, &answers = answers_, threads = part.threads] {
    Ask(tree, question, answers, threads);
  };
}

uint32_t Ladder::Last(size_t set, uint32_t threads) const {
  return LastStep(sets_[set].set.rays.size(), threads == 1 ? kLeastRays : threads * kLeastChunks);
}

std::optional<uint32_t> Ladder::StepOf(Part part, uint64_t rays) {
  const uint32_t last = Last(part.set, part.threads);
  for (part.step = 0; part.step <= last; ++part.step)
    if (RaysOf(part).rays.size() == rays) return part.step;
  return std::nullopt;
}

uint32_t Ladder::ChooseStep(const Tree& tree, size_t set, uint32_t threads) {
  const uint64_t rays = sets_[set].set.rays.size();
  const uint32_t last = Last(set, threads);
  if (last == 0 || budget_.passes > 0) return 0;
  for (Part part{set, threads, last};; --part.step) {
    const std::function<void()> pass = PassOver(tree, part);
    double seconds = TimeOf(tree, pass, threads).wall;
    if (seconds < kLongPassSeconds) seconds = std::min(seconds, TimeOf(tree, pass, threads).wall);
    if (seconds < kProbeSeconds && part.step > 0) continue;
    return StepFor(seconds * double(rays) / double(RaysOf(part).rays.size()), last, budget_);
  }
}

SamplePlan Ladder::Plan(const Tree& tree, const Part& part, Seconds& cold) {
  const std::function<void()> pass = PassOver(tree, part);
  cold = TimeOf(tree, pass, part.threads);
  const bool again = budget_.passes == 0 && cold.wall < kLongPassSeconds;
  const double shorter = again ? std::min(cold.wall, TimeOf(tree, pass, part.threads).wall) : cold.wall;
  SamplePlan plan = PlanSamples(shorter, budget_);
  plan.sample_cost = std::max(plan.sample_cost, min_time_);
  return plan;
}

TimedTask Ladder::Task(const Tree& tree, const Part& part, const SamplePlan& plan) {
  TimedTask task;
  task.pass = PassOver(tree, part);
  task.passes = plan.passes;
  task.warm_up = plan.warm_up;
  task.samples = plan.samples;
  task.sample_cost = plan.sample_cost;
  task.parallel = part.threads > 1;
  task.device = IsOnDevice(tree.structure());
  return task;
}

void Ladder::AddDeviceTimes(const Tree& tree, const Part& part, Row& row) {
  const std::optional<rb_device> start = tree.Device();
  if (!start) return;
  const std::function<void()> pass = PassOver(tree, part);
  const double rays = double(RaysOf(part).rays.size());
  std::vector<double> query, copies;
  for (rb_device before = *start; query.size() < 5;) {
    pass();
    const rb_device after = *tree.Device();
    query.push_back(after.query - before.query), copies.push_back(after.query_copies - before.query_copies);
    before = after;
  }
  std::nth_element(query.begin(), query.begin() + 2, query.end());
  std::nth_element(copies.begin(), copies.begin() + 2, copies.end());
  row[column::device_ns] = query[2] * 1e9 / rays;
  row[column::copies_ns] = copies[2] * 1e9 / rays;
}

}  // namespace raybench
