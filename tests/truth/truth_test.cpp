// The exact oracle against brute force in big integers, which shares no formula with it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <boost/multiprecision/cpp_int.hpp>
#include <cstdlib>
#include <tuple>

#include "accel/host/registry.h"
#include "accel/ray/exact.h"
#include "harness/truth/oracle.h"
#include "tests/support/effort.h"
#include "tests/support/oracle_scenes.h"

namespace raybench {
namespace {

using namespace testing;
using Int = boost::multiprecision::cpp_int;
using Rational = boost::multiprecision::cpp_rational;
using IntVec = Vec3<Int>;

/// x 2^160: an integer for every float and every middle of two floats.
Int ToInt(double x) {
  int exponent;
  const int64_t mantissa = int64_t(std::ldexp(std::frexp(x, &exponent), 53));
  const int shift = exponent - 53 + 160;
  return shift >= 0 ? Int(mantissa) << shift : Int(mantissa >> -shift);
}
IntVec ToInt(const float* p) { return {ToInt(p[0]), ToInt(p[1]), ToInt(p[2])}; }

struct Reference {
  bool hit = false, coplanar = false;
  Rational t;
  float t_rounded = 0;
  uint32_t first = RAYBENCH_NONE;
  std::vector<uint32_t> tied;
  Feature feature = Feature::kInterior;
};

/// n / d >= 0 rounded to float, by bisection over all floats. What follows the largest float stands
/// for infinity.
float Rounded(const Int& n, const Int& d) {
  const auto value = [](uint32_t bits) { return bits == 0x7F800000u ? 0x1p128 : std::bit_cast<float>(bits); };
  const auto order = [&](double x) { return Int(n * ToInt(1) - ToInt(x) * d).sign(); };
  uint32_t below = 0, above = 0x7F800000u;
  if (order(0x1p128) >= 0) return kInf;
  while (above - below > 1) {
    const uint32_t middle = below + (above - below) / 2;
    (order(value(middle)) >= 0 ? below : above) = middle;
  }
  const int side = order(0.5 * (value(below) + value(above)));
  return std::bit_cast<float>(side > 0 || (side == 0 && below % 2 == 1) ? above : below);
}

/// Does the line, in the plane of p, meet the triangle within the interval? By parameters of the meetings
/// with edges.
bool MeetsCoplanar(const IntVec& o, const IntVec& d, const IntVec (&p)[3], const rb_ray& ray) {
  const IntVec n = Cross(p[1] - p[0], p[2] - p[0]);
  Rational lo = Rational(ToInt(ray.tnear), ToInt(1)),
           hi = std::isinf(ray.tfar) ? Rational(Int(1) << 2000) : Rational(ToInt(ray.tfar), ToInt(1));
  bool open = true;  // at lo
  for (int i = 0; i < 3; ++i) {
    const IntVec inward = Cross(n, p[(i + 1) % 3] - p[i]);
    const Int at = Dot(inward, o - p[i]), slope = Dot(inward, d);
    if (slope == 0) {
      if (at < 0) return false;
      continue;
    }
    const Rational t = slope > 0 ? Rational(-at, slope) : Rational(at, -slope);
    if (slope > 0 && t > lo) lo = t, open = false;
    if (slope < 0 && t < hi) hi = t;
  }
  return open ? lo < hi : lo <= hi;
}

/// Moeller-Trumbore in integers.
Reference Ask(const Scene& scene, const rb_ray& ray) {
  Reference best;
  if (!(ray.tnear < ray.tfar)) return best;
  const IntVec o = ToInt(ray.org), d = ToInt(ray.dir);
  const Int one = ToInt(1);
  Int best_n, best_d;
  std::vector<std::tuple<uint32_t, Int, Int>> hits;
  for (uint32_t i = 0; i < scene.triangles.size(); ++i) {
    IntVec p[3];
    for (size_t k = 0; k < 3; ++k) p[k] = ToInt(&scene.positions[scene.triangles[i][k]].x);
    const IntVec e1 = p[1] - p[0], e2 = p[2] - p[0], s = o - p[0], h = Cross(d, e2), q = Cross(s, e1);
    Int det = Dot(e1, h), u = Dot(s, h), v = Dot(d, q), t = Dot(e2, q);
    if (det == 0) {
      if (Dot(s, Cross(e1, e2)) == 0) best.coplanar = best.coplanar || MeetsCoplanar(o, d, p, ray);
      continue;
    }
    if (det < 0) det = -det, u = -u, v = -v, t = -t;
    if (u < 0 || v < 0 || u + v > det) continue;
    if (t * one <= ToInt(ray.tnear) * det) continue;
    if (!std::isinf(ray.tfar) && t * one > ToInt(ray.tfar) * det) continue;
    hits.emplace_back(i, t, det);
    const Int order = best.hit ? Int(t * best_d - best_n * det) : Int(-1);
    if (order > 0) continue;
    if (order < 0) {
      best.hit = true, best_n = t, best_d = det;
      best.tied.clear();
      const int zeros = int(u == 0) + int(v == 0) + int(u + v == det);
      best.feature = zeros == 0 ? Feature::kInterior : zeros == 1 ? Feature::kEdge : Feature::kVertex;
    }
    best.tied.push_back(i);
  }
  if (!best.hit) return best;
  best.t = Rational(best_n, best_d);
  const auto answer = [&](const Int& n, const Int& d) {
    const float t = Rounded(n, d);
    return t == ray.tnear ? std::nextafter(t, kInf) : t;
  };
  best.t_rounded = answer(best_n, best_d);
  for (const auto& [prim, n, d] : hits)
    if (best.first == RAYBENCH_NONE && answer(n, d) == best.t_rounded) best.first = prim;
  return best;
}

/// Random, edge-aimed, vertex-aimed, in-plane and axis-parallel rays, rays from far away and from within an
/// ulp of a triangle, with directions of all lengths and intervals that end on true hits.
std::vector<rb_ray> NastyRays(const Scene& scene, size_t count, uint64_t seed) {
  std::vector<rb_ray> rays;
  const Vec3d lo = ToDouble(scene.bounds().lo), size = ToDouble(scene.bounds().hi) - lo;
  for (size_t i = 0; i < count; ++i) {
    Random random(seed, i);
    const auto corner = [&] {
      return scene.positions[scene.triangles[random.Below(scene.triangles.size())][random.Below(3)]];
    };
    const auto inside = [&] {
      return ToFloat(lo + Vec3d{size.x * random.NextDouble(), size.y * random.NextDouble(),
                                size.z * random.NextDouble()});
    };
    const auto& t = scene.triangles[random.Below(scene.triangles.size())];
    const Vec3f a = scene.positions[t[0]], b = scene.positions[t[1]], c = scene.positions[t[2]];
    Vec3f org = inside(), dir = ToFloat(random.UnitVector());
    switch (random.Below(12)) {
      case 0:
        break;
      case 1:
        dir = corner() - org;
        break;
      case 2:
        dir = (a + b) * 0.5f - org;
        break;
      case 3:
        org = corner(), dir = corner() - org;
        break;
      case 4:
        org = a + (b - a) * 2.0f, dir = (c - a) * 0.5f - (b - a);
        break;  // in the plane of a lattice triangle
      case 5:
        org = corner(), dir = {0, 0, 0}, dir[int(random.Below(3))] = random.Below(2) ? 1.0f : -1.0f;
        break;
      case 6:
        org = corner() + (b - c), dir = corner() - org;
        break;
      case 7:
        org = (a + b) * 0.5f + (a - c), dir = c - a;
        break;
      case 8:
      case 9:
        org = ToFloat(ToDouble(org) + random.UnitVector() * std::ldexp(Length(size), int(random.Below(12))));
        dir = inside() - org;
        break;
      case 10:
      case 11: {
        const float u = random.NextFloat(), v = random.NextFloat() * (1 - u);
        org = a + (b - a) * u + (c - a) * v;
        for (int k = 0; k < 3; ++k) org[k] = std::nextafter(org[k], org[k] + float(random.Below(3)) - 1.0f);
        if (random.Below(2)) dir = corner() - org;
        break;
      }
    }
    if (random.Below(4) == 0) dir = dir * std::ldexp(1 + random.NextFloat(), int(random.Below(241)) - 120);
    rb_ray ray = MakeRay(org, dir);
    if (!IsValidRay(ray)) ray = MakeRay(inside(), {1, 0, 0});
    const Reference truth = Ask(scene, ray);
    if (truth.hit && truth.t_rounded < kInf) {
      const float hit = truth.t_rounded;
      switch (random.Below(9)) {
        case 0:
          ray.tnear = hit;
          break;
        case 1:
          ray.tfar = hit;
          break;
        case 2:
          ray.tnear = std::nextafter(hit, 0.0f);
          break;
        case 3:
          ray.tfar = std::nextafter(hit, 0.0f);
          break;
        case 4:
          ray.tnear = hit * 0.5f, ray.tfar = hit * 2;
          break;
        case 5:
          ray.tnear = std::nextafter(hit, 0.0f), ray.tfar = hit;
          break;
        default:
          break;
      }
    }
    rays.push_back(ray);
  }
  return rays;
}

struct Counted {
  size_t hits = 0, ties = 0, edges = 0, vertices = 0, coplanar = 0, first_not_tied = 0;
};

/// The verdicts on `spec`'s answers.
VerdictCounts JudgeStructure(const Scene& scene, const Oracle& oracle, std::span<const rb_ray> rays,
                             std::span<const Truth> truth, const char* spec, uint32_t kind) {
  static const Registry registry;
  const rb_geometry geometry = scene.Geometry();
  const Tree tree(ParseContestant(registry, spec), geometry, DefaultBuildOptions());
  std::vector<rb_hit> hits(rays.size());
  std::vector<uint8_t> occluded(rays.size());
  rb_query query{};
  query.struct_size = sizeof query, query.kind = kind, query.n = rays.size(), query.rays = rays.data();
  query.hits = hits.data(), query.occluded = occluded.data();
  tree.Query(query);
  return JudgeAll(oracle, kind, rays, truth, hits, occluded, 2);
}

Counted ExpectSame(const Scene& scene, const std::vector<rb_ray>& rays) {
  Counted counted;
  const auto oracle = MakeCgalOracle(scene);
  const std::vector<Truth> truth = oracle->Ask(rays, 2);
  for (size_t i = 0; i < rays.size(); ++i) {
    const Reference want = Ask(scene, rays[i]);
    const Truth& got = truth[i];
    SCOPED_TRACE(i);
    EXPECT_EQ(got.hit, want.hit);
    EXPECT_EQ(got.coplanar, want.coplanar);
    EXPECT_EQ(got.tied, want.tied);
    EXPECT_EQ(got.feature, want.feature);
    if (want.hit) {
      EXPECT_EQ(got.t, want.t.convert_to<double>());
    }
    EXPECT_EQ(got.t_rounded, want.t_rounded);
    EXPECT_EQ(got.first, want.first);
    if (::testing::Test::HasFailure()) break;
    counted.hits += got.hit, counted.ties += got.tied.size() > 1, counted.coplanar += got.coplanar;
    counted.first_not_tied += got.hit && got.first != got.tied.front();
    counted.edges += got.feature == Feature::kEdge, counted.vertices += got.feature == Feature::kVertex;
  }
  EXPECT_EQ(oracle->Audit(rays, truth, 3, 150), std::min<size_t>(rays.size(), 150));
  // With longer and shorter directions t, or a product with it, may leave the range of normal floats.
  std::vector<rb_ray> answerable;
  std::vector<Truth> their_truth;
  for (size_t i = 0; i < rays.size(); ++i) {
    const float* d = rays[i].dir;
    const float length = std::max({std::fabs(d[0]), std::fabs(d[1]), std::fabs(d[2])});
    if (!(length >= 0x1p-30f && length <= 0x1p30f)) continue;
    answerable.push_back(rays[i]), their_truth.push_back(truth[i]);
  }
  for (const uint32_t kind : {uint32_t(RB_CLOSEST), uint32_t(RB_ANY)}) {
    const auto judge = [&](const char* spec) {
      return JudgeStructure(scene, *oracle, answerable, their_truth, spec, kind);
    };
    EXPECT_EQ(judge("brute(numerics=exact)").strict, answerable.size());
    // No sound test may be blamed.
    for (const char* spec : {"brute(numerics=watertight)", "brute(numerics=double)"})
      EXPECT_FALSE(BreaksClaim(RB_CLAIM_WATERTIGHT, judge(spec))) << spec << ' ' << kind;
  }
  return counted;
}

/// How many rays each mesh is tried with; with `whole` as many under the sanitizers.
size_t RaysPerMesh(bool whole) {
  const char* text = std::getenv("RAYBENCH_TEST_RAYS");
  return text ? std::stoul(text) : whole ? 1500 : Effort(1500);
}

struct Case {
  const char* name;
  Scene (*make)();
};

class OracleExactness : public ::testing::TestWithParam<Case> {
 protected:
  void SetUp() override {
    if (!MakeCgalOracle(MakeLatticeBox(1))) GTEST_SKIP() << "built without CGAL";
  }
};

TEST_P(OracleExactness, AgreesWithIntegersOnEveryRay) {
  const Scene scene = GetParam().make();
  const bool sheets = GetParam().name == std::string("sheets");  // where few rays would not meet what is rare
  const size_t count = RaysPerMesh(sheets);
  const Counted counted = ExpectSame(scene, NastyRays(scene, int(count), 7));
  EXPECT_GT(counted.hits, count / 8);  // else the rays test nothing
  if (sheets) {
    EXPECT_GT(counted.first_not_tied, count / 20);
  }
}

INSTANTIATE_TEST_SUITE_P(
    Meshes, OracleExactness,
    ::testing::Values(Case{"lattice_box", [] { return MakeLatticeBox(2); }},
                      Case{"copies",
                           [] {
                             return MakeLatticeBox(1, {0, 0, 0}, 1, 4);
                           }},
                      Case{"soup", [] { return MakeLatticeSoup(40, 3); }},
                      Case{"far",
                           [] {
                             return MakeLatticeBox(2, {1e6f, -3e6f, 7e5f});
                           }},
                      Case{"far_odd",
                           [] {
                             return MakeLatticeBox(2, {16777.213f, 3.14159f, -0.001f}, 1.7f);
                           }},
                      Case{"tiny",
                           [] {
                             return MakeLatticeBox(2, {0.1f, 0.2f, 0.3f}, 1e-8f);
                           }},
                      Case{"slivers", [] { return MakeSlivers(40, 5); }},
                      Case{"sheets", [] { return MakeSheets(24, 6); }},
                      Case{"icosphere", [] { return MakeIcosphere(1); }}),
    [](const auto& info) { return std::string(info.param.name); });

class OracleTruth : public OracleExactness {};

TEST_F(OracleTruth, LatticeGeometryHitsEveryFeature) {
  const Scene scene = MakeLatticeBox(2);
  const Counted counted = ExpectSame(scene, NastyRays(scene, int(Effort(1500)), 8));
  EXPECT_GT(counted.ties, Effort(50));
  EXPECT_GT(counted.edges, Effort(30));
  EXPECT_GT(counted.vertices, Effort(30));
  EXPECT_GT(counted.coplanar, Effort(30));
}

TEST_F(OracleTruth, EmptySceneMissesAndOneTriangleIsHit) {
  const rb_ray ray[] = {MakeRay({0.25f, 0.25f, 1}, {0, 0, -1})};
  const Scene empty = MakeScene({}, {});
  EXPECT_FALSE(MakeCgalOracle(empty)->Ask(ray, 1)[0].hit);
  const Scene one = MakeScene({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}});
  const Truth truth = MakeCgalOracle(one)->Ask(ray, 1)[0];
  EXPECT_TRUE(truth.hit);
  EXPECT_EQ(truth.t, 1);
  EXPECT_EQ(truth.tied, std::vector<uint32_t>{0});
  EXPECT_EQ(truth.feature, Feature::kInterior);
  EXPECT_EQ(MakeCgalOracle(one)->JudgeAny(ray[0], truth, true), Verdict::kExact);
}

TEST_F(OracleTruth, IntervalIsOpenAtTnearAndClosedAtTfar) {
  const Scene scene = MakeScene({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}});
  const auto oracle = MakeCgalOracle(scene);
  const auto hit = [&](float tnear, float tfar) {
    const rb_ray ray[] = {MakeRay({0.25f, 0.25f, 3}, {0, 0, -1}, tnear, tfar)};
    return oracle->Ask(ray, 1)[0].hit;
  };
  const float before = std::nextafter(3.0f, 0.0f), after = std::nextafter(3.0f, 4.0f);
  EXPECT_TRUE(hit(0, 3));
  EXPECT_FALSE(hit(0, before));
  EXPECT_FALSE(hit(3, kInf));
  EXPECT_TRUE(hit(before, kInf));
  EXPECT_TRUE(hit(before, 3));
  EXPECT_FALSE(hit(3, 3));
  EXPECT_FALSE(hit(after, 3));
  EXPECT_TRUE(hit(0, std::numeric_limits<float>::max()));
}

