// raybench trials: builds and times what it is told by lines of JSON. `tune` and `advise` are made of it.
#include "harness/trials/trials.h"

#include "harness/cli/commands.h"
#include "harness/terminal/load.h"

namespace raybench {
namespace {

struct TrialsArguments {
  std::string scene;
  MixOptions mix;
  bool drop_bad = false;
};

void AddOptions(CLI::App& command, TrialsArguments& arguments) {
  command.add_option("scene", arguments.scene, "A file, generator or model (see: raybench list scenes)")
      ->required()
      ->type_name("SCENE");
  command
      .add_option("--mix", arguments.mix.mix,
                  "Rays: picture (default), or ray sets and families with weights, such as "
                  "camera=1,shadow=2,diffuse=4")
      ->type_name("MIX");
  command
      .add_option("--rays", arguments.mix.rays,
                  "Rays of each set to choose by, at most, and as many that are held out; default 16K")
      ->transform(WholeNumber(64, 1 << 24, Units::kSizes))
      ->type_name("N");
  command.add_option("--depth", arguments.mix.depth, "Bounces of the picture; default 2")
      ->transform(WholeNumber(0, 64))
      ->type_name("N");
  command
      .add_option("--seed", arguments.mix.seed, "Of rays, their halves and the order of timing; default 1")
      ->transform(WholeNumber())
      ->type_name("N");
  command.add_flag("--drop-bad", arguments.drop_bad, "Leave out bad triangles instead of refusing the file");
  command.footer(
      "The first line of output says what there is; then each line of input, a JSON object, gets one line "
      "of\n"
      "output. One thread, processor time. Requests:\n"
      "  {\"build\": \"grid(density=4)\", \"seconds\": 10}   -> {\"tree\": 1, \"seconds\": ..., \"bytes\": "
      "...,\n"
      "                                                   \"claims\": \"watertight\"} or {\"stopped\": WHY}\n"
      "  {\"time\": [1, 2], \"rays\": 4096, \"rounds\": 9}    -> {\"ns\": nanoseconds [tree][round][set]}; "
      "also\n"
      "                                                   \"held_out\": true, \"seconds\": LIMIT\n"
      "  {\"judge\": 1, \"rays\": 4096}                     -> errors against exact truth, of the mix and "
      "of\n"
      "                                                   rays aimed at edges and vertices\n"
      "  {\"drop\": [1]}                                  -> {}");
}

void AddTrialsCommand(CLI::App& app, Invocation& invocation) {
  AddCommand<TrialsArguments>(app, invocation, "trials",
                              "Build and time structures as lines of JSON on stdin say, for other programs",
                              AddOptions, [](const TrialsArguments& arguments, const Registry& registry) {
                                ParseMix(arguments.mix.mix);  // before a scene that takes long
                                LoadOptions load;
                                load.drop_bad = arguments.drop_bad;
                                const Scene scene = LoadWithProgress(arguments.scene, load);
                                Trials trials(registry, scene, arguments.mix);
                                return ServeTrials(trials);
                              });
}

}  // namespace

const Command kTrials = {88, AddTrialsCommand};

}  // namespace raybench
