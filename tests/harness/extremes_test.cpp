// raybench extremes: rows, what must be flat at zero, what must not, what is refused, wrong arguments.
#include <gmock/gmock.h>

#include <chrono>
#include <cstring>
#include <fstream>
#include <set>
#include <thread>

#include "harness/extremes/make.h"
#include "harness/extremes/point.h"
#include "harness/plan/plan.h"
#include "tests/support/command.h"

namespace raybench {
namespace {

using extremes::FindSuite;
using extremes::MeasurePoint;
using extremes::Point;
using extremes::Suite;

std::vector<Contestant> Contestants(std::initializer_list<const char*> specs) {
  static const Registry registry;
  std::vector<Contestant> all;
  for (const char* spec : specs) all.push_back(ParseContestant(registry, spec));
  return all;
}

/// Rows of the points of a suite where claims must hold, few rays each.
std::vector<Json> Measure(const std::string& name, std::initializer_list<const char*> specs, double most,
                          uint64_t rays = 128) {
  const Suite& suite = FindSuite(name);
  std::vector<Json> rows;
  for (const Point& point : suite.points()) {
    if (!point.valid || point.magnitude > most) continue;
    for (const Row& row : MeasurePoint(suite, point, Contestants(specs), {rays, 5, {}}))
      rows.push_back(row.ToJson(kExtremesColumns));
  }
  return rows;
}

uint64_t Sum(const std::vector<Json>& rows, const char* spec, const char* column) {
  uint64_t sum = 0, found = 0;
  for (const Json& row : rows) {
    if (row["spec"] != spec || row[column].is_null()) continue;
    sum += row[column].get<uint64_t>(), ++found;
  }
  EXPECT_GT(found, 0u) << spec << " " << column;
  return sum;
}

TEST(Extremes, EverySuiteMakesValidRaysThatItsSeedDecides) {
  std::set<std::string> names;
  for (const Suite* each : extremes::Suites()) {
    const Suite& suite = *each;
    SCOPED_TRACE(suite.name);
    EXPECT_TRUE(names.insert(suite.name).second);
    EXPECT_EQ(&FindSuite(suite.name), &suite);
    const std::vector<Point> points = suite.points();
    ASSERT_GE(points.size(), 4u);
    std::map<std::string, std::vector<double>> axis;
    bool any_valid = false;
    for (const Point& point : points)
      axis[point.variant].push_back(point.magnitude), any_valid |= point.valid;
    EXPECT_TRUE(any_valid);
    for (const auto& [variant, magnitudes] : axis)
      EXPECT_THAT(magnitudes, ::testing::WhenSorted(::testing::ContainerEq(magnitudes))) << variant;
    const Point& first = points[1];
    const extremes::Workload a = suite.make(first, 64, 5), b = suite.make(first, 64, 5),
                             c = suite.make(first, 64, 6);
    ASSERT_GT(a.rays.size(), 0u);
    ASSERT_EQ(a.rays.size(), b.rays.size());
    EXPECT_EQ(std::memcmp(a.rays.data(), b.rays.data(), a.rays.size() * sizeof(rb_ray)), 0);
    EXPECT_EQ(a.scene.hash(), b.scene.hash());
    EXPECT_NE(
        std::memcmp(a.rays.data(), c.rays.data(), std::min(a.rays.size(), c.rays.size()) * sizeof(rb_ray)),
        0);
    EXPECT_EQ(a.second != nullptr, suite.second != nullptr);
    for (const rb_ray& ray : a.rays) EXPECT_TRUE(IsValidRay(ray));
  }
}

TEST(Extremes, WatertightDoesNotFailWhereFastDoes) {
  for (const char* suite : {"edge_aim", "far_scene", "sliver", "flat_box"}) {
    SCOPED_TRACE(suite);
    const auto rows = Measure(suite, {"bvh_sah", "bvh_sah(numerics=fast)"}, 2000);
    EXPECT_EQ(Sum(rows, "bvh_sah", "failures"), 0u);
    EXPECT_GT(Sum(rows, "bvh_sah(numerics=fast)", "failures"), 0u);
    for (const Json& row : rows) {
      EXPECT_EQ(row["status"], "measured") << row["note"];
      EXPECT_GT(row["failure_bound"], row["failure_rate"]);
      EXPECT_GT(row["ns_per_ray"], 0);
      EXPECT_EQ(row["failures"], row["leak"].get<int>() + row["wrong"].get<int>() +
                                     row["false_miss"].get<int>() + row["false_hit"].get<int>());
    }
  }
}

TEST(Extremes, TheSceneModelRescalesAndRefuses) {
  std::vector<Json> rows;
  for (const Point& point : FindSuite("scale").points())
    rows.push_back(MeasurePoint(FindSuite("scale"), point, Contestants({"bvh_sah"}), {64, 5, {}})
                       .front()
                       .ToJson(kExtremesColumns));
  std::set<int> refused;
  bool rescaled = false;
  for (const Json& row : rows) {
    const int k = int(row["magnitude"].get<double>());
    const bool mixed = row["variant"].get<std::string>().find("second ball") != std::string::npos;
    if (row["status"] == "refused") {
      refused.insert(k);
      EXPECT_TRUE(row["rays"].is_null());
      const std::string note = row["note"];
      EXPECT_NE(note.find(mixed ? "too small beside the largest coordinate" : "must be finite"),
                std::string::npos)
          << note;
    } else {
      EXPECT_EQ(row["failures"], 0);
      const bool changed = !row["note"].is_null();
      EXPECT_EQ(changed, std::abs(k) > 30) << k;
      rescaled |= changed;
    }
  }
  EXPECT_TRUE(rescaled);
  EXPECT_EQ(refused, (std::set<int>{75, 90, 120, 128}));
}

TEST(Extremes, SecondMeasuresAndCuresDoWhatTheySay) {
  const auto rows = Measure("self_hit", {"bvh_sah", "embree"}, 10, 1024);
  uint64_t none = 0, offset = 0;
  for (const Json& row : rows) {
    const std::string cure = row["variant"];
    if (cure.starts_with("skip")) {
      EXPECT_EQ(row["status"], row["structure"] == "embree" ? "skipped" : "measured");
      EXPECT_TRUE(row["leak"].is_null());  // the oracle knows no skipped primitive
      continue;
    }
    const uint64_t failures = row["failures"].get<uint64_t>();
    if (cure == "no cure") none += failures;
    if (cure.starts_with("error-bound")) offset += failures + row["second"].get<uint64_t>();
    if (cure.starts_with("tnear") && row["magnitude"] == 0.001) {
      EXPECT_GT(row["second_rate"], 0.9);
    }
  }
  EXPECT_GT(none, 500u);
  EXPECT_EQ(offset, 0u);
}

TEST(Extremes, OfCopiesTheLowestIdWins) {
  const auto rows = Measure("coincident", {"bvh_sah", "brute"}, 1000, 64);
  EXPECT_EQ(Sum(rows, "bvh_sah", "failures"), 0u);
  EXPECT_EQ(Sum(rows, "brute", "failures"), 0u);
  EXPECT_EQ(rows.back()["triangles"], 1000);
}

TEST(Extremes, ArithmeticIsEnumeratedFromTheParameters) {
  const Registry registry;
  std::set<std::string> specs;
  for (const Contestant& c : EveryArithmetic(registry, {"all"})) specs.insert(c.Spec());
  EXPECT_EQ(specs.count("null"), 0u);
  for (const rb_structure* s : registry.structures()) {
    for (uint32_t i = 0; i < s->param_count; ++i) {
      if (std::string_view(s->params[i].name) != "numerics") continue;
      for (auto* choice = s->params[i].choices; *choice != nullptr; ++choice) {
        const std::string spec = fmt::format("{}(numerics={})", s->name, *choice);
        EXPECT_EQ(specs.count(ParseContestant(registry, spec).Spec()), 1u) << spec;
      }
    }
  }
}

TEST_F(HarnessCommand, ExtremesWritesARowForEachPointAndContestant) {
  const fs::path out = folder_ / "out";
  const Outcome run =
      Call({"extremes", "--suites", "split_plane,scale", "--structures", "bvh_sah,bvh_sah(numerics=fast)",
            "--quick", "--rays", "64", "--seed", "3", "--no-report", "--out", out.string()});
  EXPECT_EQ(run.exit_code, 0) << run.err;
  auto rows = ReadCsv(out / "extremes.csv");
  std::map<std::string, int> counted;
  for (auto& row : rows) {
    ++counted[row["suite"] + " " + row["spec"] + " " + row["status"]];
    EXPECT_EQ(row["rays"], row["status"] == "refused" ? "" : "64");
    EXPECT_EQ(row["seed"], "3");
  }
  EXPECT_EQ(counted["split_plane bvh_sah measured"], 4);
  EXPECT_EQ(counted["split_plane bvh_sah(numerics=fast) measured"], 4);
  EXPECT_GT(counted["scale bvh_sah refused"], 1);
  EXPECT_NE(run.out.find("split_plane"), std::string::npos);
  EXPECT_NE(run.out.find("refused at load"), std::string::npos);
  const Json facts = Json::parse(Read(out / "extremes.json"));
  EXPECT_EQ(facts["suites"].size(), 2u);
  EXPECT_TRUE(facts.contains("machine"));
  EXPECT_FALSE(facts["interrupted"].get<bool>());
  // The same folder again is refused, and keeps what it holds.
  const Outcome again = Call({"extremes", "--suites", "split_plane", "--out", out.string()});
  EXPECT_EQ(again.exit_code, 2);
  EXPECT_NE(again.err.find("already holds"), std::string::npos);
  EXPECT_EQ(ReadCsv(out / "extremes.csv").size(), rows.size());
}

TEST_F(HarnessCommand, ABrokenClaimEndsExtremesWithOneAndARayThatShowsIt) {
  const fs::path out = folder_ / "out";
  const std::string plugin = (BuildPlugins() / "libwrong.so").string();
  const Outcome run = Call({"--plugin", plugin, "extremes", "--suites", "edge_aim", "--structures",
                            "wrong_misses,wrong_uv,wrong_not", "--quick", "--rays", "128", "--no-report",
                            "--out", out.string()});
  EXPECT_EQ(run.exit_code, 1) << run.err;
  EXPECT_NE(run.err.find("BROKEN CLAIM: edge_aim at 20: wrong_misses: claims watertight, but of 128 rays 1 "
                         "leak; ray 99: org (-0x"),
            std::string::npos)
      << run.err;
  EXPECT_NE(run.err.find(" with u or v beyond its bound; ray 0: org ("), std::string::npos) << run.err;
  for (auto& row : ReadCsv(out / "extremes.csv")) {
    EXPECT_EQ(row["status"], row["structure"] == "wrong_not" ? "measured" : "broken") << row["note"];
    EXPECT_EQ(row["failures"], row["structure"] == "wrong_misses" ? "1" : "0");
    EXPECT_EQ(row["uv_wrong"] == "0", row["structure"] != "wrong_uv");
  }
}

TEST_F(HarnessCommand, ExtremesSaysWhatIsWrongAndWhatThereIs) {
  const std::string out = (folder_ / "out").string();
  for (const auto& [arguments, says] : std::vector<std::pair<std::vector<std::string>, std::string>>{
           {{"--suites", "edge_aim,nosuch"}, "unknown suite 'nosuch'; see: raybench extremes --list"},
           {{"--suites", "sliver,sliver"}, "given twice"},
           {{"--structures", "nosuch"}, "nosuch"},
           {{"--rays", "3"}, "--rays"}}) {
    std::vector<std::string> words = {"extremes", "--out", out};
    words.insert(words.end(), arguments.begin(), arguments.end());
    const Outcome outcome = Call(words);
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_NE(outcome.err.find(says), std::string::npos) << outcome.err;
    EXPECT_FALSE(fs::exists(out));
  }
  const Outcome list = Call({"extremes", "--list"});
  EXPECT_EQ(list.exit_code, 0);
  for (const Suite* suite : extremes::Suites()) EXPECT_NE(list.out.find(suite->name), std::string::npos);
  EXPECT_NE(list.out.find("not here: bad_input"), std::string::npos);
}

TEST_F(HarnessCommand, InterruptedExtremesKeepFinishedPoints) {
  const fs::path out = folder_ / "out";
  const pid_t pid =
      Start({"extremes", "--structures", "bvh_sah", "--rays", "1M", "--no-report", "--out", out.string()});
  std::this_thread::sleep_for(std::chrono::milliseconds(1500));
  kill(pid, SIGINT);
  const Outcome run = Finish(pid);
  EXPECT_EQ(run.exit_code, 130);
  EXPECT_NE(run.err.find("finished points are kept"), std::string::npos) << run.err;
  EXPECT_TRUE(Json::parse(Read(out / "extremes.json"))["interrupted"].get<bool>());
  ReadCsv(out / "extremes.csv");  // whole
}

TEST_F(HarnessCommand, FilesBeyondTheValidRangeAreRefusedByRenderAndRun) {
  const auto write = [&](const char* name, const char* text) {
    std::ofstream(folder_ / name) << text;
    return (folder_ / name).string();
  };
  // Too large for float; and too small beside the largest to be rescaled without loss.
  const std::string large = write("large.obj", "v 0 0 0\nv 4e38 0 0\nv 0 1 0\nf 1 2 3\n");
  const std::string mixed =
      write("mixed.obj", "v 0 0 0\nv 1e38 0 0\nv 0 1e38 0\nv 1e-30 1.3e-30 0\nf 1 2 3\nf 1 2 4\n");
  const std::string fine = write("fine.obj", "v 0 0 0\nv 1e38 0 0\nv 0 1e38 1e37\nf 1 2 3\n");
  for (const auto& [file, says] :
       {std::pair{large, "line 2: vertex 1 has the coordinate '4e38'; it must be finite"},
        std::pair{mixed, "vertex 3 is (1e-30, 1.3e-30, 0), too small beside"}}) {
    for (const std::vector<std::string>& command :
         {std::vector<std::string>{"render", file, "-o", (folder_ / "a.png").string(), "--size", "8x8"},
          {"run", file, "--quick", "--out", (folder_ / "run").string()}}) {
      const Outcome outcome = Call(command);
      EXPECT_EQ(outcome.exit_code, 2);
      EXPECT_NE(outcome.err.find(says), std::string::npos) << outcome.err;
      EXPECT_NE(outcome.err.find(fs::path(file).filename().string()), std::string::npos) << outcome.err;
      EXPECT_FALSE(fs::exists(folder_ / "a.png"));
      EXPECT_FALSE(fs::exists(folder_ / "run"));
    }
  }
  EXPECT_EQ(Call({"render", fine, "-o", (folder_ / "a.png").string(), "--size", "8x8"}).exit_code, 0);
}

}  // namespace
}  // namespace raybench
