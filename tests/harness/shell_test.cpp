// The raybench command among a shell's troubles: numbers and names that are none, full disks, odd paths.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/file.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "harness/cli/commands.h"
#include "tests/support/command.h"
#include "tests/support/effort.h"

namespace raybench {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

class HarnessShell : public HarnessCommand {
 protected:
  /// One shell command, in which $RB is raybench; in the test's folder.
  Outcome Shell(const std::string& line) {
    const std::string command =
        fmt::format("cd '{0}' && export RB='{1}/raybench'; ( {2} ) > '{0}/stdout' 2> '{0}/stderr'",
                    folder_.string(), kBinaryDirectory, line);
    const int status = std::system(command.c_str());
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status), Read(folder_ / "stdout"),
            Read(folder_ / "stderr")};
  }
  static bool IsOneLine(const std::string& text) {
    return text.starts_with("raybench: ") && std::count(text.begin(), text.end(), '\n') == 1;
  }
  /// What is left of files that were being written.
  size_t TemporaryFiles() const {
    size_t count = 0;
    for (const auto& entry : fs::recursive_directory_iterator(folder_))
      count += entry.path().extension() == ".tmp";
    return count;
  }
};

TEST_F(HarnessShell, NumbersOutOfRangeAreRefusedByEveryOption) {
  const std::string scene = "icosphere(level=1)";
  const std::vector<std::vector<std::string>> whole = {{"run", scene, "--seed"},
                                                       {"run", scene, "--threads"},
                                                       {"run", scene, "--repetitions"},
                                                       {"run", scene, "--depth"},
                                                       {"run", scene, "--memory-limit"},
                                                       {"run", scene, "--verify-rays"},
                                                       {"verify", scene, "--seed"},
                                                       {"verify", scene, "--threads"},
                                                       {"verify", scene, "--examples"},
                                                       {"verify", scene, "--closed"},
                                                       {"extremes", "--seed"},
                                                       {"extremes", "--rays"},
                                                       {"rays", "record", scene, "-o", "x", "--seed"},
                                                       {"rays", "record", scene, "-o", "x", "--rays"},
                                                       {"rays", "record", scene, "-o", "x", "--depth"},
                                                       {"render", scene, "-o", "x.png", "--seed"},
                                                       {"render", scene, "-o", "x.png", "--depth"},
                                                       {"render", scene, "-o", "x.png", "--threads"},
                                                       {"render", scene, "-o", "x.png", "--samples"},
                                                       {"render", scene, "-o", "x.png", "--sampling-seed"},
                                                       {"list", "scene", scene, "--seed"},
                                                       {"spd", "--threads"}};
  for (std::vector<std::string> words : whole) {
    const std::string option = words.back();
    for (const char* value : {"-1", "", "1.5", "1e3", "0x10", "0b1", "+1", " 1", "1'000", "1_000",
                              "18446744073709551616", "99999999999G", "17179869184G", "1Q", "nan"}) {
      std::vector<std::string> call = words;
      call.back() += std::string("=") + value;
      SCOPED_TRACE(::testing::PrintToString(call));
      const Outcome outcome = Call(call);
      EXPECT_EQ(outcome.exit_code, 2);
      EXPECT_TRUE(IsOneLine(outcome.err)) << outcome.err;
      EXPECT_THAT(outcome.err, HasSubstr(option));
      EXPECT_THAT(outcome.err, HasSubstr(*value == 0 ? "missing" : "a whole number from"));
    }
  }
  for (const char* option : {"--adaptive", "--min-contribution", "--self-intersection-size"})
    for (const char* value : {"-1", "nan", "inf", "0x1", "", "1e39"}) {
      const Outcome outcome = Call({"render", scene, "-o", "x.png", fmt::format("{}={}", option, value)});
      EXPECT_EQ(outcome.exit_code, 2) << option << value;
      EXPECT_THAT(outcome.err, HasSubstr(*value == 0 ? "missing" : "a number from 0 to")) << option << value;
    }
}

