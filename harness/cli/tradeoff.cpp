// raybench tradeoff: what does accuracy cost on this scene? The Python part sweeps and draws (reports/TRADEOFF.md).
#include <fmt/format.h>

#include "harness/cli/commands.h"
#include "harness/results/python.h"
#include "harness/results/report_words.h"

namespace raybench {
namespace {

struct TradeoffOptions {
  std::vector<std::string> scenes;
  std::string suite, out, size;
  std::optional<std::string> knobs, structure;
  std::optional<double> seconds;
  std::optional<uint64_t> rays, verify_rays, samples, reference, seed;
  bool quick = false, list = false, no_report = false;
};

void AddOptions(CLI::App& command, TradeoffOptions& options) {
  command
      .add_option("scenes", options.scenes, "Files, generators or fetched models (see: raybench list scenes)")
      ->type_name("SCENE");
  command
      .add_option(
          "--knobs", options.knobs,
          "Such as numerics,depth,\"bvh_sah.leaf_size=1|4|16\"; default numerics,tests,precision,tracer. "
          "--list shows all")
      ->type_name("A,B,...");
  command
      .add_option(
          "--suite", options.suite,
          "TOML file with scenes, knobs and the numbers below; what is given beside it takes the place "
          "of its own")
      ->type_name("FILE.toml");
  command.add_flag("--quick", options.quick,
                   "Fewer points, rays and samples: about a minute on small scenes");
  command
      .add_option("--seconds", options.seconds,
                  "Budget of all timing of a scene; default 180, quick 40. Judging answers and reference "
                  "pictures come on top")
      ->transform(RealNumber(0.001, 1e6))
      ->type_name("SECONDS");
  command
      .add_option("--rays", options.rays,
                  "Rays of a set that are timed; default 16K, quick 4K; "
                  "fewer where the slowest structure cannot do them in its share of --seconds")
      ->transform(WholeNumber(64, uint64_t{1} << 28, Units::kSizes))
      ->type_name("N");
  command
      .add_option("--verify-rays", options.verify_rays,
                  "Rays of a set that are compared with the truth; default 32K, quick 4K")
      ->transform(WholeNumber(64, uint64_t{1} << 28, Units::kSizes))
      ->type_name("N");
  command
      .add_option("--size", options.size,
                  "Pictures in pixels; default 192x192, quick 96x96; smaller where the "
                  "reference would take too long")
      ->type_name("WxH");
  command
      .add_option("--reference-samples", options.reference,
                  "Reference of what samples: N x N a pixel; default 64, quick 16")
      ->transform(WholeNumber(2, 64))
      ->type_name("N");
  command
      .add_option("--samples", options.samples,
                  "Times that each picture is rendered, each in a process of its own; default 7, quick 6; 6 "
                  "have an interval and are taken whatever --seconds says. What is undecided gets the "
                  "seconds that are left")
      ->transform(WholeNumber(1, 1000))
      ->type_name("N");
  command.add_option("--structure", options.structure, "Traces the pictures; default bvh_wide")
      ->type_name("A(X=1)");
  command.add_option("--seed", options.seed, "Seed of everything random; default 1")
      ->transform(WholeNumber())
      ->type_name("N");
  command.add_option("--out", options.out, "Result folder; default: results/tradeoff-<UTC time>")
      ->type_name("DIR");
  command.add_flag("--list", options.list, "List the knobs");
  command.add_flag("--no-report", options.no_report, "Make no report.html");
  command.footer(
      "Writes tradeoff.csv (a row a point), fronts.csv (what dominates what), tradeoff.json, pictures with "
      "their\ndifferences, and report.html with the Pareto fronts. Each point has the command that measures "
      "it "
      "again.\nKnobs that must be exact (stored precision but for vertices, parameters of structures) fail "
      "on any "
      "disagreement; "
      "others are\nscored. A structure whose claim is broken has no time and stands on no front.\n\n"
      "Examples:\n"
      "  raybench tradeoff armadillo                              numerics, tests, stored precision, tracer\n"
      "  raybench tradeoff armadillo --knobs numerics             speed against wrong answers\n"
      "  raybench tradeoff sponza --knobs samples,filter --size 256x256\n"
      "  raybench tradeoff bunny --knobs \"bvh_sah.leaf_size=1|2|4|8|16,kdtree_sah.max_depth\"\n"
      "Exit codes: 0 fine; 1 a claim is broken, or what must be exact disagrees; 2 wrong input; 130 "
      "interrupted "
      "(nothing\nis written).");
}

int Tradeoff(const TradeoffOptions& options, const Registry& registry, const Invocation& invocation) {
  if (options.structure) ParseContestant(registry, *options.structure);
  ReportWords words("tradeoff", invocation.plugins);
  words.Option("--knobs", options.knobs);
  words.Option("--suite", options.suite);
  words.Option("--size", options.size);
  words.Option("--structure", options.structure);
  words.Option("--out", options.out);
  words.Option("--seconds", options.seconds);
  words.Option("--rays", options.rays);
  words.Option("--verify-rays", options.verify_rays);
  words.Option("--reference-samples", options.reference);
  words.Option("--samples", options.samples);
  words.Option("--seed", options.seed);
  words.Option("--quick", options.quick);
  words.Option("--list", options.list);
  words.Option("--no-report", options.no_report);
  words.Operands(options.scenes);
  return Reports().Run(words.all());
}

void AddTradeoffCommand(CLI::App& app, Invocation& invocation) {
  AddCommand<TradeoffOptions>(app, invocation, "tradeoff",
                              "What does accuracy cost? Pareto fronts of a scene", AddOptions,
                              [&invocation](const TradeoffOptions& options, const Registry& registry) {
                                return Tradeoff(options, registry, invocation);
                              });
}

}  // namespace

const Command kTradeoff = {95, AddTradeoffCommand};

}  // namespace raybench
