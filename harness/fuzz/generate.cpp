#include "harness/fuzz/generate.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "accel/contract/valid_ray.h"
#include "accel/host/compatible.h"
#include "accel/host/parameters.h"
#include "harness/fuzz/lattice.h"
#include "harness/rays/aim.h"
#include "harness/truth/mesh_edges.h"

namespace raybench::fuzz {
namespace {

constexpr float kInf = std::numeric_limits<float>::infinity();
constexpr double kFarthest = 0x1p29;
constexpr size_t kRays = 40;

double Between(Random& random, double lo, double hi) { return lo + random.NextDouble() * (hi - lo); }
int Integer(Random& random, int lo, int hi) { return lo + int(random.Below(uint64_t(hi - lo + 1))); }
float SignedZero(Random& random) { return random.Below(2) ? 0.0f : -0.0f; }
/// 2^e with e uniform, times something in [1, 2), of either sign.
double LogUniform(Random& random, int lo, int hi) {
  const double x = std::ldexp(1 + random.NextDouble(), Integer(random, lo, hi - 1));
  return random.Below(2) ? x : -x;
}
/// Small numbers are likelier, up to `most`.
size_t Few(Random& random, size_t most) {
  const size_t bound = size_t{1} << random.Below(uint64_t(std::ilogb(double(most))) + 1);
  return 1 + size_t(random.Below(std::min(most, 2 * bound)));
}

class Builder {
 public:
  explicit Builder(Random& random, Case begun = {}) : random_(random), case_(std::move(begun)) {}

  /// Rays at what there is.
  std::vector<rb_ray> Rays(size_t count) {
    case_.rays.clear();
    while (case_.rays.size() < count && case_.primitives() > 0)
      case_.exact ? LatticeRay(kLattice) : AimedRay();
    return case_.rays;
  }

  // ---- exact ----

  Case Exact() {
    case_.exact = true;
    const int reach =
        Integer(random_, random_.Below(4) == 0 ? 1 : 5, kLattice);  // the larger, the less is touched
    const auto number = [&] { return float(Integer(random_, -reach, reach)); };
    const size_t count = Few(random_, random_.Below(16) == 0 ? 600 : 60);
    for (size_t i = 0; i < count; ++i) {
      Vec3f p[3];
      for (Vec3f& q : p) q = {number(), number(), number()};
      if (random_.Below(2)) {  // in a plane of the lattice, where splits and cell walls are
        const int axis = Integer(random_, 0, 2);
        p[1][axis] = p[2][axis] = p[0][axis];
      }
      Triangle(p[0], p[1], p[2]);
      if (random_.Below(6) == 0) Copies();
    }
    for (size_t i = 0; i < kRays; ++i) LatticeRay(reach);
    return Finish();
  }

  // ---- chaotic ----

  Case Chaotic() {
    const uint64_t size_class = random_.Below(24);
    const size_t most = size_class == 0 ? 2000 : size_class < 6 ? 200 : 24;
    const size_t parts = 1 + random_.Below(3);
    const bool plain = random_.Below(2) != 0;  // one scale for all
    scale_ = std::ldexp(1.0, plain ? 0 : Integer(random_, -24, 24));
    offset_ = Vec3d{0, 0, 0};
    if (random_.Below(3) == 0)
      for (int k = 0; k < 3; ++k) offset_[k] = scale_ * LogUniform(random_, -3, 18);
    for (size_t i = 0; i < parts; ++i) {
      if (!plain && random_.Below(3) == 0) scale_ *= std::ldexp(1.0, Integer(random_, -12, 12));
      Part(Few(random_, most));
    }
    if (case_.primitives() == 0) Part(1);
    for (size_t i = 0; i < kRays; ++i) AimedRay();
    return Finish();
  }

