// Sweeps as a user meets them: runs that are killed and go on, shards and their merge, processes, completion.
#include <gtest/gtest.h>
#include <signal.h>

#include <chrono>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <thread>

#include "accel/base/random.h"
#include "tests/support/command.h"

namespace raybench {
namespace {

class SweepsCommand : public HarnessCommand {
 protected:
  SweepsCommand() {
    // Truth is cached where the runs of one test find it.
    unsetenv("RAYBENCH_TRUTH_CACHE");
    setenv("RAYBENCH_CACHE", (folder_ / "cache").c_str(), 1);
    std::ofstream(folder_ / "suite.toml") << R"(
scenes = [{ name = "icosphere", level = [1, 2] }]
structures = ["null", "bvh_sah", "grid", "kdtree_sah"]
rays = 256
verify_rays = 256
depth = 1
seed = 3
threads = [1]
tree_samples = 128
heat_pixels = 8
)";
  }
  ~SweepsCommand() override { unsetenv("RAYBENCH_CACHE"); }

  std::vector<std::string> Run(const std::string& out, std::vector<std::string> more = {}) const {
    std::vector<std::string> words = {"run",
                                      "--suite",
                                      (folder_ / "suite.toml").string(),
                                      "--repetitions",
                                      "6",
                                      "--budget",
                                      "0.002",
                                      "--no-report",
                                      "--out",
                                      (folder_ / out).string()};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }

  std::vector<std::map<std::string, std::string>> WithoutTimes(const std::string& out) const {
    auto rows = ReadCsv(folder_ / out / "cases.csv");
    for (auto& row : rows) EraseVarying(row);
    return rows;
  }

  /// Each timed case has so many samples, each once, and each query the anchor's time.
  void ExpectSamples(const std::string& out, size_t wanted) const {
    std::map<std::string, std::set<std::string>> numbers;
    for (const auto& row : ReadCsv(folder_ / out / "samples.csv"))
      EXPECT_TRUE(numbers[row.at("case_id")].insert(row.at("sample")).second) << "doubled";
    for (const auto& row : ReadCsv(folder_ / out / "cases.csv")) {
      if (row.at("status") != "timed") continue;
      EXPECT_EQ(numbers[row.at("case_id")].size(), wanted) << row.at("spec") << row.at("ray_set");
      EXPECT_EQ(row.at("samples"), std::to_string(wanted));
      EXPECT_EQ(row.at("anchor_ns") == "", row.at("query") == "build") << row.at("spec") << row.at("ray_set");
      EXPECT_EQ(row.at("machine").size(), 8u);
    }
  }

  /// Lines of all journals in the folder of a run.
  size_t Known(const std::string& out) const {
    size_t lines = 0;
    std::error_code error;
    for (fs::directory_iterator it(folder_ / out / "journal", error), end; !error && it != end;
         it.increment(error)) {
      const std::string text = Read(it->path());
      lines += size_t(std::count(text.begin(), text.end(), '\n'));
    }
    return lines;
  }
  size_t Finished(const std::string& out) const {
    std::error_code error;
    const fs::directory_iterator it(folder_ / out / "cases", error);
    return error ? 0 : size_t(std::distance(it, fs::directory_iterator()));
  }
};

TEST_F(SweepsCommand, KilledAtAnyMomentARunLosesTheOpenPassAndNothingElse) {
  ASSERT_EQ(Call(Run("whole")).exit_code, 0);
  Random random(11);
  int kills = 0;
  for (bool ended = false; !ended && kills < 40;) {
    // So many things come to be known before the next kill, whatever the machine is busy with besides.
    const size_t wanted = Known("killed") + Finished("killed") + 1 + random.Below(70);
    const pid_t pid = Start(Run("killed", {"--resume"}));
    siginfo_t info = {};
    while (Known("killed") + Finished("killed") < wanted && !ended) {
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
      waitid(P_PID, id_t(pid), &info, WEXITED | WNOHANG | WNOWAIT);
      ended = info.si_pid == pid;
    }
    if (!ended) kill(pid, SIGKILL);
    const Outcome outcome = Finish(pid);
    if (ended) {
      EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    } else {
      ++kills;
      // As if the kill had met a line half written.
      for (const auto& entry : fs::directory_iterator(folder_ / "killed"))
        if (kills % 3 == 0 && entry.path().filename() == "journal")
          for (const auto& journal : fs::directory_iterator(entry))
            std::ofstream(journal.path(), std::ios::app) << R"({"kind":"sample","of":")";
    }
  }
  EXPECT_GE(kills, 5);
  EXPECT_LT(kills, 40) << "no progress";
  EXPECT_EQ(WithoutTimes("whole"), WithoutTimes("killed"));
  ExpectSamples("whole", 6);
  ExpectSamples("killed", 6);
  EXPECT_FALSE(fs::exists(folder_ / "killed" / "journal")) << "nothing is unfinished";
  std::set<std::string> sessions;
  for (const auto& row : ReadCsv(folder_ / "killed" / "samples.csv")) sessions.insert(row.at("session"));
  EXPECT_GE(sessions.size(), 3u) << "samples of sessions before the last are kept";
  const auto run = nlohmann::json::parse(Read(folder_ / "killed" / "run.json"));
  EXPECT_GT(run.at("sessions").size(), sessions.size() - 1);
}

