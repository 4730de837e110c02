// The smallest safe offset: truth about rays that leave, the search, the command.
#include "harness/offset/offset.h"

#include <gmock/gmock.h>

#include <fstream>

#include "accel/base/random.h"
#include "accel/ray/exact.h"
#include "harness/offset/search.h"
#include "harness/plan/build_options.h"
#include "harness/truth/oracle.h"
#include "tests/support/command.h"
#include "tests/support/effort.h"
#include "tests/support/oracle_scenes.h"

namespace raybench {
namespace {

using ::testing::HasSubstr;
using OffsetRow = std::map<std::string, std::string>;

Vec3d Exactly(const Scene& scene, const Spot& spot) {
  const auto& [a, b, c] = scene.triangles[spot.prim];
  const double u = spot.u, v = spot.v;
  return ToDouble(scene.positions[a]) * (1 - u - v) + ToDouble(scene.positions[b]) * u +
         ToDouble(scene.positions[c]) * v;
}

TEST(HarnessOffset, SpotsAreCutDownToTheirTriangle) {
  for (const auto& [u, v] : {std::pair{0.25f, 0.5f},
                             {-1e-9f, 0.5f},
                             {0.5f, 0.5f + 0x1p-24f},
                             {1.5f, 0.1f},
                             {0x1p-149f, 1.0f},
                             {1.0f, 0x1p-149f},
                             {0.7f, 0.3f},
                             {0.0f, -0.0f}}) {
    const Spot spot = SpotOf(3, u, v, -1);
    EXPECT_EQ(spot.prim, 3u);
    EXPECT_GE(spot.u, 0);
    EXPECT_GE(spot.v, 0);
    double error;
    const double sum = exact::TwoSum(spot.u, spot.v, error);
    EXPECT_TRUE(sum < 1 || (sum == 1 && error <= 0)) << u << " " << v;
    EXPECT_NEAR(spot.u, std::clamp(u, 0.0f, 1.0f), 1e-6);
  }
  EXPECT_EQ(SpotOf(0, 0.25f, 0.5f, 1).v, 0.5f);
}

// On a lattice spots are floats, so that the oracle can be asked about the same ways and rays.
TEST(HarnessOffset, AgreesWithTheOracleOnALattice) {
  const Scene scene = testing::MakeLatticeSoup(60, 5);
  const LeavingTruth truth(scene);
  const auto oracle = MakeOracle(scene);
  uint64_t leapt = 0, clear = 0, true_hits = 0, touching = 0;
  for (uint64_t i = 0; i < testing::Effort(20000); ++i) {
    Random random(7, i);
    const auto eighths = [&](uint64_t n) { return float(random.Below(n)) / 8; };
    const float u = eighths(9), v = float(random.Below(uint64_t(8 * (1 - u)) + 1)) / 8;
    const Spot spot =
        SpotOf(uint32_t(random.Below(scene.triangles.size())), u, v, (random.NextBits() & 1) != 0 ? 1 : -1);
    const Vec3f at = ToFloat(Exactly(scene, spot));
    ASSERT_EQ(ToDouble(at), Exactly(scene, spot));
    Vec3f way;
    for (int k = 0; k < 3; ++k) way[k] = float(int64_t(random.Below(65)) - 32) / 8;
    if (!truth.Leaves(spot, way)) continue;
    const rb_ray ray{{at.x, at.y, at.z}, 0, {way.x, way.y, way.z}, 1};
    rb_ray endless = ray;
    endless.tfar = std::numeric_limits<float>::infinity();
    const Truth within = oracle->Ask(std::span(&ray, 1), 1)[0],
                ahead = oracle->Ask(std::span(&endless, 1), 1)[0];
    if (within.coplanar || ahead.coplanar) continue;
    const bool leaps = truth.LeapsOver(spot, ToDouble(at + way));
    ASSERT_EQ(leaps, within.hit) << i;
    (leaps ? leapt : clear) += 1;
    touching += within.hit && within.t == 1;
    // What a ray from the exact point meets first is no self-hit.
    for (uint32_t prim : ahead.tied) {
      ++true_hits;
      ASSERT_FALSE(truth.IsSelfHit(spot, ToDouble(at), way, prim)) << i;
    }
    ASSERT_TRUE(truth.IsSelfHit(spot, ToDouble(at), way, spot.prim));
  }
  EXPECT_GT(leapt, 100u);
  EXPECT_GT(clear, 100u);
  EXPECT_GT(true_hits, 100u);
  EXPECT_GT(touching, 0u);
}

/// A floor; a wall that stands on its edge y = 0, one that hangs from it, and a copy of the floor.
Scene Corner() {
  return testing::MakeScene({{0, 0, 0}, {4, 0, 0}, {0, 4, 0}, {4, 0, 4}, {4, 0, -4}},
                            {{0, 1, 2}, {0, 1, 3}, {0, 1, 4}, {0, 1, 2}});
}

TEST(HarnessOffset, NeighboursAreHitByMistakeOrRightly) {
  const Scene scene = Corner();
  const LeavingTruth truth(scene);
  const Spot near = SpotOf(0, 0.5f, 0x1p-20f, 1), on = SpotOf(0, 0.5f, 0, 1);
  const Vec3d at = Exactly(scene, near);
  const Vec3f to_wall{0.1f, -1, 0.1f}, away{0, 1, 1};
  EXPECT_FALSE(truth.IsSelfHit(near, at, to_wall, 1));
  EXPECT_TRUE(truth.IsSelfHit(near, at, to_wall, 2));                   // nowhere in front
  EXPECT_TRUE(truth.IsSelfHit(near, at, away, 3));                      // a copy
  EXPECT_TRUE(truth.IsSelfHit(near, at, away, 1));                      // not ahead
  EXPECT_TRUE(truth.IsSelfHit(near, {2, -0x1p-20, 0x1p-10}, away, 1));  // leapt over, hit from behind
  EXPECT_TRUE(truth.IsSelfHit(near, {2, 0x1p-10, -0x1p-4}, to_wall, 1));
  EXPECT_FALSE(
      truth.IsSelfHit(near, {2, 0x1p-4, -0x1p-10}, to_wall, 1));  // below the floor, but hit above it

  EXPECT_TRUE(truth.LeapsOver(near, {2, -0x1p-20, 0x1p-20}));
  EXPECT_TRUE(truth.LeapsOver(near, {2, 0, 0x1p-20}));  // begins on the wall: not hit any more
  EXPECT_FALSE(truth.LeapsOver(near, {2, 0x1p-30, 0x1p-20}));
  EXPECT_FALSE(truth.LeapsOver(near, {2, 0x1p-18, 100}));
  EXPECT_FALSE(truth.LeapsOver(on, {2, -1, 1}));  // touches at the spot
  EXPECT_FALSE(truth.LeapsOver(on, {2, 0, 1}));   // along the wall
  EXPECT_TRUE(truth.Leaves(on, {1, 0, 0x1p-149f}));
  EXPECT_FALSE(truth.Leaves(on, {1, 0, 0}));
  EXPECT_FALSE(truth.Leaves({0, 0.5f, 0, -1}, {1, 0, 1}));
}

/// Two shells; the inner one's surface is `gap` below the outer one's.
Scene Shells(int level, float gap, float scale = 1) {
  Scene inner = testing::MakeIcosphere(level);
  std::vector<Vec3f> positions;
  auto triangles = inner.triangles;
  for (Vec3f p : inner.positions) positions.push_back(p * scale);
  for (Vec3f p : inner.positions) positions.push_back(p * (scale * (1 - gap)));
  for (auto t : inner.triangles) {
    for (uint32_t& v : t) v += uint32_t(inner.positions.size());
    triangles.push_back(t);
  }
  Scene scene = testing::MakeScene(positions, triangles);
  scene.materials[0].transmit = {1, 1, 1};  // so that rays leave to both sides
  return scene;
}

struct SearchOf {
  explicit SearchOf(Scene of, uint64_t rays, uint32_t threads = 0)
      : scene(std::move(of)),
        truth(scene),
        tree(ParseContestant(registry, "bvh_wide"), scene.Geometry(),
             BuildOptions(1, 1, RB_NEED_UV | RB_NEED_SKIP)),
        departing(MakeDepartures(registry, scene, truth, {rays, 1, false, threads})),
        search(scene, tree, truth, departing, threads, {}) {}
  Registry registry;
  Scene scene;
  LeavingTruth truth;
  Tree tree;
  std::vector<Departing> departing;
  OffsetSearch search;
};

TEST(HarnessOffset, AnOffsetOfNothingHitsItselfAndOneBeyondTheGapLosesHits) {
  constexpr float kGap = 1e-3f;
  const uint64_t rays = testing::Effort(20000);
  const SearchOf s(Shells(2, kGap), rays);
  for (SelfIntersection cure : {SelfIntersection::kNormalOffset, SelfIntersection::kFixedTnear}) {
    const Seen nothing = s.search.Look(cure, 0, rays);
    EXPECT_GT(*nothing.self_hits, rays / 10);
    EXPECT_LT(*nothing.lost, rays / 1000);
    const Seen beyond = s.search.Look(cure, 3 * kGap, rays);
    EXPECT_GT(*beyond.lost, rays / 10);
  }
  EXPECT_GT(*s.search.Look(SelfIntersection::kNone, 0, rays).self_hits, rays / 10);
  EXPECT_TRUE(s.search.Look(SelfIntersection::kErrorBound, 0, rays).Safe());

  const CureFindings found = s.search.Find(SelfIntersection::kNormalOffset);
  ASSERT_TRUE(found.below && found.smallest_safe && found.largest_safe && found.above);
  EXPECT_GT(*found.below->self_hits, 0u);
  EXPECT_LT(found.below->offset, found.smallest_safe->offset);
  EXPECT_LT(found.smallest_safe->offset / found.below->offset, 1.12f);
  EXPECT_LT(found.smallest_safe->offset, found.largest_safe->offset);
  // The shells' facets are a little nearer to each other than their vertices.
  EXPECT_GT(found.largest_safe->offset, 0.8f * kGap);
  EXPECT_LT(found.largest_safe->offset, kGap);
  EXPECT_GT(*found.above->lost, 0u);
  EXPECT_TRUE(found.named.Safe());
  EXPECT_NEAR(found.shortest, found.named.offset, 1e-6);
  EXPECT_NEAR(found.longest, found.named.offset, 1e-6);
  EXPECT_FALSE(s.search.Find(SelfIntersection::kErrorBound).smallest_safe);
}

TEST(HarnessOffset, RaysAreTheSameAtAnyNumberOfThreadsAndLeaveToTheirSide) {
  const SearchOf one(Shells(1, 0.1f), 5000, 1), three(Shells(1, 0.1f), 5000, 3);
  ASSERT_EQ(one.departing.size(), 5000u);
  uint64_t inward = 0;
  for (size_t i = 0; i < one.departing.size(); ++i) {
    const Departing &a = one.departing[i], &b = three.departing[i];
    ASSERT_TRUE(a.prim == b.prim && a.u == b.u && a.v == b.v && a.side == b.side && a.dir == b.dir);
    ASSERT_TRUE(one.truth.Leaves(a.At(), a.dir));
    inward += a.side < 0;
  }
  EXPECT_GT(inward, 1000u);
  EXPECT_LT(inward, 4000u);
}

class HarnessOffsetCommand : public HarnessCommand {
 protected:
  std::string In(const std::string& name) const { return (folder_ / name).string(); }
  Outcome Offset(std::vector<std::string> words) {
    words.insert(words.begin(), "offset");
    return Call(words);
  }
  /// The row of a cure with that role.
  static OffsetRow Of(const std::vector<OffsetRow>& rows, const std::string& cure, const std::string& role) {
    for (const OffsetRow& row : rows)
      if (row.at("cure") == cure && row.at("role") == role) return row;
    ADD_FAILURE() << "no row of " << cure << ", " << role;
    return {};
  }
};

TEST_F(HarnessOffsetCommand, NamesASafeOffsetAtEachScale) {
  std::vector<double> smallest;
  for (const char* factor : {"1e-6", "1", "1e6"}) {
    const std::string out = In(std::string("out") + factor);
    const Outcome outcome =
        Offset({fmt::format("scale(icosphere(level=2),factor={})", factor), "--rays", "8K", "--out", out});
    ASSERT_EQ(outcome.exit_code, 0) << outcome.out << outcome.err;
    EXPECT_THAT(outcome.out, HasSubstr("Take --self-intersection error-bound: no self-hit and no lost hit"));
    EXPECT_THAT(outcome.out, HasSubstr("Safe, too: "));
    const auto rows = ReadCsv(fs::path(out) / "offset.csv");
    EXPECT_EQ(Of(rows, "error-bound", "named").at("safe"), "1");
    EXPECT_EQ(Of(rows, "none", "named").at("safe"), "0");
    EXPECT_GT(std::stod(Of(rows, "none", "named").at("self_hits")), 800);
    EXPECT_GT(std::stod(Of(rows, "normal-offset", "below").at("self_hits")), 0);
    const OffsetRow named = Of(rows, "normal-offset", "named");
    EXPECT_EQ(named.at("safe"), "1");
    EXPECT_EQ(named.at("self_hits") + " " + named.at("lost") + " " + named.at("rays"), "0 0 8192");
    smallest.push_back(std::stod(Of(rows, "normal-offset", "smallest_safe").at("offset")));
    EXPECT_THAT(Read(fs::path(out) / "offset.json"), HasSubstr("\"advice\": \"Take --self-intersection"));
  }
  // Rounding grows with the scene.
  EXPECT_NEAR(smallest[0] * 1e6 / smallest[1], 1, 0.5);
  EXPECT_NEAR(smallest[2] * 1e-6 / smallest[1], 1, 0.5);
}

TEST_F(HarnessOffsetCommand, SaysThatNothingIsSafe) {
  // Two oblique panes of glass that meet in an edge and are nowhere more than an ulp of the coordinates apart:
  // rounding alone puts origins beyond the other one.
  std::ofstream(In("m.mtl")) << "newmtl glass\nillum 6\nKd 0 0 0\nTf 1 1 1\nNi 1\n";
  std::ofstream(In("panes.obj")) << "mtllib m.mtl\nusemtl glass\nv 3 0 1000\nv 1003 0 1700\nv 0 1000 1300\n"
                                    "v 3 0 1000.00007\nf 1 2 3\nf 4 2 3\n";
  const Outcome outcome = Offset({In("panes.obj"), "--rays", "16K"});
  EXPECT_EQ(outcome.exit_code, 1) << outcome.out << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("No cure is safe here. Least goes wrong with --self-intersection"));
}

TEST_F(HarnessOffsetCommand, WrongInputIsOneLine) {
  fs::create_directories(In("full"));
  std::ofstream(In("full/offset.csv")) << "x\n";
  std::ofstream(In("empty.off")) << "OFF\n0 0 0\n";
  for (const auto& [words, says] : std::vector<std::pair<std::vector<std::string>, std::string>>{
           {{}, "scene is required"},
           {{"icosphere", "--rays", "7"}, "--rays"},
           {{"icosphere", "--structure", "bvh_wid"}, "did you mean bvh_wide?"},
           {{"icosphere", "--out", In("full")}, "already holds an offset.csv"},
           {{"sphereflake(depth=1,tessellation=0)"}, "has 10 procedural primitives"},
           {{In("empty.off")}, "has no faces"},
           {{"scale(icosphere,factor=0)"}, "factor"},
           {{"scale(scale(scale(scale(icosphere,factor=1e12),factor=1e12),factor=1e12),factor=1e12)"},
            "leads out of float's range"}}) {
    SCOPED_TRACE(::testing::PrintToString(words));
    const Outcome outcome = Offset(words);
    EXPECT_EQ(outcome.exit_code, 2) << outcome.out << outcome.err;
    EXPECT_EQ(outcome.out, "");
    EXPECT_THAT(outcome.err, HasSubstr(says));
  }
}

}  // namespace
}  // namespace raybench
