// Case names, case files and the CSVs derived from them.
#include "harness/results/results.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>

#include "harness/base/columns.h"
#include "harness/judge/verdicts.h"
#include "harness/measure/measure.h"
#include "harness/results/table.h"
#include "tests/support/files.h"

namespace raybench {
namespace {

namespace fs = std::filesystem;

class HarnessResults : public ::testing::Test {
 protected:
  HarnessResults() : folder_(fs::path(::testing::TempDir()) / (std::string("raybench_results_") + Name())) {
    fs::remove_all(folder_);
  }
  ~HarnessResults() override { fs::remove_all(folder_); }
  static const char* Name() { return ::testing::UnitTest::GetInstance()->current_test_info()->name(); }
  fs::path folder_;
};

Case ACase() {
  Case c;
  c.scene = "sphereflake(depth=2)", c.scene_hash = "0123456789abcdef", c.primitives = 91;
  c.structure = "bvh_sah", c.spec = "bvh_sah(leaf_size=2)", c.params = "leaf_size=2,numerics=watertight";
  c.ray_set = "camera", c.ray_hash = "00000000000000ff", c.query = "closest", c.order = "traced",
  c.rays = 640;
  c.threads = 2, c.seed = 5;
  return c;
}

TEST(HarnessPlan, CaseIdIsStableAndChangesWithEveryPartOfTheName) {
  const Case base = ACase();
  // Results of different machines and days are merged by this; it may not change by accident.
  EXPECT_EQ(base.Id(), ACase().Id());
  EXPECT_EQ(base.Id().size(), 16u);
  std::set<std::string> ids = {base.Id()};
  for (auto part : {&Case::scene, &Case::scene_hash, &Case::structure, &Case::params, &Case::ray_set,
                    &Case::ray_hash, &Case::query, &Case::order}) {
    Case other = base;
    other.*part += "x";
    EXPECT_TRUE(ids.insert(other.Id()).second);
  }
  Case other = base;
  other.threads = 3;
  EXPECT_TRUE(ids.insert(other.Id()).second);
  other = base, other.seed = 6;
  EXPECT_TRUE(ids.insert(other.Id()).second);
  other = base, other.plan_index = 99, other.spec = "anything";
  EXPECT_EQ(other.Id(), base.Id());
}

TEST(HarnessPlan, FileStemsAreSafe) {
  EXPECT_EQ(FileStem("sphereflake(depth=4)"), "sphereflake_depth_4");
  EXPECT_EQ(FileStem("stadium(size=1.5,detail=3)"), "stadium_size_1_5_detail_3");
  EXPECT_EQ(FileStem("/data/my model.v2.glb"), "my_model_v2");
  EXPECT_EQ(FileStem("../..//"), "scene");
}

TEST(HarnessCsv, QuotesWhatNeedsItAndLeavesNullEmpty) {
  EXPECT_EQ(CsvField("plain"), "plain");
  EXPECT_EQ(CsvField("a=1,b=2"), "\"a=1,b=2\"");
  EXPECT_EQ(CsvField("say \"hi\""), "\"say \"\"hi\"\"\"");
  EXPECT_EQ(CsvField("two\nlines"), "\"two\nlines\"");
  EXPECT_EQ(CsvField(nullptr), "");
  EXPECT_EQ(CsvField(0), "0");
  EXPECT_EQ(CsvField(uint64_t{18446744073709551615u}), "18446744073709551615");
  EXPECT_EQ(CsvField(0.1), "0.1");
  EXPECT_EQ(std::stod(CsvField(1.0 / 3)), 1.0 / 3);
}

TEST(HarnessRow, ReadsBackWhatItWroteAndRefusesWhatIsOfAnotherTableOrType) {
  Row row;
  row[column::scene] = "s";
  row[column::hits] = 18446744073709551615u;
  row[column::sah_cost] = 1.0 / 3;
  row[column::needs_geometry] = true;
  row[column::epo] = std::optional<double>();
  const Row read(Json::parse(Dump(row.ToJson(kCasesColumns))), kCasesColumns);
  EXPECT_EQ(read.Get(column::scene), "s");
  EXPECT_EQ(read.Get(column::hits), 18446744073709551615u);
  EXPECT_EQ(read.Get(column::sah_cost), 1.0 / 3);
  EXPECT_EQ(read.Get(column::needs_geometry), true);
  EXPECT_FALSE(read.Has(column::epo));
  EXPECT_EQ(read.Get(column::epo), std::nullopt);
  EXPECT_EQ(read.ToCsv(kCasesColumns), row.ToCsv(kCasesColumns));
  EXPECT_THROW(row.ToJson(kSamplesColumns), std::logic_error) << "samples have no hits";
  for (const char* text : {R"([])", R"({"stauts": "timed"})", R"({"hits": -1})", R"({"hits": 1.5})",
                           R"({"needs_geometry": 2})", R"({"scene": 1})", R"({"sah_cost": "much"})"})
    EXPECT_THROW(Row(Json::parse(text), kCasesColumns), std::invalid_argument) << text;
  EXPECT_NO_THROW(Row(Json::parse(R"({"sah_cost": 3, "note": null})"), kCasesColumns));
}

TEST(HarnessRow, EveryVerdictIsAColumnOfEveryTableThatCountsThem) {
  for (size_t v = 0; v < size_t(Verdict::kCount); ++v) {
    Row row;
    row[ClassColumn(Verdict(v))] = 1u;
    EXPECT_NO_THROW(row.ToJson(kCasesColumns));
    EXPECT_NO_THROW(row.ToJson(kVerdictsColumns));
    EXPECT_NO_THROW(row.ToJson(kExtremesColumns));
  }
}

/// A row with a status alone.
Row Ended(const char* status) {
  Row row;
  row[column::status] = status;
  return row;
}

TEST_F(HarnessResults, StoredCasesComeBackInPlanOrderAndAsCsv) {
  const ResultFolder folder(folder_, false);
  Case second = ACase(), first = ACase();
  second.plan_index = 7, first.plan_index = 3, first.threads = 1;
  const Sample sample{0, 4, 12, {0.25, 1.0 / 3}, 2, 5};
  EXPECT_FALSE(folder.Has(second.Id()));
  Row timed = Ended("timed"), refused = Ended("refused");
  timed[column::steps] = 1.0 / 3;
  timed[column::hits] = 12u;
  timed[column::timed_rays] = 128u;
  refused[column::note] = "claims \"exact\", but";
  folder.Store(second, timed, std::span(&sample, 1));
  folder.Store(first, refused, {});
  EXPECT_TRUE(folder.Has(second.Id()));
  const std::vector<FinishedCase> cases = folder.Cases();
  ASSERT_EQ(cases.size(), 2u);
  EXPECT_EQ(cases[0].row.Get(column::case_id), first.Id());
  EXPECT_EQ(cases[1].row.Get(column::steps), 1.0 / 3);
  EXPECT_FALSE(cases[0].row.Has(column::median_ns));
  folder.WriteCsvs();
  const std::string csv = Read(folder_ / "cases.csv");
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 3);
  EXPECT_TRUE(csv.starts_with("case_id,scene,scene_hash,primitives,structure,spec,params,ray_set,"));
  EXPECT_NE(
      csv.find(
          ",build_peak_bytes,cold_ns,samples,timed_rays,median_ns,lo_ns,hi_ns,rate,anchor,anchor_ns,device,"
          "device_ns,copies_ns,sessions,machine\n"),
      std::string::npos);
  EXPECT_NE(csv.find(",\"claims \"\"exact\"\", but\","), std::string::npos);
  EXPECT_EQ(
      Read(folder_ / "samples.csv"),
      "case_id,scene,structure,spec,ray_set,query,threads,sample,sequence,passes,rays,seconds,cpu_seconds,"
      "process,session\n" +
          second.Id() +
          ",sphereflake(depth=2),bvh_sah,bvh_sah(leaf_size=2),camera,closest,2,0,4,12,128,0.25," +
          CsvField(1.0 / 3) + ",2,5\n");
  for (const auto& entry : fs::recursive_directory_iterator(folder_))
    EXPECT_NE(entry.path().extension(), ".tmp");
}

TEST_F(HarnessResults, AColumnOfAnotherTableIsAProgrammingError) {
  Row row;
  row[column::suite] = "far";
  EXPECT_THROW(ResultFolder(folder_, false).Store(ACase(), row, {}), std::logic_error);
}

TEST_F(HarnessResults, AFolderWithCasesNeedsResume) {
  ResultFolder(folder_, false).Store(ACase(), Ended("timed"), {});
  try {
    ResultFolder(folder_, false);
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("already holds 1 finished cases: add --resume"),
              std::string::npos);
  }
  EXPECT_TRUE(ResultFolder(folder_, true).Has(ACase().Id()));
}