TEST_F(OracleTruth, CoincidentCopiesAreAllTied) {
  const Scene scene = MakeLatticeBox(1, {0, 0, 0}, 1, 5);
  const rb_ray rays[] = {MakeRay({0.5f, 0.25f, 0.5f}, {1, 0, 0})};
  const Truth truth = MakeCgalOracle(scene)->Ask(rays, 1)[0];
  EXPECT_EQ(truth.tied.size(), 5u);
  for (size_t i = 1; i < truth.tied.size(); ++i) EXPECT_EQ(truth.tied[i] - truth.tied[i - 1], 12u);
}

/// Is org + 2^k dir exact in double for some k? Then the ray can be handed to CGAL's EPICK kernel.
bool SomePowerIsExact(const rb_ray& ray) {
  for (int k = -300; k <= 300; ++k) {
    bool exact = true;
    for (int i = 0; i < 3; ++i) {
      double error;
      exact::TwoSum(ray.org[i], std::ldexp(double(ray.dir[i]), k), error);
      exact = exact && error == 0;
    }
    if (exact) return true;
  }
  return false;
}

TEST_F(OracleTruth, DirectionsThatDoubleSumsLoseStayExact) {
  // A wall whose edge stands at x = 1e9; whether a ray from below that edge meets it is told by a component
  // that is lost in any sum with 1e9, while the other components forbid to scale it up.
  const float far = 1e9f;
  const Scene scene =
      MakeScene({{far, 1, 0}, {far + 128, 1, 0}, {far + 128, 1, 1}, {far, 1, 1}}, {{0, 1, 2}, {0, 2, 3}});
  std::vector<rb_ray> rays;
  size_t scalable = 0, lost = 0;
  for (uint64_t i = 0; i < 900; ++i) {
    Random random(11, i);
    const float tiny = (random.NextFloat() - 0.5f) * 1e-9f, up = 1 + random.NextFloat();
    rays.push_back(MakeRay({far, random.NextFloat() * 1e-9f, random.NextFloat()}, {i % 3 ? tiny : 0, up, 0}));
    if (i % 4 == 0) rays.back().dir[1] *= -1;
    if (i % 5 == 0) rays.back().tfar = 1;
    if (i % 7 == 0) rays.back().dir[2] = rays.back().dir[0];
    (SomePowerIsExact(rays.back()) ? scalable : lost) += 1;
    rays.push_back(MakeRay({far - 64, 0.5f, 0.5f}, {1, tiny / 1000, std::nextafter(tiny, 1.0f)}));
  }
  EXPECT_GT(lost, 300u);
  EXPECT_GT(scalable, 100u);
  const Counted counted = ExpectSame(scene, rays);
  EXPECT_GT(counted.hits, 200u);
  EXPECT_GT(counted.edges, 50u);
}

