// Every registered structure, at each of its numerics, on every nasty mesh: judged by the oracle against what
// the built tree claims, and against itself with other batches, threads and with counting. A new structure is
// covered by being registered.
#include <gtest/gtest.h>

#include <cstring>

#include "accel/host/parameters.h"
#include "harness/truth/oracle.h"
#include "tests/support/conformance.h"
#include "tests/support/effort.h"
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

/// A mesh as a scene, with rays at what structures see of it (rescaled, without degenerate triangles),
/// and truth.
struct Known {
  Scene scene;
  std::vector<rb_ray> rays;
  std::unique_ptr<Oracle> oracle;
  std::vector<Truth> truth;

  explicit Known(const Mesh& mesh) : scene(SceneOf(mesh)) {
    for (const rb_ray& ray :
         NastyRays(Mesh{mesh.name, scene.positions, scene.triangles}, int(Effort(150)), 77)) {
      if (IsValidRay(ray)) rays.push_back(ray);
    }
    oracle = MakeOracle(scene);
    truth = oracle->Ask(rays, 1);
  }
};

/// One for each mesh, made once.
const std::vector<std::unique_ptr<const Known>>& KnownMeshes() {
  static const auto known = [] {
    std::vector<std::unique_ptr<const Known>> all;
    for (const Mesh& mesh : Meshes()) all.push_back(std::make_unique<const Known>(mesh));
    return all;
  }();
  return known;
}

/// "brute" with the numerics that the spec chooses.
std::string BruteLike(const std::string& spec) {
  const Contestant contestant = ParseContestant(TestRegistry(), spec);
  for (uint32_t i = 0; i < contestant.structure->param_count; ++i) {
    const rb_param& p = contestant.structure->params[i];
    if (std::string_view(p.name) == "numerics")
      return "brute(numerics=" + FormatParameter(p, contestant.config.data()) + ")";
  }
  return "brute";
}

/// One structure on one mesh.
class Trial {
 public:
  Trial(const std::string& spec, const Known& scene)
      : spec_(spec),
        scene_(scene),
        geometry_(scene.scene.Geometry()),
        tree_(Build(spec, geometry_)),
        hits_(Closest(tree_, rays())),
        occluded_(Occluded(tree_, rays())) {}

  void ExpectClaimKept() {
    const VerdictCounts closest = JudgeAll(*scene_.oracle, RB_CLOSEST, rays(), scene_.truth, hits_, {}, 1);
    const VerdictCounts any = JudgeAll(*scene_.oracle, RB_ANY, rays(), scene_.truth, {}, occluded_, 1);
    for (const VerdictCounts* counts : {&closest, &any}) {
      uint64_t sum = 0;
      for (uint64_t n : counts->by_class) sum += n;
      EXPECT_EQ(sum, rays().size());
      EXPECT_FALSE(BreaksClaim(tree_.Claims(), *counts))
          << "leaks " << counts->leaks() << ", plain errors " << counts->plain_errors() << ", u or v wrong "
          << counts->uv_wrong << ", off by at most " << counts->uv_error_max << " of the bound";
    }
    // Whatever a structure claims, most of its answers are right; null, which claims nothing, always misses.
    // A kernel of floats alone constructs no hit point right far from the origin, nor does a map of the world; and
    // where vertices moved, t is that of where they are.
    if (tree_.Claims() == RB_CLAIM_NOTHING) {
      for (const rb_hit& hit : hits_) EXPECT_EQ(hit.prim, RAYBENCH_NONE);
    } else {
      const bool expects_most = ((spec_ != "cgal_aabb(kernel=cartesian_float)" &&
                                  spec_.find("baldwin_weber") == std::string::npos) ||
                                 !scene_.scene.name.starts_with("far")) &&
                                !HasQuantisedLeaves(spec_);
      if (expects_most) {
        EXPECT_LE(closest.leaks() + closest.plain_errors(), rays().size() / 2);
      }
    }
  }

