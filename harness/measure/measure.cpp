#include "harness/measure/measure.h"

#include <benchmark/benchmark.h>
#include <fmt/format.h>
#include <sched.h>
#include <time.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <sstream>

#include "accel/base/error.h"
#include "harness/terminal/interrupt.h"

namespace raybench {
namespace {

bool g_user_sets_min_time = false;
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

/// Where a benchmark's name says which task's sample it is: "INDEX|..." with the index of the task.
size_t TaskOf(const std::string& name) { return std::stoul(name); }

class Collector : public benchmark::BenchmarkReporter {
 public:
  Collector(size_t tasks, const std::function<void(size_t, const Sample&)>& take)
      : taken_(tasks), take_(take) {}

  bool ReportContext(const Context& context) override {
    std::ostringstream remarks;
    PrintBasicContext(&remarks, context);
    g_remarks = remarks.str();
    return true;
  }

  void ReportRuns(const std::vector<Run>& runs) override {
    for (const Run& run : runs) {
      if (run.run_type != Run::RT_Iteration || Failed(run)) continue;
      const size_t task = TaskOf(run.run_name.function_name);
      const double passes = double(run.iterations);
      Sample sample;
      sample.sample = taken_[task]++;
      sample.sequence = uint64_t(run.counters.at("sequence").value);
      sample.passes = uint64_t(run.iterations);
      sample.time = {run.real_accumulated_time / passes, run.cpu_accumulated_time / passes};
      // A build's CPU time is its own measurement: the engine's includes the tree's destruction.
      if (auto cpu = run.counters.find("build_cpu"); cpu != run.counters.end()) {
        sample.time.cpu = cpu->second.value / passes;
      }
      if (run.counters.contains("device")) sample.time.cpu = sample.time.wall;
      take_(task, sample);
    }
  }

 private:
  std::vector<uint64_t> taken_;
  const std::function<void(size_t, const Sample&)>& take_;
};

void TakeSample(const TimedTask& task, benchmark::State& state) {
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
    return;
  }
  Pinned pinned(!task.parallel && !task.device);
  if (task.warm_up) task.pass();
  for (auto _ : state) {
    task.pass();
    benchmark::ClobberMemory();
  }
}

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

EngineFlags::EngineFlags(const std::vector<std::string>& flags) {
  for (const std::string& flag : flags) {
    const size_t equals = std::min(flag.find('='), flag.size());
    const std::string name = flag.substr(0, equals), value = flag.substr(std::min(equals + 1, flag.size()));
    if (name == "--benchmark_filter") {
      // The engine's own reading: this keyword and nothing at all mean everything.
      filter_ = value == "all" ? "" : value;
      const bool negative = filter_.starts_with('-');
      try {
        if (!filter_.empty()) expression_.emplace(filter_.substr(negative), std::regex::extended);
      } catch (const std::regex_error&) {
        throw InputError(fmt::format("{}: not a regular expression (POSIX, extended)", flag));
      }
    } else if (name == "--benchmark_min_time") {
      const std::string number = value.ends_with('s') ? value.substr(0, value.size() - 1) : value;
      char* end = nullptr;
      const double seconds = std::strtod(number.c_str(), &end);
      if (number.empty() || *end != 0 || !(seconds > 0 && seconds <= 3600))
        throw InputError(fmt::format("{}: must be a number of seconds above 0 and at most 3600", flag));
      min_time_ = seconds;
    } else {
      throw InputError(fmt::format(
          "{}: of Google Benchmark's arguments a run takes --benchmark_filter and --benchmark_min_time{}",
          flag, name == "--benchmark_repetitions" ? "; say --repetitions instead" : ""));
    }
  }
}

bool EngineFlags::Takes(const std::string& name) const {
  return !expression_ || std::regex_search(name, *expression_) != filter_.starts_with('-');
}

void InitialiseEngine(const EngineFlags& flags) {
  // The engine keeps the pointer to the first word. It takes defaults from variables BENCHMARK_... of the
  // environment, so what would matter is said.
  static std::vector<std::string> words;
  words = {"raybench",
           "--benchmark_enable_random_interleaving=true",
           "--benchmark_filter=.",
           "--benchmark_list_tests=false",
           "--benchmark_out=",
           "--benchmark_out_format=json",
           "--benchmark_format=console",
           "--benchmark_perf_counters=",
           "--benchmark_min_warmup_time=0"};
  g_user_sets_min_time = flags.min_time().has_value();
  if (flags.min_time()) words.push_back(fmt::format("--benchmark_min_time={}", *flags.min_time()));
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  int argc = int(argv.size());
  argv.push_back(nullptr);
  benchmark::Initialize(&argc, argv.data());
  if (argc > 1) throw std::logic_error(fmt::format("Google Benchmark cannot read '{}'", argv[1]));
}

std::string EngineRemarks() { return g_remarks; }

std::map<size_t, std::string> Measure(const std::vector<TimedTask>& tasks,
                                      const std::function<void(size_t, const Sample&)>& take,
                                      const std::function<void(double)>& progress) {
  std::map<size_t, std::string> failed;
  if (tasks.empty()) return failed;
  uint64_t sequence = 0;
  double total = 1e-9, done = 0;
  for (const TimedTask& task : tasks) total += task.sample_cost * task.samples;

  const auto add = [&](size_t index, uint32_t sample) {
    const TimedTask& task = tasks[index];
    const std::string name = fmt::format("{}|{}|{}", index, task.name, sample);
    auto* registered = benchmark::RegisterBenchmark(name.c_str(), [&, index](benchmark::State& state) {
      if (Interrupted() || failed.contains(index)) {
        state.SkipWithError("interrupted");
        return;
      }
      progress(std::min(1.0, done / total));
      done += task.sample_cost;
      const double place = double(sequence++);
      try {
        TakeSample(task, state);
      } catch (const std::runtime_error& error) {
        state.SkipWithError(error.what());
        failed[index] = error.what();
        return;
      }
      state.counters["sequence"] = place;
      if (task.device) state.counters["device"] = 1;
    });
    registered->ReportAggregatesOnly(false);
    if (task.build) registered->UseManualTime();
    if (task.parallel) registered->MeasureProcessCPUTime();
    if ((task.parallel || task.device) && !task.build) registered->UseRealTime();
    if (!g_user_sets_min_time)
      registered->Iterations(benchmark::IterationCount(std::max<uint64_t>(1, task.passes)));
  };
  // Each sample is a benchmark of its own: of several repetitions the engine tells all when the last one is
  // there. The order in which it runs them is random either way.
  for (size_t i = 0; i < tasks.size(); ++i)
    for (uint32_t sample = 0; sample < tasks[i].samples; ++sample) add(i, sample);

  Collector collector(tasks.size(), take);
  benchmark::RunSpecifiedBenchmarks(&collector);
  benchmark::ClearRegisteredBenchmarks();
  return failed;
}

}  // namespace raybench
