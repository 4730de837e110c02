// How fast the oracle is, by one thread: rays per second of CPU time for truth, and for judging answers.
//
//   oracle_speed [SCENE] [RAYS]      random and aimed rays, RAYS of each (default: icosphere(level=6), 20000)
//
// Judged are answers that are mostly right (`bvh_sah`) and answers that are mostly wrong (`null`: always a
// miss). The audit's rate is printed too; a run audits a small sample only.
#include <fmt/format.h>

#include <ctime>

#include "accel/host/registry.h"
#include "harness/rays/from_inside.h"
#include "harness/truth/oracle.h"
#include "tests/tools/tool.h"

namespace raybench {
namespace {

/// Rays per second of CPU time.
template <class Work>
double Rate(size_t rays, const Work& work) {
  const std::clock_t start = std::clock();
  work();
  return double(rays) * CLOCKS_PER_SEC / double(std::clock() - start);
}

int Main(int argc, char** argv) {
  const Scene scene = LoadScene(argc > 1 ? argv[1] : "icosphere(level=6)");
  const uint64_t count = argc > 2 ? std::stoull(argv[2]) : 20000;
  const Registry registry;
  const rb_geometry geometry = scene.Geometry();
  const auto oracle = MakeOracle(scene);
  fmt::print("{}: {} primitives, {}; rays per second of one thread\n", scene.name, scene.primitive_count(),
             oracle->Name());
  for (const RaySet& set : {RandomRays(scene, count, 1), AimedRays(scene, count, 1)}) {
    std::vector<Truth> truth;
    std::string line = fmt::format("{:8} truth {:8.0f}", set.kind,
                                   Rate(set.rays.size(), [&] { truth = oracle->Ask(set.rays, 1); }));
    for (const char* spec : {"bvh_sah", "null"}) {
      const Tree tree(ParseContestant(registry, spec), geometry, DefaultBuildOptions());
      std::vector<rb_hit> hits(set.rays.size());
      std::vector<uint8_t> occluded(set.rays.size());
      rb_query query{};
      query.struct_size = sizeof query, query.n = set.rays.size(), query.rays = set.rays.data();
      query.hits = hits.data(), query.occluded = occluded.data();
      for (const uint32_t kind : {uint32_t(RB_CLOSEST), uint32_t(RB_ANY)}) {
        query.kind = kind;
        tree.Query(query);
        line += fmt::format(
            "   {} {} {:8.0f}", spec, kind == RB_CLOSEST ? "closest" : "any",
            Rate(hits.size(), [&] { JudgeAll(*oracle, kind, set.rays, truth, hits, occluded, 1); }));
      }
    }
    fmt::print("{}\n", line);
  }
  return 0;
}

}  // namespace
}  // namespace raybench

int main(int argc, char** argv) { return raybench::RunTool("oracle_speed", raybench::Main, argc, argv); }
