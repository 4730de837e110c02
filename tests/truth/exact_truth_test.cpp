// The truth about procedural primitives against textbook formulas in 700 bits, and cases by hand that double
// arithmetic gets wrong.
#include <gtest/gtest.h>

#include <boost/multiprecision/cpp_bin_float.hpp>
#include <optional>

#include "accel/host/registry.h"
#include "harness/truth/oracle.h"
#include "harness/truth/surd.h"
#include "harness/truth/verdict.h"
#include "tests/support/effort.h"
#include "tests/support/oracle_scenes.h"

namespace raybench::testing {
namespace {

namespace mp = boost::multiprecision;
using Real = mp::number<mp::cpp_bin_float<700, mp::digit_base_2>, mp::et_off>;
using RealVec = Vec3<Real>;

RealVec ToReal(Vec3f v) { return {Real(v.x), Real(v.y), Real(v.z)}; }
/// All roots and products here of inputs with exponents in [-30, 30] are exact to 2^-500 or so.
bool Same(const Real& a, const Real& b) { return abs(a - b) <= ldexp(abs(a) + abs(b), -300); }
bool IsZero(const Real& value, const Real& terms) { return abs(value) <= ldexp(terms, -300); }

struct Reference {
  const Scene& scene;
  RealVec o, d;
  Real tnear;
  std::optional<Real> tfar;
  bool coplanar = false;
  std::vector<std::pair<Real, uint32_t>> hits;

  Reference(const Scene& s, const rb_ray& ray)
      : scene(s), o(ToReal(LoadVec3(ray.org))), d(ToReal(LoadVec3(ray.dir))), tnear(ray.tnear) {
    if (!std::isinf(ray.tfar)) tfar = Real(ray.tfar);
    for (uint32_t prim = 0; prim < scene.primitive_count(); ++prim) {
      const auto [kind, i] = scene.Locate(prim);
      if (kind == PrimKind::kTriangle) Fan(prim, {scene.triangles[i].begin(), scene.triangles[i].end()});
      if (kind == PrimKind::kSphere) Ball(prim, scene.spheres[i]);
      if (kind == PrimKind::kCone) Side(prim, scene.cones[i]);
      if (kind == PrimKind::kPolygon) {
        const auto corners = scene.CornersOf(scene.polygons[i]);
        Fan(prim, {corners.begin(), corners.end()});
      }
    }
  }

  void Take(uint32_t prim, const Real& t) {
    if (Same(t, tnear) || t < tnear || (tfar && t > *tfar && !Same(t, *tfar))) return;
    hits.emplace_back(t, prim);
  }

  void Ball(uint32_t prim, const Sphere& s) {
    const RealVec f = o - ToReal(s.center);
    const Real a = Dot(d, d), b = 2 * Dot(f, d), c = Dot(f, f) - Real(s.radius) * s.radius;
    Real discriminant = b * b - 4 * a * c;
    if (IsZero(discriminant, b * b + abs(4 * a * c))) discriminant = 0;
    if (discriminant < 0) return;
    if (s.radius > 0) Take(prim, (-b - sqrt(discriminant)) / (2 * a));
    Take(prim, (-b + sqrt(discriminant)) / (2 * a));
  }

  /// In a frame of the axis: height along it, and what is across.
  void Side(uint32_t prim, const Cone& cone) {
    const RealVec base = ToReal(cone.base), axis = ToReal(cone.apex) - base;
    const Real length = sqrt(Dot(axis, axis)), r0 = abs(Real(cone.base_radius)),
               slope = (abs(Real(cone.apex_radius)) - r0) / length;
    const RealVec unit = axis * Real(1 / length), f = o - base;
    const Real height = Dot(f, unit), climb = Dot(d, unit);
    const RealVec across = f - unit * height, move = d - unit * climb;
    const Real r = r0 + slope * height, widen = slope * climb;
    Real a = Dot(move, move) - widen * widen, b = Dot(across, move) - r * widen,
         c = Dot(across, across) - r * r;
    const Real size = Dot(f, f) + length * length + r0 * r0;
    if (IsZero(a, Dot(d, d))) a = 0;
    if (IsZero(b, size * Dot(d, d))) b = 0;
    if (IsZero(c, size)) c = 0;
    const auto take = [&](const Real& t) {
      const Real at = height + t * climb;
      const Real scale = abs(height) + abs(t * climb) + length;
      if ((at < 0 && !IsZero(at, scale)) || (at > length && !IsZero(at - length, scale))) return;
      const Real leaving = a * t + b;
      if ((cone.base_radius < 0 || cone.apex_radius < 0) && leaving < 0 &&
          !IsZero(leaving, abs(a * t) + abs(b)))
        return;
      Take(prim, t);
    };
    if (a == 0 && b == 0) {
      if (c != 0) return;
      const Real t0 = -height / climb, t1 = (length - height) / climb;
      const Real first = t0 < t1 ? t0 : t1, last = t0 < t1 ? t1 : t0;
      coplanar =
          coplanar || (last > tnear && !Same(last, tnear) && (!tfar || first <= *tfar || Same(first, *tfar)));
      return;
    }
    if (a == 0) return take(-c / (2 * b));
    Real discriminant = b * b - a * c;
    if (IsZero(discriminant, b * b + abs(a * c))) discriminant = 0;
    if (discriminant < 0) return;
    take((-b - sqrt(discriminant)) / a), take((-b + sqrt(discriminant)) / a);
  }

