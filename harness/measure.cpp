#include "harness/measure.h"

#include <benchmark/benchmark.h>
#include <fmt/format.h>
#include <sched.h>
#include <time.h>

#include <algorithm>
#include <cstring>
#include <map>
#include <sstream>

#include "accel/parameters.h"
#include "harness/interrupt.h"

namespace raybench {
namespace {

bool g_user_sets_min_time = false;
uint32_t g_repetitions = 1;
std::string g_remarks;

double ReadClock(clockid_t clock) {
  timespec t;
  clock_gettime(clock, &t);
  return double(t.tv_sec) + 1e-9 * double(t.tv_nsec);
}

/// Google Benchmark 1.7 says error_occurred, 1.8 and later say skipped.
bool Failed(const auto& run) {
  if constexpr (requires { run.error_occurred; }) {
    return run.error_occurred;
  } else {
    return bool(run.skipped);
  }
}

class Collector : public benchmark::BenchmarkReporter {
 public:
  Collector(const std::map<std::string, size_t>& index, std::vector<Measurement>& results)
      : index_(index), results_(results) {}

  bool ReportContext(const Context& context) override {
    std::ostringstream remarks;
    PrintBasicContext(&remarks, context);
    g_remarks = remarks.str();
    return true;
  }

  void ReportRuns(const std::vector<Run>& runs) override {
    for (const Run& run : runs) {
      if (run.run_type != Run::RT_Iteration) continue;
      Measurement& result = results_[index_.at(run.run_name.function_name)];
      if (Failed(run)) {
        result.status = MeasureStatus::kInterrupted;
        continue;
      }
      if (result.status == MeasureStatus::kFilteredOut) result.status = MeasureStatus::kTimed;
      const double passes = double(run.iterations);
      Sample sample;
      sample.sample = result.samples.size();
      sample.sequence = uint64_t(run.counters.at("sequence").value);
      sample.passes = uint64_t(run.iterations);
      sample.time = {run.real_accumulated_time / passes, run.cpu_accumulated_time / passes};
      // A build's CPU time is its own measurement: the engine's includes the tree's destruction.
      if (auto cpu = run.counters.find("build_cpu"); cpu != run.counters.end()) {
        sample.time.cpu = cpu->second.value / passes;
      }
      result.samples.push_back(sample);
    }
  }

 private:
  const std::map<std::string, size_t>& index_;
  std::vector<Measurement>& results_;
};

}  // namespace

Stopwatch::Stopwatch(bool process)
    : process_(process),
      start_{ReadClock(CLOCK_MONOTONIC),
             ReadClock(process ? CLOCK_PROCESS_CPUTIME_ID : CLOCK_THREAD_CPUTIME_ID)} {}

Seconds Stopwatch::Elapsed() const {
  const double cpu = ReadClock(process_ ? CLOCK_PROCESS_CPUTIME_ID : CLOCK_THREAD_CPUTIME_ID);
  return {ReadClock(CLOCK_MONOTONIC) - start_.wall, cpu - start_.cpu};
}

Pinned::Pinned(bool active) : active_(active) {
  if (!active_) return;
  cpu_set_t allowed;
  active_ = sched_getaffinity(0, sizeof allowed, &allowed) == 0;
  if (!active_) return;
  saved_.resize(sizeof allowed);
  std::memcpy(saved_.data(), &allowed, sizeof allowed);
  int last = 0;
  for (int cpu = 0; cpu < CPU_SETSIZE; ++cpu) {
    if (CPU_ISSET(cpu, &allowed)) last = cpu;
  }
  cpu_set_t one;
  CPU_ZERO(&one);
  CPU_SET(last, &one);
  active_ = sched_setaffinity(0, sizeof one, &one) == 0;
}

Pinned::~Pinned() {
  if (!active_) return;
  cpu_set_t allowed;
  std::memcpy(&allowed, saved_.data(), sizeof allowed);
  sched_setaffinity(0, sizeof allowed, &allowed);
}

void InitialiseEngine(const std::vector<std::string>& flags, uint32_t repetitions) {
  g_repetitions = repetitions;
  // The engine keeps the pointer to the first word.
  static std::vector<std::string> words;
  words = {"raybench", "--benchmark_enable_random_interleaving=true",
           fmt::format("--benchmark_repetitions={}", repetitions)};
  for (const std::string& flag : flags) {
    words.push_back(flag);
    if (flag.starts_with("--benchmark_min_time")) g_user_sets_min_time = true;
    if (flag.starts_with("--benchmark_repetitions")) {
      throw InputError("--benchmark_repetitions: say --repetitions instead");
    }
  }
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  int argc = int(argv.size());
  argv.push_back(nullptr);
  benchmark::Initialize(&argc, argv.data());
  if (argc > 1) throw InputError(fmt::format("Google Benchmark cannot read '{}'", argv[1]));
}

std::string EngineRemarks() { return g_remarks; }

std::vector<Measurement> Measure(const std::vector<TimedTask>& tasks,
                                 const std::function<void(double)>& progress) {
  std::vector<Measurement> results(tasks.size());
  if (tasks.empty()) return results;
  std::map<std::string, size_t> index;
  uint64_t sequence = 0;
  const double total = double(tasks.size()) * g_repetitions;

  for (size_t i = 0; i < tasks.size(); ++i) {
    const TimedTask& task = tasks[i];
    index[task.name] = i;
    auto* registered = benchmark::RegisterBenchmark(task.name.c_str(), [&](benchmark::State& state) {
      if (Interrupted()) {
        state.SkipWithError("interrupted");
        return;
      }
      progress(std::min(1.0, double(sequence) / total));
      const double place = double(sequence++);
      if (task.build) {
        double cpu = 0;
        for (auto _ : state) {
          const Seconds seconds = task.build();
          if (Interrupted()) {
            state.SkipWithError("interrupted");
            break;
          }
          state.SetIterationTime(seconds.wall);
          cpu += seconds.cpu;
        }
        state.counters["build_cpu"] = cpu;
      } else {
        Pinned pinned(!task.parallel);
        if (task.warm_up) task.pass();
        for (auto _ : state) {
          task.pass();
          benchmark::ClobberMemory();
        }
      }
      state.counters["sequence"] = place;
    });
    registered->ReportAggregatesOnly(false);
    if (task.build) registered->UseManualTime();
    if (task.parallel) registered->MeasureProcessCPUTime();
    if (task.parallel && !task.build) registered->UseRealTime();
    if (!g_user_sets_min_time)
      registered->Iterations(benchmark::IterationCount(std::max<uint64_t>(1, task.passes)));
  }

  Collector collector(index, results);
  benchmark::RunSpecifiedBenchmarks(&collector);
  benchmark::ClearRegisteredBenchmarks();
  if (Interrupted()) {
    for (Measurement& result : results) {
      if (result.status == MeasureStatus::kTimed && result.samples.size() < g_repetitions) {
        result.status = MeasureStatus::kInterrupted;
      }
    }
  }
  return results;
}

}  // namespace raybench
