// raybench render: one picture, or heat maps of what traversal costs per pixel.
#include <fmt/format.h>

#include <filesystem>
#include <optional>

#include "accel/base/files.h"
#include "accel/host/parameters.h"
#include "datasets/scene/facts.h"
#include "datasets/scene/scene.h"
#include "harness/base/json.h"
#include "harness/cli/commands.h"
#include "harness/cli/picture_options.h"
#include "harness/measure/machine.h"
#include "harness/measure/measure.h"
#include "harness/plan/build_options.h"
#include "harness/plan/plan.h"
#include "harness/render/device_waves.h"
#include "harness/render/heat.h"
#include "harness/terminal/interrupt.h"
#include "harness/terminal/load.h"
#include "harness/terminal/progress.h"
#include "tracer/image_io.h"
#include "tracer/image_library.h"
#include "tracer/tracer.h"

namespace raybench {
namespace fs = std::filesystem;
namespace {

struct RenderOptions {
  std::string scene, structure = "bvh_sah", out, size, json, secondary;
  uint32_t width = 512, height = 512, depth = 4, threads = 0;
  uint64_t seed = 1;
  bool drop_bad = false;
  std::optional<std::string> heat, heat_structures;
  std::string heat_scale = "auto";
  std::string waves;  ///< host, device; empty: host, and no table of them
  PictureOptions picture;
};

/// "640x480", each side 1 to 16384.
void ParseSize(const std::string& text, RenderOptions& options) {
  const size_t by = text.find('x');
  const auto side = [](std::string_view digits) {
    return ParseWholeNumber(digits, Units::kNone).value_or(0);
  };
  const uint64_t width = side(text.substr(0, by)), height = by == text.npos ? 0 : side(text.substr(by + 1));
  if (width < 1 || height < 1 || width > 16384 || height > 16384)
    throw InputError(fmt::format("--size {}: write WIDTHxHEIGHT, each 1 to 16384", text));
  options.width = uint32_t(width);
  options.height = uint32_t(height);
}

/// Before any work: that the file, and pictures at all, can be written.
void CheckOut(const std::string& out) {
  const fs::path path(out), folder = path.has_parent_path() ? path.parent_path() : fs::path(".");
  const std::string extension = path.extension().string();
  if (extension != ".png" && extension != ".exr")
    throw InputError(fmt::format("{}: unknown picture format '{}'; allowed: .png, .exr", out, extension));
  std::error_code error;
  if (!fs::is_directory(folder, error))
    throw InputError(fmt::format("{}: cannot be written: {} is not a directory", out, folder.string()));
  LoadImageLibrary();
}

RenderHeatOptions HeatOptionsOf(const Registry& registry, const RenderOptions& options) {
  RenderHeatOptions heat;
  heat.scene_name = options.scene;
  heat.out = options.out;
  heat.kind = *options.heat;
  heat.scale = options.heat_scale;
  heat.contestants = HeatContestants(
      registry, options.heat_structures ? SplitSpecs(*options.heat_structures) : std::vector<std::string>());
  heat.width = options.width;
  heat.height = options.height;
  heat.depth = options.depth;
  heat.threads = options.threads;
  heat.seed = options.seed;
  return heat;
}

void PrintWaves(const TraceResult& result) {
  fmt::print("{:<6}{:>12}{:>12}{:>12}{:>12}\n", "wave", "rays", "hits", "shadow", "blocked");
  for (size_t w = 0; w < result.waves.size(); ++w) {
    const WaveCounts& wave = result.waves[w];
    fmt::print("{:<6}{:>12}{:>12}{:>12}{:>12}\n", w, wave.rays, wave.hits, wave.shadow, wave.blocked);
  }
}

/// A scene and the tree over it.
struct Built {
  explicit Built(Scene loaded) : scene(std::move(loaded)), geometry(scene.Geometry()) {}

