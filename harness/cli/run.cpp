// raybench run: what the main job takes.
#include "harness/run/run.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <tuple>

#include "accel/host/parameters.h"
#include "harness/cli/commands.h"
#include "harness/plan/params_file.h"
#include "harness/rays/ray_sets.h"

namespace raybench {
namespace {

struct RunArguments {
  RunOptions run;
  std::optional<std::string> structures, suite, shard, params;
  std::optional<uint64_t> seed;
  std::optional<uint32_t> depth, processes;
  std::vector<std::string> rays;  ///< a number, files, or both
  bool quick = false, full = false, no_report = false;
};

void AddOptions(CLI::App& command, RunArguments& arguments) {
  RunOptions& run = arguments.run;
  command.add_option("scenes", run.scenes, "Files, generators or fetched models (see: raybench list scenes)")
      ->type_name("SCENE");
  command
      .add_option("--structures", arguments.structures,
                  "Such as bvh_sah,embree(robust=true); default: one of each family; all: every one")
      ->type_name("A,B(X=1)");
  command
      .add_option(
          "--params", arguments.params,
          "Parameters of structures, as raybench tune writes them; what --structures says of one goes "
          "before")
      ->type_name("FILE.toml");
  CLI::Option* suite =
      command
          .add_option(
              "--suite", arguments.suite,
              "What is measured, and how: the name of a suite (see: raybench list suites) or a file of "
              "your own; default: default. Scenes and options given beside it take the place of its own")
          ->type_name("NAME|FILE.toml");
  CLI::Option* quick = command.add_flag("--quick", arguments.quick, "--suite quick: less than a minute");
  command.add_flag("--full", arguments.full, "--suite full: every structure, a million rays a set; hours")
      ->excludes(suite)
      ->excludes(quick);
  quick->excludes(suite);
  command.add_option("--out", run.out, "Result folder; default: results/<UTC time>")->type_name("DIR");
  command
      .add_option(
          "--rays", arguments.rays,
          "A number: rays per set; default 128K, suite quick 8K. Or a .rays file or a folder of them (see: "
          "raybench rays): replay these rays instead of captured ones; all of them, unless a number "
          "is given too. The files' names become the names of the sets. May be repeated")
      ->allow_extra_args(false)
      ->type_name("N|FILE");
  command.add_option("--sets", run.sets, "Captured ray sets to trace, such as camera,shadow.0; default all")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->type_name("A,B");
  command
      .add_option("--verify-rays", run.verify_rays,
                  "Rays per set that are compared with the truth; default 4K, quick 1K")
      ->transform(WholeNumber(uint64_t{1}, uint64_t{1} << 28, Units::kSizes))
      ->type_name("N");
  command
      .add_option("--budget", run.budget,
                  "Seconds that timing a case may take; default 0.36, quick 0.03; with --repetitions, "
                  "seconds per sample. A case that is too slow is timed on a part of its rays (1/4, 1/16, "
                  "... of the tiles; column timed_rays), and the anchor on the same part; a build gets fewer "
                  "samples. Verdicts and counters are always those of all rays")
      ->transform(RealNumber(0.0001, 86400))
      ->type_name("SECONDS");
  command
      .add_option("--repetitions", run.repetitions,
                  "Samples per case; default 9, quick 6, fewer where the budget is too short")
      ->transform(WholeNumber(1, 10000))
      ->type_name("N");
  command
      .add_option(
          "--passes", run.passes,
          "Passes over the rays a sample, none before them, instead of as many as the budget pays: for "
          "counting instructions rather than time")
      ->transform(WholeNumber(1, 1000000))
      ->type_name("N");
  command.add_option("--threads", run.threads, "Thread counts; default 1, for builds 1 and all")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->transform(WholeNumber(1, 1024))
      ->type_name("N,M");
  command.add_option("--depth", arguments.depth, "Bounces of the picture whose rays are recorded; default 2")
      ->transform(WholeNumber(0, 64))
      ->type_name("N");
  command.add_option("--seed", arguments.seed, "Seed of everything random; default 1")
      ->transform(WholeNumber())
      ->type_name("N");
  command
      .add_option("--memory-limit", run.memory_limit,
                  "Memory for all trees held at once (with the anchor's) and the build in progress, such as "
                  "8G; default: half of the machine's memory. Trees that do not fit together are timed in "
                  "groups, each with the anchor")
      ->transform(WholeNumber(0, UINT64_MAX, Units::kSizes))
      ->type_name("BYTES");
  command.add_flag("--shuffled", run.shuffled, "Also time a shuffled copy of each traced ray set");
  command.add_flag("--drop-bad", run.drop_bad, "Leave out bad triangles instead of refusing the file");
  command.add_flag("--resume", run.resume,
                   "Continue the run in --out with the samples that are missing. A run that was stopped, by "
                   "whatever, has lost the pass it was in and no more");
  command
      .add_option(
          "--processes", arguments.processes,
          "Processes that measure one after the other, each with a memory layout of its own; default 1. "
          "Intervals are then over processes and the samples of each")
      ->transform(WholeNumber(1, 1000))
      ->type_name("N");
  command
      .add_option(
          "--shard", arguments.shard,
          "Measure the I-th of N parts (1/4, 2/4, ...) of the structures and scenes, with the anchor beside; "
          "raybench merge puts the folders together")
      ->type_name("I/N");
  command.add_flag("--keep-rays", run.keep_rays,
                   "Store the captured ray sets in the result folder, for --again");
  command
      .add_option(
          "--again", run.again,
          "Measure anew, in this process, what the same program measured in DIR (with --keep-rays). Its "
          "rays are read from there; its verdicts, counters and figures of trees are taken over "
          "where the tree and all answers have the same digests, else judged as ever")
      ->type_name("DIR");
  command
      .add_option(
          "--parts-of", run.parts_of,
          "Time each case on the part of its rays on which it was timed in DIR, so that both times can "
          "be compared; other cases choose their own")
      ->type_name("DIR");
  command.add_flag("--no-report", arguments.no_report, "Make no report.html");
  command.footer(std::string(kGoals) + "\nRay sets, N being the depth:\n" +
                 FormatFamilies(CapturedFamilies()) +
                 "\nTwo arguments of Google Benchmark are accepted: --benchmark_min_time=SECONDS (per "
                 "sample) and --benchmark_filter=REGEX (of scene/structure/ray set/order/query/threads:N).");
}

/// "I/N" into the number of a shard, from 1, and how many there are.
std::pair<uint32_t, uint32_t> ReadShard(const std::string& text) {
  const size_t slash = std::min(text.find('/'), text.size());
  const auto shard = ParseWholeNumber(text.substr(0, slash), Units::kNone);
  const auto shards = ParseWholeNumber(text.substr(std::min(slash + 1, text.size())), Units::kNone);
  if (!shard || !shards || *shards < 1 || *shards > 100000 || *shard < 1 || *shard > *shards)
    throw InputError(fmt::format("--shard {}: allowed: I/N, such as 1/4, with I from 1 to N", text));
  return {uint32_t(*shard), uint32_t(*shards)};
}

/// What was not typed is what the suite says.
void TakeFromSuite(RunArguments& arguments, const Registry& registry) {
  RunOptions& run = arguments.run;
  const std::string short_form = arguments.quick ? "quick" : arguments.full ? "full" : "default";
  run.suite = ReadSuite(registry, arguments.suite.value_or(short_form));
  const Suite& suite = run.suite;
  run.named_scenes = !run.scenes.empty();
  if (!run.named_scenes) run.scenes = suite.scenes;
  run.structures = arguments.structures ? SplitSpecs(*arguments.structures) : suite.structures;
  if (arguments.params) run.structures = ApplyParams(registry, *arguments.params, run.structures);
  if (run.sets.empty() && run.ray_files.empty()) run.sets = suite.sets;
  if (run.threads.empty()) run.threads = suite.threads;
  run.shuffled = run.shuffled || suite.shuffled;
  run.seed = arguments.seed.value_or(suite.seed);
  run.depth = arguments.depth.value_or(suite.depth);
  run.processes = arguments.processes.value_or(suite.processes);
}

void AddRunCommand(CLI::App& app, Invocation& invocation) {
  AddCommand<RunArguments>(
      app, invocation, "run", "Verify and measure structures on scenes", AddOptions,
      [&invocation](RunArguments& arguments, const Registry& registry) {
        RunOptions& run = arguments.run;
        const RayWords rays = ReadRayWords(arguments.rays);
        run.rays = rays.number;
        run.ray_files = rays.files;
        if (!run.ray_files.empty() && run.scenes.empty())
          throw InputError("--rays FILE: name the scene that the rays were recorded in");
        if (!run.ray_files.empty() && !run.sets.empty())
          throw InputError("--sets names captured ray sets; it cannot be used with --rays FILE");
        if (run.resume && run.out.empty())
          throw InputError("--resume needs --out: the folder of the run to continue");
        if (arguments.shard) std::tie(run.shard, run.shards) = ReadShard(*arguments.shard);
        TakeFromSuite(arguments, registry);
        std::sort(run.threads.begin(), run.threads.end());
        run.threads.erase(std::unique(run.threads.begin(), run.threads.end()), run.threads.end());
        run.plugins = invocation.plugins;
        run.command_line = invocation.arguments;
        run.benchmark_flags = std::exchange(invocation.benchmark_flags, {});
        run.report = !arguments.no_report;
        return RunBenchmark(registry, run);
      });
}

}  // namespace

const Command kRun = {10, AddRunCommand};

}  // namespace raybench