  /// Triangles and polygons: the corners are projected along the ray onto a coordinate plane through
  /// the origin.
  void Fan(uint32_t prim, const std::vector<uint32_t>& corners) {
    int z = 0;
    for (int k = 1; k < 3; ++k)
      if (abs(d[k]) > abs(d[z])) z = k;
    const int x = (z + 1) % 3, y = (z + 2) % 3;
    const size_t n = corners.size();
    std::vector<RealVec> p;
    std::vector<std::pair<Real, Real>> flat;
    RealVec mean{0, 0, 0}, normal{0, 0, 0}, lo, hi;
    for (uint32_t v : corners) {
      const RealVec a = ToReal(scene.positions[v]) - o;
      lo = p.empty() ? a : Min(lo, a);
      hi = p.empty() ? a : Max(hi, a);
      p.push_back(a), mean = mean + a;
      flat.emplace_back(a[x] * d[z] - a[z] * d[x], a[y] * d[z] - a[z] * d[y]);  // exact
    }
    bool inside = false, on = false;
    for (size_t i = 0; i < n; ++i) {
      const auto& [ax, ay] = flat[i];
      const auto& [bx, by] = flat[(i + 1) % n];
      const RealVec &a = p[i], &b = p[(i + 1) % n];
      normal =
          normal + RealVec{(a.y - b.y) * (a.z + b.z), (a.z - b.z) * (a.x + b.x), (a.x - b.x) * (a.y + b.y)};
      const Real cross = ax * by - ay * bx;
      if (cross == 0 && ax * bx <= 0 && ay * by <= 0) on = true;
      if ((ay > 0) != (by > 0) && (cross > 0) == (by > 0)) inside = !inside;
    }
    if (!inside && !on) return;
    std::optional<Real> near, far;
    for (int k = 0; k < 3; ++k) {
      if (d[k] == 0) continue;
      const Real a = lo[k] / d[k], b = hi[k] / d[k];
      near = near ? std::max(*near, std::min(a, b)) : std::min(a, b),
      far = far ? std::min(*far, std::max(a, b)) : std::max(a, b);
    }
    const Real toward = Dot(normal, d), away = Dot(normal, mean);  // exact
    if (toward == 0 && away == 0) {
      coplanar = coplanar || (*far > tnear && !Same(*far, tnear) && (!tfar || *near <= *tfar));
    } else {
      const Real t = toward == 0 ? *near : Real(away / (toward * Real(n)));
      Take(prim, t < *near ? *near : t > *far ? *far : t);
    }
  }
};

/// Primitives on a small lattice, moved by `shift`: many tangents, ties, rims and corners.
Scene LatticeScene(uint64_t seed, Vec3f shift) {
  Random random(seed);
  Scene scene;
  scene.name = scene.provenance.source = "lattice";
  const auto point = [&] {
    return Vec3f{float(random.Below(7)), float(random.Below(7)), float(random.Below(7))} + shift;
  };
  for (uint32_t i = 0; i < 8; ++i) {
    const uint32_t first = uint32_t(scene.positions.size());
    for (int k = 0; k < 3; ++k) scene.positions.push_back(point());
    scene.triangles.push_back({first, first + 1, first + 2});
  }
  for (int i = 0; i < 10; ++i)
    scene.spheres.push_back({point(), float(1 + random.Below(3)) * (i % 4 ? 1.0f : -1.0f)});
  for (size_t i = 0; i < 5; ++i) scene.spheres.push_back(scene.spheres[i]);
  for (int i = 0; i < 14; ++i) {
    const Vec3f base = point();
    Vec3f axis{0, 0, 0};
    axis[int(random.Below(3))] = float(1 + random.Below(4));
    if (i % 2) axis = Vec3f{float(random.Below(3)), 3, float(random.Below(3))};
    const float r = float(1 + random.Below(3)) * (i % 4 ? 1.0f : -1.0f);
    scene.cones.push_back({base, r, base + axis, i % 3 == 0 ? 0 : i % 3 == 1 ? r : 2 * r});
  }
  for (int i = 0; i < 10; ++i) {
    const uint32_t first = uint32_t(scene.polygon_vertices.size()), count = 4 + random.Below(3);
    const int flat = int(random.Below(3));
    Vec3f a = point();
    for (uint32_t k = 0; k < count; ++k) {
      Vec3f p = point();
      if (i % 3) p[flat] = a[flat];
      scene.polygon_vertices.push_back(uint32_t(scene.positions.size()));
      scene.positions.push_back(p);
    }
    scene.polygons.push_back({first, count});
  }
  scene.Finish(true);
  return scene;
}

std::vector<rb_ray> LatticeRays(const Scene& scene, uint64_t seed, int count, Vec3f shift) {
  Random random(seed);
  std::vector<rb_ray> rays;
  for (int i = 0; i < count; ++i) {
    const auto lattice = [&](int lo, int size) {
      return Vec3f{float(lo + int(random.Below(size))), float(lo + int(random.Below(size))),
                   float(lo + int(random.Below(size)))};
    };
    Vec3f org = lattice(-4, 15) + shift, dir = lattice(-2, 5);
    if (i % 3 == 1) {
      // Aimed at a tangent point of a sphere, or beside it by an ulp.
      const Sphere& s = scene.spheres[random.Below(scene.spheres.size())];
      const Vec3d axis = random.UnitVector(), across = Normalize(Cross(axis, random.UnitVector()));
      const double away = i % 2 ? 4 : 1e6;
      org = ToFloat(ToDouble(s.center) + axis * std::fabs(double(s.radius)) - across * away);
      dir = ToFloat(ToDouble(s.center) + axis * std::fabs(double(s.radius)) - ToDouble(org));
    }
    if (i % 3 == 2) dir = lattice(0, 7) + shift - org;
    rb_ray ray = MakeRay(org, dir);
    if (i % 5 == 3)
      ray.tnear = float(random.Below(4)), ray.tfar = ray.tnear + float(1 + random.Below(3)) * 0.5f;
    if (IsValidRay(ray)) rays.push_back(ray);
  }
  return rays;
}

class ExactTruthAgainstReference : public ::testing::TestWithParam<float> {};

TEST_P(ExactTruthAgainstReference, AgreesInEverything) {
  const Vec3f shift = Vec3f{1, -1, 1} * GetParam();
  uint64_t hits = 0, ties = 0, coplanar = 0;
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    const Scene scene = LatticeScene(seed, shift);
    const std::vector<rb_ray> rays = LatticeRays(scene, 100 + seed, int(Effort(250)), shift);
    for (const auto& oracle : {MakeOracle(scene), MakeBoxOracle(scene)}) {
      const auto truth = oracle->Ask(rays, 1);
      for (size_t i = 0; i < rays.size(); ++i) {
        const std::string where = oracle->Name() + " ray " + std::to_string(i);
        Reference reference(scene, rays[i]);
        const Truth& got = truth[i];
        ASSERT_EQ(got.hit, !reference.hits.empty()) << where;
        if (!got.hit) {
          ASSERT_EQ(got.coplanar, reference.coplanar) << where;
          continue;
        }
        const Real t = std::min_element(reference.hits.begin(), reference.hits.end())->first;
        const auto rounded = [&](const Real& at) { return AnswerableT(static_cast<float>(at), rays[i]); };
        std::vector<uint32_t> tied;
        uint32_t first = RAYBENCH_NONE;
        for (const auto& [at, prim] : reference.hits) {
          if (Same(at, t) && (tied.empty() || tied.back() != prim)) tied.push_back(prim);
          if (rounded(at) == rounded(t)) first = std::min(first, prim);
        }
        ASSERT_EQ(got.tied, tied) << where;
        ASSERT_EQ(got.t, static_cast<double>(t)) << where;
        ASSERT_EQ(got.t_rounded, rounded(t)) << where;
        ASSERT_EQ(got.first, first) << where;
        ++hits, ties += tied.size() > 1, coplanar += got.coplanar;
      }
    }
  }
  EXPECT_GT(hits, Effort(600));
  EXPECT_GT(ties, Effort(100));
  EXPECT_GT(coplanar, Effort(10));
}
INSTANTIATE_TEST_SUITE_P(Shifts, ExactTruthAgainstReference, ::testing::Values(0.0f, 4096.0f));

Truth TruthOf(const Scene& scene, const rb_ray& ray) {
  return MakeOracle(scene)->Ask(std::span(&ray, 1), 1)[0];
}

Scene Finished(Scene scene) {
  scene.name = scene.provenance.source = "test";
  scene.Finish();
  return scene;
}

float Above(float x) { return std::nextafter(x, kInf); }
float Below(float x) { return std::nextafter(x, -kInf); }

TEST(ExactTruth, GrazingSpheres) {
  Scene scene;
  scene.spheres = {{{0, 0, 0}, 1}};
  scene = Finished(std::move(scene));
  const auto along = [](float y, float x) { return MakeRay({x, y, 0}, {1, 0, 0}); };
  for (const float x : {-3.0f, -1e6f, -0x1p29f}) {
    EXPECT_EQ(TruthOf(scene, along(1, x)).t, -double(x)) << "tangent from " << x;
    EXPECT_FALSE(TruthOf(scene, along(Above(1), x)).hit) << x;
    // 1 - (1 - 2^-24)^2 = 2^-23 - 2^-48
    const Truth inside = TruthOf(scene, along(Below(1), x));
    EXPECT_EQ(inside.t, -double(x) - std::sqrt(0x1p-23 - 0x1p-48)) << x;
  }
  // The direction's smallest change, 1e6 away.
  const float slope = 0x1p-60f;
  EXPECT_FALSE(TruthOf(scene, MakeRay({-1e6f, 1, 0}, {1, slope, 0})).hit);
  EXPECT_TRUE(TruthOf(scene, MakeRay({-1e6f, 1, 0}, {1, -slope, 0})).hit);
}

TEST(ExactTruth, SpheresTiedAndNearlySo) {
  // Along x all are entered at 5 - sqrt(3), the last but one by less than 2^-23 later.
  Scene scene;
  scene.spheres = {{{5, 1, 0}, 2}, {{5, -1, 0}, 2}, {{5, 3, 2}, 4}, {{5, 1, 0}, Below(2)}, {{5, 0, 1}, 2}};
  scene = Finished(std::move(scene));
  const rb_ray ray = MakeRay({0, 0, 0}, {1, 0, 0});
  Truth truth = TruthOf(scene, ray);
  EXPECT_EQ(truth.tied, (std::vector<uint32_t>{0, 1, 2, 4}));
  EXPECT_EQ(truth.t, 5 - std::sqrt(3.0));
  EXPECT_EQ(truth.first, 0u);
  // Equal when rounded, to double too, but not equal: the lower id is the farther one.
  Scene close;
  close.spheres = {{{0x1p20f, 1, 0}, Below(2)}, {{0x1p20f, 1, 0}, 2}};
  close.spheres[0].center.y = 0x1.000002p0f, close.spheres[0].radius = 2;
  close = Finished(std::move(close));
  truth = TruthOf(close, MakeRay({-0x1p29f, 0, 0}, {1, 0, 0}));
  EXPECT_EQ(truth.tied, std::vector<uint32_t>{1});
  EXPECT_EQ(truth.first, 0u);
  EXPECT_EQ(truth.t_rounded, 0x1p29f + 0x1p20f);
}

TEST(ExactTruth, SphereTiedWithTriangle) {
  Scene scene;
  scene.positions = {{2, -1, -1}, {2, 2, -1}, {2, -1, 2}};
  scene.triangles = {{0, 1, 2}};
  scene.spheres = {{{3, 0, 0}, 1}};
  scene = Finished(std::move(scene));
  const Truth truth = TruthOf(scene, MakeRay({-1e6f, 0, 0}, {1, 0, 0}));
  EXPECT_EQ(truth.tied, (std::vector<uint32_t>{0, 1}));
  EXPECT_EQ(truth.t, 1e6 + 2);
  // Beside the point of contact the triangle is in front by 2^-61, which no double shows.
  const Truth beside = TruthOf(scene, MakeRay({0, 0x1p-30f, 0}, {1, 0, 0}));
  EXPECT_EQ(beside.tied, std::vector<uint32_t>{0});
  EXPECT_EQ(beside.t, 2);
  // ... and from the other side the sphere is left after it.
  EXPECT_EQ(TruthOf(scene, MakeRay({2.5f, 0x1p-30f, 0}, {-1, 0, 0})).tied, std::vector<uint32_t>{1});
}

TEST(ExactTruth, TinySpheres) {
  Scene scene;
  scene.spheres = {{{1, 1, 1}, 0x1p-100f}, {{8, 0, 0}, 1}};
  scene = Finished(std::move(scene));
  EXPECT_EQ(TruthOf(scene, MakeRay({0, 0, 0}, {1, 1, 1})).tied, std::vector<uint32_t>{0});
  EXPECT_FALSE(TruthOf(scene, MakeRay({0, 0, 0}, {1, 1, Above(1)})).hit);
  EXPECT_EQ(TruthOf(scene, MakeRay({-1e6f, 1, 1}, {1, 0, 0})).t, 1e6 + 1);
}

TEST(ExactTruth, ApexAndRims) {
  Scene scene;
  // Two cylinders on each other, a cone with its apex at (0, 0, 9).
  scene.cones = {{{0, 0, 0}, 1, {0, 0, 2}, 1}, {{0, 0, 2}, 1, {0, 0, 4}, 1}, {{0, 0, 6}, 2, {0, 0, 9}, 0}};
  scene = Finished(std::move(scene));
  for (const float x : {-3.0f, -1e6f}) {
    const Truth rim = TruthOf(scene, MakeRay({x, 0, 2}, {1, 0, 0}));
    EXPECT_EQ(rim.tied, (std::vector<uint32_t>{0, 1}));
    EXPECT_EQ(rim.feature, Feature::kEdge);
    EXPECT_EQ(TruthOf(scene, MakeRay({x, 0, Below(2)}, {1, 0, 0})).tied, std::vector<uint32_t>{0});
    EXPECT_EQ(TruthOf(scene, MakeRay({x, 0, Above(2)}, {1, 0, 0})).tied, std::vector<uint32_t>{1});
    EXPECT_EQ(TruthOf(scene, MakeRay({x, 0, 9}, {1, 0, 0})).t, -double(x));
    EXPECT_FALSE(TruthOf(scene, MakeRay({x, 0, Above(9)}, {1, 0, 0})).hit);
  }
  // Down through the apex, inside the cone: only the apex is met, then the cone is left by its open end.
  const Truth apex = TruthOf(scene, MakeRay({0.25f, 0.125f, 12}, {-0.25f, -0.125f, -3}));
  EXPECT_EQ(apex.t, 1);
  EXPECT_EQ(apex.tied, std::vector<uint32_t>{2});
  EXPECT_EQ(apex.feature, Feature::kEdge);
}

TEST(ExactTruth, RayInAConesSide) {
  Scene scene;
  scene.cones = {{{0, 0, 0}, 5, {0, 0, 4}, 5}, {{0, 0, 10}, 3, {0, 0, 14}, 0}};
  scene = Finished(std::move(scene));
  const auto oracle = MakeOracle(scene);
  const auto judge = [&](const rb_ray& ray, float t, uint32_t prim) {
    const Truth truth = oracle->Ask(std::span(&ray, 1), 1)[0];
    return std::string(VerdictName(oracle->Judge(ray, truth, {t, 0, 0, prim})));
  };
  const rb_ray up = MakeRay({3, 4, -2}, {0, 0, 1}, 0, 9), slant = MakeRay({3, 0, 10}, {-3, 0, 4}, 0, 0.5f);
  for (const rb_ray& ray : {up, slant}) {
    const Truth truth = oracle->Ask(std::span(&ray, 1), 1)[0];
    EXPECT_TRUE(truth.coplanar);
    EXPECT_FALSE(truth.hit);
    EXPECT_EQ(judge(ray, ray.tfar, RAYBENCH_NONE), "exact");
  }
  EXPECT_EQ(judge(up, 3, 0), "exact");
  EXPECT_EQ(judge(up, 7, 0), "false_hit");
  EXPECT_EQ(judge(slant, 0.25f, 1), "exact");
  EXPECT_FALSE(TruthOf(scene, MakeRay({3, 4, -2}, {0, 0, 1}, 0, 1.5f)).coplanar) << "ends before it";
  EXPECT_FALSE(TruthOf(scene, MakeRay({3, 4, -2}, {0, 0, 1}, 6, 9)).coplanar) << "begins behind it";
}

TEST(ExactTruth, PolygonCornersAndEdges) {
  Scene scene;
  scene.positions = {{0, 0, 0}, {4, 0, 0}, {4, 4, 0}, {2, 1, 0}, {0, 4, 0}};
  scene.polygon_vertices = {0, 1, 2, 3, 4};
  scene.polygons = {{0, 5}};
  scene = Finished(std::move(scene));
  const auto down = [&](float x, float y) { return TruthOf(scene, MakeRay({x, y, 1e6f}, {0, 0, -1})); };
  EXPECT_EQ(down(2, 1).feature, Feature::kVertex);
  EXPECT_EQ(down(4, 4).feature, Feature::kVertex);
  EXPECT_EQ(down(3, 2.5f).feature, Feature::kEdge);
  EXPECT_EQ(down(4, 3).feature, Feature::kEdge);
  EXPECT_EQ(down(1, 1).feature, Feature::kInterior);
  EXPECT_EQ(down(1, 1).t, 1e6);
  EXPECT_FALSE(down(2, Above(1)).hit) << "in the notch";
  EXPECT_FALSE(down(3, Above(2.5f)).hit);
  EXPECT_TRUE(down(3, Below(2.5f)).hit);
  EXPECT_FALSE(down(Above(4), 2).hit);
}

TEST(ExactTruth, IntervalEnds) {
  Scene scene;
  scene.spheres = {{{3, 0, 0}, 1}, {{30, 1, 0}, 2}};
  scene = Finished(std::move(scene));
  const auto between = [&](float tnear, float tfar) {
    return TruthOf(scene, MakeRay({0, 0, 0}, {1, 0, 0}, tnear, tfar));
  };
  EXPECT_EQ(between(0, 2).t, 2) << "tfar belongs to the interval";
  EXPECT_FALSE(between(0, Below(2)).hit);
  EXPECT_EQ(between(2, 9).t, 4) << "tnear does not";
  EXPECT_FALSE(between(4, 9).hit);
  EXPECT_TRUE(between(Below(4), 9).hit);
  // The second is entered at 30 - sqrt(3), between two floats: what rounds to tnear is answered above it.
  const double t = 30 - std::sqrt(3.0);
  const float nearest = float(t), under = nearest < t ? nearest : Below(nearest);
  EXPECT_FALSE(between(5, under).hit);
  EXPECT_TRUE(between(5, Above(under)).hit);
  EXPECT_EQ(between(under, 40).t, t);
  EXPECT_EQ(between(under, 40).t_rounded, nearest == under ? Above(under) : nearest);
  EXPECT_EQ(between(Above(under), 40).t, 30 + std::sqrt(3.0));
}

TEST(ExactTruth, SurdsCompareAndRound) {
  const Surd root2(0, 1, 2, 1), three_halves(3, 2);
  EXPECT_EQ(Compare(root2, three_halves), -1);
  EXPECT_EQ(Compare(root2, Surd(0, -1, 2, -1)), 0);
  EXPECT_EQ(Compare(Surd(1, 1, 2, 1), Surd(0, 1, 6, 1)), -1) << "2.4142 < 2.4495";
  EXPECT_EQ(Compare(Surd(5, -1, 24, 1), Surd(-3, 1, 10, 1)), -1) << "0.1010 < 0.1623";
  EXPECT_EQ(Compare(Surd(7, 1, 8, 1), Surd(14, 1, 32, 2)), 0);
  EXPECT_EQ(Round<double>(root2), std::sqrt(2.0));
  EXPECT_EQ(Round<float>(root2), std::sqrt(2.0f));
  // sqrt(n^2 + 1) - n without cancellation.
  const Int n = Int(1) << 200;
  EXPECT_EQ(Round<double>(Surd(-n, 1, Int(n * n + 1), 1)), 0x1p-201);
  // Middles between floats go to the even one, and a hair decides.
  const Int one = Int(1) << 24;
  EXPECT_EQ(Round<float>(Surd(Int(one + 1), one)), 1.0f);
  EXPECT_EQ(Round<float>(Surd(Int(one + 3), one)), 1 + 0x1p-22f);
  const Int fine = Int(1) << 400;
  EXPECT_EQ(Round<float>(Surd(Int((one + 1) * fine + 1), Int(one * fine))), 1 + 0x1p-23f);
  EXPECT_EQ(Round<float>(Surd(Int((one + 3) * fine - 1), Int(one * fine))), 1 + 0x1p-23f);
  EXPECT_EQ(Round<double>(Surd(Int((Int(1) << 53) + 1), Int(Int(1) << 53))), 1.0);
}

}  // namespace
}  // namespace raybench::testing
