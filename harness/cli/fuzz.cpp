// raybench fuzz, raybench replay: what they take.
#include "harness/fuzz/fuzz.h"

#include <fmt/format.h>

#include "accel/host/parameters.h"
#include "harness/cli/commands.h"
#include "harness/fuzz/check_plugin.h"
#include "harness/fuzz/replay.h"
#include "harness/fuzz/report.h"

namespace raybench {
namespace {

struct FuzzArguments {
  fuzz::FuzzOptions fuzz;
  std::optional<std::string> structures;
  bool has_cases = false, has_seconds = false;
  std::vector<std::string> regress;
};

std::string ListOfChecks() {
  std::string text;
  for (const fuzz::CheckInfo& info : fuzz::Checks()) {
    const char* who = info.demand == fuzz::Demand::kAlways         ? "all"
                      : info.demand == fuzz::Demand::kConservative ? "claims"
                                                                   : "own";
    text += fmt::format("  {:<14} {:<7} {}\n", info.name, who, info.doc);
  }
  return text;
}

constexpr const char* kFooter = R"help(
Who is asked: all, every structure; claims, trees that claim watertight or exact; own, structures of raybench itself that
use its tests. A structure that claims inexact is held to the contract alone.
A crash, a hang of 20 s (120 s without computing) and 2 GiB of memory are findings, too: each case runs in a
child process.

Examples:
  raybench fuzz                                        every structure, a minute
  raybench fuzz --structures bvh_sah,kdtree_sah --seconds 3600 --seed 7
  raybench fuzz --plugin ./libmine.so --structures mine --findings 1
  raybench fuzz --regress findings                     case files again
  raybench replay fuzz_findings/mine-closest.case --plugin ./libmine.so
Exit codes: 0 nothing found; 1 a promise was broken; 2 wrong input; 130 interrupted before anything was found.)help";

void AddOptions(CLI::App& command, FuzzArguments& arguments) {
  fuzz::FuzzOptions& fuzz = arguments.fuzz;
  command
      .add_option("--structures", arguments.structures,
                  "Such as bvh_sah,grid: with parameters at random; bvh_sah(numerics=exact): with these. "
                  "Default: every "
                  "one, those of plugins among them")
      ->type_name("A,B(X=1)");
  command.add_option("--seconds", fuzz.seconds, "How long; default 60, or without end if --cases is given")
      ->transform(RealNumber(0, 1e9))
      ->each([&](const std::string&) { arguments.has_seconds = true; })
      ->type_name("N");
  command.add_option("--cases", fuzz.cases, "How many cases at most; the same seed gives the same ones")
      ->transform(WholeNumber(1, uint64_t{1} << 48, Units::kSizes))
      ->each([&](const std::string&) { arguments.has_cases = true; })
      ->type_name("N");
  command.add_option("--seed", fuzz.seed, "Seed of everything random; default 1")
      ->transform(WholeNumber())
      ->type_name("N");
  command
      .add_option("--mode", fuzz.mode,
                  "exact: lattices of integers; chaotic: floats at their worst; default both")
      ->check(CLI::IsMember({"exact", "chaotic", "both"}))
      ->type_name("MODE");
  command.add_option("--check", fuzz.check, "One promise alone, see below")->type_name("NAME");
  command.add_option("--findings", fuzz.findings, "Stop at so many broken promises; default: go on")
      ->transform(WholeNumber())
      ->type_name("N");
  command.add_option("--jobs", fuzz.jobs, "Processes; default all processors")
      ->transform(WholeNumber(1, 1024))
      ->type_name("N");
  command
      .add_option("--out", fuzz.out,
                  "Folder for case files and fuzz.json; default fuzz_findings, made when something is found")
      ->type_name("DIR");
  command.add_flag("!--no-shrink", fuzz.shrink, "Leave the cases as they were found");
  command.add_option("--regress", arguments.regress, "Case files, or folders of them: examine these instead")
      ->type_name("FILE|DIR");
  command.footer("\nPromises:\n" + ListOfChecks() + kFooter);
}

int RunTheFuzzer(FuzzArguments& arguments, const Registry& registry, const Invocation& invocation) {
  fuzz::FuzzOptions& fuzz = arguments.fuzz;
  if (!arguments.regress.empty()) {
    fuzz::ReplayOptions replay;
    replay.files = arguments.regress, replay.brief = true;
    if (arguments.structures) replay.structure = *arguments.structures;
    return fuzz::RunReplay(registry, replay);
  }
  if (arguments.structures) fuzz.structures = SplitSpecs(*arguments.structures);
  if (!fuzz.check.empty()) fuzz::FindCheck(fuzz.check);
  if (arguments.has_cases && !arguments.has_seconds) fuzz.seconds = 0;
  if (fuzz.cases == 0 && fuzz.seconds == 0) throw InputError("fuzz: --seconds 0 needs --cases");
  fuzz.plugins = invocation.plugins;
  return fuzz::RunFuzz(registry, fuzz);
}

void AddReplayOptions(CLI::App& command, fuzz::ReplayOptions& options) {
  command.add_option("files", options.files, "Case files of raybench fuzz, or folders of them")
      ->required()
      ->type_name("FILE");
  command.add_option("--structure", options.structure, "Examine this one on the cases instead of theirs")
      ->type_name("A(X=1)");
  command.add_flag("--brief", options.brief, "A line each, and what broke");
  command.add_option("--shrink", options.shrunk, "Folder for smaller cases that break the same promises")
      ->type_name("DIR");
  command.footer("\nExit codes: 0 every promise held; 1 one was broken; 2 wrong input.");
}

constexpr const char* kCheckPluginFooter = R"help(
First come rays aimed at vertices, edges, outlines and planes of small scenes, then random cases (see: raybench fuzz
--help, where the promises are listed), each in a child process. What broke is shown with the smallest case found.

Exit codes: 0 every promise held; 1 one was broken, or the plugin cannot be loaded; 2 wrong input; 130 interrupted.)help";

