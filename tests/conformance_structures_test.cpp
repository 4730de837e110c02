// Every registered structure, at each of its numerics, on every nasty mesh: judged by the oracle against what
// the built tree claims, and against itself with other batches, threads and with counting. A new structure is
// covered by being registered.
#include <gtest/gtest.h>

#include <cstring>

#include "harness/oracle.h"
#include "tests/conformance.h"
#include "tracer/tracer.h"

namespace raybench::testing {
namespace {

/// A ball among points and lines, exactly collinear.
Mesh Degenerate() {
  Mesh mesh = Ball(2);
  mesh.name = "degenerate";
  const uint32_t n = uint32_t(mesh.positions.size());
  for (float x : {0.1f, 0.2f, 0.4f}) mesh.positions.push_back({x, x, x});
  for (uint32_t i = 0; i < 50; ++i) {
    mesh.triangles.insert(mesh.triangles.begin() + i, {n, n + 1, n + 2});
    mesh.triangles.push_back({i, i, (i + 1) % n});
  }
  return mesh;
}

const std::vector<Mesh>& Meshes() {
  static const std::vector<Mesh> meshes = {
      Mesh{"empty", {}, {}},
      Mesh{"one", {{0, 0, 0}, {1, 0, 0}, {0, 1, 0.5f}}, {{0, 1, 2}}},
      Ball(3),
      Lattice(10),
      Coincident(100),
      Degenerate(),
      Needles(100),
      Moved(Ball(3), 1, {1000, -2000, 500}, "far_1e3"),
      Moved(Ball(3), 1, {1e6f, 1e6f, -1e6f}, "far_1e6"),
      Moved(Ball(3), 0x1p-30f, {0, 0, 0}, "scale_2e-30"),
      Moved(Ball(3), 0x1p29f, {0, 0, 0}, "scale_2e29"),
      Moved(Ball(3), 0x1p-100f, {0, 0, 0}, "scale_2e-100"),
      Moved(Ball(3), 0x1p100f, {0, 0, 0}, "scale_2e100"),
  };
  return meshes;
}

class Structure : public ::testing::TestWithParam<std::tuple<std::string, size_t>> {
 protected:
  Structure() : scene_(SceneOf(mesh())), tree_(Build(spec(), geometry_ = scene_.Geometry())) {
    // Rays aim at what the structure sees: the rescaled scene without its degenerate triangles.
    Mesh seen{mesh().name, scene_.positions, scene_.triangles};
    for (const rb_ray& ray : NastyRays(seen, 150, 77)) {
      if (IsValidRay(ray)) rays_.push_back(ray);
    }
  }
  const std::string& spec() const { return std::get<0>(GetParam()); }
  const Mesh& mesh() const { return Meshes()[std::get<1>(GetParam())]; }

