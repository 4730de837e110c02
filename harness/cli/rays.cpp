// raybench rays: ray sets as files.
#include <fmt/format.h>

#include <cmath>
#include <filesystem>

#include "harness/cli/commands.h"
#include "harness/measure/machine.h"
#include "harness/rays/ray_sets.h"
#include "harness/terminal/interrupt.h"
#include "harness/terminal/load.h"
#include "harness/terminal/progress.h"

namespace raybench {
namespace fs = std::filesystem;
namespace {

struct RecordOptions {
  std::string scene, out;
  std::vector<std::string> sets;
  uint64_t rays = 1u << 20, seed = 1;
  uint32_t depth = 2;
  bool shuffled = false, drop_bad = false;
};

int RecordCommand(const Registry& registry, const RecordOptions& options) {
  CheckFamilyNames("--sets", options.sets, CapturedFamilies());
  LoadOptions load;
  load.seed = options.seed;
  load.drop_bad = options.drop_bad;
  const Scene scene = LoadWithProgress(options.scene, load);
  if (scene.primitive_count() == 0)
    throw InputError(fmt::format("scene '{}' has no primitives", options.scene));
  Progress progress;
  CaptureOptions capture;
  capture.rays = options.rays;
  capture.seed = options.seed;
  capture.depth = options.depth;
  capture.shuffled = options.shuffled;
  capture.sets = options.sets;
  capture.progress = [&](double fraction) { progress.Update(0.8 * fraction, "capturing rays"); };
  capture.note = [&](const std::string& line) { progress.Say(line); };
  const std::vector<SourcedSet> sets = CaptureRaySets(registry, scene, capture).sets;

  std::error_code error;
  fs::create_directories(options.out, error);
  if (error) throw InputError(fmt::format("{}: cannot be made: {}", options.out, error.message()));
  const auto path_of = [&](const RaySet& set) {
    const char* twin = set.order == "shuffled" ? ".shuffled" : "";
    return fs::path(options.out) / fmt::format("{}{}.rays", set.Label(), twin);
  };
  // Recorded again they are replaced, but not by those of another scene.
  for (const SourcedSet& s : sets)
    if (const fs::path path = path_of(s.set);
        fs::exists(path, error) && ReadRayFileHeader(path).scene_hash != scene.hash())
      throw InputError(fmt::format("{}: holds rays of another scene; choose another folder", path.string()));
  double done = 0;
  for (const SourcedSet& s : sets) {
    ThrowIfInterrupted();
    const fs::path path = path_of(s.set);
    WriteRayFile(path, s.set, scene, SoftwareName());
    progress.Update(0.8 + 0.2 * ++done / double(sets.size()), "writing rays");
    progress.Clear();
    fmt::print("{}: {} rays, {}, {}, hash {}\n", path.string(), s.set.rays.size(), QueryName(s.set.query),
               s.set.order, s.set.hash);
  }
  return 0;
}

/// What the rays tell without their scene.
struct RayStatistics {
  uint64_t invalid = 0, empty = 0, axis_parallel = 0, finite = 0, offset = 0;
  Bounds3 origins;

