#include "harness/render/heat.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <optional>

#include "datasets/scene/needs.h"
#include "harness/measure/machine.h"
#include "harness/measure/measure.h"
#include "harness/plan/build_options.h"
#include "harness/plan/plan.h"
#include "harness/results/heat_files.h"
#include "harness/results/python.h"
#include "harness/terminal/interrupt.h"
#include "harness/terminal/progress.h"
#include "tracer/heat_map.h"
#include "tracer/image_io.h"
#include "tracer/tracer.h"

namespace raybench {
namespace fs = std::filesystem;
namespace {

/// Removed with all it holds when it goes out of scope.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string pattern = (fs::temp_directory_path() / "raybench-heat-XXXXXX").string();
    if (::mkdtemp(pattern.data()) == nullptr) throw InputError(pattern + ": no temporary folder can be made");
    path_ = pattern;
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

/// One structure's part of the result.
struct Counted {
  std::string spec, why_not;
  HeatMap map;
  double build_seconds = 0;
};

std::string Facts(const std::vector<uint32_t>& map) {
  const HeatSummary summary = Summarize(map);
  return fmt::format("mean {:.2f}, max {}", double(summary.sum) / double(map.size()), summary.max);
}

std::vector<Channel> Channels(const std::vector<Counted>& all, const std::string& kind) {
  std::vector<Channel> channels;
  for (const Counted& c : all) {
    if (!c.why_not.empty()) continue;
    if (kind != "prims") channels.push_back({c.spec + ".steps", {c.map.steps.begin(), c.map.steps.end()}});
    if (kind != "steps") channels.push_back({c.spec + ".prims", {c.map.prims.begin(), c.map.prims.end()}});
  }
  return channels;
}

}  // namespace

std::vector<Contestant> HeatContestants(const Registry& registry, const std::vector<std::string>& specs) {
  std::vector<Contestant> chosen = ChooseContestants(registry, specs);
  if (specs.empty()) {
    std::erase_if(chosen, [](const Contestant& c) {
      const std::string_view name = c.structure->name;
      return name == "null" || name == "brute" || c.structure->query_counted == nullptr;
    });
  }
  return chosen;
}

int RenderHeat(const Registry& registry, const Scene& scene, const RenderHeatOptions& options) {
  const std::vector<Contestant>& contestants = options.contestants;
  if (std::all_of(contestants.begin(), contestants.end(),
                  [&](const Contestant& c) { return !WhyNotCounted(*c.structure, scene).empty(); })) {
    std::string reasons;
    for (const Contestant& c : contestants)
      reasons +=
          fmt::format("{}{} {}", reasons.empty() ? "" : ", ", c.Spec(), WhyNotCounted(*c.structure, scene));
    throw InputError(fmt::format("no heat map can be made of {}: {}", options.scene_name, reasons));
  }
  std::optional<Reports> reports;
  if (fs::path(options.out).extension() == ".png") {
    try {
      reports.emplace();
    } catch (const InputError& error) {
      throw InputError(
          fmt::format("Python draws a sheet of heat maps: {}; an .exr needs no Python", error.what()));
    }
  }

  const rb_build_options build = BuildOptions(options.threads, options.seed, NeedsOf(scene).BuildNeeds());
  const rb_geometry geometry = scene.Geometry();
  Progress progress;
  size_t step = 0;
  const auto update = [&](double fraction, const std::string& what) {
    ThrowIfInterrupted();
    progress.Update((double(step) + fraction) / double(contestants.size() + 1), what);
  };

  update(0, "rendering");
  TraceOptions trace;
  trace.width = options.width;
  trace.height = options.height;
  trace.max_depth = options.depth;
  trace.threads = options.threads;
  trace.progress = [&](double fraction) { update(fraction, "rendering"); };
  const Image picture =
      Trace(scene, Tree(ParseContestant(registry, "bvh_sah"), geometry, build), trace).image;

  std::vector<Counted> all;
  for (const Contestant& contestant : contestants) {
    ++step;
    Counted& c = all.emplace_back();
    c.spec = contestant.Spec();
    c.why_not = WhyNotCounted(*contestant.structure, scene);
    if (!c.why_not.empty()) continue;
    update(0, "building " + c.spec);
    const Stopwatch watch(true);
    const Tree tree(contestant, geometry, build);
    c.build_seconds = watch.Elapsed().wall;
    HeatOptions heat;
    heat.width = options.width;
    heat.height = options.height;
    heat.threads = options.threads;
    heat.progress = [&](double fraction) { update(fraction, "counting " + c.spec); };
    c.map = CountPerPixel(scene, tree, heat);
  }

  if (reports) {
    update(1, "drawing");
    const TemporaryFolder folder;
    WriteImage(picture, (folder.path() / "picture.png").string(), SoftwareName());
    HeatFiles files(folder.path(), options.scene_name, "picture.png");
    for (const Counted& c : all)
      c.why_not.empty() ? files.Add(c.spec, c.map) : files.AddNotCounted(c.spec, c.why_not);
    progress.Clear();
    const int code = reports->Run({"heat", folder.path().string(), "--out", options.out, "--kind",
                                   options.kind, "--scale", options.scale});
    if (code != 0) return code;
  } else {
    WriteLayers(picture, Channels(all, options.kind), options.out, SoftwareName());
  }
  progress.Clear();

  fmt::print("{}: {} x {} camera rays\n", options.out, options.width, options.height);
  for (const Counted& c : all) {
    if (!c.why_not.empty()) {
      fmt::print("  {}: not counted ({})\n", c.spec, c.why_not);
      continue;
    }
    fmt::print("  {}: steps {}; primitive tests {}; built in {:.3f} s\n", c.spec, Facts(c.map.steps),
               Facts(c.map.prims), c.build_seconds);
  }
  return 0;
}

}  // namespace raybench