  Scene scene;
  rb_geometry geometry;
  Tree tree;
  Seconds time;
};

/// The scene that rays meet, before anything is built. Throws InputError.
Scene Load(const std::string& name, const RenderOptions& options, const Contestant& contestant,
           const TraceOptions& trace) {
  LoadOptions load;
  load.seed = options.seed;
  load.drop_bad = options.drop_bad;
  load.keep_unread = trace.all_needs;
  Scene scene = LoadWithProgress(name, load);
  if (scene.primitive_count() == 0) throw InputError(fmt::format("scene '{}' has no primitives", name));
  for (const std::string& note : scene.stats.notes) fmt::print("{}: {}\n", name, note);
  if (options.heat) return scene;
  if (const std::string why = WhyNotTaken(*contestant.structure, scene); !why.empty())
    throw InputError(fmt::format("structure '{}', scene '{}': {}", contestant.structure->name, name, why));
  return scene;
}

/// `more`: RB_NEED_* that another scene's rays ask of this tree.
void Build(Built& built, const RenderOptions& options, const Contestant& contestant,
           const TraceOptions& trace, uint64_t more = 0) {
  const uint64_t needs = BuildNeedsOf(built.scene, trace, *contestant.structure) | more;
  const rb_build_options build = BuildOptions(options.threads, options.seed, needs);
  const Stopwatch watch(true);
  built.tree = Tree(contestant, built.geometry, build);
  built.time = watch.Elapsed();
}

/// Of one scene and its tree.
Json FactsOf(const Built& built) {
  uint64_t node_bytes = 0, prim_bytes = 0;
  int needs_geometry = 0;
  built.tree.structure().memory(built.tree.get(), &node_bytes, &prim_bytes, &needs_geometry);
  return {{"primitives", built.scene.primitive_count()},
          {"build_seconds", built.time.wall},
          {"build_cpu_seconds", built.time.cpu},
          {"scene_bytes", BytesOf(built.scene)},
          {"node_bytes", node_bytes},
          {"prim_bytes", prim_bytes}};
}

/// What --json writes. CPU times are those of all threads.
Json FactsOf(const RenderOptions& options, const Contestant& contestant, const Built& built,
             const std::optional<Built>& secondary, const Seconds& trace, const TraceResult& result) {
  Json facts = FactsOf(built);
  facts.update({{"scene", options.scene},
                {"structure", contestant.Spec()},
                {"width", options.width},
                {"height", options.height},
                {"seconds", trace.wall},
                {"cpu_seconds", trace.cpu},
                {"rays",
                 {{"camera", result.camera_rays},
                  {"shadow", result.shadow_rays},
                  {"reflection", result.reflection_rays},
                  {"refraction", result.refraction_rays}}}});
  if (secondary) {
    facts["secondary"] = FactsOf(*secondary);
    facts["secondary"]["scene"] = options.secondary;
  }
  return facts;
}

int RenderCommand(const Registry& registry, const RenderOptions& options) {
  CheckOut(options.out);
  const Contestant contestant = ParseContestant(registry, options.structure);
  std::optional<RenderHeatOptions> heat;
  if (options.heat) heat = HeatOptionsOf(registry, options);
  TraceOptions trace;
  trace.width = options.width;
  trace.height = options.height;
  trace.max_depth = options.depth;
  trace.threads = options.threads;
  SetTraceOptions(options.picture, trace);
  const bool on_device = options.waves == "device";
  if (on_device && !options.secondary.empty())
    throw InputError("--waves device: it traces one scene; leave out --secondary-scene");
  Built built(Load(options.scene, options, contestant, trace));
  if (heat) return RenderHeat(registry, built.scene, *heat);
  SetBackground(options.picture, built.scene);
  std::optional<Built> secondary;
  if (!options.secondary.empty()) {
    secondary.emplace(Load(options.secondary, options, contestant, trace));
    TakeLights(built.scene, secondary->scene);
  }
  if (on_device) RequireDeviceWaves(registry, contestant, built.scene, trace);
  Build(built, options, contestant, trace);
  if (secondary) Build(*secondary, options, contestant, trace, RB_NEED_ANY);
  Progress progress;
  trace.progress = [&](double fraction) {
    ThrowIfInterrupted();
    progress.Update(fraction, "rendering");
  };
  const Stopwatch trace_watch(true);
  DevicePicture drawn;
  if (on_device) {
    drawn = TraceOnDevice(registry, built.scene, built.tree, trace);
  } else if (secondary) {
    const SecondaryScene coarse{secondary->scene, secondary->tree};
    drawn.result = Trace(built.scene, built.tree, trace, &coarse);
  } else {
    drawn.result = Trace(built.scene, built.tree, trace);
  }
  const TraceResult& result = drawn.result;
  const Seconds trace_time = trace_watch.Elapsed();
  ThrowIfInterrupted();
  WriteImage(result.image, options.out, SoftwareName());
  if (!options.json.empty())
    WriteFileAtomically(options.json,
                        Dump(FactsOf(options, contestant, built, secondary, trace_time, result)));
  progress.Clear();
  fmt::print("{}: {} x {}, {} built in {:.3f} s, traced and shaded in {:.3f} s\n", options.out, options.width,
             options.height, contestant.Spec(), built.time.wall, trace_time.wall);
  if (secondary)
    fmt::print("secondary rays: {}, {} primitives, built in {:.3f} s\n", options.secondary,
               secondary->scene.primitive_count(), secondary->time.wall);
  if (on_device)
    fmt::print("by the clock of {}: {:.3f} s for waves, {:.3f} s for copies\n",
               built.tree.Device().value().name, drawn.seconds, drawn.copies);
  if (!options.waves.empty()) PrintWaves(result);
  fmt::print("scene: {:.1f} MB\n", double(BytesOf(built.scene)) * 1e-6);
  fmt::print("rays: {} camera, {} shadow, {} reflection, {} refraction\n", result.camera_rays,
             result.shadow_rays, result.reflection_rays, result.refraction_rays);
  if (on_device) return 0;
  fmt::print("hits: {} camera, {} shadow, {} reflection, {} refraction; shadow rays went on {} times\n",
             result.camera_hits, result.shadow_blocked, result.reflection_hits, result.refraction_hits,
             result.shadow_resumed);
  return 0;
}

void AddRenderCommand(CLI::App& app, Invocation& invocation) {
  AddCommand<RenderOptions>(
      app, invocation, "render", "Render one picture, or a heat map of the cost of traversal",
      [](CLI::App& command, RenderOptions& render) {
        command.add_option("scene", render.scene, "File, generator or fetched model")
            ->required()
            ->type_name("SCENE");
        CLI::Option* structure = command
                                     .add_option("--structure", render.structure,
                                                 "Structure that traces the rays; default bvh_sah")
                                     ->type_name("A(X=1)");
        command.add_option("-o,--out", render.out, "Picture to write, .png or .exr")
            ->required()
            ->type_name("FILE");
        command.add_option("--size", render.size, "Size in pixels; default 512x512")->type_name("WxH");
        command
            .add_option("--depth", render.depth,
                        "Largest number of reflections and refractions in a row; default 4")
            ->transform(WholeNumber(0, 64))
            ->type_name("N");
        command.add_option("--threads", render.threads, "Threads; default all")
            ->transform(WholeNumber(1, 1024))
            ->type_name("N");
        command.add_option("--seed", render.seed, "Seed of generators; default 1")
            ->transform(WholeNumber())
            ->type_name("N");
        command.add_flag("--drop-bad", render.drop_bad,
                         "Leave out bad triangles instead of refusing the file");
        CLI::Option* secondary =
            command
                .add_option(
                    "--secondary-scene", render.secondary,
                    "What all rays but those of the camera meet, a level of detail of SCENE such as "
                    "\"decimate(bunny,keep=0.1)\". Where it stands in front of what the camera sees, that "
                    "lies "
                    "in shadow: --self-intersection normal-offset by their distance (raybench distance) "
                    "prevents that")
                ->type_name("SCENE");
        CLI::Option* waves =
            command
                .add_option(
                    "--waves", render.waves,
                    "Where the next wave's rays are made: host, or device, whose shaders queue them and "
                    "write how many there are (vulkan_rt; no textures); shows the rays of each wave")
                ->check(CLI::IsMember({"host", "device"}))
                ->type_name("WHERE");
        CLI::Option* json = command
                                .add_option("--json", render.json,
                                            "Also write times (processor time over all threads), memory and "
                                            "numbers of rays as JSON")
                                ->type_name("FILE");
        CLI::Option* heat =
            command
                .add_option(
                    "--heat", render.heat,
                    "Colour each pixel by the cost of its camera ray: traversal steps, primitive tests or "
                    "both, on one scale for all structures. A .png becomes a sheet with legends; an .exr "
                    "holds the picture and the raw counts as channels STRUCTURE.steps and STRUCTURE.prims")
                ->check(CLI::IsMember({"steps", "prims", "both"}))
                ->excludes(structure)
                ->excludes(waves)
                ->excludes(secondary)
                ->excludes(json)
                ->type_name("KIND");
        command
            .add_option("--structures", render.heat_structures,
                        "Structures that --heat compares; default: all that can count, except null and brute")
            ->needs(heat)
            ->type_name("A,B(X=1)");
        command
            .add_option(
                "--heat-scale", render.heat_scale,
                "Colours of the sheet: linear, log or auto (log where costs differ much); default auto")
            ->check(CLI::IsMember({"linear", "log", "auto"}))
            ->needs(heat)
            ->type_name("SCALE");
        for (CLI::Option* option : AddPictureOptions(command, render.picture)) option->excludes(heat);
        command.footer(
            "Examples:\n"
            "  raybench render sponza --samples 4 --filter mitchell --adaptive 0.05 -o sponza.png\n"
            "  raybench render engine --heat both --structures \"bvh_sah,kdop\" -o heat.png");
      },
      [](RenderOptions& options, const Registry& registry) {
        if (!options.size.empty()) ParseSize(options.size, options);
        return RenderCommand(registry, options);
      });
}

}  // namespace

const Command kRender = {40, AddRenderCommand};

}  // namespace raybench
