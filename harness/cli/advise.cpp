// raybench advise: what to take for a scene. The Python part decides (reports/TUNE.md), `raybench trials`
// measures.
#include <fmt/format.h>

#include "harness/cli/commands.h"
#include "harness/results/python.h"
#include "harness/results/report_words.h"
#include "harness/trials/mix.h"

namespace raybench {
namespace {

struct AdviseOptions {
  std::string scene, mix = "picture", out;
  std::vector<std::string> also;
  uint64_t rays = 1000000, seed = 1;
  std::optional<uint64_t> memory, frames;
  double max_error = 0, seconds = 30;
  bool json = false, no_offset = false;
};

void AddAdviseOptions(CLI::App& command, AdviseOptions& options) {
  command.add_option("scene", options.scene, "A file, generator or model (see: raybench list scenes)")
      ->required()
      ->type_name("SCENE");
  command
      .add_option("--rays", options.rays,
                  "Rays that one build must serve; default 1,000,000. With --rebuild-every: rays a frame")
      ->transform(WholeNumber(1, uint64_t{1} << 50, Units::kSizes))
      ->type_name("N");
  command
      .add_option("--rebuild-every", options.frames,
                  "The geometry moves, and one build serves so many frames of --rays")
      ->transform(WholeNumber(1, 1000000))
      ->type_name("F");
  command
      .add_option("--max-error", options.max_error,
                  "Highest rate of wrong answers among the rays of --mix that you accept, such as 1e-4. "
                  "Default 0: only what claims to be watertight, on all rays")
      ->transform(RealNumber(0, 1))
      ->type_name("E");
  command
      .add_option("--memory", options.memory,
                  "Most bytes that the tree may take, with the mesh where it still needs it, such as 64M")
      ->transform(WholeNumber(1, UINT64_MAX, Units::kSizes))
      ->type_name("M");
  command
      .add_option(
          "--mix", options.mix,
          "Rays: picture (default: what the tracer asks for one, as often as it asks), or ray sets and "
          "families with weights, such as camera=1,shadow=2,diffuse=4")
      ->type_name("MIX");
  command.add_option("--also", options.also, "More candidates, such as a plugin's or a tuned one")
      ->delimiter(';')
      ->allow_extra_args(false)
      ->type_name("A(X=1)");
  command.add_option("--seconds", options.seconds, "Most time that measuring may take; default 30")
      ->transform(RealNumber(0.1, 1e6))
      ->type_name("SECONDS");
  command.add_option("--seed", options.seed, "Of the rays and their order; default 1")
      ->transform(WholeNumber())
      ->type_name("N");
  command
      .add_option("--out", options.out, "Folder for advice.json and advised.toml; default: none are written")
      ->type_name("DIR");
  command.add_flag("--no-offset", options.no_offset,
                   "Do not look for a safe offset of rays that leave surfaces, which takes some seconds");
  command.add_flag("--json", options.json, "Print advice.json instead of sentences");
  command.footer(
      "Candidates are built and traced for a short while beside each other, and given up as soon as they\n"
      "cannot win. One thread, processor time. reports/TUNE.md explains it, and measures how good the advice "
      "is.\n"
      "  raybench advise stadium --rays 100M\n"
      "  raybench advise my_model.glb --rays 2M --rebuild-every 1 --max-error 1e-4 --memory 256M");
}

int Advise(const AdviseOptions& options, const Registry& registry, const Invocation& invocation) {
  ParseMix(options.mix);
  for (const std::string& spec : options.also) ParseContestant(registry, spec);
  ReportWords words("advise", invocation.plugins);
  words.Option("--mix", options.mix);
  words.Option("--rays", options.rays);
  words.Option("--max-error", options.max_error);
  words.Option("--seconds", options.seconds);
  words.Option("--seed", options.seed);
  words.Option("--also", options.also);
  words.Option("--memory", options.memory);
  words.Option("--rebuild-every", options.frames);
  words.Option("--out", options.out);
  words.Option("--json", options.json);
  words.Option("--no-offset", options.no_offset);
  words.Operands({options.scene});
  return Reports().Run(words.all());
}

void AddAdviseCommand(CLI::App& app, Invocation& invocation) {
  AddCommand<AdviseOptions>(app, invocation, "advise",
                            "What to take for a scene and a number of rays, and why", AddAdviseOptions,
                            [&invocation](const AdviseOptions& options, const Registry& registry) {
                              return Advise(options, registry, invocation);
                            });
}

}  // namespace

const Command kAdvise = {85, AddAdviseCommand};

}  // namespace raybench