  void ExpectAnswersOfBruteForce() {
    if (tree_.Claims() != RB_CLAIM_WATERTIGHT && tree_.Claims() != RB_CLAIM_EXACT) return;
    const auto expected = Closest(Build(BruteLike(spec_), geometry_), rays());
    for (size_t i = 0; i < rays().size(); ++i) {
      ASSERT_EQ(hits_[i].prim, expected[i].prim) << "ray " << i;
      ASSERT_EQ(hits_[i].t, expected[i].t) << "ray " << i;
    }
  }

  void ExpectBatchesThreadsAndCountingToChangeNothing() {
    auto expect_same = [&](const std::vector<rb_hit>& got, const char* what) {
      ASSERT_EQ(std::memcmp(got.data(), hits_.data(), hits_.size() * sizeof(rb_hit)), 0) << what;
    };
    for (size_t batch : {size_t{1}, size_t{7}, size_t{64}}) {
      std::vector<rb_hit> got(rays().size());
      for (size_t i = 0; i < rays().size(); i += batch) {
        rb_query q{};
        q.struct_size = sizeof q, q.kind = RB_CLOSEST, q.n = std::min(batch, rays().size() - i);
        q.rays = &rays()[i], q.hits = &got[i];
        tree_.Query(q);
      }
      expect_same(got, "batch size");
    }
    for (uint32_t threads : {2u, 5u}) {
      std::vector<rb_hit> got(rays().size());
      rb_query q{};
      q.struct_size = sizeof q, q.kind = RB_CLOSEST, q.n = rays().size(), q.rays = rays().data(),
      q.hits = got.data();
      QueryParallel(tree_, q, threads);
      expect_same(got, "threads asking");
      if ((tree_.structure().capabilities & RB_DETERMINISTIC) == 0) continue;
      expect_same(Closest(Build(spec_, geometry_, threads), rays()), "threads building");
    }
    if ((tree_.structure().capabilities & RB_CAN_COUNT) == 0) return;
    std::vector<rb_hit> got(rays().size());
    std::vector<uint8_t> shadow(rays().size());
    std::vector<rb_counts> counts(rays().size());
    rb_query q{};
    q.struct_size = sizeof q, q.kind = RB_CLOSEST, q.n = rays().size(), q.rays = rays().data(),
    q.hits = got.data();
    q.counts = counts.data();
    tree_.QueryCounted(q);
    expect_same(got, "counting");
    for (size_t i = 0; i < rays().size(); ++i) {
      EXPECT_TRUE(hits_[i].prim == RAYBENCH_NONE || counts[i].prims > 0);
      EXPECT_LE(counts[i].empty_leaves, counts[i].leaves);
      EXPECT_LE(counts[i].leaves, counts[i].steps);
    }
    q.kind = RB_ANY, q.occluded = shadow.data();
    tree_.QueryCounted(q);
    EXPECT_EQ(shadow, occluded_);
  }

 private:
  const std::vector<rb_ray>& rays() const { return scene_.rays; }

  const std::string& spec_;
  const Known& scene_;
  const rb_geometry geometry_;
  const Tree tree_;
  const std::vector<rb_hit> hits_;
  const std::vector<uint8_t> occluded_;
};

class Structure : public ::testing::TestWithParam<std::string> {};

TEST_P(Structure, KeepsTheContractOnEveryMesh) {
  for (const auto& known : KnownMeshes()) {
    SCOPED_TRACE("mesh " + known->scene.name);
    Trial trial(GetParam(), *known);
    trial.ExpectClaimKept();
    trial.ExpectAnswersOfBruteForce();
    trial.ExpectBatchesThreadsAndCountingToChangeNothing();
  }
}

INSTANTIATE_TEST_SUITE_P(Every, Structure, ::testing::ValuesIn(Specs()),
                         [](const auto& info) { return TestName(info.param); });

}  // namespace
}  // namespace raybench::testing
