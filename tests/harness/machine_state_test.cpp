// raybench doctor: findings from made-up /proc and /sys.
#include "harness/measure/machine_state.h"

#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>

namespace raybench {
namespace {
namespace fs = std::filesystem;
using ::testing::HasSubstr;

class MachineState : public ::testing::Test {
 protected:
  MachineState() : root_(fs::path(::testing::TempDir()) / "machine_state") {
    fs::remove_all(root_);
    // A quiet machine that tells everything.
    Write("proc/loadavg", "0.10 0.10 0.10 1/100 1");
    Write("proc/cpuinfo", "processor : 0\nflags : fpu sse\n\nprocessor : 1\nflags : fpu sse\n");
    Write("proc/stat", "cpu  1000 0 500 8000 0 0 0 0 0 0\n");
    Write("proc/meminfo",
          "MemTotal: 8000000 kB\nMemAvailable: 6000000 kB\nSwapTotal: 1000 kB\nSwapFree: 1000 kB\n");
    Write("sys/fs/cgroup/cpu.max", "max 100000");
    Write("sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "performance");
    Write("sys/devices/system/cpu/intel_pstate/no_turbo", "1");
    Write("sys/devices/system/cpu/smt/active", "0");
  }
  ~MachineState() override { fs::remove_all(root_); }

  void Write(const char* path, const char* text) {
    fs::create_directories((root_ / path).parent_path());
    std::ofstream(root_ / path) << text << '\n';
  }
  MachineFinding Find(const std::string& subject) {
    for (const MachineFinding& f : ExamineMachine(root_))
      if (f.subject == subject) return f;
    ADD_FAILURE() << subject;
    return {};
  }

  fs::path root_;
};

TEST_F(MachineState, AQuietMachineHasNoWarnings) {
  for (const MachineFinding& f : ExamineMachine(root_)) {
    if (f.subject == "cores") continue;  // of this very process
    EXPECT_EQ(f.severity, MachineFinding::kFine) << f.subject << ": " << f.says;
    EXPECT_EQ(f.cure, "") << f.subject;
  }
}

TEST_F(MachineState, WhatSpoilsTimingsIsFoundWithItsCure) {
  const struct {
    const char *path, *text, *subject;
    MachineFinding::Severity severity;
    const char* says;
  } cases[] = {
      {"proc/loadavg", "3.50 1 1 1/1 1", "load", MachineFinding::kWarning,
       "3.50 processes want to run on 2 CPUs"},
      {"proc/loadavg", "0.90 1 1 1/1 1", "load", MachineFinding::kNote, "0.90"},
      {"sys/fs/cgroup/cpu.max", "150000 100000", "cgroup", MachineFinding::kNote, "limited to 1.50 CPUs"},
      {"sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "powersave", "governor", MachineFinding::kNote,
       "powersave"},
      {"sys/devices/system/cpu/intel_pstate/no_turbo", "0", "turbo", MachineFinding::kNote, "on"},
      {"sys/devices/system/cpu/smt/active", "1", "SMT", MachineFinding::kNote, "on"},
      {"proc/stat", "cpu  1000 0 500 8000 0 0 0 500 0 0", "stolen time", MachineFinding::kWarning, "5.00 %"},
      {"proc/cpuinfo", "processor : 0\nflags : fpu hypervisor sse", "virtual", MachineFinding::kNote,
       "virtual"},
      {"proc/meminfo", "MemTotal: 8000000 kB\nMemAvailable: 600000 kB", "memory", MachineFinding::kWarning,
       "0.6 of 7.6 GiB available"}};
  for (const auto& c : cases) {
    SCOPED_TRACE(c.path);
    std::ifstream in(root_ / c.path);
    const std::string before((std::istreambuf_iterator<char>(in)), {});
    Write(c.path, c.text);
    const MachineFinding found = Find(c.subject);
    EXPECT_EQ(found.severity, c.severity);
    EXPECT_THAT(found.says, HasSubstr(c.says));
    EXPECT_NE(found.cure, "");
    Write(c.path, before.c_str());
  }
}

TEST_F(MachineState, ALimitThatThrottlesIsAWarning) {
  Write("sys/fs/cgroup/cpu.max", "150000 100000");
  Write("sys/fs/cgroup/cpu.stat", "usage_usec 1\nnr_periods 9\nnr_throttled 7");
  EXPECT_EQ(Find("cgroup").severity, MachineFinding::kWarning);
  EXPECT_THAT(Find("cgroup").says, HasSubstr("7 times"));
}

TEST_F(MachineState, WhatTheSystemDoesNotTellIsNotFine) {
  fs::remove_all(root_);
  int unknown = 0;
  for (const MachineFinding& f : ExamineMachine(root_)) unknown += f.severity == MachineFinding::kUnknown;
  EXPECT_GE(unknown, 6);
  EXPECT_NE(WorstOf(ExamineMachine(root_)).severity, MachineFinding::kWarning);
}

TEST_F(MachineState, TheWorstIsAWarning) {
  Write("sys/devices/system/cpu/smt/active", "1");
  EXPECT_EQ(WorstOf(ExamineMachine(root_)).subject, "SMT");
  Write("proc/loadavg", "9 9 9 1/1 1");
  EXPECT_EQ(WorstOf(ExamineMachine(root_)).subject, "load");
  const Json facts = FactsOf(ExamineMachine(root_));
  EXPECT_EQ(facts[0]["severity"], "warning");
}

TEST(Jitter, IsMeasuredAndJudged) {
  const Jitter jitter = MeasureJitter(0.02);
  EXPECT_GE(jitter.median, 0);
  EXPECT_GE(jitter.p95, jitter.median);
  EXPECT_EQ(FindingOf({0.001, 0.01}).severity, MachineFinding::kFine);
  EXPECT_EQ(FindingOf({0.01, 0.05}).severity, MachineFinding::kNote);
  EXPECT_EQ(FindingOf({0.1, 0.5}).severity, MachineFinding::kWarning);
}

}  // namespace
}  // namespace raybench