 private:
  void Part(size_t n) {
    switch (random_.Below(13)) {
      case 0:
        return Soup(n, 1);
      case 1:
        return Soup(n, 0.05);
      case 2:
        return Ball(n);
      case 3:
        return Fan(n);
      case 4:
        return Sheet(n);
      case 5:
        return Slivers(n);
      case 6:
        return FlatBoxes(n);
      case 7:
        return Magnitudes(n);
      case 8:
        return Shells(n);
      case 9:
        return Nested(n);
      case 10:
        return Procedural(n);
      case 11:
        return Chain(n);
      default:
        Soup(std::max<size_t>(1, n / 8), 1);
        return Copies();
    }
  }

  Vec3f At(Vec3d p) const {
    Vec3f q;
    for (int k = 0; k < 3; ++k) q[k] = float(std::clamp(offset_[k] + scale_ * p[k], -kFarthest, kFarthest));
    return q;
  }
  Vec3d InCube() { return {Between(random_, -1, 1), Between(random_, -1, 1), Between(random_, -1, 1)}; }
  uint32_t Vertex(Vec3f p) {
    case_.positions.push_back(p);
    return uint32_t(case_.positions.size() - 1);
  }
  void Triangle(Vec3f a, Vec3f b, Vec3f c) {
    const uint32_t i = Vertex(a), j = Vertex(b), k = Vertex(c);
    case_.triangles.push_back({i, j, k});
  }

