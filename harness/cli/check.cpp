// raybench check: is HEAD slower than BASE, or different? The Python part decides (reports/DECISIONS.md).
#include <fmt/format.h>

#include <filesystem>

#include "harness/cli/commands.h"
#include "harness/results/python.h"

namespace raybench {
namespace {

struct CheckOptions {
  std::vector<std::string> folders, run, commits;
  std::string anchor, build, binary, baseline, accept, tolerance, out;
  double seconds = 0, share = 0;
  uint64_t seed = 1, pairs = 0;
  bool exact_only = false, instructions = false, all = false, list = false;
};

void AddOptions(CLI::App& command, CheckOptions& options) {
  command
      .add_option("folders", options.folders,
                  "Result folders of `raybench run`: BASE and HEAD. One with --baseline")
      ->expected(0, 2)
      ->type_name("BASE HEAD");
  command
      .add_option(
          "--run", options.run,
          "Two command lines `raybench run ...`: both are run by turns, in random order, until all is "
          "decided or --seconds are spent")
      ->expected(2)
      ->type_name("\"CMD A\" \"CMD B\"");
  command
      .add_option(
          "--commits", options.commits,
          "Two commits of the repository in this folder: each is built in a worktree, then compared as by "
          "--run; what is run stands in --binary")
      ->expected(2)
      ->type_name("A B");
  command
      .add_option(
          "--build", options.build,
          "With --commits: how a worktree is built; default: raybench alone, by CMake's preset release")
      ->type_name("\"CMD\"");
  command
      .add_option("--binary", options.binary,
                  "With --commits: what is run: a program of the worktree, or any with {tree} for the "
                  "worktree in its arguments; default "
                  "\"build/release/raybench run --quick\"")
      ->type_name("\"PATH ...\"");
  command
      .add_option(
          "--anchor", options.anchor,
          "With BASE and HEAD: compare each structure's time as a ratio to this structure's in the same run: "
          "for machines that change between runs")
      ->type_name("SPEC");
  command
      .add_option("--seconds", options.seconds, "With --run and --commits: budget of measuring; default 300")
      ->transform(RealNumber(1, 1e6))
      ->type_name("SECONDS");
  command
      .add_option("--pairs", options.pairs,
                  "With --run and --commits: at most so many pairs; default: as many as fit")
      ->transform(WholeNumber(1, 100000))
      ->type_name("N");
  command.add_option("--seed", options.seed, "Of the order within pairs; default 1")
      ->transform(WholeNumber())
      ->type_name("N");
  command.add_flag("--all", options.all,
                   "Go on after the first comparison has failed, until each is decided");
  command.add_flag("--exact-only", options.exact_only,
                   "Compare no times: counters, digests, verdicts and memory alone");
  command.add_flag("--instructions", options.instructions,
                   "With --run: also count instructions of both by valgrind's callgrind, and compare them");
  command
      .add_option("--tolerance", options.tolerance,
                  "TOML file of tolerances (reports/DECISIONS.md); default: 2 % for all")
      ->type_name("FILE");
  command
      .add_option("--baseline", options.baseline,
                  "Compare the exact figures of one result folder with this file; see --accept")
      ->type_name("FILE");
  command
      .add_option(
          "--accept", options.accept,
          "Write the exact figures to --baseline, with this reason, author, date, and old and new figures")
      ->type_name("\"WHY\"");
  command
      .add_option("--out", options.out, "Folder for check.json, check.md, junit.xml and, with --run, samples")
      ->type_name("DIR");
  command.footer(
      "Exact figures (counters, digests of trees and hits, verdicts, memory) must be equal; times are pass, "
      "fail\n"
      "or inconclusive, by intervals of the median log-ratio over pairs: reports/DECISIONS.md.\n"
      "Exit codes: 0 pass; 1 fail; 2 wrong input; 3 inconclusive.\n"
      "  raybench check --run \"old/raybench run --quick\" \"new/raybench run --quick\" --seconds 600 --out "
      "check\n"
      "  raybench check results/now --baseline tests/baseline/small.txt");
}

int Check(const CheckOptions& options, const Registry&) {
  std::vector<std::string> words = {"check"};
  const auto text = [&](const char* name, const std::string& value) {
    if (!value.empty()) words.push_back(fmt::format("{}={}", name, value));
  };
  const auto flag = [&](const char* name, bool set) {
    if (set) words.push_back(name);
  };
  words.insert(words.end(), options.folders.begin(), options.folders.end());
  for (const auto& [name, two] :
       {std::pair{"--run", &options.run}, std::pair{"--commits", &options.commits}}) {
    if (two->empty()) continue;
    words.push_back(name);
    words.insert(words.end(), two->begin(), two->end());
  }
  text("--build", options.build);
  text("--binary", options.binary);
  text("--anchor", options.anchor);
  text("--baseline", options.baseline);
  text("--accept", options.accept);
  text("--tolerance", options.tolerance);
  text("--out", options.out);
  if (options.seconds > 0) text("--seconds", fmt::format("{}", options.seconds));
  if (options.pairs > 0) text("--pairs", fmt::format("{}", options.pairs));
  text("--seed", fmt::format("{}", options.seed));
  flag("--all", options.all);
  flag("--exact-only", options.exact_only);
  flag("--instructions", options.instructions);
  return Reports().Run(words);
}

void AddCheckCommand(CLI::App& app, Invocation& invocation) {
  AddCommand<CheckOptions>(app, invocation, "check", "Is HEAD slower than BASE, or different? For CI",
                           AddOptions, Check);
}

}  // namespace

const Command kCheck = {90, AddCheckCommand};

}  // namespace raybench
