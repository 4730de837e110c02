// The pipeline that run, verify and extremes share: what it asks, holds to the contract, judges and says.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include "harness/judge/claim.h"
#include "tests/support/oracle_scenes.h"

namespace raybench {
namespace {

using namespace testing;
using ::testing::StartsWith;

/// One triangle at x = 1; rays along x that meet it at t = 1, u = 0.5, v = 0.125, and one that misses.
class HarnessJudge : public ::testing::Test {
 protected:
  void SetUp() override {
    rays_.assign(4, MakeRay({0, 0.625f, 0.125f}, {1, 0, 0}));
    rays_[1] = MakeRay({0, 0.625f, 0.125f}, {-1, 0, 0});
    truth_ = oracle_->Ask(rays_, 1);
    right_ = Answers(rays_.size());
    for (size_t i = 0; i < rays_.size(); ++i) right_.hits[i] = {1, 0.5f, 0.125f, 0}, right_.occluded[i] = 1;
    right_.hits[1] = {kInf, 0, 0, RAYBENCH_NONE}, right_.occluded[1] = 0;
  }
  Verdicts Judge(const Answers& answers, uint32_t claim = RB_CLAIM_WATERTIGHT,
                 uint32_t query = RB_CLOSEST) const {
    return JudgeAnswers(claim, *oracle_, 1, {query, rays_}, {truth_}, answers, 1);
  }
  std::string Says(const Answers& answers, uint32_t claim, uint32_t query = RB_CLOSEST,
                   int scale_exponent = 0) const {
    const Verdicts verdicts = Judge(answers, claim, query);
    return BrokenClaim(claim, verdicts.counts, verdicts.breaking, scale_exponent);
  }

