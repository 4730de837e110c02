// Case names, case files and the CSVs derived from them.
#include "harness/results/results.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>

#include "harness/base/json.h"
#include "harness/measure/build_info.h"
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

TEST_F(HarnessResults, StoredCasesComeBackInPlanOrderAndAsCsv) {
  const ResultFolder folder(folder_, false);
  Case second = ACase(), first = ACase();
  second.plan_index = 7, first.plan_index = 3, first.threads = 1;
  const Sample sample{0, 4, 12, {0.25, 1.0 / 3}};
  EXPECT_FALSE(folder.Has(second.Id()));
  folder.Store(second, {{"status", "timed"}, {"steps", 1.0 / 3}, {"hits", 12}, {"timed_rays", 128}},
               std::span(&sample, 1));
  folder.Store(first, {{"status", "refused"}, {"note", "claims \"exact\", but"}}, {});
  EXPECT_TRUE(folder.Has(second.Id()));
  const std::vector<Json> cases = folder.Cases();
  ASSERT_EQ(cases.size(), 2u);
  EXPECT_EQ(cases[0].at("case").at("case_id"), first.Id());
  EXPECT_EQ(cases[1].at("case").at("steps").get<double>(), 1.0 / 3);
  EXPECT_TRUE(cases[0].at("case").at("median_ns").is_null());
  folder.WriteCsvs();
  const std::string csv = Read(folder_ / "cases.csv");
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 3);
  EXPECT_TRUE(csv.starts_with("case_id,scene,scene_hash,primitives,structure,spec,params,ray_set,"));
  EXPECT_NE(
      csv.find(",build_peak_bytes,cold_ns,samples,timed_rays,median_ns,lo_ns,hi_ns,rate,anchor,anchor_ns\n"),
      std::string::npos);
  EXPECT_NE(csv.find(",\"claims \"\"exact\"\", but\","), std::string::npos);
  EXPECT_EQ(
      Read(folder_ / "samples.csv"),
      "case_id,scene,structure,spec,ray_set,query,threads,sample,sequence,passes,rays,seconds,cpu_seconds\n" +
          second.Id() +
          ",sphereflake(depth=2),bvh_sah,bvh_sah(leaf_size=2),camera,closest,2,0,4,12,128,0.25," +
          CsvField(1.0 / 3) + "\n");
  for (const auto& entry : fs::recursive_directory_iterator(folder_))
    EXPECT_NE(entry.path().extension(), ".tmp");
}

TEST_F(HarnessResults, AColumnThatDoesNotExistIsAProgrammingError) {
  EXPECT_THROW(ResultFolder(folder_, false).Store(ACase(), {{"stauts", "timed"}}, {}), std::logic_error);
}

TEST_F(HarnessResults, AFolderWithCasesNeedsResume) {
  ResultFolder(folder_, false).Store(ACase(), {{"status", "timed"}}, {});
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
  std::ofstream(folder_ / "cases" / "0000000000000000.json") << "{\"format\": 1,";
  try {
    folder.Cases();
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("0000000000000000.json"), std::string::npos);
  }
}

TEST_F(HarnessResults, EveryColumnIsDocumented) {
  const std::string readme = Read(fs::path(kSourceDirectory) / "reports" / "README.md");
  for (const char* column : CaseColumns()) {
    const std::string name = column;
    // The verdict classes stand there as a range and as words.
    EXPECT_TRUE(readme.find("`" + name + "`") != std::string::npos ||
                readme.find(name + ",") != std::string::npos || readme.find(name + ")") != std::string::npos)
        << name;
  }
}

TEST(HarnessTable, FitsIntoItsWidthAndShowsRatiosToTheAnchorOnTheSameRays) {
  std::vector<Json> cases;
  for (const char* structure : {"bvh_sah", "embree"}) {
    for (const char* set : {"build", "camera", "shadow.0", "shadow.1", "reflection.1", "reflection.2",
                            "refraction.1", "refraction.2", "random", "diffuse", "aimed"}) {
      Json row;
      for (const char* column : CaseColumns()) row[column] = nullptr;
      row["scene"] = "s", row["primitives"] = 10, row["structure"] = structure, row["spec"] = structure;
      row["ray_set"] = set, row["query"] = std::string(set) == "build" ? "build" : "closest";
      row["status"] = "timed", row["claim"] = "watertight", row["threads"] = 1, row["rays"] = 100,
      row["verified"] = 100;
      row["leak"] = 0, row["rate"] = structure[0] == 'b' ? 2.5e6 : 1e7, row["median_ns"] = 5e6,
      row["steps"] = 12.5;
      // bvh_sah is timed on a part, where embree takes 4 ns a ray less than on all rays.
      const bool part = structure[0] == 'b';
      row["timed_rays"] = part ? 25 : 100, row["median_ns"] = part ? 400 : 104;
      row["anchor"] = "embree", row["anchor_ns"] = part ? 100 : 104;
      cases.push_back({{"case", row}});
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