TEST_F(HarnessResults, ABrokenCaseFileIsNamed) {
  const ResultFolder folder(folder_, false);
  for (const char* text : {"{\"format\": 1,", "[]", "{\"format\": 999}",
                           R"({"format": 1, "plan_index": 0, "case": {"hits": "many"}, "samples": []})"}) {
    std::ofstream(folder_ / "cases" / "0000000000000000.json") << text;
    try {
      folder.Cases();
      FAIL() << "accepted: " << text;
    } catch (const InputError& error) {
      const std::string line = error.what();
      EXPECT_NE(line.find("0000000000000000.json: not a case file of this raybench ("), std::string::npos);
      EXPECT_EQ(line.find('\n'), std::string::npos);
    }
  }
}

TEST(HarnessTable, FitsIntoItsWidthAndShowsRatiosToTheAnchorOnTheSameRays) {
  std::vector<FinishedCase> cases;
  for (const char* structure : {"bvh_sah", "embree"}) {
    for (const char* set : {"build", "camera", "shadow.0", "shadow.1", "reflection.1", "reflection.2",
                            "refraction.1", "refraction.2", "random", "diffuse", "aimed"}) {
      // bvh_sah is timed on a part, where embree takes 4 ns a ray less than on all rays.
      const bool part = structure[0] == 'b';
      Row row = Ended("timed");
      row[column::scene] = "s";
      row[column::primitives] = 10u;
      row[column::structure] = structure;
      row[column::spec] = structure;
      row[column::ray_set] = set;
      row[column::query] = std::string(set) == "build" ? "build" : "closest";
      row[column::claim] = "watertight";
      row[column::threads] = 1u;
      row[column::rays] = 100u;
      row[column::verified] = 100u;
      row[column::leak] = 0u;
      row[column::rate] = part ? 2.5e6 : 1e7;
      row[column::steps] = 12.5;
      row[column::timed_rays] = part ? 25u : 100u;
      row[column::median_ns] = part ? 400.0 : 104.0;
      row[column::anchor] = "embree";
      row[column::anchor_ns] = part ? 100.0 : 104.0;
      cases.push_back({cases.size(), std::move(row), {}});
    }
  }
  const std::string table = FormatTable(cases);
  EXPECT_NE(table.find("2.50 (0.25)"), std::string::npos) << table;
  EXPECT_NE(table.find("as a multiple of embree on the same rays"), std::string::npos) << table;
  EXPECT_NE(table.find("11 of 22 timed on a part of the rays"), std::string::npos) << table;
  EXPECT_NE(table.find("watertight ok"), std::string::npos) << table;
  std::istringstream lines(table);
  for (std::string line; std::getline(lines, line);) EXPECT_LE(line.size(), 120u) << line;
}

TEST(HarnessTable, FiguresHaveThreeDigits) {
  EXPECT_EQ(FormatFigure(0), "0");
  EXPECT_EQ(FormatFigure(0.012345), "0.0123");
  EXPECT_EQ(FormatFigure(4.5678), "4.57");
  EXPECT_EQ(FormatFigure(1234.5), "1234");
  EXPECT_EQ(FormatFigure(2.5e-9), "2.5e-09");
}

}  // namespace
}  // namespace raybench
