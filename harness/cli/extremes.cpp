// raybench extremes: where answers begin to fail, by suites of ever worse input.
#include <fmt/format.h>

#include <optional>

#include "accel/host/parameters.h"
#include "harness/cli/commands.h"
#include "harness/extremes/run.h"
#include "harness/extremes/suite.h"

namespace raybench {
namespace {

struct ExtremesArguments {
  extremes::Options options;
  std::optional<std::string> structures;
  bool list = false, no_report = false;
};

int ListSuites() {
  for (const extremes::Suite* suite : extremes::Suites()) {
    fmt::print("{}: {}\n  axis: {}; fails: {}\n", suite->name, suite->doc, suite->axis_title, suite->failure);
    if (suite->second != nullptr) fmt::print("  second measure: {}\n", suite->second);
    fmt::print("  claims must hold: {}\n", suite->range);
  }
  fmt::print("{}\n", extremes::kNotCovered);
  return 0;
}

void AddOptions(CLI::App& command, ExtremesArguments& arguments) {
  extremes::Options& options = arguments.options;
  command.add_option("--suites", options.suites, "Such as edge_aim,far_scene; default all (see --list)")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->type_name("A,B");
  command
      .add_option("--structures", arguments.structures,
                  "Such as bvh_sah,embree(robust=true); default: one of each family, with each of its "
                  "numerics; all: every one")
      ->type_name("A,B(X=1)");
  command.add_option("--rays", options.rays, "Rays per point; default 2K, quick 256")
      ->transform(WholeNumber(uint64_t{64}, uint64_t{1} << 24, Units::kSizes))
      ->type_name("N");
  command.add_option("--seed", options.seed, "Seed of everything random; default 1")
      ->transform(WholeNumber())
      ->type_name("N");
  command.add_flag("--quick", options.quick, "Every second point and fewer rays: about two minutes");
  command.add_option("--out", options.out, "Result folder; default: results/extremes-<UTC time>")
      ->type_name("DIR");
  command.add_flag("--list", arguments.list, "List the suites");
  command.add_flag("--no-report", arguments.no_report, "Make no report.html");
  command.footer(
      "reports/EXTREMES.md explains the charts. Exit code 1: a claim was broken inside a suite's range.");
}

void AddExtremesCommand(CLI::App& app, Invocation& invocation) {
  AddCommand<ExtremesArguments>(app, invocation, "extremes",
                                "Find where answers begin to fail as the input gets worse", AddOptions,
                                [&invocation](ExtremesArguments& arguments, const Registry& registry) {
                                  if (arguments.list) return ListSuites();
                                  extremes::Options& options = arguments.options;
                                  if (arguments.structures)
                                    options.structures = SplitSpecs(*arguments.structures);
                                  options.plugins = invocation.plugins;
                                  options.command_line = invocation.arguments;
                                  options.report = !arguments.no_report;
                                  return extremes::Run(registry, options);
                                });
}

}  // namespace

const Command kExtremes = {80, AddExtremesCommand};

}  // namespace raybench