  void Soup(size_t n, double size) {
    for (size_t i = 0; i < n; ++i) {
      const Vec3d p = InCube();
      Triangle(At(p), At(p + InCube() * size), At(p + InCube() * size));
    }
  }
  /// Closed: an octahedron or a finer one.
  void Ball(size_t n) {
    const int level = n > 60 ? 2 : n > 12 ? 1 : 0;
    const Vec3d center = InCube() * 0.2;
    const Vec3d axes[3] = {random_.UnitVector(), random_.UnitVector(), random_.UnitVector()};
    const bool aligned = random_.Below(2) != 0;
    const int steps = 1 << level;
    std::vector<std::vector<uint32_t>> faces(8);
    // Points of a lattice on each face of |x|+|y|+|z| = 1; shared ones have the same bits.
    const auto at = [&](int octant, int i, int j) {
      Vec3d p{double(i) / steps, double(j) / steps, double(steps - i - j) / steps};
      for (int k = 0; k < 3; ++k)
        if ((octant >> k & 1) != 0) p[k] = -p[k];
      if (level > 0) p = p * (1 / Length(p));
      if (!aligned) p = axes[0] * p.x + axes[1] * p.y + axes[2] * p.z;
      return At(center + p);
    };
    for (int octant = 0; octant < 8; ++octant)
      for (int i = 0; i < steps; ++i)
        for (int j = 0; i + j < steps; ++j) {
          Triangle(at(octant, i, j), at(octant, i + 1, j), at(octant, i, j + 1));
          if (i + j + 1 < steps)
            Triangle(at(octant, i + 1, j), at(octant, i + 1, j + 1), at(octant, i, j + 1));
        }
  }
  /// Around a vertex, closed or open.
  void Fan(size_t n) {
    n = std::clamp<size_t>(n, 3, 40);
    const Vec3d center = InCube();
    std::vector<Vec3d> rim;
    for (size_t i = 0; i < n; ++i) rim.push_back(center + random_.UnitVector() * Between(random_, 0.1, 1));
    const size_t end = random_.Below(2) ? n : n - 1;
    for (size_t i = 0; i < end; ++i) Triangle(At(center), At(rim[i]), At(rim[(i + 1) % n]));
  }
  /// A height field of few cells; often flat, and its plane on a coordinate.
  void Sheet(size_t n) {
    const int side = std::clamp(int(std::sqrt(double(n) / 2)), 1, 20), up = Integer(random_, 0, 2);
    const double height = random_.Below(2) ? 0 : Between(random_, 0, 0.5),
                 level = random_.Below(2) ? 0 : InCube().x;
    std::vector<Vec3f> points;
    for (int i = 0; i <= side; ++i)
      for (int j = 0; j <= side; ++j) {
        Vec3d p;
        p[up] = level + height * Between(random_, -1, 1);
        p[(up + 1) % 3] = double(i) / side, p[(up + 2) % 3] = double(j) / side;
        points.push_back(At(p));
      }
    const auto at = [&](int i, int j) { return points[size_t(i * (side + 1) + j)]; };
    for (int i = 0; i < side; ++i)
      for (int j = 0; j < side; ++j) {
        Triangle(at(i, j), at(i + 1, j), at(i + 1, j + 1));
        Triangle(at(i, j), at(i + 1, j + 1), at(i, j + 1));
      }
  }
  void Slivers(size_t n) {
    for (size_t i = 0; i < n; ++i) {
      const Vec3d p = InCube(), along = random_.UnitVector();
      const double width = std::fabs(LogUniform(random_, -30, -4));
      Triangle(At(p), At(p + along), At(p + along * Between(random_, 0, 1) + random_.UnitVector() * width));
    }
  }
  /// Boxes on coordinates, some without thickness.
  void FlatBoxes(size_t n) {
    for (size_t b = 0; b < std::max<size_t>(1, n / 12); ++b) {
      Vec3d lo = InCube(), hi = lo + (InCube() + Vec3d{1.1, 1.1, 1.1}) * 0.5;
      for (int k = 0; k < 3; ++k)
        if (random_.Below(3) == 0) lo[k] = std::round(4 * lo[k]) / 4, hi[k] = lo[k] + 0.5;
      if (random_.Below(2)) {
        const int axis = Integer(random_, 0, 2);
        hi[axis] = lo[axis] + (random_.Below(2) ? 0 : std::fabs(LogUniform(random_, -30, -10)));
        if (random_.Below(3) == 0) lo[axis] = hi[axis] = 0;
      }
      const Vec3f a = At(lo), z = At(hi);
      for (int axis = 0; axis < 3; ++axis)
        for (int side = 0; side < 2; ++side) {
          Vec3f p[4];
          for (int corner = 0; corner < 4; ++corner) {
            const int u = (axis + 1) % 3, v = (axis + 2) % 3;
            p[corner][axis] = side ? z[axis] : a[axis];
            p[corner][u] = (corner == 1 || corner == 2) ? z[u] : a[u];
            p[corner][v] = corner >= 2 ? z[v] : a[v];
          }
          Triangle(p[0], p[1], p[2]), Triangle(p[0], p[2], p[3]);
        }
    }
  }
  /// Each coordinate of a magnitude of its own, down to subnormal numbers, and zeros.
  void Magnitudes(size_t n) {
    const int lo = random_.Below(2) ? -149 : -40, hi = Integer(random_, -4, 29);
    const auto number = [&] {
      return random_.Below(6) == 0 ? SignedZero(random_) : float(LogUniform(random_, lo, hi));
    };
    for (size_t i = 0; i < n; ++i) {
      Vec3f p[3];
      for (Vec3f& q : p) q = {number(), number(), number()};
      if (random_.Below(3) == 0)
        for (int k = 0; k < 3; ++k) p[2][k] = std::nextafter(p[0][k], random_.Below(2) ? kInf : -kInf);
      Triangle(p[0], p[1], p[2]);
    }
  }
  /// Sheets some ulps apart.
  void Shells(size_t n) {
    const Vec3d a = InCube(), b = InCube(), c = InCube();
    const Vec3f p[3] = {At(a), At(b), At(c)};
    const int steps = Integer(random_, 0, 4), axis = Integer(random_, 0, 2);
    for (size_t i = 0; i < n; ++i) {
      Vec3f q[3] = {p[0], p[1], p[2]};
      for (Vec3f& v : q)
        for (size_t k = 0; k < i % 64 * size_t(steps); ++k) v[axis] = std::nextafter(v[axis], kInf);
      Triangle(q[0], q[1], q[2]);
    }
  }
  /// Each a fraction of the last, about one point: deep trees.
  void Nested(size_t n) {
    const Vec3d center = InCube(), shape[3] = {InCube(), InCube(), InCube()};
    const double ratio = Between(random_, 0.3, 0.95);
    double size = 1;
    for (size_t i = 0; i < n; ++i, size *= ratio) {
      Triangle(At(center + shape[0] * size), At(center + shape[1] * size), At(center + shape[2] * size));
      if (size < 1e-30) size = 1;
    }
  }
  /// Along a line with distances that double: unbalanced by any split in the middle.
  void Chain(size_t n) {
    const int axis = Integer(random_, 0, 2);
    const Vec3d size = InCube() * 0.3;
    double at = 0x1p-20;
    for (size_t i = 0; i < std::min<size_t>(n, 200); ++i) {
      Vec3d p{0, 0, 0};
      p[axis] = at;
      Triangle(At(p), At(p + Vec3d{size.x, size.y, 0} * at), At(p + Vec3d{0, size.y, size.z} * at));
      at *= i % 40 == 39 ? 0x1p-40 : 2;
    }
  }
  void Procedural(size_t n) {
    for (size_t i = 0; i < std::min<size_t>(n, 40); ++i) {
      const Vec3f center = At(InCube()), other = At(InCube());
      const auto radius = [&] { return float(scale_ * Between(random_, 0.01, 0.5)); };
      switch (random_.Below(4)) {
        case 0:
        case 1:
          case_.spheres.push_back({center, random_.Below(8) == 0 ? -radius() : radius()});
          break;
        case 2: {
          if (center == other) break;
          const float r = radius();
          case_.cones.push_back({center, r, other,
                                 random_.Below(3) == 0 ? 0
                                 : random_.Below(2)    ? r
                                                       : radius()});
          break;
        }
        default: {
          // Convex and flat, on a coordinate.
          const int corners = Integer(random_, 3, 7), axis = Integer(random_, 0, 2);
          std::vector<uint32_t> polygon;
          for (int k = 0; k < corners; ++k) {
            // On a parabola, so no libm function is needed.
            const double s = 2.0 * k / (corners - 1) - 1;
            Vec3f p = center;
            p[(axis + 1) % 3] = float(p[(axis + 1) % 3] + scale_ * 0.4 * s);
            p[(axis + 2) % 3] = float(p[(axis + 2) % 3] + scale_ * 0.4 * s * s);
            polygon.push_back(Vertex(p));
          }
          case_.polygons.push_back(polygon);
        }
      }
    }
  }
  /// Some of the triangles once more, as they are or turned.
  void Copies() {
    if (case_.triangles.empty()) return;
    const size_t n = 1 + random_.Below(6);
    for (size_t i = 0; i < n; ++i) {
      auto t = case_.triangles[random_.Below(case_.triangles.size())];
      if (random_.Below(3) == 0) std::rotate(t.begin(), t.begin() + 1, t.end());
      if (random_.Below(6) == 0) std::swap(t[0], t[1]);
      case_.triangles.push_back(t);
    }
  }