TEST_F(OracleTruth, AuditFindsWhatIsFalse) {
  const Scene scene = MakeSheets(24, 6);
  const auto oracle = MakeCgalOracle(scene);
  const std::vector<rb_ray> rays = NastyRays(scene, 300, 10);
  const std::vector<Truth> truth = oracle->Ask(rays, 2);
  EXPECT_EQ(oracle->Audit(rays, truth, 1, 64), 64u);
  const auto at = std::find_if(truth.begin(), truth.end(), [](const Truth& t) {
    return t.hit && t.first != t.tied.front() && t.feature == Feature::kInterior;
  });
  ASSERT_NE(at, truth.end());
  const size_t i = size_t(at - truth.begin());
  const std::vector<void (*)(Truth&)> lies = {
      [](Truth& t) { t = {}; },
      [](Truth& t) { t.coplanar = true; },
      [](Truth& t) { t.t = std::nextafter(std::nextafter(t.t, 0.0), 0.0); },
      [](Truth& t) { t.t_rounded = std::nextafter(t.t_rounded, 0.0f); },
      [](Truth& t) { t.t_rounded = std::nextafter(t.t_rounded, kInf); },
      [](Truth& t) { t.first = t.tied.front(); },
      [](Truth& t) { t.tied.push_back(t.tied.back() + 1); },
      [](Truth& t) { t.tied = {t.first}; },
      [](Truth& t) { t.feature = Feature::kEdge; },
  };
  for (size_t lie = 0; lie < lies.size(); ++lie) {
    std::vector<Truth> falsified = truth;
    lies[lie](falsified[i]);
    try {
      oracle->Audit(rays, falsified, 1, rays.size());
      ADD_FAILURE() << "lie " << lie << " was not found";
    } catch (const std::logic_error& error) {
      EXPECT_THAT(error.what(),
                  ::testing::HasSubstr("oracle and audit disagree on ray " + std::to_string(i)));
      EXPECT_THAT(error.what(), ::testing::HasSubstr("tfar"));
    }
  }
  // A miss that is none, and hits outside of the interval.
  rb_ray shifted = rays[i];
  shifted.tnear = truth[i].t_rounded * 2;
  EXPECT_THROW(oracle->Audit(std::span(&shifted, 1), std::span(&truth[i], 1), 1, 1), std::logic_error);
  EXPECT_THROW(oracle->Audit(rays, std::span(truth).first(5), 1, 1), InputError);
  EXPECT_EQ(MakeBoxOracle(scene)->Audit(rays, truth, 1, 64), 0u);
}

