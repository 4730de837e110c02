#include "harness/measure/machine_state.h"

#include <fmt/format.h>
#include <sched.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <map>
#include <optional>
#include <sstream>

#include "harness/measure/measure.h"

namespace raybench {
namespace fs = std::filesystem;
namespace {

using Severity = MachineFinding::Severity;

/// Reads the few small files that tell.
class Reader {
 public:
  explicit Reader(fs::path root) : root_(std::move(root)) {}

  std::optional<std::string> Text(const char* path) const {
    std::ifstream in(root_ / path);
    if (!in) return std::nullopt;
    std::ostringstream text;
    text << in.rdbuf();
    std::string all = text.str();
    while (!all.empty() && all.back() == '\n') all.pop_back();
    return all;
  }
  std::optional<double> Number(const char* path) const {
    const auto text = Text(path);
    if (!text) return std::nullopt;
    std::istringstream in(*text);
    double value;
    return in >> value ? std::optional(value) : std::nullopt;
  }
  /// The number behind a word at the start of a line, with or without ':'.
  std::optional<double> Entry(const char* path, const std::string& key) const {
    std::istringstream lines(Text(path).value_or(""));
    for (std::string line; std::getline(lines, line);) {
      std::istringstream in(line);
      std::string word;
      double value;
      if (in >> word >> value && (word == key || word == key + ":")) return value;
    }
    return std::nullopt;
  }
  size_t Cpus() const {
    std::istringstream lines(Text("proc/cpuinfo").value_or(""));
    size_t n = 0;
    for (std::string line; std::getline(lines, line);) n += line.starts_with("processor");
    return std::max<size_t>(n, 1);
  }

