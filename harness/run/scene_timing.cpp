// Times of one scene: which samples are missing, taken in one random order, and what they say.
#include <fmt/format.h>
#include <malloc.h>

#include <algorithm>
#include <map>
#include <tuple>

#include "harness/measure/statistics.h"
#include "harness/results/times.h"
#include "harness/run/scene_run.h"
#include "harness/terminal/interrupt.h"

namespace raybench {
/// A case that is to be timed.
struct SceneRun::Open {
  Entrant* entrant;
  const PlannedCase* planned;
  std::optional<KeptPlan> plan = {};
  Part part = {};
  uint32_t missing = 0;  ///< samples
};

/// The cases of the group that are to be timed. Neighbours are of different trees, so that each finds its
/// nodes out of the caches.
std::vector<SceneRun::Open> SceneRun::OpenCases() {
  std::vector<Open> open;
  for (Entrant* entrant : group_) {
    entrant->StoreSkipped(context_.results);
    for (const PlannedCase& c : entrant->cases) {
      if (!c.skip.empty() || Done(c)) continue;
      ++context_.seen;
      context_.last_name = c.Name();
      if (!context_.engine.Takes(c.Name())) {
        Row values = entrant->ValuesOf(c);
        values[column::status] = "skipped";
        values[column::note] = "left out by --benchmark_filter";
        context_.results.Store(c.key, values, {});
        continue;
      }
      ++context_.taken;
      if (IsOpen(c)) {
        open.push_back({entrant, &c, recall_.Plan(c.key.Id())});
      } else {
        sampled_.push_back({entrant, &c});
      }
    }
  }
  std::stable_sort(open.begin(), open.end(), [](const Open& a, const Open& b) {
    const auto key = [](const Open& o) {
      return std::tuple(!o.planned->key.IsBuild(), o.planned->set, o.planned->key.threads);
    };
    return key(a) < key(b);
  });
  return open;
}

TimedTask SceneRun::BuildTask(const Entrant& entrant, uint32_t threads) {
  TimedTask task;
  task.build = [this, &entrant, threads] {
    malloc_trim(0);
    Seconds seconds;
    TimedBuild(entrant, threads, seconds);
    return seconds;
  };
  task.parallel = threads > 1;
  task.device = entrant.Can(RB_DEVICE);
  task.sample_cost = entrant.build_seconds.at(threads);
  return task;
}

/// The step at which a set would be timed by this tree alone, chosen once.
uint32_t SceneRun::OwnStep(const Entrant& entrant, const Part& part) {
  const RaySet& set = sets_[part.set].set;
  const std::string key =
      fmt::format("{}/{}/{}/{}/{}", entrant.Spec(), set.Label(), set.order, set.hash, part.threads);
  if (const auto known = recall_.Step(key)) return *known;
  const uint32_t step = ladder_->ChooseStep(entrant.tree, part.set, part.threads);
  recall_.AddStep(key, step);
  return step;
}

KeptPlan SceneRun::PlanPart(const Entrant& entrant, const Part& part) {
  Seconds cold;
  KeptPlan plan{.step = part.step, .samples = ladder_->Plan(entrant.tree, part, cold)};
  plan.cold = part.threads == 1 ? cold.cpu : cold.wall;
  return plan;
}

/// How the case is timed, found out by first passes unless that is known.
void SceneRun::Choose(Open& o) {
  const Case& key = o.planned->key;
  o.part = {o.planned->set, key.threads, o.plan ? o.plan->step : 0};
  if (!o.plan) {
    if (key.IsBuild()) {
      o.plan.emplace();
      o.plan->samples.samples = context_.budget.Samples(o.entrant->build_seconds.at(key.threads));
    } else {
      const auto known = context_.parts.find(key.Id());
      if (const auto step =
              known == context_.parts.end() ? std::nullopt : ladder_->StepOf(o.part, known->second)) {
        o.part.step = *step;
      } else {
        // On a part that both can do, the anchor's time is measured beside every other one.
        o.part.step = OwnStep(*o.entrant, o.part);
        if (Anchors(o.part)) o.part.step = std::max(o.part.step, OwnStep(*anchor_, o.part));
      }
      o.plan = PlanPart(*o.entrant, o.part);
    }
    recall_.AddPlan(key.Id(), *o.plan);
  }
  o.missing = recall_.Missing(key.Id(), *o.plan);
}

/// Under which the anchor's samples are kept that are no samples of its own cases.
std::string SceneRun::AnchorKey(const Part& part) const {
  const RaySet& set = sets_[part.set].set;
  return fmt::format("anchor {}/{}/{}/{}/{}/{}", anchor_->Spec(), set.Label(), set.order, set.hash,
                     part.threads, part.step);
}

/// The anchor's samples on a part: those of its own case where that is timed on this part, and those beside.
std::vector<Sample> SceneRun::AnchorSamples(const Part& part) const {
  std::vector<Sample> samples = recall_.Samples(AnchorKey(part));
  for (const PlannedCase& c : anchor_->cases) {
    if (c.key.IsBuild() || c.set != part.set || c.key.threads != part.threads) continue;
    const std::optional<KeptPlan> plan = recall_.Plan(c.key.Id());
    if (!plan || plan->step != part.step) continue;
    const std::vector<Sample> own = recall_.Samples(c.key.Id());
    samples.insert(samples.end(), own.begin(), own.end());
  }
  return samples;
}

/// Of a case that has its plan.
bool SceneRun::LacksAnchor(const PlannedCase& c) const {
  const Part part{c.set, c.key.threads, recall_.Plan(c.key.Id()).value().step};
  return !c.key.IsBuild() && Anchors(part) && AnchorSamples(part).empty();
}

/// Seconds of the anchor's pass: each session's samples weigh as much together as the case's own of it.
std::optional<double> SceneRun::AnchorSeconds(const Part& part, std::span<const Sample> samples) const {
  const std::vector<Sample> beside = AnchorSamples(part);
  const auto own = TimesOf(samples, part.threads), anchors = TimesOf(beside, part.threads);
  std::vector<std::pair<double, double>> weighted;
  for (const auto& [session, times] : anchors) {
    const auto of_case = own.find(session);
    if (of_case == own.end()) continue;
    for (double time : times)
      weighted.push_back({time, double(of_case->second.size()) / double(times.size())});
  }
  // Killed before the anchor's turn: better of another session than none.
  if (weighted.empty())
    for (const Sample& s : beside) weighted.push_back({TimeOf(s, part.threads), 1});
  return weighted.empty() ? std::nullopt : std::optional(WeightedMedian(std::move(weighted)));
}

/// Stores the case, whose samples are all there.
void SceneRun::StoreTimed(const Entrant& entrant, const PlannedCase& c) {
  const std::vector<Sample> samples = recall_.Samples(c.key.Id());
  const KeptPlan plan = recall_.Plan(c.key.Id()).value();
  Row values = entrant.ValuesOf(c);
  const Part part{c.set, c.key.threads, plan.step};
  const uint64_t rays = c.key.IsBuild() ? 0 : ladder_->RaysOf(part).rays.size();
  if (!c.key.IsBuild()) {
    values[column::cold_ns] = plan.cold * 1e9 / double(rays);
    values[column::timed_rays] = rays;
    if (entrant.tree) ladder_->AddDeviceTimes(entrant.tree, part, values);
  }
  values[column::query] = c.key.query;
  values[column::threads] = c.key.threads;
  values[column::primitives] = c.key.primitives;
  AddTimes(values, samples);
  if (!c.key.IsBuild() && Anchors(part)) {
    values[column::anchor] = anchor_->Spec();
    const std::optional<double> seconds = AnchorSeconds(part, samples);
    if (&entrant == anchor_) {
      values[column::anchor_ns] = values.Get(column::median_ns);
    } else if (seconds) {
      values[column::anchor_ns] = *seconds * 1e9 / double(rays);
    }
  }
  context_.results.Store(c.key, values, samples);
}

/// Times all open cases of the group and gives its trees back, but for the anchor's.
void SceneRun::TimeGroup() {
  std::vector<std::string> specs;
  for (const Entrant* entrant : group_) specs.push_back(entrant->Spec());
  schedule_.Begin(Work::kFirstPasses, specs, "first passes");
  std::vector<Open> open = OpenCases();
  std::vector<TimedTask> tasks;
  std::vector<std::string> keys;  // under which the samples of each task are kept
  std::vector<Entrant*> owners;   // of each task's tree
  const auto add = [&](Entrant* owner, TimedTask task, std::string name, std::string key, uint32_t samples) {
    task.name = std::move(name);
    task.samples = samples;
    tasks.push_back(std::move(task));
    keys.push_back(std::move(key));
    owners.push_back(owner);
  };
  std::map<Entrant*, std::string> failed;  // those whose device ceased to answer
  std::map<Part, uint32_t>
      beside;  // samples of the anchor that are wanted in this session, and not yet there
  for (Open& o : open) {
    if (failed.contains(o.entrant)) continue;
    try {
      Choose(o);
    } catch (const QueryError& error) {
      failed[o.entrant] = error.what();
      continue;
    }
    const Case& key = o.planned->key;
    add(o.entrant,
        key.IsBuild() ? BuildTask(*o.entrant, key.threads)
                      : ladder_->Task(o.entrant->tree, o.part, o.plan->samples),
        o.planned->Name(), key.Id(), o.missing);
    if (!key.IsBuild() && Anchors(o.part) && o.entrant != anchor_)
      beside[o.part] = std::max(beside[o.part], o.missing);
    ThrowIfInterrupted();
    schedule_.Update(double(tasks.size()) / double(open.size()));
  }
  std::erase_if(open, [&](const Open& o) { return failed.contains(o.entrant); });
  for (const Open& o : open)
    if (o.entrant == anchor_ && beside.contains(o.part)) {
      uint32_t& samples = beside.at(o.part);
      samples = std::min(samples, o.plan->samples.samples);  // as many as its own case has are enough
      samples -= std::min(samples, o.missing);
    }
  for (const auto& [entrant, c] : sampled_) {
    if (entrant == anchor_ || !LacksAnchor(*c)) continue;
    const KeptPlan plan = recall_.Plan(c->key.Id()).value();
    beside.try_emplace({c->set, c->key.threads, plan.step}, plan.samples.samples);
  }
  for (const auto& [part, samples] : beside) {
    if (samples == 0) continue;
    const std::string key = AnchorKey(part);
    try {
      if (!recall_.Plan(key)) recall_.AddPlan(key, PlanPart(*anchor_, part));
    } catch (const QueryError& error) {
      failed[anchor_] = error.what();
      break;
    }
    add(anchor_, ladder_->Task(anchor_->tree, part, recall_.Plan(key)->samples),
        fmt::format("anchor of set {}/step {}/threads:{}", part.set, part.step, part.threads), key, samples);
    ThrowIfInterrupted();
  }
  double seconds = 0;
  for (const TimedTask& task : tasks) seconds += task.sample_cost * task.samples;
  schedule_.Begin(Work::kTiming, specs, "timing");
  schedule_.Expect(seconds);
  const std::map<size_t, std::string> given_up = raybench::Measure(
      tasks, [&](size_t task, const Sample& sample) { recall_.AddSample(keys[task], sample); },
      [&](double fraction) { schedule_.Update(fraction); });
  for (const auto& [task, why] : given_up) failed.try_emplace(owners[task], why);
  for (const Open& o : open)
    if (!IsOpen(*o.planned)) sampled_.push_back({o.entrant, o.planned});
  if (context_.LastProcess())
    for (const auto& [entrant, planned] : sampled_) {
      if (failed.contains(entrant)) continue;
      try {
        StoreTimed(*entrant, *planned);
      } catch (const QueryError& error) {
        failed[entrant] = error.what();
      }
    }
  sampled_.clear();
  ThrowIfInterrupted();
  for (const auto& [entrant, why] : failed) GiveUp(*entrant, why);
  for (Entrant* entrant : group_)
    if (entrant != anchor_) entrant->tree = Tree();
  group_.clear();
}

}  // namespace raybench