TEST_F(OracleTruth, DoesNotDependOnThreads) {
  const Scene scene = MakeIcosphere(2);
  const std::vector<rb_ray> rays = NastyRays(scene, int(Effort(400)), 9);
  const auto oracle = MakeCgalOracle(scene);
  const auto one = oracle->Ask(rays, 1), two = oracle->Ask(rays, 2);
  for (size_t i = 0; i < rays.size(); ++i) EXPECT_EQ(one[i].tied, two[i].tied) << i;
}

/// Two ways to find candidates, one truth.
TEST_F(OracleTruth, TreeOfBoxesAgrees) {
  for (const Scene& scene :
       {MakeIcosphere(2), MakeLatticeBox(3, {0, 0, 0}, 1, 3), MakeLatticeSoup(150, 7), MakeSlivers(60, 8)}) {
    const std::vector<rb_ray> rays = NastyRays(scene, int(Effort(1000)), 13);
    const auto cgal = MakeCgalOracle(scene)->Ask(rays, 2), boxes = MakeBoxOracle(scene)->Ask(rays, 2);
    for (size_t i = 0; i < rays.size(); ++i) {
      ASSERT_EQ(cgal[i].tied, boxes[i].tied) << i;
      ASSERT_EQ(cgal[i].t, boxes[i].t) << i;
      // Behind a hit, the tree does not look for triangles whose plane holds the ray.
      if (!cgal[i].hit) {
        ASSERT_EQ(cgal[i].coplanar, boxes[i].coplanar) << i;
      }
      if (cgal[i].hit) {
        ASSERT_EQ(cgal[i].feature, boxes[i].feature) << i;
      }
    }
  }
}

