// raybench distance: how far one surface is from another.
#include "harness/distance/distance.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "harness/base/json.h"
#include "harness/cli/commands.h"
#include "harness/terminal/interrupt.h"
#include "harness/terminal/load.h"

namespace raybench {
namespace {

struct DistanceArguments {
  std::string scene, other;
  uint64_t seed = 1;
  bool json = false;
};

constexpr uint32_t kDirections = 16, kAcross = 256;

Scene LoadSurface(const std::string& name, uint64_t seed) {
  LoadOptions load;
  load.seed = seed;
  Scene scene = LoadWithProgress(name, load);
  ThrowIfInterrupted();
  if (scene.procedural_count() > 0)
    throw InputError(
        fmt::format("distance: scene '{}' has {} procedural primitives; it must be of triangles alone", name,
                    scene.procedural_count()));
  if (scene.triangles.empty()) throw InputError(fmt::format("distance: scene '{}' has no triangles", name));
  return scene;
}

int MeasureDistance(const DistanceArguments& arguments) {
  const Scene a = LoadSurface(arguments.scene, arguments.seed),
              b = LoadSurface(arguments.other, arguments.seed);
  if (a.scale_exponent != b.scale_exponent)
    throw InputError(fmt::format("distance: '{}' and '{}' are of too different a size to be compared",
                                 arguments.scene, arguments.other));
  const double unit = std::ldexp(1.0, -a.scale_exponent),
               diagonal = Length(ToDouble(a.bounds().Extent())) * unit;
  const OneSided there = DistanceTo(a, b), back = DistanceTo(b, a);
  const SilhouetteError silhouette = CompareSilhouettes(a, b, kDirections, kAcross, arguments.seed);
  const double hausdorff = std::max(there.max, back.max) * unit;
  const auto as_json = [&](const OneSided& side) {
    return Json{{"samples", side.samples},
                {"max", side.max * unit},
                {"mean", side.mean * unit},
                {"rms", side.rms * unit}};
  };
  if (arguments.json) {
    const Json json{{"a", arguments.scene},
                    {"b", arguments.other},
                    {"triangles_a", a.triangles.size()},
                    {"triangles_b", b.triangles.size()},
                    {"diagonal_a", diagonal},
                    {"a_to_b", as_json(there)},
                    {"b_to_a", as_json(back)},
                    {"hausdorff", hausdorff},
                    {"silhouette_lines", silhouette.lines},
                    {"silhouette_differ", silhouette.differ},
                    {"silhouette_error", silhouette.Share()}};
    fmt::print("{}\n", json.dump(2, ' ', false, Json::error_handler_t::replace));
    return 0;
  }
  fmt::print("A {}: {} triangles, diagonal {:.4g}\nB {}: {} triangles\n", arguments.scene, a.triangles.size(),
             diagonal, arguments.other, b.triangles.size());
  const auto print = [&](const char* way, const OneSided& side) {
    fmt::print(
        "{}: at most {:.4g} ({:.3g} % of the diagonal), mean {:.3g}, RMS {:.3g}, from {} vertices and "
        "centres\n",
        way, side.max * unit, 100 * side.max * unit / diagonal, side.mean * unit, side.rms * unit,
        side.samples);
  };
  print("A to B", there);
  print("B to A", back);
  fmt::print("Hausdorff distance of these samples: {:.4g} ({:.3g} % of the diagonal)\n", hausdorff,
             100 * hausdorff / diagonal);
  fmt::print("silhouettes: {} lines meet one surface only, of {} that meet A ({:.3g} %), {} directions\n",
             silhouette.differ, silhouette.lines, 100 * silhouette.Share(), kDirections);
  return 0;
}

void AddDistanceOptions(CLI::App& command, DistanceArguments& arguments) {
  command.add_option("a", arguments.scene, "Scene of triangles, such as the original")
      ->required()
      ->type_name("SCENE");
  command.add_option("b", arguments.other, "Another, such as a level of detail")
      ->required()
      ->type_name("SCENE");
  command.add_option("--seed", arguments.seed, "Seed of generators and directions; default 1")
      ->transform(WholeNumber())
      ->type_name("N");
  command.add_flag("--json", arguments.json, "Print this as JSON, lengths in units of A's file");
  command.footer(R"help(
One-sided distances go from each vertex and each face's centre to the nearest point of the other surface's triangles; the
larger one is the Hausdorff distance of these samples. The silhouettes' error is the share of parallel lines, from
random directions, that meet one surface and miss the other, among those that meet A.

Example:
  raybench distance bunny "decimate(bunny,keep=0.1)")help");
}

void AddDistanceCommand(CLI::App& app, Invocation& invocation) {
  AddCommand<DistanceArguments>(
      app, invocation, "distance", "How far one surface is from another", AddDistanceOptions,
      [](const DistanceArguments& arguments, const Registry&) { return MeasureDistance(arguments); });
}

}  // namespace

const Command kDistance = {86, AddDistanceCommand};

}  // namespace raybench
