// How a case keeps within its budget: parts of ray sets, samples, what is left of a run, engine arguments.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "accel/base/error.h"
#include "harness/measure/measure.h"
#include "harness/plan/cost_model.h"
#include "harness/plan/time_budget.h"

namespace raybench {
namespace {

/// Ray i starts at (i, 0, 0).
RaySet NumberedRays(uint64_t count) {
  RaySet set{.kind = "camera", .order = "traced", .rays = {}, .hash = "00000000000000ff"};
  for (uint64_t i = 0; i < count; ++i) set.rays.push_back({{float(i), 0, 0}, 0, {0, 0, 1}, 1});
  return set;
}

std::vector<uint64_t> NumbersOf(const RaySet& set) {
  std::vector<uint64_t> numbers;
  for (const rb_ray& ray : set.rays) numbers.push_back(uint64_t(ray.org[0]));
  return numbers;
}

TEST(HarnessBudget, APartIsOfWholeTilesEvenlySpreadAndInEveryLargerOne) {
  const RaySet set = NumberedRays(64 * 64);
  EXPECT_EQ(NumbersOf(PartOf(set, 0, 1)), NumbersOf(set));
  std::vector<uint64_t> larger = NumbersOf(set);
  for (uint32_t step = 1; step <= 3; ++step) {
    const std::vector<uint64_t> part = NumbersOf(PartOf(set, step, 1));
    ASSERT_EQ(part.size(), set.rays.size() >> (2 * step));
    const uint64_t stretch = 64u << (2 * step);  // rays of which one tile stays
    for (uint64_t i = 0; i < part.size(); ++i) {
      EXPECT_EQ(part[i] % 64, i % 64) << "a tile is whole and in order";
      EXPECT_EQ(part[i] / stretch, i / 64) << "one of each stretch";
    }
    EXPECT_TRUE(std::includes(larger.begin(), larger.end(), part.begin(), part.end())) << step;
    larger = part;
  }
  EXPECT_EQ(NumbersOf(PartOf(set, 2, 1)), NumbersOf(PartOf(set, 2, 1)));
  EXPECT_NE(NumbersOf(PartOf(set, 1, 1)), NumbersOf(PartOf(set, 1, 2)));
  RaySet other = set;
  other.hash = "00000000000000fe";
  EXPECT_NE(NumbersOf(PartOf(set, 1, 1)), NumbersOf(PartOf(other, 1, 1)));
}

TEST(HarnessBudget, AnIncompleteTileIsATileToo) {
  // 5 tiles, the last of 10 rays; 2 at step 1, the second of which is that.
  const RaySet part = PartOf(NumberedRays(4 * 64 + 10), 1, 7);
  EXPECT_EQ(part.rays.size(), 74u);
  EXPECT_EQ(part.rays.back().org[0], 4 * 64 + 9);
  EXPECT_EQ(part.query, uint32_t(RB_CLOSEST));
}

TEST(HarnessBudget, TheLadderEndsAtTheSmallestPartThatIsLargeEnough) {
  EXPECT_EQ(LastStep(1 << 17, 1024), 3u);  // 32K, 8K, 2K rays
  EXPECT_EQ(LastStep(1 << 14, 1024), 2u);  // 4K, 1K
  EXPECT_EQ(LastStep(4095, 1024), 1u);     // 64 tiles: 16
  EXPECT_EQ(LastStep(1023, 1024), 0u);
  EXPECT_EQ(LastStep(0, 1024), 0u);
  EXPECT_EQ(LastStep(1 << 17, 64 * 1024), 0u);
  for (uint64_t rays : {1000u, 4096u, 100000u}) {
    const uint32_t last = LastStep(rays, 1024);
    EXPECT_TRUE(last == 0 || PartOf(NumberedRays(rays), last, 1).rays.size() + 63 >= 1024) << rays;
  }
}

TEST(HarnessBudget, AStepIsTheFirstWhosePassFitsIntoASample) {
  const TimeBudget budget{.seconds = 0.36, .repetitions = 9};  // samples of 20 ms
  EXPECT_DOUBLE_EQ(budget.SampleSeconds(), 0.02);
  EXPECT_EQ(StepFor(0.019, 3, budget), 0u);
  EXPECT_EQ(StepFor(0.021, 3, budget), 1u);
  EXPECT_EQ(StepFor(0.081, 3, budget), 2u);
  EXPECT_EQ(StepFor(25, 3, budget), 3u) << "there is nothing below the last";
}

TEST(HarnessBudget, SamplesAreAsManyAsTheBudgetPaysAndThreeAtLeast) {
  const TimeBudget budget{.seconds = 0.36, .repetitions = 9};
  EXPECT_EQ(budget.Samples(0.04), 9u);
  EXPECT_EQ(budget.Samples(0.05), 7u);
  EXPECT_EQ(budget.Samples(10), 3u);
  EXPECT_EQ((TimeBudget{.seconds = 0.36, .repetitions = 9, .fixed = true}.Samples(10)), 9u)
      << "what the user asked for";
  EXPECT_EQ((TimeBudget{.seconds = 0.04, .repetitions = 1}.Samples(10)), 1u) << "never more than asked for";
  EXPECT_EQ((TimeBudget{.seconds = 0.03, .repetitions = 6, .fewest = 1}.Samples(10)), 1u) << "a quick run";
  EXPECT_EQ((TimeBudget{.seconds = 0.03, .repetitions = 6, .fewest = 1}.Samples(0.01)), 3u);
  const SamplePlan fast = PlanSamples(0.001, budget);
  EXPECT_EQ(fast.passes, 20u);
  EXPECT_TRUE(fast.warm_up);
  EXPECT_DOUBLE_EQ(fast.sample_cost, 0.021);
  EXPECT_EQ(fast.samples, 9u);
  const SamplePlan slow = PlanSamples(0.5, budget);
  EXPECT_EQ(slow.passes, 1u);
  EXPECT_FALSE(slow.warm_up);
  EXPECT_EQ(slow.samples, 3u);
}

TEST(HarnessCostModel, GuessesHoldUntilSomethingIsMeasured) {
  CostModel costs;
  costs.Plan(Work::kCheck, "a", 10);
  costs.Plan(Work::kCheck, "b", 5);
  costs.Plan(Work::kTiming, "", 20);
  EXPECT_DOUBLE_EQ(costs.Left(), 35);
  costs.Withdraw(Work::kTiming, "", 8);
  EXPECT_DOUBLE_EQ(costs.Left(), 27);
  costs.Withdraw(Work::kTiming, "", 100);
  EXPECT_DOUBLE_EQ(costs.Left(), 15) << "never less than nothing";
}

TEST(HarnessCostModel, WhatWasMeasuredCorrectsTheSameDoerMostThenTheKindThenAll) {
  CostModel costs;
  for (const char* who : {"slow", "usual"}) costs.Plan(Work::kCheck, who, 20);
  costs.Plan(Work::kCheck, "new", 10);
  costs.Plan(Work::kBuild, "slow", 10);
  costs.Finish(Work::kCheck, "slow", 10, 100);
  costs.Finish(Work::kCheck, "usual", 10, 10);
  EXPECT_NEAR(costs.Expect(Work::kCheck, "slow", 10), 100, 3);
  EXPECT_NEAR(costs.Expect(Work::kCheck, "usual", 10), 10, 1);
  EXPECT_NEAR(costs.Expect(Work::kCheck, "new", 10), 55, 2) << "as that kind of work went";
  EXPECT_NEAR(costs.Expect(Work::kBuild, "slow", 10), 55, 2) << "as all work went";
  EXPECT_DOUBLE_EQ(costs.Left(),
                   costs.Expect(Work::kCheck, "slow", 10) + costs.Expect(Work::kCheck, "usual", 10) +
                       costs.Expect(Work::kCheck, "new", 10) + costs.Expect(Work::kBuild, "slow", 10));
  EXPECT_DOUBLE_EQ(costs.Spent(Work::kCheck), 110);
  EXPECT_DOUBLE_EQ(costs.Spent(Work::kTiming), 0);
}

TEST(HarnessCostModel, AfterAFifthTheRestIsRightWhateverTheMachine) {
  // Three scenes alike, on a machine three times slower than the guesses think, one doer slower still.
  CostModel costs;
  const std::map<std::string, double> truth = {{"a", 3}, {"b", 3}, {"grid", 12}};
  for (int scene = 0; scene < 5; ++scene)
    for (const auto& [who, seconds] : truth) costs.Plan(Work::kCheck, who, 1);
  for (const auto& [who, seconds] : truth) costs.Finish(Work::kCheck, who, 1, seconds);
  EXPECT_NEAR(costs.Left(), 4 * 18, 0.25 * 4 * 18);
}

TEST(HarnessEngineFlags, OnlyFilterAndMinTimeAreTakenAndOnlyWhereTheyCanBeRead) {
  for (const char* flag : {"--benchmark_perf_counters=CYCLES",
                           "--benchmark_list_tests=true",
                           "--benchmark_list_tests",
                           "--benchmark_out=x.json",
                           "--benchmark_out_format=xml",
                           "--benchmark_format=xml",
                           "--benchmark_format=json",
                           "--benchmark_repetitions=3",
                           "--benchmark_dry_run",
                           "--benchmark_enable_random_interleaving=false",
                           "--benchmark_report_aggregates_only=true",
                           "--benchmark_bogus",
                           "--benchmark_filter=[",
                           "--benchmark_filter=-(",
                           "--benchmark_min_time=",
                           "--benchmark_min_time",
                           "--benchmark_min_time=soon",
                           "--benchmark_min_time=10x",
                           "--benchmark_min_time=-1",
                           "--benchmark_min_time=0",
                           "--benchmark_min_time=nan",
                           "--benchmark_min_time=inf"}) {
    try {
      const EngineFlags flags({flag});
      ADD_FAILURE() << flag << " is taken";
    } catch (const InputError& error) {
      EXPECT_TRUE(std::string(error.what()).starts_with(std::string(flag) + ": ")) << error.what();
    }
  }
  EXPECT_EQ(EngineFlags({"--benchmark_min_time=0.25"}).min_time(), 0.25);
  EXPECT_EQ(EngineFlags({"--benchmark_min_time=2s"}).min_time(), 2);
  EXPECT_FALSE(EngineFlags({}).min_time());
}

TEST(HarnessEngineFlags, TheFilterIsGoogleBenchmarks) {
  EXPECT_TRUE(EngineFlags({}).Takes("a"));
  for (const char* all : {"--benchmark_filter", "--benchmark_filter=", "--benchmark_filter=all"})
    EXPECT_TRUE(EngineFlags({all}).Takes("scene/b")) << all;
  const EngineFlags camera({"--benchmark_filter=camera|shadow[.]0"});
  EXPECT_TRUE(camera.Takes("s/bvh_sah/camera/traced/closest/threads:1"));
  EXPECT_TRUE(camera.Takes("s/bvh_sah/shadow.0/traced/any/threads:1"));
  EXPECT_FALSE(camera.Takes("s/bvh_sah/shadow.1/traced/any/threads:1"));
  const EngineFlags not_camera({"--benchmark_filter=-camera"});
  EXPECT_FALSE(not_camera.Takes("s/bvh_sah/camera/traced/closest/threads:1"));
  EXPECT_TRUE(not_camera.Takes("s/bvh_sah/random/traced/closest/threads:1"));
}

}  // namespace
}  // namespace raybench
