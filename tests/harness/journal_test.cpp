// The journal of unfinished cases: what comes back, what is dropped, what is an error. And what samples of several
// sessions say.
#include "harness/results/journal.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "accel/base/error.h"
#include "accel/base/random.h"
#include "harness/measure/statistics.h"
#include "harness/results/times.h"
#include "harness/run/entrant.h"
#include "tests/support/files.h"

namespace raybench {
namespace {

namespace fs = std::filesystem;

class SweepsJournal : public ::testing::Test {
 protected:
  SweepsJournal()
      : file_(fs::path(::testing::TempDir()) /
              ("journal_" + std::string(::testing::UnitTest::GetInstance()->current_test_info()->name())) /
              "s.jsonl") {
    fs::remove_all(file_.parent_path());
  }
  ~SweepsJournal() override { fs::remove_all(file_.parent_path()); }

  const fs::path file_;
  const Json same_ = {{"machine", "m"}};
};

Sample ASample(double seconds, uint64_t session = 0) {
  return {
      .sample = 0, .sequence = 3, .passes = 2, .time = {seconds, seconds}, .process = 1, .session = session};
}

TEST_F(SweepsJournal, GivesBackWhatEarlierSessionsAdded) {
  {
    Journal first(file_, same_, 0);
    EXPECT_FALSE(fs::exists(file_)) << "nothing is written before there is something to keep";
    first.Add("build", "grid/1", {{"seconds", 0.1}});
    first.Add("build", "grid/1", {{"seconds", 1.0 / 3}});
    first.AddSample("a", ASample(0.25));
  }
  Journal second(file_, same_, 1);
  EXPECT_EQ(second.Find("build", "grid/1").at("seconds"), 1.0 / 3) << "the newest, to the bit";
  EXPECT_TRUE(second.Find("build", "grid/2").is_null());
  second.AddSample("a", ASample(0.5));
  const std::vector<Sample> samples = Journal(file_, same_, 2).SamplesOf("a");
  ASSERT_EQ(samples.size(), 2u);
  EXPECT_EQ(samples[0].session, 0u);
  EXPECT_EQ(samples[1].session, 1u);
  EXPECT_EQ(samples[1].sample, 1u);
  EXPECT_EQ(samples[1].process, 1u);
  EXPECT_EQ(samples[1].time.cpu, 0.5);
}

TEST_F(SweepsJournal, ALineThatAKillTookHalfOfIsDroppedAndWrittenOver) {
  Journal(file_, same_, 0).AddSample("a", ASample(0.25));
  std::ofstream(file_, std::ios::app) << R"({"kind": "sample", "of": "a", "sec)";
  {
    Journal second(file_, same_, 1);
    EXPECT_EQ(second.SamplesOf("a").size(), 1u);
    second.AddSample("a", ASample(0.5));
  }
  EXPECT_EQ(Journal(file_, same_, 2).SamplesOf("a").size(), 2u);
}

TEST_F(SweepsJournal, DropsWhatDependedOnSomethingElse) {
  Journal(file_, same_, 0).AddSample("a", ASample(0.25));
  Journal other(file_, {{"machine", "n"}}, 1);
  EXPECT_TRUE(other.dropped());
  EXPECT_TRUE(other.SamplesOf("a").empty());
  other.AddSample("b", ASample(0.5));
  EXPECT_TRUE(Journal(file_, same_, 2).dropped());
}

TEST_F(SweepsJournal, CountsSessionsThatGotNowhere) {
  Journal(file_, same_, 0).AddSample("a", ASample(0.25));
  EXPECT_EQ(Journal(file_, same_, 1).FruitlessSessions(), 0u);
  for (uint64_t session : {1, 2}) Journal(file_, same_, session).Begin();
  EXPECT_EQ(Journal(file_, same_, 3).FruitlessSessions(), 2u);
  Journal(file_, same_, 3).AddSample("a", ASample(0.25));
  EXPECT_EQ(Journal(file_, same_, 4).FruitlessSessions(), 0u);
}

TEST_F(SweepsJournal, ABrokenLineIsNamed) {
  Journal(file_, same_, 0).AddSample("a", ASample(0.25));
  std::ofstream(file_, std::ios::app) << "what?\n";
  try {
    Journal(file_, same_, 1);
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("s.jsonl: line 4 is no record"), std::string::npos)
        << error.what();
  }
}