TEST(ShellNumbers, UnitsArePowersOf1024UpToTheLastBit) {
  EXPECT_EQ(ParseWholeNumber("18446744073709551615", Units::kNone), UINT64_MAX);
  EXPECT_EQ(ParseWholeNumber("64K", Units::kSizes), 65536u);
  EXPECT_EQ(ParseWholeNumber("8GiB", Units::kSizes), uint64_t{8} << 30);
  EXPECT_EQ(ParseWholeNumber("15e", Units::kSizes), uint64_t{15} << 60);
  EXPECT_EQ(ParseWholeNumber("7b", Units::kSizes), 7u);
  for (const char* text : {"16E", "64K ", "K", "1KK", "1iB", "64 K"})
    EXPECT_FALSE(ParseWholeNumber(text, Units::kSizes)) << text;
  EXPECT_FALSE(ParseWholeNumber("64K", Units::kNone));
}

TEST_F(HarnessShell, MistypedNamesAreAnsweredWithTheNearest) {
  const std::string scene = "icosphere(level=1)";
  for (const auto& [words, meant] : std::vector<std::pair<std::vector<std::string>, std::string>>{
           {{"verfy", scene}, "verify"},
           {{"list", "structurs"}, "structures"},
           {{"run", scene, "--structurs=bvh_sah"}, "--structures"},
           {{"run", scene, "--quik"}, "--quick"},
           {{"run", "bunnyy"}, "bunny"},
           {{"run", "icospere(level=1)"}, "icosphere"},
           {{"run", "icosphere(levl=1)"}, "level"},
           {{"run", scene, "--structures", "bvh_sha"}, "bvh_sah"},
           {{"run", scene, "--structures", "bvh_sah(leafsize=4)"}, "leaf_size"},
           {{"run", scene, "--structures", "bvh_sah(numerics=fats)"}, "fast"},
           {{"run", scene, "--sets", "camrea"}, "camera"},
           {{"verify", scene, "--sets", "aimed_egde"}, "aimed_edge"},
           {{"extremes", "--suites", "egde_aim"}, "edge_aim"},
           {{"render", scene, "-o", "x.png", "--filter", "gausian"}, "gaussian"},
           {{"list", "structure", "kdopp"}, "kdop"},
           {{"list", "generator", "terain"}, "terrain"},
           {{"list", "model", "sponzaa"}, "sponza"},
           {{"fetch", "folaige"}, "foliage"}}) {
    SCOPED_TRACE(::testing::PrintToString(words));
    const Outcome outcome = Call(words);
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_TRUE(IsOneLine(outcome.err)) << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr("(did you mean " + meant + "?)"));
    EXPECT_LT(outcome.err.size(), 400u) << "a wall of names";
  }
}

TEST_F(HarnessShell, ListsHaveALineEachAndJsonHasAll) {
  const Outcome list = Call({"list", "structures"});
  Registry registry;
  for (const rb_structure* s : registry.structures())
    EXPECT_THAT(list.out, HasSubstr(fmt::format("\n{} ", s->name)));
  EXPECT_THAT(list.out, ::testing::Not(HasSubstr("correctly rounded")));
  auto all = nlohmann::json::parse(Call({"list", "structures", "--json"}).out);
  for (size_t i = all.size(); i-- > 0;)
    if (all[i].contains("on_request")) all.erase(i);
  ASSERT_EQ(all.size(), registry.structures().size());
  for (const auto& s : all)
    for (const char* key : {"family", "build", "trace"})
      EXPECT_TRUE(s[key].is_string()) << s["name"] << " lacks its " << key;
  const auto one = nlohmann::json::parse(Call({"list", "structure", "bvh_sah", "--json"}).out);
  EXPECT_EQ(one["parameters"][0]["name"], "numerics");
  EXPECT_EQ(one["parameters"][0]["default"], "watertight");
  EXPECT_EQ(one["parameters"][0]["approximate"], true);
  EXPECT_THAT(Call({"list", "structure", "bvh_sah"}).out, HasSubstr("correctly rounded"));
  EXPECT_THAT(Call({"list", "structure", "grid"}).out, HasSubstr("on a logarithmic scale"));
  EXPECT_THAT(Call({"list", "generator", "soup"}).out, HasSubstr("aspect"));
  EXPECT_THAT(Call({"list", "model", "bunny"}).out, HasSubstr("licence"));
  for (const char* what : {"generators", "models", "scenes"}) {
    EXPECT_FALSE(nlohmann::json::parse(Call({"list", what, "--json"}).out).empty()) << what;
    EXPECT_THAT(Call({"list", what}).out, HasSubstr("what it is")) << what;
  }
}

