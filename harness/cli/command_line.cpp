#include "harness/cli/command_line.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "accel/host/names.h"
#include "harness/cli/commands.h"
#include "harness/measure/machine.h"
#include "harness/terminal/interrupt.h"

namespace raybench {
namespace {

constexpr const char* kExamples = R"help(
Examples:
  raybench run                          the main job: a real model and two procedural scenes
  raybench run --quick                  the same with fewer rays, in less than a minute
  raybench run --suite mine.toml --out results/sweep --resume
                                        a suite of your own; goes on where it was stopped
  raybench run model.glb --structures "bvh_sah,bvh_sah(numerics=fast),embree" --out results/mine
  raybench run "sphereflake(depth=5)" --rays 1M --threads 1,2 --seed 7
  raybench run model.obj --plugin ./libmine.so --structures mine,bvh_sah
  raybench verify model.obj --structures bvh_sah,embree
  raybench check-plugin ./libmine.so    does it keep the whole contract?
  raybench fuzz --seconds 600           look for a case that breaks a promise
  raybench rays record model.obj -o model_rays
  raybench run model.obj --rays model_rays
  raybench render engine -o engine.png --size 1280x720
  raybench list structures              all structures; list structure NAME shows parameters
  raybench fetch engine                 fetch a real model
  raybench extremes --quick             find where answers begin to fail: far away, slivers, copies, ...
  raybench spd                          compare ray counts with published ones
  raybench report results/mine          a page to look at, mail and cite
  raybench explain grid bvh_sah results/mine   why is one slower than the other?
  raybench check --commits main HEAD    did it become slower, or different?
  raybench doctor                       what of this machine spoils timings
Computed truth is stored beside fetched models, in RAYBENCH_CACHE or else ~/.cache/raybench, for the next
run. RAYBENCH_TRUTH_CACHE=off turns that off.
Exit codes: 0 success; 1 a broken claim; 2 wrong input; 3 inconclusive; 130 interrupted.)help";

/// The command that was typed, down to the last word that is one.
const CLI::App& LastCommand(const CLI::App& app) {
  const CLI::App* last = &app;
  while (!last->get_subcommands().empty()) last = last->get_subcommands().back();
  return *last;
}

std::string Typed(const CLI::App& app) {
  std::string words = app.get_name();
  for (const CLI::App* at = &app; !at->get_subcommands().empty();) {
    at = at->get_subcommands().back();
    words += " " + at->get_name();
  }
  return words;
}

/// Suggests what the first unknown word may have been meant to be.
std::string Meant(const CLI::App& app) {
  const std::vector<std::string> left = app.remaining(true);
  if (left.empty()) return {};
  const CLI::App& command = LastCommand(app);
  const std::string word = left[0].substr(0, left[0].find('='));
  std::vector<std::string> names;
  if (word.starts_with("-")) {
    for (const CLI::App* at : {&command, &app})
      for (const CLI::Option* option : at->get_options())
        for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  } else {
    for (const CLI::App* sub : command.get_subcommands([](const CLI::App*) { return true; }))
      names.push_back(sub->get_name());
  }
  return DidYouMean(word, std::vector<std::string_view>(names.begin(), names.end()));
}

/// Where plugins are to lie that come with raybench: where it was installed, else in the build folder.
std::string FolderOnRequest() {
  const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe").parent_path();
  const std::filesystem::path installed = program / RAYBENCH_INSTALLED_LIBRARIES "/plugins";
  return (std::filesystem::exists(installed) ? installed : program / "plugins").lexically_normal().string();
}

}  // namespace

int RunCommandLine(std::vector<std::string> arguments) {
  Invocation invocation;
  invocation.arguments = arguments;
  CLI::App app("Benchmark of ray-tracing acceleration structures", "raybench");
  app.footer(std::string(kGoals) + kExamples);
  app.require_subcommand(0, 1);
  app.fallthrough();
  app.set_version_flag(
      "--version", [] { return VersionText(); }, "Versions, commit and libraries");
  app.add_option("--plugin", invocation.plugins, "Shared library with more structures; may be repeated")
      ->allow_extra_args(false)
      ->type_name("FILE.so");
  std::vector<const Command*> commands(std::begin(kAllCommands), std::end(kAllCommands));
  std::stable_sort(commands.begin(), commands.end(),
                   [](const Command* a, const Command* b) { return a->place < b->place; });
  for (const Command* command : commands) command->add(app, invocation);

  // Google Benchmark's flags are its own: they are set aside before ours are read.
  const auto own = std::stable_partition(arguments.begin() + 1, arguments.end(),
                                         [](const std::string& a) { return !a.starts_with("--benchmark_"); });
  invocation.benchmark_flags.assign(own, arguments.end());
  std::vector<std::string> reversed(std::make_reverse_iterator(own),
                                    std::make_reverse_iterator(arguments.begin() + 1));
  try {
    app.parse(reversed);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == int(CLI::ExitCodes::Success)) return app.exit(error);
    std::string line = error.what();
    std::replace(line.begin(), line.end(), '\n', ' ');
    throw InputError(line + Meant(app) + "; see " + Typed(app) + " --help");
  }
  const auto typed = app.get_subcommands();
  if (!invocation.benchmark_flags.empty() && (typed.empty() || typed[0]->get_name() != "run")) {
    throw InputError(fmt::format("{}: only `raybench run` takes arguments of Google Benchmark",
                                 invocation.benchmark_flags[0]));
  }
  if (!invocation.action) {
    std::string names;
    for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; }))
      names += (names.empty() ? "" : ", ") + command->get_name();
    throw InputError(fmt::format("no command given; commands: {}; see raybench --help", names));
  }

  CatchInterrupts();
  Registry registry;
  registry.SetOnRequest(FolderOnRequest());
  for (const std::string& plugin : invocation.plugins) registry.LoadPlugin(plugin);
  return invocation.action(registry);
}

}  // namespace raybench