  explicit RayStatistics(const std::vector<rb_ray>& rays) {
    for (const rb_ray& ray : rays) {
      if (!IsValidRay(ray)) {
        ++invalid;
        continue;
      }
      origins.Extend(LoadVec3(ray.org));
      empty += !(ray.tnear < ray.tfar);
      axis_parallel += (ray.dir[0] == 0) + (ray.dir[1] == 0) + (ray.dir[2] == 0) == 2;
      finite += std::isfinite(ray.tfar);
      offset += ray.tnear > 0;
    }
  }
};

void PrintInfo(const std::string& path) {
  const RayFile file = ReadRayFile(path);
  const RayFileHeader& header = file.header;
  const RayStatistics statistics(file.rays);
  const auto share = [&](const char* name, uint64_t count) {
    fmt::print("  {:<16} {} ({:.2f} %)\n", name, count, 100 * double(count) / double(header.count));
  };
  fmt::print("{}\n", path);
  fmt::print("  {:<16} {} ({})\n", "scene", header.scene_hash,
             header.scene.empty() ? "no name" : header.scene);
  fmt::print("  {:<16} {}, depth {}\n", "kind", header.kind, header.depth);
  fmt::print("  {:<16} {}\n", "query", QueryName(header.query));
  fmt::print("  {:<16} {}\n", "order", header.order);
  fmt::print("  {:<16} {}\n", "written by", header.software);
  fmt::print("  {:<16} {} (verified)\n", "checksum", header.rays_hash);
  fmt::print("  {:<16} {}\n", "rays", header.count);
  share("invalid", statistics.invalid);
  share("tfar <= tnear", statistics.empty);
  share("tfar finite", statistics.finite);
  share("tnear > 0", statistics.offset);
  share("axis-parallel", statistics.axis_parallel);
  if (const Bounds3& b = statistics.origins; !b.Empty())
    fmt::print("  {:<16} ({}, {}, {}) to ({}, {}, {})\n", "origins in", b.lo.x, b.lo.y, b.lo.z, b.hi.x,
               b.hi.y, b.hi.z);
}

struct InfoOptions {
  std::vector<std::string> files;
};

void AddRecordOptions(CLI::App& command, RecordOptions& record) {
  command.add_option("scene", record.scene, "File, generator or fetched model")
      ->required()
      ->type_name("SCENE");
  command.add_option("-o,--out", record.out, "Folder for LABEL.rays files; created if it does not exist")
      ->required()
      ->type_name("DIR");
  command.add_option("--sets", record.sets, "Ray sets to record, such as camera,shadow.0; default all")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->type_name("A,B");
  command.add_option("--rays", record.rays, "Rays per set, at most; default 1M = 2^20")
      ->transform(WholeNumber(uint64_t{64}, uint64_t{1} << 28, Units::kSizes))
      ->type_name("N");
  command.add_option("--depth", record.depth, "Bounces of the picture whose rays are recorded; default 2")
      ->transform(WholeNumber(0, 64))
      ->type_name("N");
  command.add_flag("--shuffled", record.shuffled, "Also write a shuffled copy of each traced set");
  command.add_option("--seed", record.seed, "Seed of everything random; default 1")
      ->transform(WholeNumber())
      ->type_name("N");
  command.add_flag("--drop-bad", record.drop_bad, "Leave out bad triangles instead of refusing the file");
  command.footer(
      "Ray sets, N being the depth:\n" + FormatFamilies(CapturedFamilies()) +
      "`raybench run SCENE --rays DIR` replays them. The format is described in tracer/rays/RAYS.md;\n"
      "tracer/rays/recorder/ has a C header that records the rays of other programs.");
}

void AddRaysCommand(CLI::App& app, Invocation& invocation) {
  CLI::App& rays = *app.add_subcommand("rays", "Record ray sets as .rays files, or inspect such files");
  rays.fallthrough();
  rays.require_subcommand(0, 1);
  rays.callback([&rays] {
    if (rays.get_subcommands().empty())
      throw InputError("raybench rays: add record or info; see raybench rays --help");
  });
  AddCommand<RecordOptions>(rays, invocation, "record", "Capture the ray sets of a scene as files",
                            AddRecordOptions, [](const RecordOptions& options, const Registry& registry) {
                              return RecordCommand(registry, options);
                            });
  AddCommand<InfoOptions>(
      rays, invocation, "info", "Verify .rays files and show their contents",
      [](CLI::App& command, InfoOptions& options) {
        command.add_option("files", options.files, ".rays files, or folders of them")
            ->required()
            ->type_name("FILE");
      },
      [](const InfoOptions& options, const Registry&) {
        for (const std::string& file : RayFiles(options.files)) {
          ThrowIfInterrupted();
          PrintInfo(file);
        }
        return 0;
      });
}

}  // namespace

const Command kRays = {50, AddRaysCommand};

}  // namespace raybench