TEST_F(HarnessShell, GoalsStandInBothHelpsAndInReadme) {
  const std::string readme = Read(fs::path(kSourceDirectory) / "README.md");
  EXPECT_THAT(Call({"--help"}).out, HasSubstr(kGoals));
  EXPECT_THAT(Call({"run", "--help"}).out, HasSubstr(kGoals));
  EXPECT_THAT(readme, HasSubstr(std::string(kGoals).substr(1)));
}

TEST_F(HarnessShell, AnOutputThatCannotBeWrittenIsAnError) {
  for (const char* words : {"list structures", "--help", "list scenes --json"}) {
    const Outcome outcome = Shell(fmt::format("$RB {} > /dev/full", words));
    EXPECT_EQ(outcome.exit_code, 2) << words;
    EXPECT_TRUE(IsOneLine(outcome.err)) << outcome.err;
  }
  EXPECT_EQ(Shell("$RB list structures | head -1").err, "");
}

TEST_F(HarnessShell, AFileThatMayNotGrowIsOneLineAndLeavesNoHalf) {
  const Outcome outcome =
      Shell("ulimit -f 1; $RB rays record 'icosphere(level=1)' --rays 4K --sets random -o rays");
  EXPECT_EQ(outcome.exit_code, 2) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("random.rays"));
  EXPECT_EQ(TemporaryFiles(), 0u);
  EXPECT_FALSE(fs::exists(folder_ / "rays" / "random.rays"));
}

TEST_F(HarnessShell, APictureThatMayNotGrowLeavesNoHalf) {
  const Outcome outcome = Shell("ulimit -f 4; $RB render 'sphereflake(depth=2)' --size 200x200 -o a.png");
  EXPECT_EQ(outcome.exit_code, 2) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("a.png"));
  EXPECT_EQ(TemporaryFiles(), 0u);
  EXPECT_FALSE(fs::exists(folder_ / "a.png"));
}

TEST_F(HarnessShell, WithoutPythonARunSaysHowToMakeItsPageAndAReportSaysWhy) {
  const std::string run =
      "$RB run 'icosphere(level=1)' --structures bvh_sah --quick --rays 64 --threads 1 --out r";
  const Outcome outcome = Shell("RAYBENCH_PYTHON=/nonexistent " + run);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("report  not made: "));
  EXPECT_THAT(outcome.out, HasSubstr("then: raybench report r"));
  const Outcome report = Shell("RAYBENCH_PYTHON=/nonexistent $RB report r");
  EXPECT_EQ(report.exit_code, 2);
  EXPECT_TRUE(IsOneLine(report.err)) << report.err;
}

TEST_F(HarnessShell, WhatIsMountedReadOnlyIsOneLine) {
  const std::string mounted = "unshare -m sh -c 'mkdir -p ro && mount -t tmpfs -o ro none ro && ";
  // Mounting takes root, and more than some containers give it.
  if (Shell(mounted + "true'").exit_code != 0) GTEST_SKIP() << "SKIPPED: this process may not mount anything";
  for (const char* words :
       {"run \"icosphere(level=1)\" --structures null --quick --rays 64 --no-report --out ro/x",
        "verify \"icosphere(level=1)\" --structures brute --rays 64 --out ro/x",
        "extremes --quick --suites scale --structures brute --no-report --out ro/x",
        "render \"icosphere(level=1)\" --size 8x8 -o ro/x.png",
        "rays record \"icosphere(level=1)\" --rays 64 --sets random -o ro"}) {
    const Outcome outcome = Shell(mounted + "$RB " + words + "'");
    EXPECT_EQ(outcome.exit_code, 2) << words << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr("ro/")) << words;
    EXPECT_THAT(outcome.err, HasSubstr("Read-only file system")) << words;
    EXPECT_THAT(outcome.err, ::testing::Not(HasSubstr("terminate"))) << words;
  }
}

