// How much the fuzzer finds: plugins with one classic fault each, and their honest twins.
#include <gtest/gtest.h>
#include <sched.h>

#include <algorithm>
#include <filesystem>
#include <set>

#include "harness/fuzz/fuzz.h"
#include "tests/support/effort.h"
#include "tests/support/source_directory.h"

namespace raybench::fuzz {
namespace {
namespace fs = std::filesystem;
using raybench::testing::kSanitized;

std::vector<std::string> Plugins() {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(kBuiltSaboteurs))
    if (entry.path().extension() == ".so") names.push_back(entry.path().stem());
  std::sort(names.begin(), names.end());
  return names;
}

std::string PathOf(const std::string& name) { return (fs::path(kBuiltSaboteurs) / (name + ".so")).string(); }

/// These show only in large trees or between threads.
bool NeedsMuch(const std::string& name) {
  static const std::set<std::string> names = {"stack_overflow", "race_in_counters", "shared_mailbox"};
  return names.contains(name);
}

/// While it lives, this process and its children run on one processor.
class OneProcessor {
 public:
  OneProcessor() {
    EXPECT_EQ(sched_getaffinity(0, sizeof before_, &before_), 0);
    cpu_set_t one;
    CPU_ZERO(&one);
    for (int i = 0; i < CPU_SETSIZE && CPU_COUNT(&one) == 0; ++i)
      if (CPU_ISSET(i, &before_)) CPU_SET(i, &one);
    EXPECT_EQ(sched_setaffinity(0, sizeof one, &one), 0);
  }
  ~OneProcessor() { sched_setaffinity(0, sizeof before_, &before_); }
  OneProcessor(const OneProcessor&) = delete;

 private:
  cpu_set_t before_;
};

std::string TextOf(const std::vector<Finding>& findings) {
  std::string text;
  for (const Finding& f : findings) text += f.check + ": " + f.text + "\n";
  return text;
}

class Saboteur : public ::testing::TestWithParam<std::string> {};

TEST_P(Saboteur, IsFoundAndShrunk) {
  Registry registry;
  if (GetParam() == "default_out_of_range") {
    EXPECT_THROW(registry.LoadPlugin(PathOf(GetParam())), InputError);
    return;
  }
  registry.LoadPlugin(PathOf(GetParam()));
  const bool honest = GetParam().starts_with("honest_");
  FuzzOptions options;
  options.structures = {GetParam()};
  options.seconds = 0, options.cases = honest ? (kSanitized ? 40 : 400) : 20000;
  options.findings = honest ? 0 : 1, options.quiet = true;
  options.shrink = !kSanitized;  // a process for each candidate takes long there
  const FuzzResult result = Fuzz(registry, options);
  if (honest) {
    for (const FoundFault& fault : result.faults)
      ADD_FAILURE() << fault.check << ": " << fault.text << "\n" << Format(fault.smallest);
    return;
  }
  ASSERT_FALSE(result.faults.empty()) << result.structures[0].cases << " cases";
  const FoundFault& fault = result.faults[0];
  EXPECT_TRUE(fault.repeats) << fault.check << ": " << fault.text;
  if (NeedsMuch(GetParam()) || kSanitized) return;
  EXPECT_LE(fault.smallest.primitives(), 4u) << Format(fault.smallest);
  EXPECT_LE(fault.smallest.rays.size(), GetParam() == "stale_hit" ? 2u : 1u) << Format(fault.smallest);
  // The file alone shows it again.
  const Case again = ParseCase(Format(fault.smallest), "case");
  const std::vector<Finding> findings = ExamineIsolated(registry, again);
  EXPECT_TRUE(std::ranges::any_of(findings, [&](const Finding& f) { return f.check == fault.check; }))
      << Format(again);
  const OneProcessor only;
  EXPECT_EQ(TextOf(ExamineIsolated(registry, again)), TextOf(findings));
}

INSTANTIATE_TEST_SUITE_P(Fuzz, Saboteur, ::testing::ValuesIn(Plugins()),
                         [](const auto& info) { return info.param; });

}  // namespace
}  // namespace raybench::fuzz