  // ---- rays ----

  void Ray(Vec3f org, Vec3f dir) {
    const rb_ray ray{{org.x, org.y, org.z}, 0, {dir.x, dir.y, dir.z}, kInf};
    if (IsValidRay(ray)) case_.rays.push_back(ray);
  }

  /// A vertex, a point of an edge, or one inside; of a procedural primitive a point near it.
  Vec3f Target() {
    const size_t i = random_.Below(case_.primitives());
    if (i >= case_.triangles.size()) {
      const size_t k = i - case_.triangles.size();
      if (k < case_.spheres.size()) {
        const Sphere& s = case_.spheres[k];
        return ToFloat(ToDouble(s.center) +
                       random_.UnitVector() * (double(s.radius) * (random_.Below(2) ? 1 : 0.5)));
      }
      if (k - case_.spheres.size() < case_.cones.size()) {
        const Cone& c = case_.cones[k - case_.spheres.size()];
        return random_.Below(2) ? c.base : c.apex;
      }
      const auto& polygon = case_.polygons[k - case_.spheres.size() - case_.cones.size()];
      return case_.positions[polygon[random_.Below(polygon.size())]];
    }
    const auto& t = case_.triangles[i];
    const size_t k = random_.Below(3);
    const Vec3d a = ToDouble(case_.positions[t[k]]), b = ToDouble(case_.positions[t[(k + 1) % 3]]),
                c = ToDouble(case_.positions[t[(k + 2) % 3]]);
    switch (random_.Below(4)) {
      case 0:
        return case_.positions[t[k]];
      case 1:
        return ToFloat(a + (b - a) * (random_.Below(2) ? 0.5 : random_.NextDouble()));
      default: {
        const double u = random_.NextDouble(), v = (1 - u) * random_.NextDouble();
        return ToFloat(a + (b - a) * u + (c - a) * v);
      }
    }
  }

