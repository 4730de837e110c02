// raybench tune: parameters of a structure for a scene. The Python part searches (reports/TUNE.md), `raybench
// trials` measures.
#include <fmt/format.h>

#include "harness/cli/commands.h"
#include "harness/results/python.h"
#include "harness/results/report_words.h"
#include "harness/trials/mix.h"

namespace raybench {
namespace {

struct TuneOptions {
  std::string scene, structure, mix = "picture", objective = "total", out;
  uint64_t rays = 1000000, seed = 1;
  std::optional<uint64_t> evaluations;
  std::optional<double> seconds;
};

void AddTuneOptions(CLI::App& command, TuneOptions& options) {
  command.add_option("scene", options.scene, "A file, generator or model (see: raybench list scenes)")
      ->required()
      ->type_name("SCENE");
  command
      .add_option(
          "--structure", options.structure,
          "What is tuned. Parameters given here stay as they are; those that trade accuracy for speed "
          "are never tuned")
      ->required()
      ->type_name("A(X=1)");
  command
      .add_option(
          "--mix", options.mix,
          "Rays: picture (default: what the tracer asks for one, as often as it asks), or ray sets and "
          "families with weights, such as camera=1,shadow=2,diffuse=4")
      ->type_name("MIX");
  command
      .add_option("--rays", options.rays, "Rays that one build must serve; default 1,000,000 (1M is 2^20)")
      ->transform(WholeNumber(1, uint64_t{1} << 50, Units::kSizes))
      ->type_name("N");
  command
      .add_option("--objective", options.objective,
                  "What shall be least: total (default), the time of building and tracing --rays; or trace")
      ->check(CLI::IsMember({"total", "trace"}))
      ->type_name("total|trace");
  CLI::Option* evaluations =
      command
          .add_option(
              "--evaluations", options.evaluations,
              "Points that are tried, the default among them; default 60, the same for each structure")
          ->transform(WholeNumber(2, 100000))
          ->type_name("N");
  command.add_option("--seconds", options.seconds, "Instead: try points for so long")
      ->transform(RealNumber(1, 1e6))
      ->excludes(evaluations)
      ->type_name("SECONDS");
  command.add_option("--seed", options.seed, "Of the search and the rays; default 1")
      ->transform(WholeNumber(0, INT32_MAX))
      ->type_name("N");
  command
      .add_option(
          "--out", options.out,
          "Folder for tuned.toml (raybench run --params takes it), trials.csv and tune.json; default: "
          "none are written")
      ->type_name("DIR");
  command.footer(
      "Half of the rays are used to choose, the other half to compare the result with the default, by "
      "turns.\n"
      "One thread, processor time. reports/TUNE.md explains the search.\n"
      "  raybench tune stadium --structure grid --out tuned/grid\n"
      "  raybench run stadium --structures grid,embree --params tuned/grid/tuned.toml");
}

int Tune(const TuneOptions& options, const Registry& registry, const Invocation& invocation) {
  ParseContestant(registry, options.structure);  // one line about what is wrong, before a scene is loaded
  ParseMix(options.mix);
  ReportWords words("tune", invocation.plugins);
  words.Option("--structure", options.structure);
  words.Option("--mix", options.mix);
  words.Option("--rays", options.rays);
  words.Option("--objective", options.objective);
  words.Option("--seed", options.seed);
  words.Option("--evaluations", options.evaluations);
  words.Option("--seconds", options.seconds);
  words.Option("--out", options.out);
  words.Operands({options.scene});
  return Reports().Run(words.all());
}

void AddTuneCommand(CLI::App& app, Invocation& invocation) {
  AddCommand<TuneOptions>(app, invocation, "tune", "Find a structure's best parameters for a scene",
                          AddTuneOptions,
                          [&invocation](const TuneOptions& options, const Registry& registry) {
                            return Tune(options, registry, invocation);
                          });
}

}  // namespace

const Command kTune = {86, AddTuneCommand};

}  // namespace raybench