TEST(OracleProcedural, SpheresNearAndFarSide) {
  Scene scene;
  scene.name = scene.provenance.source = "test";
  scene.spheres = {{{0, 0, 0}, 1}, {{5, 0, 0}, 2}, {{5, 0, 0}, 2}};
  scene.Finish();
  const auto oracle = MakeOracle(scene);
  EXPECT_TRUE(oracle->Exact());
  const rb_ray rays[] = {MakeRay({-3, 0, 0}, {2, 0, 0}), MakeRay({0, 0, 0}, {1, 0, 0}),
                         MakeRay({0, 0, 0}, {1, 0, 0}, 1), MakeRay({-3, 1.5f, 0}, {1, 0, 0}, 0, 5)};
  const auto truth = oracle->Ask(rays, 1);
  EXPECT_EQ(truth[0].t, 1);
  EXPECT_EQ(truth[0].tied, std::vector<uint32_t>{0});
  EXPECT_EQ(truth[1].t, 1);
  EXPECT_EQ(truth[2].t, 3);
  EXPECT_EQ(truth[2].tied, (std::vector<uint32_t>{1, 2}));
  EXPECT_FALSE(truth[3].hit);
  EXPECT_EQ(oracle->Judge(rays[0], truth[0], {1, 0, 0, 0}), Verdict::kExact);
  EXPECT_EQ(oracle->Judge(rays[2], truth[2], {3, 0, 0, 2}), Verdict::kTie);
  EXPECT_EQ(oracle->Judge(rays[0], truth[0], {2, 0, 0, 0}), Verdict::kWrong);  // the far side
  EXPECT_EQ(oracle->Judge(rays[0], truth[0], {kInf, 0, 0, RAYBENCH_NONE}), Verdict::kFalseMiss);
  EXPECT_EQ(oracle->JudgeAny(rays[3], truth[3], true), Verdict::kFalseHit);
  const rb_ray graze = MakeRay({-3, 1, 0}, {1, 0, 0}, 0, 4);
  const Truth grazed = oracle->Ask(std::span(&graze, 1), 1)[0];
  EXPECT_TRUE(grazed.hit);
  EXPECT_EQ(oracle->JudgeAny(graze, grazed, false), Verdict::kFalseMissMarginal);
}

TEST(Exact, ExpansionsAreExact) {
  for (uint64_t i = 0; i < 3000; ++i) {
    Random random(17, i);
    const auto number = [&] {
      return double(std::ldexp(random.NextFloat() - 0.5f, int(random.Below(80)) - 40));
    };
    const double a = number(), b = number(), c = number(), d = number();
    const auto value = [](const auto& e) {
      Int sum = 0;
      for (int k = 0; k < e.size; ++k) {
        int exponent;
        const Int m = int64_t(std::ldexp(std::frexp(e.term[k], &exponent), 53));
        sum += m << (exponent - 53 + 700);
      }
      return sum;
    };
    const auto e =
        exact::Difference(a, b) * exact::Difference(c, d) - exact::Difference(b, d) * exact::Difference(a, c);
    const Int A = ToInt(a), B = ToInt(b), C = ToInt(c), D = ToInt(d);
    const Int want = ((A - B) * (C - D) - (B - D) * (A - C)) << (700 - 320);
    EXPECT_EQ(value(e), want);
    EXPECT_EQ(value(exact::Compressed(e)), want);
    EXPECT_EQ(e.Sign(), want > 0 ? 1 : want < 0 ? -1 : 0);
  }
}

}  // namespace
}  // namespace raybench