  void LatticeRay(int reach) {
    Vec3f org, dir;
    for (int k = 0; k < 3; ++k) {
      org[k] = float(Integer(random_, -2 * reach, 2 * reach));
      dir[k] = random_.Below(3) == 0 ? SignedZero(random_) : float(Integer(random_, -reach, reach));
    }
    Ray(org, dir);
    if (random_.Below(3) == 0 && !case_.rays.empty()) {
      rb_ray& ray = case_.rays.back();
      ray.tnear = float(random_.Below(16)) * 0.25f;
      if (random_.Below(2)) ray.tfar = ray.tnear + float(random_.Below(32)) * 0.125f;
    }
  }

  void AimedRay() {
    const Vec3f target = Target();
    Vec3f org = random_.Below(2) ? Target() : At(InCube() * 2.0), dir;
    switch (random_.Below(8)) {
      case 0: {  // along an axis, zeros of either sign
        const int axis = Integer(random_, 0, 2);
        org = target, dir = {SignedZero(random_), SignedZero(random_), SignedZero(random_)};
        const float sign = random_.Below(2) ? 1.0f : -1.0f;
        dir[axis] = sign;
        org[axis] = float(target[axis] - sign * scale_ * LogUniform(random_, -2, 3));
        break;
      }
      case 1: {  // within a plane of a coordinate
        const int axis = Integer(random_, 0, 2);
        org[axis] = target[axis];
        dir = target - org;
        dir[axis] = SignedZero(random_);
        break;
      }
      case 2: {  // from far
        const Vec3d way = random_.UnitVector() * std::fabs(LogUniform(random_, 0, 20));
        org = At((ToDouble(target) - offset_) * (1 / scale_) - way);
        dir = target - org;
        break;
      }
      case 3: {  // one component next to nothing
        dir = target - org;
        const int axis = Integer(random_, 0, 2);
        dir[axis] =
            float(LogUniform(random_, -149, -10)) * (random_.Below(2) ? 1 : std::fabs(dir[(axis + 1) % 3]));
        break;
      }
      case 4:
        dir = ToFloat(random_.UnitVector());
        break;
      default:
        dir = target - org;
        if (random_.Below(2)) dir = dir * float(Between(random_, 0.5, 2));
    }
    if (random_.Below(8) == 0) {
      const float length = float(std::fabs(LogUniform(random_, -100, 60)));
      if (const Vec3f scaled = dir * length; std::isfinite(scaled.x + scaled.y + scaled.z)) dir = scaled;
    }
    const size_t before = case_.rays.size();
    Ray(org, dir);
    if (case_.rays.size() == before || random_.Below(4) != 0) return;
    // The target lies near t = 1 on most rays.
    rb_ray& ray = case_.rays.back();
    const float ends[] = {0, 0.5f, 1, std::nextafter(1.0f, 0.0f), std::nextafter(1.0f, 2.0f), 2, 1e-30f};
    ray.tnear = ends[random_.Below(std::size(ends))];
    if (random_.Below(2)) ray.tfar = ends[random_.Below(std::size(ends))];
  }

