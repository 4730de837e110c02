// What the plugin contract costs: rays per second through rb_structure::query of `embree`, against a loop
// that reads rb_ray, calls rtcIntersect1 and writes rb_hit over the very same Embree scene. The two run in
// turn, in random order; printed is the ratio of their times with the bootstrap interval of its median.
//
//   contract_cost [SCENE] [ROUNDS]      exit 0: the 90 % interval lies within 3 %; 1: it lies outside; 3:
//   neither
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <vector>

#include "accel/base/random.h"
#include "accel/host/registry.h"
#include "accel/structures/library/embree.h"
#include "datasets/scene/scene.h"
#include "tests/tools/tool.h"
#include "tracer/rays/ray_set.h"

namespace raybench {
namespace {

[[gnu::noinline]] void DirectLoop(RTCScene scene, const rb_ray* rays, rb_hit* hits, size_t n) {
#if RAYBENCH_EMBREE_MAJOR >= 4
  RTCIntersectArguments args;
  rtcInitIntersectArguments(&args);
#else
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
#endif
  for (size_t i = 0; i < n; ++i) {
    const rb_ray& in = rays[i];
    RTCRayHit rh;
    rh.ray = {in.org[0], in.org[1], in.org[2], in.tnear,     in.dir[0], in.dir[1],
              in.dir[2], 0,         in.tfar,   unsigned(-1), 0,         0};
    rh.hit.geomID = rh.hit.primID = rh.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
#if RAYBENCH_EMBREE_MAJOR >= 4
    rtcIntersect1(scene, &rh, &args);
#else
    rtcIntersect1(scene, &context, &rh);
#endif
    if (rh.hit.geomID == RTC_INVALID_GEOMETRY_ID) {
      hits[i] = {in.tfar, 0, 0, RAYBENCH_NONE};
    } else {
      hits[i] = {rh.ray.tfar, rh.hit.u, rh.hit.v, rh.hit.primID};
    }
  }
}

double Median(std::vector<double> v) {
  std::nth_element(v.begin(), v.begin() + long(v.size() / 2), v.end());
  return v[v.size() / 2];
}

int Main(int argc, char** argv) {
  const Scene scene = LoadScene(argc > 1 ? argv[1] : "icosphere(level=6)");
  const int rounds = argc > 2 ? std::atoi(argv[2]) : 60;
  const rb_geometry geometry = scene.Geometry();
  const Registry registry;
  const Tree tree(ParseContestant(registry, "embree"), geometry, DefaultBuildOptions());
  const RaySet set = RandomRays(scene, 1 << 16, 1);
  std::vector<rb_hit> contract(set.rays.size()), direct(set.rays.size());
  rb_query query{};
  query.struct_size = sizeof query, query.kind = RB_CLOSEST, query.n = set.rays.size();
  query.rays = set.rays.data(), query.hits = contract.data();
  auto timed = [](auto&& run) {
    const auto start = std::chrono::steady_clock::now();
    run();
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  };

  Random random(7);
  std::vector<double> ratios;
  for (int i = -2; i < rounds; ++i) {  // the first two warm up
    double through = 0, beside = 0;
    auto a = [&] { through = timed([&] { tree.Query(query); }); };
    auto b = [&] {
      beside = timed(
          [&] { DirectLoop(EmbreeSceneOf(tree.get()), set.rays.data(), direct.data(), direct.size()); });
    };
    if (random.Below(2) == 0) {
      a(), b();
    } else {
      b(), a();
    }
    if (i >= 0) ratios.push_back(beside / through);
  }
  if (std::memcmp(contract.data(), direct.data(), contract.size() * sizeof(rb_hit)) != 0) {
    fmt::print(stderr, "contract_cost: the two loops give different hits\n");
    return 1;
  }

  std::vector<double> medians;
  for (int i = 0; i < 4000; ++i) {
    std::vector<double> draw;
    for (size_t k = 0; k < ratios.size(); ++k) draw.push_back(ratios[random.Below(ratios.size())]);
    medians.push_back(Median(draw));
  }
  std::sort(medians.begin(), medians.end());
  const double lo = medians[medians.size() / 20], hi = medians[medians.size() - 1 - medians.size() / 20];
  fmt::print(
      "{}: {} random rays, {} rounds: rays per second through the contract / direct loop: {:.4f}, 90 % "
      "interval "
      "[{:.4f}, {:.4f}]\n",
      scene.name, set.rays.size(), rounds, Median(ratios), lo, hi);
  if (lo >= 0.97 && hi <= 1.03) return 0;
  return hi < 0.97 || lo > 1.03 ? 1 : 3;
}

}  // namespace
}  // namespace raybench

int main(int argc, char** argv) { return raybench::RunTool("contract_cost", raybench::Main, argc, argv); }
