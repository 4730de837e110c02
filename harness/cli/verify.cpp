// raybench verify: what it takes.
#include "harness/verify/verify.h"

#include <fmt/format.h>

#include <optional>

#include "accel/host/parameters.h"
#include "harness/cli/commands.h"
#include "harness/plan/small_scenes.h"
#include "harness/rays/aim.h"
#include "harness/verify/closed.h"
#include "harness/verify/crossings.h"

namespace raybench {
namespace {

struct VerifyArguments {
  VerifyOptions verify;
  std::optional<std::string> structures, replay;
  std::vector<std::string> rays;
};

constexpr const char* kFooter = R"help(
How to read the table: every answer is compared with exact geometry.
  exact       the right primitive (of several at one t the lowest), t correct within float's error
  tie         another primitive at exactly that t
  neighbour   a primitive beside it: the ray passes their common edge closer than float arithmetic can tell
  leak        the ray went through a closed surface at an edge or a vertex: always an error
  wrong, false miss, false hit   plain errors; in brackets the marginal ones: at an outline or at an end of the
              interval, where the exact geometry lies within float's error
  t error     median, 99 % and maximum, in units in the last place of float, where a right primitive is named, though its
              t may be wrong, or a neighbour
  uv error    the largest error of u and v on triangles, in units of the bound of a sound float test; in brackets the
              number of answers beyond that bound
  leak rate, plain rate   upper bounds at 95 %: no event among n rays means that the rate is below 3/n
A structure that claims watertight may have no leak, no plain error and no u or v beyond the bound. One that claims
exact must give only exact answers, equal to the bit, with u and v within the bound.

--closed N fires N rays from points inside a closed mesh at its edges and vertices. Every such ray hits something, so
a miss is a leak and no truth is needed: this runs nearly as fast as the structure. --ledger FILE sums over runs of
the same scene, structure, parameters and raybench commit. A run takes the first seed from --seed on that the ledger
does not have for these, so no ray counts twice: the same command again fires new rays.

--crossings N decides whether N points are inside or outside a closed mesh, by counting the crossings of their lines.
Columns: wrong answers and ns per point (of one thread) by
  rule        all triangles of the line, walked by `after`, each judged by exact predicates: never wrong where a
              structure is watertight or exact (harness/verify/CROSSINGS.md has the proof)
  after       all answers from the point along an axis, walked by `after`
  epsilon     the same, restarted 1e-4 of the diagonal behind each hit
  vote        the majority of that along three random directions

Examples:
  raybench verify model.glb                                      one structure of each family
  raybench verify "icosphere(level=6)" --structures "bvh_sah,embree(robust=true)" --rays 1M --out verified
  raybench verify model.obj --plugin ./libmine.so --structures mine --sets aimed_edge,planes
  raybench verify model.obj --structures mine --rays verified/model-mine-closest.rays
  raybench verify "icosphere(level=6)" --structures bvh_sah --closed 100M --ledger ledger.json
  raybench verify menger --structures bvh_sah,embree --crossings 1M
  raybench verify --all --rays 64K                               all scenes and structures; takes long
Exit codes: 0 fine; 1 a claim, the contract or a tree is broken; 2 wrong input; 3 a structure could not be built;
130 interrupted (results up to then are shown, and recorded).)help";

void AddOptions(CLI::App& command, VerifyArguments& arguments) {
  VerifyOptions& verify = arguments.verify;
  command
      .add_option("scenes", verify.scenes, "Files, generators or fetched models (see: raybench list scenes)")
      ->type_name("SCENE");
  CLI::Option* all = command.add_flag(
      "--all", verify.all,
      "Every generator with 3,000 primitives (or its fewest), every fetched model of at most 80,000, every "
      "structure with each of its numerics: a table with one line per scene, and details only of failures");
  command
      .add_option("--structures", arguments.structures,
                  "Such as bvh_sah,embree(robust=true); default: one of each family, with each value of "
                  "numerics and robust; all: every one")
      ->type_name("A,B(X=1)");
  CLI::Option* rays =
      command
          .add_option("--rays", arguments.rays,
                      "A number: rays per set; default 16K, with --all 2K. Or a .rays file or a folder of "
                      "them: judge these rays instead (not with --all). May be repeated")
          ->allow_extra_args(false)
          ->type_name("N|FILE");
  CLI::Option* sets =
      command.add_option("--sets", verify.sets, "Ray sets, such as aimed_edge,planes; default all")
          ->delimiter(',')
          ->allow_extra_args(false)
          ->type_name("A,B");
  CLI::Option* any =
      command.add_flag("--any", verify.any,
                       "Any-hit queries of all rays; by default of a quarter of them. Closest-hit queries "
                       "are always of all rays. With --closed: any-hit instead of closest-hit queries");
  command.add_option("--seed", verify.seed, "Seed of everything random; default 1")
      ->transform(WholeNumber())
      ->type_name("N");
  command.add_option("--threads", verify.threads, "Threads; default all")
      ->transform(WholeNumber(1, 1024))
      ->type_name("N");
  command.add_option("--examples", verify.examples, "Worst answers shown per structure; default 5")
      ->transform(WholeNumber(0, 1000))
      ->type_name("K");
  CLI::Option* out =
      command
          .add_option(
              "--out", verify.out,
              "Folder for verdicts.csv, examples.json, the examples as .rays and verify.json; default: "
              "nothing is written. With --crossings: for crossings.csv")
          ->type_name("DIR");
  CLI::Option* replay =
      command
          .add_option("--replay", arguments.replay,
                      "Judge this one ray, in the coordinates of the scene's file, and print all details")
          ->excludes(rays)
          ->excludes(sets)
          ->excludes(out)
          ->excludes(all)
          ->type_name("OX,OY,OZ,TNEAR,DX,DY,DZ,TFAR");
  CLI::Option* closed = command
                            .add_option("--closed", verify.closed,
                                        "Instead: fire N rays, such as 100M, from inside a closed mesh")
                            ->transform(WholeNumber(uint64_t{1}, uint64_t{1} << 48, Units::kSizes))
                            ->excludes(rays)
                            ->excludes(sets)
                            ->excludes(out)
                            ->excludes(all)
                            ->excludes(replay)
                            ->type_name("N");
  command.add_option("--ledger", verify.ledger, "JSON file in which --closed sums over runs; default none")
      ->needs(closed)
      ->type_name("FILE");
  command
      .add_option("--crossings", verify.crossings,
                  "Instead: decide whether N points, such as 10M, are inside or outside a closed mesh")
      ->transform(WholeNumber(uint64_t{1}, uint64_t{1} << 28, Units::kSizes))
      ->excludes(rays)
      ->excludes(sets)
      ->excludes(any)
      ->excludes(all)
      ->excludes(replay)
      ->excludes(closed)
      ->type_name("N");
  command.add_flag("--drop-bad", verify.drop_bad, "Leave out bad triangles instead of refusing the file");
  command.footer("\nRay sets:\n" + FormatFamilies(AimedFamilies()) + kFooter);
}

constexpr uint64_t kSmallGenerated = 3000, kSmallModel = 80000, kRaysOfAll = 2048;

void TakeAll(VerifyOptions& verify) {
  if (!verify.scenes.empty())
    throw InputError("verify --all takes every scene; name none, or leave --all out");
  if (!verify.ray_files.empty())
    throw InputError("verify --all makes its own rays; --rays takes only a number then");
  SmallScenes scenes = EverySmallScene(kSmallGenerated, kSmallModel);
  if (!scenes.not_fetched.empty())
    fmt::print(stderr, "models that are not fetched are left out: {} (raybench fetch NAME fetches one)\n",
               fmt::join(scenes.not_fetched, ", "));
  verify.scenes = std::move(scenes.names);
  if (verify.structures.empty()) verify.structures = {"all"};
  if (verify.rays == 0) verify.rays = kRaysOfAll;
}

int Verify(VerifyArguments& arguments, const Registry& registry, const Invocation& invocation) {
  VerifyOptions& verify = arguments.verify;
  if (arguments.structures) verify.structures = SplitSpecs(*arguments.structures);
  const RayWords rays = ReadRayWords(arguments.rays);
  verify.rays = rays.number;
  verify.ray_files = rays.files;
  if (verify.all) {
    TakeAll(verify);
  } else if (verify.scenes.empty()) {
    throw InputError("verify: name a scene, such as a file or \"icosphere(level=4)\", or add --all");
  }
  if (!verify.ray_files.empty() && !verify.sets.empty())
    throw InputError("--sets names generated ray sets; it cannot be used with --rays FILE");
  verify.plugins = invocation.plugins;
  verify.command_line = invocation.arguments;
  if (arguments.replay) {
    if (verify.scenes.size() != 1) throw InputError("--replay: name one scene");
    return ReplayOneRay(registry, verify, *arguments.replay);
  }
  if (verify.crossings != 0) return RunCrossings(registry, verify);
  return verify.closed != 0 ? RunClosed(registry, verify) : RunVerify(registry, verify);
}

void AddVerifyCommand(CLI::App& app, Invocation& invocation) {
  AddCommand<VerifyArguments>(app, invocation, "verify", "Find out whether structures lose rays", AddOptions,
                              [&invocation](VerifyArguments& arguments, const Registry& registry) {
                                return Verify(arguments, registry, invocation);
                              });
}

}  // namespace

const Command kVerify = {20, AddVerifyCommand};

}  // namespace raybench