TEST_F(SweepsCommand, AResumedRunTakesTheRaysThatWereCaptured) {
  const pid_t pid = Start(Run("killed"));
  for (int i = 0; i < 30000 && Known("killed") < 20; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  kill(pid, SIGKILL);
  Finish(pid);
  // Capturing would draw the picture anew.
  std::vector<fs::path> pictures;
  for (const auto& entry : fs::directory_iterator(folder_ / "killed" / "images"))
    pictures.push_back(entry.path());
  EXPECT_FALSE(pictures.empty());
  for (const fs::path& picture : pictures) fs::remove(picture);
  ASSERT_EQ(Call(Run("killed", {"--resume"})).exit_code, 0);
  for (const fs::path& picture : pictures) EXPECT_FALSE(fs::exists(picture)) << picture;
  ASSERT_EQ(Call(Run("whole")).exit_code, 0);
  EXPECT_EQ(WithoutTimes("whole"), WithoutTimes("killed"));
}

TEST_F(SweepsCommand, ShardsMergedAreTheWholeRun) {
  ASSERT_EQ(Call(Run("whole")).exit_code, 0);
  std::vector<std::string> merge = {"merge", (folder_ / "merged").string()};
  for (const char* shard : {"1/4", "2/4", "3/4", "4/4"}) {
    const std::string part = std::string("part") + shard[0];
    const Outcome outcome = Call(Run(part, {"--shard", shard}));
    ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
    EXPECT_EQ(ReadCsv(folder_ / part / "cases.csv").size(), WithoutTimes("whole").size() / 4);
    merge.push_back((folder_ / part).string());
  }
  const Outcome outcome = Call(merge);
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(WithoutTimes("whole"), WithoutTimes("merged"));
  ExpectSamples("merged", 6);
  const auto run = nlohmann::json::parse(Read(folder_ / "merged" / "run.json"));
  EXPECT_EQ(run.at("scenes").size(), 2u);
  EXPECT_TRUE(run.at("shard").is_null());
  EXPECT_EQ(run.at("merged").size(), 4u);
  EXPECT_EQ(run.at("scenes").at(0).at("anchor"), "bvh_sah");
  const auto heat =
      nlohmann::json::parse(Read(folder_ / "merged" / "heat" / "icosphere_level_1" / "heat.json"));
  EXPECT_EQ(heat.at("maps").size(), 3u) << "all but null";

  // One is missing; two of one kind; another suite; not finished.
  merge = {"merge", (folder_ / "less").string(), (folder_ / "part1").string(), (folder_ / "part3").string()};
  const Outcome less = Call(merge);
  EXPECT_EQ(less.exit_code, 3);
  EXPECT_NE(less.out.find("missing: shard 2/4, 4/4"), std::string::npos) << less.out;
  merge = {"merge", (folder_ / "no").string(), (folder_ / "part1").string(), (folder_ / "part1").string()};
  EXPECT_NE(Call(merge).err.find("is given twice"), std::string::npos);
  merge.back() = (folder_ / "cache").string();
  EXPECT_NE(Call(merge).err.find("run.json: not there"), std::string::npos);
  ASSERT_EQ(Call(Run("other", {"--structures", "null", "--rays", "300"})).exit_code, 0);
  merge.back() = (folder_ / "other").string();
  const Outcome other = Call(merge);
  EXPECT_EQ(other.exit_code, 2);
  EXPECT_NE(other.err.find("other: rays_per_set is 300, and 256 in "), std::string::npos) << other.err;
  EXPECT_FALSE(fs::exists(folder_ / "no"));
}

TEST_F(SweepsCommand, RunsOfOneMachineArePooledAndOfUnlikeOnesKeptApartAndCompared) {
  for (const char* out : {"a", "b"}) ASSERT_EQ(Call(Run(out)).exit_code, 0);
  const std::string a = (folder_ / "a").string(), b = (folder_ / "b").string();
  ASSERT_EQ(Call({"merge", (folder_ / "pooled").string(), a, b}).exit_code, 0);
  EXPECT_EQ(WithoutTimes("a"), WithoutTimes("pooled"));
  ExpectSamples("pooled", 12);
  for (const auto& row : ReadCsv(folder_ / "pooled" / "cases.csv"))
    EXPECT_EQ(row.at("sessions"), row.at("status") == "timed" ? "2" : "");

  // As if b came from another machine, and one of its counters differed.
  auto run = nlohmann::ordered_json::parse(Read(folder_ / "b" / "run.json"));
  run["machine"]["fingerprint"] = "00000000";
  std::ofstream(folder_ / "b" / "run.json") << run;
  EXPECT_EQ(Call({"merge", (folder_ / "apart").string(), a, b}).exit_code, 0);
  EXPECT_TRUE(fs::exists(folder_ / "apart" / "00000000" / "cases.csv"));
  EXPECT_FALSE(fs::exists(folder_ / "apart" / "cases.csv"));
  for (const auto& row : ReadCsv(folder_ / "b" / "cases.csv")) {
    if (row.at("steps") == "" || row.at("spec") != "grid") continue;
    const fs::path file = folder_ / "b" / "cases" / (row.at("case_id") + ".json");
    auto changed = nlohmann::ordered_json::parse(Read(file));
    changed["case"]["steps"] = 1.5;
    std::ofstream(file) << changed;
    break;
  }
  const Outcome outcome = Call({"merge", (folder_ / "differ").string(), a, b});
  EXPECT_EQ(outcome.exit_code, 1) << outcome.err;
  EXPECT_NE(outcome.out.find("DISAGREE"), std::string::npos) << outcome.out;
  EXPECT_NE(outcome.out.find("steps is "), std::string::npos) << outcome.out;
  EXPECT_NE(outcome.out.find("/grid/"), std::string::npos) << outcome.out;
}

TEST_F(SweepsCommand, ProcessesTakeTheirSamplesOneAfterTheOther) {
  ASSERT_EQ(Call(Run("one", {"--structures", "bvh_sah,grid"})).exit_code, 0);
  const Outcome outcome = Call(Run("three", {"--structures", "bvh_sah,grid", "--processes", "3"}));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_NE(outcome.err.find("process 2 of 3 is done"), std::string::npos) << outcome.err;
  EXPECT_EQ(WithoutTimes("one"), WithoutTimes("three"));
  ExpectSamples("three", 18);
  std::map<std::string, size_t> of_process;
  for (const auto& row : ReadCsv(folder_ / "three" / "samples.csv")) {
    EXPECT_EQ(row.at("process"), row.at("session"));
    ++of_process[row.at("process")];
  }
  ASSERT_EQ(of_process.size(), 3u);
  EXPECT_EQ(of_process["0"], of_process["2"]);
  for (const auto& row : ReadCsv(folder_ / "three" / "cases.csv")) EXPECT_EQ(row.at("sessions"), "3");
}

TEST_F(SweepsCommand, AResumedRunOfAnotherBuildIsRefused) {
  ASSERT_EQ(Call(Run("out", {"--structures", "null"})).exit_code, 0);
  auto run = nlohmann::ordered_json::parse(Read(folder_ / "out" / "run.json"));
  run["build"]["commit"] = "older";
  std::ofstream(folder_ / "out" / "run.json") << run;
  const Outcome outcome = Call(Run("out", {"--structures", "null", "--resume"}));
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_NE(outcome.err.find("results of two builds are kept apart"), std::string::npos) << outcome.err;
}

TEST_F(SweepsCommand, BashCompletesCommandsOptionsAndNames) {
  const Outcome script = Call({"completion", "bash"});
  ASSERT_EQ(script.exit_code, 0) << script.err;
  std::ofstream(folder_ / "completion.bash") << script.out;
  std::ofstream(folder_ / "try.bash") << "source '" << (folder_ / "completion.bash").string() << R"('
for words in 'ru' 'run --str' 'run --structures bvh_sah,kdtree_sa' 'list structure octr' 'run spheref' 'run --suite qui' \
    'completion z' 'render --structure embree_' 'run --seed '; do
  IFS=' ' read -r -a typed <<< "raybench $words"
  [[ $words == *' ' ]] && typed+=('')
  COMP_WORDS=("${typed[@]}") COMP_CWORD=$((${#typed[@]} - 1))
  _raybench
  echo "${COMPREPLY[*]}"
done
)";
  const std::string command = fmt::format("bash '{0}/try.bash' > '{0}/completed' 2>&1", folder_.string());
  ASSERT_EQ(std::system(command.c_str()), 0) << Read(folder_ / "completed");
  EXPECT_EQ(Read(folder_ / "completed"),
            "run\n--structures\nbvh_sah,kdtree_sah\noctree\nsphereflake\nquick\nzsh\nembree_topology\n\n");
  EXPECT_EQ(Call({"completion", "csh"}).exit_code, 2);
}

TEST_F(SweepsCommand, ZshAndFishReadTheirCompletionWhereTheyAreInstalled) {
  const std::pair<const char*, const char*> tries[] = {
      {"zsh",
       "zsh -f -c 'compdef() {{ : }}; source {0}/script; words=(raybench run --str); CURRENT=3; "
       "compadd() {{ print -- \"$@\" }}; _raybench' > {0}/completed 2>&1"},
      {"fish", "fish -c 'source {0}/script; complete -C \"raybench run --str\"' > {0}/completed 2>&1"}};
  int installed = 0;
  for (const auto& [shell, command] : tries) {
    if (std::system(fmt::format("command -v {} > /dev/null", shell).c_str()) != 0) continue;
    ++installed;
    std::ofstream(folder_ / "script") << Call({"completion", shell}).out;
    EXPECT_EQ(std::system(fmt::format(fmt::runtime(command), folder_.string()).c_str()), 0) << shell;
    EXPECT_NE(Read(folder_ / "completed").find("--structures"), std::string::npos)
        << Read(folder_ / "completed");
  }
  if (installed == 0) GTEST_SKIP() << "neither zsh nor fish is installed";
}

}  // namespace
}  // namespace raybench