 private:
  fs::path root_;
};

MachineFinding Load(const Reader& read) {
  const auto load = read.Number("proc/loadavg");
  if (!load) return {"load", Severity::kUnknown, "the system does not tell its load", ""};
  const double cpus = double(read.Cpus());
  const std::string says =
      fmt::format("{:.2f} processes want to run on {:.0f} CPUs (mean of the last minute)", *load, cpus);
  if (*load > 0.8 * cpus)
    return {"load", Severity::kWarning, says,
            "stop what else runs, or decide by pairs (raybench check --run), which see the same load"};
  if (*load > 0.3 * cpus) return {"load", Severity::kNote, says, "stop what else runs"};
  return {"load", Severity::kFine, says, ""};
}

MachineFinding Affinity(const Reader& read) {
  cpu_set_t allowed;
  if (sched_getaffinity(0, sizeof allowed, &allowed) != 0)
    return {"cores", Severity::kUnknown, "the system does not tell which CPUs may be used", ""};
  const int may = CPU_COUNT(&allowed);
  const std::string says = fmt::format("{} of {} CPUs may be used", may, read.Cpus());
  if (may == 1)
    return {"cores", Severity::kNote, says + ": this process shares its only one with all others",
            "allow a second CPU"};
  return {"cores", Severity::kFine, says, ""};
}

MachineFinding Cgroup(const Reader& read) {
  std::istringstream limit(read.Text("sys/fs/cgroup/cpu.max").value_or("max"));
  std::string quota;
  double period = 0;
  limit >> quota >> period;
  const double throttled = read.Entry("sys/fs/cgroup/cpu.stat", "nr_throttled").value_or(0);
  if (quota == "max" || period <= 0) return {"cgroup", Severity::kFine, "no limit on CPU time", ""};
  const std::string says = fmt::format("CPU time is limited to {:.2f} CPUs; it was throttled {:.0f} times",
                                       std::stod(quota) / period, throttled);
  return {"cgroup", throttled > 0 ? Severity::kWarning : Severity::kNote, says,
          "give the container whole CPUs (docker --cpuset-cpus) instead of a quota"};
}

MachineFinding Governor(const Reader& read) {
  const auto governor = read.Text("sys/devices/system/cpu/cpu0/cpufreq/scaling_governor");
  if (!governor)
    return {"governor", Severity::kUnknown, "the system does not tell how the frequency is governed", ""};
  if (*governor == "performance") return {"governor", Severity::kFine, "performance", ""};
  return {"governor", Severity::kNote, *governor + ": the frequency follows the load",
          "cpupower frequency-set -g performance"};
}

MachineFinding Turbo(const Reader& read) {
  const auto no_turbo = read.Number("sys/devices/system/cpu/intel_pstate/no_turbo");
  const auto boost = read.Number("sys/devices/system/cpu/cpufreq/boost");
  if (!no_turbo && !boost)
    return {"turbo", Severity::kUnknown, "the system does not tell whether turbo is on", ""};
  if (no_turbo ? *no_turbo != 0 : *boost == 0) return {"turbo", Severity::kFine, "off", ""};
  return {"turbo", Severity::kNote, "on: the frequency depends on temperature and on the other cores",
          no_turbo ? "echo 1 > /sys/devices/system/cpu/intel_pstate/no_turbo"
                   : "echo 0 > /sys/devices/system/cpu/cpufreq/boost"};
}

MachineFinding Smt(const Reader& read) {
  const auto active = read.Number("sys/devices/system/cpu/smt/active");
  if (!active)
    return {"SMT", Severity::kUnknown, "the system does not tell whether cores run two threads", ""};
  if (*active == 0) return {"SMT", Severity::kFine, "off, or hidden by a virtual machine", ""};
  return {"SMT", Severity::kNote, "on: a neighbour on the same core takes caches and units",
          "echo off > /sys/devices/system/cpu/smt/control"};
}

MachineFinding Virtual(const Reader& read) {
  const std::string cpu = read.Text("proc/cpuinfo").value_or("");
  if (cpu.empty())
    return {"virtual", Severity::kUnknown, "the system does not tell whether it is virtual", ""};
  if (cpu.find(" hypervisor") == std::string::npos)
    return {"virtual", Severity::kFine, "no virtual machine", ""};
  return {"virtual", Severity::kNote,
          "a virtual machine: its neighbours, frequency and threads per core are hidden",
          "compare only what was measured in the same run"};
}

/// Since the machine started: other guests of the same host.
MachineFinding Stolen(const Reader& read) {
  std::istringstream in(read.Text("proc/stat").value_or(""));
  std::string word;
  double value = 0, all = 0, stolen = 0;
  in >> word;
  for (int i = 0; i < 8 && in >> value; ++i) {
    all += value;
    if (i == 7) stolen = value;
  }
  if (all <= 0) return {"stolen time", Severity::kUnknown, "the system does not tell", ""};
  const double percent = 100 * stolen / all;
  const std::string says =
      fmt::format("{:.2f} % of the CPU time since start went to other guests of the host", percent);
  if (percent > 1)
    return {"stolen time", Severity::kWarning, says, "use a host that is not shared, or decide by pairs"};
  return {"stolen time", percent > 0.1 ? Severity::kNote : Severity::kFine, says, ""};
}

MachineFinding Memory(const Reader& read) {
  const auto total = read.Entry("proc/meminfo", "MemTotal"),
             available = read.Entry("proc/meminfo", "MemAvailable");
  if (!total || !available) return {"memory", Severity::kUnknown, "the system does not tell", ""};
  const double swapped = read.Entry("proc/meminfo", "SwapTotal").value_or(0) -
                         read.Entry("proc/meminfo", "SwapFree").value_or(0);
  const std::string says = fmt::format("{:.1f} of {:.1f} GiB available, {:.1f} GiB swapped out",
                                       *available / (1 << 20), *total / (1 << 20), swapped / (1 << 20));
  if (*available < 0.1 * *total)
    return {"memory", Severity::kWarning, says,
            "free memory: trees that are paged out are timed reading a disk"};
  return {"memory", swapped > 0.05 * *total ? Severity::kNote : Severity::kFine, says, ""};
}

}  // namespace

std::vector<MachineFinding> ExamineMachine(const fs::path& root) {
  const Reader read(root);
  return {Load(read), Affinity(read), Cgroup(read),  Governor(read), Turbo(read),
          Smt(read),  Stolen(read),   Virtual(read), Memory(read)};
}

Jitter MeasureJitter(double seconds) {
  Pinned pinned(true);
  std::vector<double> times;
  const Stopwatch whole(false);
  volatile uint64_t sink = 0;
  while (whole.Elapsed().wall < seconds || times.size() < 20) {
    const Stopwatch watch(false);
    uint64_t x = 1;
    for (int i = 0; i < 400000; ++i) x = x * 6364136223846793005u + 1442695040888963407u;
    sink = sink + x;
    times.push_back(watch.Elapsed().cpu);
  }
  std::sort(times.begin(), times.end());
  return {times[times.size() / 2] / times[0] - 1, times[times.size() * 95 / 100] / times[0] - 1};
}

MachineFinding FindingOf(const Jitter& jitter) {
  const std::string says = fmt::format(
      "the same work takes {:.1f} % longer than its best time in the middle, {:.1f} % at the 95th percentile",
      100 * jitter.median, 100 * jitter.p95);
  const Severity severity = jitter.p95 > 0.1    ? Severity::kWarning
                            : jitter.p95 > 0.02 ? Severity::kNote
                                                : Severity::kFine;
  return {"jitter", severity, says,
          severity == Severity::kFine ? "" : "more pairs: raybench check --run with a longer --seconds"};
}

MachineFinding WorstOf(const std::vector<MachineFinding>& findings) {
  const auto worst = std::max_element(
      findings.begin(), findings.end(), [](const MachineFinding& a, const MachineFinding& b) {
        const auto weight = [](const MachineFinding& f) {
          return f.severity == Severity::kUnknown ? Severity::kFine : f.severity;
        };
        return weight(a) < weight(b);
      });
  return worst == findings.end() ? MachineFinding{} : *worst;
}

const char* SeverityName(MachineFinding::Severity severity) {
  constexpr const char* kNames[] = {"fine", "unknown", "note", "warning"};
  return kNames[severity];
}

Json FactsOf(const std::vector<MachineFinding>& findings) {
  Json all = Json::array();
  for (const MachineFinding& f : findings)
    all.push_back(
        {{"subject", f.subject}, {"severity", SeverityName(f.severity)}, {"says", f.says}, {"cure", f.cure}});
  return all;
}

}  // namespace raybench