  const Scene scene_ = MakeScene({{1, 0, 0}, {1, 1, 0}, {1, 1, 1}}, {{0, 1, 2}});
  const std::unique_ptr<Oracle> oracle_ = MakeBoxOracle(scene_);
  std::vector<rb_ray> rays_;
  std::vector<Truth> truth_;
  Answers right_;
};

constexpr const char* kRay =
    "org (0x0p+0, 0x1.4p-1, 0x1p-3) dir (0x1p+0, 0x0p+0, 0x0p+0) tnear 0x0p+0 tfar inf is answered ";

TEST_F(HarnessJudge, RightAnswersBreakNothing) {
  for (uint32_t claim : {RB_CLAIM_WATERTIGHT, RB_CLAIM_EXACT})
    for (uint32_t query : {RB_CLOSEST, RB_ANY}) {
      EXPECT_EQ(Says(right_, claim, query), "");
      const Verdicts verdicts = Judge(right_, claim, query);
      EXPECT_EQ(verdicts.contract_flaw, "");
      EXPECT_EQ(verdicts.counts.rays, 4u);
      EXPECT_EQ(verdicts.counts.uv_judged, query == RB_CLOSEST ? 3u : 0u);
      EXPECT_FALSE(verdicts.breaking);
    }
}

TEST_F(HarnessJudge, SaysHowManyBreakAClaimAndWhichIsTheFirst) {
  Answers missing = right_, off = right_, loose = right_, free = right_;
  missing.hits[2] = missing.hits[3] = {kInf, 0, 0, RAYBENCH_NONE};
  const std::string lost = std::string(kRay) + "miss (false_miss); true is primitive 0 at t 0x1p+0";
  EXPECT_EQ(Says(missing, RB_CLAIM_WATERTIGHT),
            "claims watertight, but of 4 rays 2 false_miss; ray 2: " + lost);
  EXPECT_EQ(
      Says(missing, RB_CLAIM_EXACT),
      "claims exact, but of 4 rays 2 are not answered exactly to the bit: 2 false_miss; ray 2: " + lost);
  EXPECT_EQ(Says(missing, RB_CLAIM_INEXACT), "");
  off.hits[3].u = 0.25f;
  for (const auto& [claim, name] :
       {std::pair(RB_CLAIM_WATERTIGHT, "watertight"), std::pair(RB_CLAIM_EXACT, "exact")})
    EXPECT_THAT(Says(off, claim),
                StartsWith(fmt::format(
                    "claims {}, but of 4 rays 1 with u or v beyond its bound; ray 3: {}primitive 0 at t "
                    "0x1p+0, u 0x1p-2 v 0x1p-3 (exact); true is primitive 0 at t 0x1p+0, of the answered "
                    "one u 0x1p-1 +- ",
                    name, kRay)));
  loose.hits[0].t = std::nextafter(1.0f, 2.0f);
  EXPECT_EQ(Says(loose, RB_CLAIM_WATERTIGHT), "");
  EXPECT_THAT(
      Says(loose, RB_CLAIM_EXACT),
      StartsWith(
          "claims exact, but of 4 rays 1 are not answered exactly to the bit: 1 exact within the error; "
          "ray 0: "));
  free.occluded[0] = 0;
  EXPECT_EQ(Says(free, RB_CLAIM_WATERTIGHT, RB_ANY, 1),
            "claims watertight, but of 4 rays 1 false_miss; ray 0: org (0x0p+0, 0x1.4p-2, 0x1p-4) dir "
            "(0x1p-1, 0x0p+0, "
            "0x0p+0) tnear 0x0p+0 tfar inf is answered free (false_miss); true is primitive 0 at t 0x1p+0");
}

TEST_F(HarnessJudge, JudgesThePickedRaysAndNamesThemByTheirPlaces) {
  const std::vector<uint32_t> picks = {1, 3};
  const std::vector<Truth> truth = {truth_[1], truth_[3]};
  Answers answers = right_;
  answers.hits[0] = answers.hits[3] = {kInf, 0, 0, RAYBENCH_NONE};
  const Verdicts verdicts =
      JudgeAnswers(RB_CLAIM_WATERTIGHT, *oracle_, 1, {RB_CLOSEST, rays_}, {truth, picks}, answers, 1);
  EXPECT_EQ(verdicts.counts.rays, 2u);
  EXPECT_EQ(verdicts.counts[Verdict::kFalseMiss], 1u);
  ASSERT_TRUE(verdicts.breaking);
  EXPECT_EQ(verdicts.breaking->index, 3u);
}

TEST_F(HarnessJudge, WhatSkipsOrResumesIsHeldToTheContractAlone) {
  Answers answers = right_;
  answers.hits[0].t = 0;
  const std::vector<uint32_t> none(4, RAYBENCH_NONE),
      resumes = {0, RAYBENCH_NONE, RAYBENCH_NONE, RAYBENCH_NONE};
  const auto judge = [&](const Question& question) {
    return JudgeAnswers(RB_CLAIM_WATERTIGHT, *oracle_, 1, question, {truth_}, answers, 1);
  };
  const std::string flaw = "ray 0 hits at t = 0; a finite t in (0, inf] is allowed";
  for (const Question& question :
       {Question{RB_CLOSEST, rays_, none}, Question{RB_CLOSEST, rays_, {}, none}}) {
    EXPECT_EQ(judge(question).counts.rays, 0u);
    EXPECT_EQ(judge(question).contract_flaw, flaw);
  }
  EXPECT_EQ(judge({RB_CLOSEST, rays_}).contract_flaw, flaw);
  EXPECT_EQ(judge({RB_CLOSEST, rays_}).counts.rays, 4u);
  EXPECT_EQ(judge({RB_CLOSEST, rays_, {}, resumes}).contract_flaw, "") << "t == tnear may be the next hit";
}

TEST_F(HarnessJudge, WithoutUvTheyAreNeitherJudgedNorCompared) {
  Answers answers = right_;
  for (rb_hit& hit : answers.hits) hit.u = hit.v = kNan;
  Question question{RB_CLOSEST, rays_};
  EXPECT_EQ(FirstDifference(question, right_, answers), 0u);
  EXPECT_EQ(JudgeAnswers(RB_CLAIM_EXACT, *oracle_, 1, question, {truth_}, answers, 1).counts.uv_wrong, 3u);
  question.has_uv = false;
  EXPECT_EQ(FirstDifference(question, right_, answers), 4u);
  const Verdicts verdicts = JudgeAnswers(RB_CLAIM_EXACT, *oracle_, 1, question, {truth_}, answers, 1);
  EXPECT_EQ(verdicts.counts.uv_judged, 0u);
  EXPECT_FALSE(verdicts.breaking);
}

}  // namespace
}  // namespace raybench