TEST_F(HarnessShell, APluginMayLieInAFolderOfAnyLetters) {
  const fs::path odd = folder_ / "Ünï cödé 模型";
  fs::create_directories(odd);
  fs::copy_file(BuildPlugins() / "libsorted_list.so", odd / "libsörted list.so");
  const Outcome list = Call({"--plugin", (odd / "libsörted list.so").string(), "list", "structures"});
  EXPECT_THAT(list.out, HasSubstr("\nsorted_list ")) << list.err;
}

TEST_F(HarnessShell, AFolderThatCannotBeWrittenIsOneLine) {
  for (const char* out : {"/proc/raybench", "/dev/null/x"}) {
    const Outcome run = Call({"run", "icosphere(level=1)", "--structures", "null", "--quick", "--rays", "64",
                              "--no-report", "--out", out});
    EXPECT_EQ(run.exit_code, 2) << run.err;
    EXPECT_THAT(run.err, HasSubstr(out));
    const Outcome verify =
        Call({"verify", "icosphere(level=1)", "--structures", "brute", "--rays", "64", "--out", out});
    EXPECT_EQ(verify.exit_code, 2) << verify.err;
    EXPECT_THAT(verify.err, HasSubstr(out));
  }
}

TEST_F(HarnessShell, OneFolderIsForOneRunAndADeadOneHoldsNobodyUp) {
  fs::create_directories(folder_ / "out");
  const std::string lock = (folder_ / "out" / ".lock").string();
  const int file = open(lock.c_str(), O_CREAT | O_RDWR | O_CLOEXEC, 0666);
  ASSERT_EQ(flock(file, LOCK_EX), 0);
  const Outcome second = Call(TinyRun("out", {"--structures", "null"}));
  EXPECT_EQ(second.exit_code, 2);
  EXPECT_THAT(second.err, HasSubstr("another raybench is writing there"));
  EXPECT_FALSE(fs::exists(folder_ / "out" / "run.json"));
  const Outcome verify = Call({"verify", "icosphere(level=1)", "--structures", "brute", "--rays", "64",
                               "--out", (folder_ / "out").string()});
  EXPECT_THAT(verify.err, HasSubstr("another raybench is writing there"));
  close(file);  // as the end of its process does; the file stays
  EXPECT_TRUE(fs::exists(lock));
  const Outcome after = Call(TinyRun("out", {"--structures", "null", "--resume"}));
  EXPECT_NE(after.exit_code, 2) << after.err;
}

TEST_F(HarnessShell, PathsMayHaveSpacesAndAnyLetters) {
  const fs::path odd = folder_ / "Ünï cödé 模型, (x=1)";
  fs::create_directories(odd);
  std::ofstream(odd / "mein würfel.obj") << "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\n";
  for (const char* locale : {"C", "tr_TR.UTF-8", "de_DE.UTF-8"}) {
    setenv("LC_ALL", locale, 1);
    const std::string out = (odd / locale).string();
    const Outcome run = Call({"run", (odd / "mein würfel.obj").string(), "--structures", "brute", "--quick",
                              "--rays", "64", "--threads", "1", "--no-report", "--out", out});
    EXPECT_NE(run.exit_code, 2) << run.err;
    EXPECT_TRUE(fs::exists(fs::path(out) / "cases.csv")) << run.err;
  }
  unsetenv("LC_ALL");
}

TEST_F(HarnessShell, NoHomeNoCacheNoMemoryIsNoCrash) {
  std::ofstream(folder_ / "file") << "no folder";
  for (const char* environment : {"env -u HOME -u RAYBENCH_CACHE", "RAYBENCH_CACHE=file",
                                  "RAYBENCH_CACHE=/proc/none", "TMPDIR=/nonexistent"}) {
    const Outcome outcome = Shell(fmt::format(
        "env -u RAYBENCH_TRUTH_CACHE {} $RB verify 'icosphere(level=1)' --structures brute --rays 64",
        environment));
    EXPECT_EQ(outcome.exit_code, 0) << environment << ": " << outcome.err;
  }
  if (testing::kSanitized) return;  // AddressSanitizer reserves terabytes of addresses
  const Outcome little = Shell("ulimit -v 400000; $RB list scene 'soup(size=100000000)'");
  EXPECT_EQ(little.exit_code, 2);
  EXPECT_THAT(little.err, HasSubstr("out of memory"));
}

}  // namespace
}  // namespace raybench