  Scene scene_;
  rb_geometry geometry_;
  Tree tree_;
  std::vector<rb_ray> rays_;
};

TEST_P(Structure, KeepsItsClaim) {
  const auto oracle = MakeOracle(scene_);
  const auto truth = oracle->Ask(rays_, 1);
  const auto hits = Closest(tree_, rays_);
  const auto occluded = Occluded(tree_, rays_);
  const VerdictCounts closest = JudgeAll(*oracle, RB_CLOSEST, rays_, truth, hits, {}, 1);
  const VerdictCounts any = JudgeAll(*oracle, RB_ANY, rays_, truth, {}, occluded, 1);
  for (const VerdictCounts* counts : {&closest, &any}) {
    uint64_t sum = 0;
    for (uint64_t n : counts->by_class) sum += n;
    EXPECT_EQ(sum, rays_.size());
    EXPECT_FALSE(BreaksClaim(tree_.Claims(), *counts))
        << "leaks " << counts->leaks() << ", plain errors " << counts->plain_errors();
  }
  // Whatever a structure claims, most of its answers are right; null, which claims nothing, always misses.
  if (tree_.Claims() == RB_CLAIM_NOTHING) {
    for (const rb_hit& hit : hits) EXPECT_EQ(hit.prim, RAYBENCH_NONE);
  } else {
    EXPECT_LE(closest.leaks() + closest.plain_errors(), rays_.size() / 2);
  }
}

/// "brute" with the numerics that the spec chooses.
std::string BruteLike(const std::string& spec) {
  const Registry registry;
  const Contestant contestant = ParseContestant(registry, spec);
  for (uint32_t i = 0; i < contestant.structure->param_count; ++i) {
    const rb_param& p = contestant.structure->params[i];
    if (std::string_view(p.name) == "numerics")
      return "brute(numerics=" + FormatParameter(p, contestant.config.data()) + ")";
  }
  return "brute";
}

TEST_P(Structure, AnswersAsBruteForceWhereItPromisesWatertightness) {
  if (tree_.Claims() != RB_CLAIM_WATERTIGHT && tree_.Claims() != RB_CLAIM_EXACT) return;
  const auto expected = Closest(Build(BruteLike(spec()), geometry_), rays_);
  const auto hits = Closest(tree_, rays_);
  for (size_t i = 0; i < rays_.size(); ++i) {
    ASSERT_EQ(hits[i].prim, expected[i].prim) << "ray " << i;
    ASSERT_EQ(hits[i].t, expected[i].t) << "ray " << i;
  }
}

TEST_P(Structure, BatchesThreadsAndCountingChangeNothing) {
  const auto hits = Closest(tree_, rays_);
  const auto occluded = Occluded(tree_, rays_);
  auto expect_same = [&](const std::vector<rb_hit>& got, const char* what) {
    ASSERT_EQ(std::memcmp(got.data(), hits.data(), hits.size() * sizeof(rb_hit)), 0) << what;
  };
  for (size_t batch : {size_t{1}, size_t{7}, size_t{64}}) {
    std::vector<rb_hit> got(rays_.size());
    for (size_t i = 0; i < rays_.size(); i += batch) {
      rb_query q{};
      q.struct_size = sizeof q, q.kind = RB_CLOSEST, q.n = std::min(batch, rays_.size() - i);
      q.rays = &rays_[i], q.hits = &got[i];
      tree_.Query(q);
    }
    expect_same(got, "batch size");
  }
  for (uint32_t threads : {2u, 5u}) {
    std::vector<rb_hit> got(rays_.size());
    rb_query q{};
    q.struct_size = sizeof q, q.kind = RB_CLOSEST, q.n = rays_.size(), q.rays = rays_.data(),
    q.hits = got.data();
    QueryParallel(tree_, q, threads);
    expect_same(got, "threads asking");
    if ((tree_.structure().capabilities & RB_DETERMINISTIC) == 0) continue;
    expect_same(Closest(Build(spec(), geometry_, threads), rays_), "threads building");
  }
  if ((tree_.structure().capabilities & RB_CAN_COUNT) == 0) return;
  std::vector<rb_hit> got(rays_.size());
  std::vector<uint8_t> shadow(rays_.size());
  std::vector<rb_counts> counts(rays_.size());
  rb_query q{};
  q.struct_size = sizeof q, q.kind = RB_CLOSEST, q.n = rays_.size(), q.rays = rays_.data(),
  q.hits = got.data();
  q.counts = counts.data();
  tree_.QueryCounted(q);
  expect_same(got, "counting");
  for (size_t i = 0; i < rays_.size(); ++i) {
    EXPECT_TRUE(hits[i].prim == RAYBENCH_NONE || counts[i].prims > 0);
    EXPECT_LE(counts[i].empty_leaves, counts[i].leaves);
    EXPECT_LE(counts[i].leaves, counts[i].steps);
  }
  q.kind = RB_ANY, q.occluded = shadow.data();
  tree_.QueryCounted(q);
  EXPECT_EQ(shadow, occluded);
}

INSTANTIATE_TEST_SUITE_P(Every, Structure,
                         ::testing::Combine(::testing::ValuesIn(Specs()),
                                            ::testing::Range(size_t{0}, Meshes().size())),
                         [](const auto& info) {
                           return TestName(std::get<0>(info.param) + "_on_" +
                                           Meshes()[std::get<1>(info.param)].name);
                         });

}  // namespace
}  // namespace raybench::testing