  /// Leaves out what the scene model would.
  Case Finish() {
    if (IsScene(case_)) return std::move(case_);
    // What is left of a case below the smallest scale gets a triangle of ordinary size beside it.
    Triangle({1, 0, 0}, {0, 1, 0}, {0, 0, 1});
    Case kept = case_;
    kept.triangles.clear(), kept.spheres.clear(), kept.cones.clear(), kept.polygons.clear();
    const Case none = kept;
    const auto keep = [&](auto list) {
      for (const auto& primitive : case_.*list) {
        Case one = none;
        (one.*list).push_back(primitive);
        if (IsScene(one)) (kept.*list).push_back(primitive);
      }
    };
    keep(&Case::triangles), keep(&Case::spheres), keep(&Case::cones), keep(&Case::polygons);
    return kept;
  }
  static bool IsScene(const Case& c) {
    try {
      SceneOf(c);
      return true;
    } catch (const InputError&) {
      return false;
    }
  }

  Random& random_;
  Case case_;
  double scale_ = 1;
  Vec3d offset_{0, 0, 0};
};

}  // namespace

Case GenerateCase(Mode mode, uint64_t seed, uint64_t index) {
  Random random(seed, index);
  if (mode == Mode::kBoth) mode = random.Below(3) == 0 ? Mode::kExact : Mode::kChaotic;
  Builder builder(random);
  return mode == Mode::kExact ? builder.Exact() : builder.Chaotic();
}

void AimAnew(Case& c, size_t count, Random& random) { c.rays = Builder(random, c).Rays(count); }

namespace {

constexpr const char* kStandardScenes[] = {"icosphere(level=3)", "menger(depth=1)", "soup(size=500)",
                                           "terrain_box(n=12)",  "balls(size=2)",   "city(size=400)",
                                           "rings(size=1)"};

}  // namespace

size_t StandardCaseCount() { return std::size(kStandardScenes) * AimedFamilies().size(); }

Case StandardCase(size_t index, uint64_t seed) {
  constexpr size_t kSetRays = 256;
  const size_t families = AimedFamilies().size();
  LoadOptions load;
  load.seed = seed;
  const Scene scene = LoadScene(kStandardScenes[index / families], load);
  Case c;
  c.positions = scene.positions, c.triangles = scene.triangles;
  c.spheres = scene.spheres, c.cones = scene.cones;
  for (const Polygon& polygon : scene.polygons) {
    const auto corners = scene.CornersOf(polygon);
    c.polygons.emplace_back(corners.begin(), corners.end());
  }
  const std::vector<MeshEdge> edges = MeshEdges(scene);
  for (const AimedSet& set : SharedSets(scene, edges, kSetRays, seed)) {
    if (!set.absent.empty() || set.name != AimedFamilies()[index % families].name) continue;
    c.rays.resize(kSetRays);
    set.fill(0, c.rays, 1);
  }
  return c;
}

namespace {

std::vector<std::byte> DrawConfig(const rb_structure& structure, Random& random) {
  std::vector<std::pair<std::string, std::string>> values;
  const std::span params(structure.params, structure.param_count);
  for (const rb_param& p : params) {
    if (random.Below(2)) continue;
    std::string value;
    if (p.type == RB_BOOL) {
      value = random.Below(2) ? "true" : "false";
    } else if (p.type == RB_CHOICE) {
      size_t n = 0;
      while (p.choices[n] != nullptr) ++n;
      value = p.choices[random.Below(n)];
    } else {
      double x = random.Below(8) == 0 ? p.lo : random.Below(8) == 0 ? p.hi : Between(random, p.lo, p.hi);
      // Large ranges are of sizes: small values are the usual ones.
      if (p.lo >= 0 && p.hi > 64 && random.Below(4) != 0) x = std::min(p.hi, p.lo + Between(random, 0, 16));
      if (p.type == RB_INT) x = std::floor(x);
      value = fmt::format("{}", x);
    }
    values.emplace_back(p.name, value);
  }
  return Configure(structure.name, params, structure.config_size, values);
}

}  // namespace

std::string DrawParameters(const rb_structure& structure, Random& random) {
  std::vector<std::byte> config = DrawConfig(structure, random);
  while (!WhyIncompatible(structure, config.data()).empty()) config = DrawConfig(structure, random);
  return FormatSpec(structure.name, {structure.params, structure.param_count}, config.data());
}

}  // namespace raybench::fuzz
