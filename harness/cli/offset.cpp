// raybench offset: the smallest safe offset of a scene.
#include "harness/offset/offset.h"

#include "harness/cli/commands.h"

namespace raybench {
namespace {

constexpr const char* kOffsetFooter = R"help(
A ray that leaves a surface must not find that surface again. Cures are those of `raybench render
--self-intersection`: a least distance (tnear), an origin moved along the normal by a fixed length (normal-offset), by
units in the last place (integer-offset) or by a bound of all errors (error-bound), or a primitive that is not hit
(skip). Each can fail in two ways, and every ray is judged by exact predicates:
  self-hit    the answer is the surface that the ray leaves, such as a neighbour across an edge
  lost hit    another surface lies between the point on the surface and the place from which hits count: it is leapt
              over, and what lies behind it is seen instead
Offsets of tnear and normal-offset are looked for by powers of four and bisection, to 10 %: the smallest at which no ray
hits itself, and the largest at which none loses a hit, in units of the scene's file, among 131,072 of the rays. Between
them the command names one, and there all rays are judged. Where none is safe, the one that fails least is shown.
Rays are paths from the camera and from around the scene; they are the same for each structure.

Examples:
  raybench offset "shells(count=64)"
  raybench offset model.glb --structure "embree(robust=true)" --out offset
  raybench offset "scale(bunny,factor=1e-6)" --quick
Exit codes: 0 the cure named is safe; 1 no cure is; 2 wrong input; 130 interrupted.)help";

void AddOffsetOptions(CLI::App& command, OffsetOptions& options) {
  command.add_option("scene", options.scene, "File, generator, model or modified scene, of triangles")
      ->required()
      ->type_name("SCENE");
  command
      .add_option("--structure", options.structure,
                  "Structure that answers; default bvh_wide, whose numerics are watertight")
      ->type_name("A(X=1)");
  command.add_option("--rays", options.rays, "Rays that leave; default 1000000, quick 64K")
      ->transform(WholeNumber(uint64_t{1024}, uint64_t{1} << 28, Units::kSizes))
      ->type_name("N");
  command.add_flag("--aimed", options.aimed, "Rays leave where paths aimed at edges and vertices arrive");
  command.add_option("--seed", options.seed, "Seed of everything random; default 1")
      ->transform(WholeNumber())
      ->type_name("N");
  command.add_option("--threads", options.threads, "Threads; default all")
      ->transform(WholeNumber(1, 1024))
      ->type_name("N");
  command.add_flag("--quick", options.quick, "Fewer rays: some seconds");
  command
      .add_option("--out", options.out, "Folder for offset.csv and offset.json; default: nothing is written")
      ->type_name("DIR");
  command.add_flag("--drop-bad", options.drop_bad, "Leave out bad triangles instead of refusing the file");
  command.footer(kOffsetFooter);
}

void AddOffsetCommand(CLI::App& app, Invocation& invocation) {
  AddCommand<OffsetOptions>(app, invocation, "offset",
                            "Find the smallest safe offset of rays that leave surfaces", AddOffsetOptions,
                            [&invocation](OffsetOptions& options, const Registry& registry) {
                              options.plugins = invocation.plugins;
                              options.command_line = invocation.arguments;
                              return RunOffset(registry, options);
                            });
}

}  // namespace

const Command kOffset = {85, AddOffsetCommand};

}  // namespace raybench
