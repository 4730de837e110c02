// Inside or outside by counting: truth, rule and command.
#include "harness/verify/crossings.h"

#include <gmock/gmock.h>

#include <chrono>
#include <fstream>
#include <thread>

#include "accel/ray/triangle.h"
#include "tests/support/command.h"
#include "tests/support/effort.h"
#include "tests/support/oracle_scenes.h"

namespace raybench {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using Line = std::map<std::string, std::string>;

constexpr const char* kSphere = "icosphere(level=2)";

TEST(HarnessCrossings, OfABoxEveryPlaceIsKnownAndTheRuleFindsIt) {
  // All triangles twice: a second copy is none.
  const Scene box = testing::MakeLatticeBox(2, {0, 0, 0}, 1, 2);
  const Vec3f lo = box.bounds().lo, hi = box.bounds().hi;
  ASSERT_TRUE(IsOnLattice(box));
  const InsideTruth truth(box);
  const double step = LatticeStep(box);
  const auto along = [&](int k) {
    const double size = double(hi[k]) - lo[k];
    std::vector<float> values;
    for (double part : {0.0, 0.25, 0.5, 0.6875, 1.0}) {
      const double at = lo[k] + part * size, ulp = at != 0 ? std::ldexp(1.0, std::ilogb(at) - 23) : step;
      for (int off : {-1, 0, 1}) values.push_back(float(at + off * ulp));
    }
    values.push_back(float(lo[k] - 0.25 * size)), values.push_back(float(hi[k] + 0.25 * size));
    return values;
  };
  Random random(1);
  uint64_t inside_points = 0, surface_points = 0;
  for (float x : along(0)) {
    for (float y : along(1)) {
      for (float z : along(2)) {
        CrossingPoint point{{x, y, z}};
        bool closed = true, open = true;
        for (int k = 0; k < 3; ++k) {
          closed &= lo[k] <= point.at[k] && point.at[k] <= hi[k];
          open &= lo[k] < point.at[k] && point.at[k] < hi[k];
        }
        const Place place = open ? Place::kInside : closed ? Place::kOnSurface : Place::kOutside;
        ASSERT_EQ(truth.Of(point.at, random), place) << x << " " << y << " " << z;
        inside_points += open, surface_points += closed && !open;
        if (place == Place::kOnSurface) continue;
        for (int turn = 0; turn < 12; ++turn) {
          point.axis = uint8_t(turn % 3), point.backward = turn / 3 % 2 != 0;
          double t;
          const rb_ray ray = CountingRay(point, step, turn / 6 != 0, t);
          bool odd = false;
          for (size_t i = 0; i < box.triangles.size(); ++i)
            odd ^= truth.distinct()[i] && CrossesBehind(exact::Line(ray), CornersOf(box, i), t);
          ASSERT_EQ(odd, open) << x << " " << y << " " << z << " turn " << turn;
        }
      }
    }
  }
  EXPECT_GT(inside_points, 500u);
  EXPECT_GT(surface_points, 500u);
}

TEST(HarnessCrossings, IntegersAgreeWithTruthAndSayWhereNot) {
  const Scene ball = testing::MakeIcosphere(2);
  const InsideTruth truth(ball);
  std::vector<CrossingPoint> points(2048);
  FillCrossingBatch(ball, MeshEdges(ball), truth, 3, 5, points);
  std::vector<Vec3f> at;
  std::vector<Place> places;
  for (const CrossingPoint& point : points) {
    at.push_back(point.at), places.push_back(point.inside ? Place::kInside : Place::kOutside);
    // Flat faces are nearer to the centre than their corners.
    const double distance = Length(ToDouble(point.at));
    if (distance > 1 + 1e-6 || distance < 0.9) {
      EXPECT_EQ(point.inside, distance < 1);
    }
  }
  EXPECT_NO_THROW(truth.Audit(at, places, 1));
  places[7] = places[7] == Place::kInside ? Place::kOutside : Place::kInside;
  EXPECT_THROW(truth.Audit(at, places, 1), std::logic_error);
}

TEST(HarnessCrossings, PointsOffTheLatticeAreNone) {
  const Scene box = testing::MakeLatticeBox(2);
  std::vector<Vec3f> positions = box.positions;
  positions[0].x += 0x1p-70f * (positions[0].x == 0);
  const bool moved = positions[0].x != box.positions[0].x;
  EXPECT_EQ(IsOnLattice(testing::MakeScene(positions, box.triangles)), !moved);
  EXPECT_TRUE(moved);
}

/// Lemma 2 of CROSSINGS.md: on lines beside edges, through vertices and along faces.
TEST(HarnessCrossings, TestsAcceptEveryTriangleThatATiltedLineMeets) {
  constexpr double kStep = 0x1p-51;  // of coordinates below 1
  Random random(7);
  const auto coordinate = [&] {
    const uint64_t bits = random.NextBits();
    if ((bits & 3) == 0) return 0.25f * float(int64_t(bits >> 2 & 3) - 1);  // many are the same
    return float(int64_t(random.Below(1 << 24)) - (1 << 23)) * 0x1p-24f;
  };
  uint64_t met = 0, straight_lost = 0;
  for (int i = 0; i < 100000; ++i) {
    Vec3f p[3];
    for (Vec3f& v : p) v = {coordinate(), coordinate(), coordinate()};
    CrossingPoint point{{coordinate(), coordinate(), coordinate()}};
    if (i % 2 == 0) {  // beside an edge that passes zero, where floats are dense
      p[1] = p[0] * -0.5f;
      point.at = p[0] * (1 / float(3 + random.Below(1 << 12)));
    } else if (i % 4 == 1) {
      for (int k = 0; k < 3; ++k) point.at[k] = p[random.Below(3)][k];
    }
    const exact::Corners corners = {ToDouble(p[0]), ToDouble(p[1]), ToDouble(p[2])};
    const Vec3d normal = Cross(corners[1] - corners[0], corners[2] - corners[0]);
    if (normal == Vec3d{0, 0, 0}) continue;
    point.axis = uint8_t(random.Below(3)), point.backward = random.Below(2) != 0;
    float lanes[3][3][4];
    for (int corner = 0; corner < 3; ++corner)
      for (int axis = 0; axis < 3; ++axis)
        for (float& lane : lanes[corner][axis]) lane = p[corner][axis];
    for (bool tilted : {false, true}) {
      double t;
      const rb_ray ray = CountingRay(point, kStep, tilted, t);
      const exact::Meeting meeting = exact::Meet(exact::Line(ray), corners);
      if (meeting == exact::Meeting::kNone || meeting == exact::Meeting::kInPlane) continue;
      PrimHit hit;
      const auto accepts = [&](const auto& test) {
        if constexpr (requires { test.MayHit(Lanes{lanes}); }) {
          if (test.MayHit(Lanes{lanes}) != 15u) return false;
        }
        return test.Intersect(p[0], p[1], p[2], hit);
      };
      if (!tilted) {
        straight_lost += !accepts(WatertightTest(ray));
        continue;
      }
      ++met;
      ASSERT_TRUE(accepts(WatertightTest(ray))) << i;
      ASSERT_TRUE(accepts(DoubleTest(ray))) << i;
      ASSERT_GT(hit.t, 0);
    }
  }
  EXPECT_GT(met, 20000u);
  EXPECT_GT(straight_lost, 100u);  // why lines are tilted
}

class HarnessCrossingsCommand : public HarnessCommand {
 protected:
  std::string In(const std::string& name) const { return (folder_ / name).string(); }
  Outcome Verify(std::vector<std::string> words) {
    words.insert(words.begin(), "verify");
    return Call(words);
  }
  std::vector<Line> Csv(const std::string& out) const { return ReadCsv(fs::path(In(out)) / "crossings.csv"); }
  static uint64_t Number(const Line& row, const std::string& name) { return std::stoull(row.at(name)); }
};

TEST_F(HarnessCrossingsCommand, NoConservativeTreeIsWrongByTheRuleAndAllAreByOtherWays) {
  for (const char* scene : {kSphere, "menger(depth=1)"}) {
    SCOPED_TRACE(scene);
    const std::string out = std::string("out_") + scene[0];
    std::vector<std::string> words{scene, "--crossings", testing::kSanitized ? "1K" : "2K", "--out", In(out)};
    if (testing::kSanitized) {
      words.insert(words.end(), {"--structures", "bvh_sah,bvh_sah(numerics=exact),grid"});
    } else {
      words.insert(words.end(), {"--structures", "all"});
    }
    const Outcome outcome = Verify(words);
    ASSERT_EQ(outcome.exit_code, 0) << outcome.out << outcome.err;
    EXPECT_THAT(outcome.out, HasSubstr(std::string(scene) + ": closed, "));
    EXPECT_THAT(outcome.out, Not(HasSubstr("BROKEN")));
    uint64_t conservative = 0, wrong_otherwise = 0;
    for (const Line& row : Csv(out)) {
      SCOPED_TRACE(row.at("spec") + " " + row.at("way"));
      EXPECT_EQ(row.at("held"), "1");
      EXPECT_EQ(Number(row, "points"), testing::kSanitized ? 1024u : 2048u);
      EXPECT_GT(std::stod(row.at("ns_per_point")), 0);
      const bool claims = row.at("claim") == "watertight" || row.at("claim") == "exact";
      if (row.at("way") == "rule" && claims) {
        ++conservative;
        EXPECT_EQ(Number(row, "wrong"), 0u);
        EXPECT_GT(std::stod(row.at("wrong_upper")), 0);
      } else if (row.at("way") == "after" && claims) {
        EXPECT_GT(Number(row, "wrong"), 0u);
      } else {
        wrong_otherwise += Number(row, "wrong");
      }
    }
    EXPECT_GE(conservative, testing::kSanitized ? 3u : 40u);
    EXPECT_GT(wrong_otherwise, 0u);
  }
}

TEST_F(HarnessCrossingsCommand, NothingButTimeDependsOnThreadsAndRunsOfASeedAreTheSame) {
  std::vector<std::vector<Line>> tables;
  for (const char* threads : {"1", "3"}) {
    const std::string out = std::string("out") + threads;
    const Outcome outcome = Verify({kSphere, "--structures", "bvh_sah(numerics=fast),embree", "--crossings",
                                    "20000", "--threads", threads, "--out", In(out)});
    ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
    EXPECT_THAT(outcome.out, HasSubstr("embree: cannot resume by `after`, so there is no rule for it"));
    tables.push_back(Csv(out));
    for (Line& row : tables.back()) row.erase("ns_per_point");
  }
  EXPECT_EQ(tables[0], tables[1]);
  ASSERT_EQ(tables[0].size(), 6u);               // four ways of the one, two of the other
  EXPECT_GT(Number(tables[0][0], "wrong"), 0u);  // which claims nothing of the kind
}

TEST_F(HarnessCrossingsCommand, ATreeThatLosesATriangleIsFoundAndTheTriangleNamed) {
  const std::string plugin = (BuildPlugins() / "libleaky.so").string();
  const Outcome good = Verify({kSphere, "--plugin", plugin, "--structures", "leaky", "--crossings", "8K"});
  EXPECT_EQ(good.exit_code, 0) << good.out;
  const Outcome bad = Verify({kSphere, "--plugin", plugin, "--structures", "leaky(flaw=drop),null",
                              "--crossings", "8K", "--examples", "2", "--out", In("out")});
  EXPECT_EQ(bad.exit_code, 1) << bad.out;
  EXPECT_THAT(bad.out, HasSubstr("leaky(flaw=drop) claims watertight: BROKEN"));
  EXPECT_THAT(bad.out, HasSubstr("it does not show triangle 160"));
  EXPECT_THAT(bad.out, HasSubstr("null: not counted with: it claims nothing"));
  EXPECT_EQ(Csv("out")[0].at("held"), "0");
}

TEST_F(HarnessCrossingsCommand, MalformedAnswersBreakTheContract) {
  const std::string plugin = (BuildPlugins() / "libwrong.so").string();
  for (const auto& [structure, says] :
       {std::pair{"wrong_bad_ids", "primitive 327 of 320"}, std::pair{"wrong_early_t", "contract BROKEN"}}) {
    const Outcome outcome =
        Verify({kSphere, "--plugin", plugin, "--structures", structure, "--crossings", "512"});
    EXPECT_EQ(outcome.exit_code, 1) << outcome.out;
    EXPECT_THAT(outcome.out, HasSubstr("contract BROKEN"));
    EXPECT_THAT(outcome.out, HasSubstr(says));
  }
}

TEST_F(HarnessCrossingsCommand, CtrlCKeepsWhatWasCounted) {
  std::vector<Line> rows;
  for (int seconds = 1; seconds <= 64 && rows.empty(); seconds *= 4) {
    fs::remove_all(In("out"));
    const pid_t pid =
        Start({"verify", kSphere, "--structures", "brute", "--crossings", "256K", "--out", In("out")});
    std::this_thread::sleep_for(std::chrono::seconds(seconds));
    kill(pid, SIGINT);
    EXPECT_EQ(Finish(pid).exit_code, 130);
    rows = Csv("out");
  }
  ASSERT_FALSE(rows.empty());
  EXPECT_LT(Number(rows[0], "points"), 262144u);
  EXPECT_EQ(Number(rows[0], "wrong"), 0u);
}

TEST_F(HarnessCrossingsCommand, WrongInputIsOneLine) {
  std::ofstream(In("open.off")) << "OFF\n4 3 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n";
  std::ofstream(In("ball.nff"))
      << "v\nfrom 0 -8 1\nat 0 0 0\nup 0 0 1\nangle 45\nhither 0.01\nresolution 64 64\n"
         "f 1 1 1 1 0 0 0 1\ns 0 0 0 1\n";
  fs::create_directories(In("full"));
  std::ofstream(In("full/crossings.csv")) << "x\n";
  for (const auto& [words, says] : std::vector<std::pair<std::vector<std::string>, std::string>>{
           {{kSphere, "--crossings", "0"}, "--crossings"},
           {{kSphere, "--crossings", "1G"}, "--crossings"},
           {{kSphere, "--crossings", "1K", "--closed", "1K"}, "excludes"},
           {{kSphere, "--crossings", "1K", "--rays", "64"}, "excludes"},
           {{kSphere, "--crossings", "1K", "--any"}, "excludes"},
           {{kSphere, "--crossings", "1K", "--ledger", In("l.json")}, "--closed"},
           {{kSphere, "--crossings", "1K", "--out", In("full")}, "holds the results of another verification"},
           {{In("open.off"), "--crossings", "1K", "--out", In("out")},
            "is not closed: 3 of 6 edges have an odd number of triangles"},
           {{In("ball.nff"), "--crossings", "1K"}, "has no triangles"},
           {{"--crossings", "1K"}, "name a scene"}}) {
    SCOPED_TRACE(::testing::PrintToString(words));
    const Outcome outcome = Verify(words);
    EXPECT_EQ(outcome.exit_code, 2) << outcome.err;
    EXPECT_EQ(outcome.out, "");
    EXPECT_THAT(outcome.err, HasSubstr(says));
    EXPECT_FALSE(fs::exists(In("out")));
  }
}

}  // namespace
}  // namespace raybench