void AddCheckPluginOptions(CLI::App& command, fuzz::CheckPluginOptions& options) {
  command.add_option("plugin", options.plugin, "The shared library")->required()->type_name("FILE.so");
  command.add_option("--seconds", options.seconds, "For each structure; default 60")
      ->transform(RealNumber(1, 1e9))
      ->type_name("N");
  command
      .add_option("--out", options.out,
                  "Folder for case files, fuzz.json and junit.xml; default: nothing is written")
      ->type_name("DIR");
  command.add_option("--seed", options.seed, "Seed of everything random; default 1")
      ->transform(WholeNumber())
      ->type_name("N");
  command.add_option("--jobs", options.jobs, "Processes; default all processors")
      ->transform(WholeNumber(1, 1024))
      ->type_name("N");
  command.footer(kCheckPluginFooter);
}

void AddFuzzCommand(CLI::App& app, Invocation& invocation) {
  AddCommand<FuzzArguments>(app, invocation, "fuzz", "Look for cases in which a structure breaks a promise",
                            AddOptions, [&invocation](FuzzArguments& arguments, const Registry& registry) {
                              return RunTheFuzzer(arguments, registry, invocation);
                            });
  AddCommand<fuzz::CheckPluginOptions>(
      app, invocation, "check-plugin", "Find out whether a plugin keeps the whole contract",
      AddCheckPluginOptions,
      [](fuzz::CheckPluginOptions& options, const Registry&) { return fuzz::RunCheckPlugin(options); });
  AddCommand<fuzz::ReplayOptions>(
      app, invocation, "replay", "Examine case files of fuzz once more, with exact numbers", AddReplayOptions,
      [](fuzz::ReplayOptions& options, const Registry& registry) {
        return fuzz::RunReplay(registry, options);
      });
}

}  // namespace

const Command kFuzz = {30, AddFuzzCommand};

}  // namespace raybench