TEST(SweepsEntrant, AVerdictIsThatOfATreeWithTheSameNodes) {
  Entrant entrant;
  entrant.build_values[1][column::claim] = "watertight";
  EXPECT_TRUE(entrant.MayHaveDigest("0123456789abcdef")) << "nothing is known";
  entrant.build_values[2][column::tree_digest] = "0123456789abcdef";
  EXPECT_TRUE(entrant.MayHaveDigest("0123456789abcdef"));
  EXPECT_FALSE(entrant.MayHaveDigest("fedcba9876543210"));
  EXPECT_FALSE(entrant.MayHaveDigest(""));
}

TEST(SweepsStatistics, AWeightedMedianHasHalfOfTheWeightOnEachSide) {
  EXPECT_EQ(WeightedMedian({{3, 1}, {1, 1}, {2, 1}}), 2);
  EXPECT_EQ(WeightedMedian({{4, 1.0 / 3}, {1, 1.0 / 3}, {2, 1.0 / 3}, {3, 1.0 / 3}}), 2.5);
  EXPECT_EQ(WeightedMedian({{1, 1}, {2, 1}, {10, 5}}), 10);
  EXPECT_EQ(WeightedMedian({{7, 0.1}}), 7);
}

TEST(SweepsStatistics, GroupsThatDifferHaveAWiderIntervalThanTheirSamplesPooled) {
  std::vector<std::vector<double>> groups;
  std::vector<double> pooled;
  for (int g = 0; g < 6; ++g) {
    groups.emplace_back();
    for (int i = 0; i < 9; ++i) groups.back().push_back(100 + 10 * g + 0.1 * i);
    pooled.insert(pooled.end(), groups.back().begin(), groups.back().end());
  }
  const MedianInterval by_groups = MedianOfGroups(groups), one = MedianOf(pooled);
  EXPECT_EQ(by_groups.median, one.median);
  EXPECT_GT(*by_groups.hi - *by_groups.lo, 1.3 * (*one.hi - *one.lo));
  EXPECT_LE(*by_groups.lo, by_groups.median);
  EXPECT_EQ(*MedianOfGroups(groups).lo, *by_groups.lo) << "the same each time";
  EXPECT_EQ(MedianOfGroups({{pooled}}).lo, one.lo) << "one group is as ever";
  EXPECT_FALSE(MedianOfGroups(std::vector<std::vector<double>>{{1, 2}, {3, 4, 5}}).lo) << "five samples";
}

TEST(SweepsStatistics, TheIntervalOfGroupsCoversItsMedianAsOftenAsItSays) {
  // Six groups of five, whose centres are spread as widely as the values within: 300 times.
  Random random(5);
  const auto noise = [&] {
    double sum = -6;  // nearly normal
    for (int i = 0; i < 12; ++i) sum += double(random.Below(1 << 20)) / (1 << 20);
    return sum;
  };
  int covered = 0;
  constexpr int kTries = 300;
  for (int t = 0; t < kTries; ++t) {
    std::vector<std::vector<double>> groups(6);
    for (auto& group : groups) {
      const double centre = noise();
      for (int i = 0; i < 5; ++i) group.push_back(centre + noise());
    }
    const MedianInterval interval = MedianOfGroups(groups);
    covered += *interval.lo <= 0 && 0 <= *interval.hi;
  }
  // Six groups are few: the percentile interval is known to be somewhat short there.
  EXPECT_GE(covered, kTries * 85 / 100);
  EXPECT_LE(covered, kTries * 99 / 100);
}

}  // namespace
}  // namespace raybench
