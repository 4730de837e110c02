#include "harness/rays/aim.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "accel/base/hash.h"
#include "accel/base/random.h"
#include "accel/contract/structure.h"
#include "harness/truth/verdict.h"
#include "tracer/tracer.h"

namespace raybench {
namespace {

/// Boxes of a tree that the rays of `planes` are aimed at, at most.
constexpr size_t kBoxes = 1 << 16;
constexpr float kInfinity = std::numeric_limits<float>::infinity();

/// Rays from a function that makes one; it is called again after an invalid ray (origin and target
/// fell together).
AimedSet PerRay(const char* name, uint64_t seed, std::function<rb_ray(Random&)> make) {
  Hash64 hash;
  hash.Add(std::string_view(name));
  const auto fill = [make = std::move(make), seed, stream = hash.value()](
                        uint64_t first, std::span<rb_ray> rays, uint32_t threads) {
    ForEachOnThreads(rays.size(), threads, [&](size_t i) {
      Random random(seed, stream + first + i);
      for (int tries = 0; tries < 64; ++tries)
        if (rays[i] = make(random); IsValidRay(rays[i])) return;
      rays[i] = InvalidRayStandIn();
    });
  };
  return {name, fill, {}};
}

AimedSet Absent(const char* name, std::string why) { return {name, {}, std::move(why)}; }

/// `x` moved by this many floats.
float Ulps(float x, int64_t steps) {
  for (; steps > 0; --steps) x = std::nextafter(x, kInfinity);
  for (; steps < 0; ++steps) x = std::nextafter(x, -kInfinity);
  return x;
}

float SignedZero(Random& random) { return random.Below(2) ? 0.0f : -0.0f; }

double Between(Random& random, double lo, double hi) { return lo + random.NextDouble() * (hi - lo); }

/// 1, 0.1, ... with an exact exponent; libm's pow may differ between machines.
double PowerOfTen(uint64_t exponent) {
  double power = 1;
  for (; exponent > 0; --exponent) power *= 10;
  return power;
}

/// From where to where: what the families have in common.
class Aim {
 public:
  Aim(const Scene& scene, std::span<const MeshEdge> edges) : scene_(scene), edges_(edges) {
    if (bounds_ = scene.bounds(); bounds_.Empty()) bounds_ = {{-1, -1, -1}, {1, 1, 1}};
    const Vec3d lo = ToDouble(bounds_.lo), hi = ToDouble(bounds_.hi);
    center_ = (lo + hi) * 0.5;
    size_ = std::max(Length(hi - lo), 0x1p-100);
    for (uint32_t i = 0; i < edges.size(); ++i)
      if (edges[i].count >= 2) inner_.push_back(i);
  }

  const Scene& scene() const { return scene_; }
  const Bounds3& bounds() const { return bounds_; }
  Vec3d center() const { return center_; }
  double size() const { return size_; }  ///< diagonal of the bounds
  bool HasInnerEdges() const { return !inner_.empty(); }

  Vec3f Vertex(Random& random) const {
    return scene_.positions[scene_.triangles[random.Below(scene_.triangles.size())][random.Below(3)]];
  }
  const MeshEdge& InnerEdge(Random& random) const { return edges_[inner_[random.Below(inner_.size())]]; }
  /// The midpoint or any point, rounded.
  Vec3f PointOn(const MeshEdge& edge, Random& random) const {
    const Vec3d a = ToDouble(scene_.positions[edge.a]), b = ToDouble(scene_.positions[edge.b]);
    return ToFloat(a + (b - a) * (random.Below(2) ? 0.5 : random.NextDouble()));
  }
  /// A vertex or a point of an edge; of a procedural primitive a point where its bounds touch or nearly
  /// touch it.
  Vec3f Target(Random& random) const {
    const uint64_t triangles = scene_.triangles.size();
    if (random.Below(scene_.primitive_count()) < triangles)
      return HasInnerEdges() && random.Below(2) ? PointOn(InnerEdge(random), random) : Vertex(random);
    const Bounds3 box =
        PrimBounds(scene_.Geometry(), uint32_t(triangles + random.Below(scene_.procedural_count())));
    Vec3f target = ToFloat((ToDouble(box.lo) + ToDouble(box.hi)) * 0.5);
    const int axis = int(random.Below(3));
    target[axis] = random.Below(2) ? box.lo[axis] : box.hi[axis];
    return target;
  }

  /// Around the centre (inside of many a mesh), within the bounds, or outside of them.
  Vec3f Origin(Random& random) const {
    const uint64_t kind = random.Below(3);
    if (kind == 2) {
      const Vec3d way = random.UnitVector();
      return ToFloat(center_ + way * (size_ * Between(random, 0.6, 2)));
    }
    const double part = kind == 0 ? 0.05 : 1;
    Vec3d org;
    for (int k = 0; k < 3; ++k) {
      const double half = 0.5 * part * (double(bounds_.hi[k]) - bounds_.lo[k]);
      org[k] = center_[k] + half * Between(random, -1, 1);
    }
    return ToFloat(org);
  }

  /// Differences of coordinates on a lattice are exact and hide errors; so half of the directions are scaled.
  static rb_ray Towards(Vec3f org, Vec3f target, Random& random) {
    Vec3f dir = target - org;
    if (random.Below(2)) dir = dir * float(Between(random, 0.5, 2));
    return {{org.x, org.y, org.z}, 0, {dir.x, dir.y, dir.z}, kInfinity};
  }

  /// Through `target`, with one or two components of the direction +0 or -0: along `along` if two.
  rb_ray Parallel(Vec3f target, int zero, bool two, Random& random) const {
    rb_ray ray{{target.x, target.y, target.z}, 0, {0, 0, 0}, kInfinity};
    const Vec3f from = Origin(random);
    const int first = (zero + 1) % 3, second = (zero + 2) % 3;
    const int along = random.Below(2) ? first : second;
    for (int k : {first, second}) {
      if (two && k != along) continue;
      ray.org[k] = from[k];
      ray.dir[k] = target[k] - from[k];
    }
    for (int k : {zero, two ? first + second - along : zero}) ray.dir[k] = SignedZero(random);
    return ray;
  }

 private:
  const Scene& scene_;
  std::span<const MeshEdge> edges_;
  std::vector<uint32_t> inner_;
  Bounds3 bounds_;
  Vec3d center_;
  double size_;
};

/// The ray meets the edge where one triangle hides the other: both lie on one side of the plane through edge
/// and origin. Such origins form a wedge around the edge: seen along it, the edge is a point and the
/// triangles two rays u, v from it; a line through the point has both on one side if its normal lies between
/// the normal of u on the side of v and the normal of v on the side of u.
rb_ray SilhouetteRay(const Aim& aim, Random& random) {
  const Scene& scene = aim.scene();
  const rb_ray none{{0, 0, 0}, 0, {0, 0, 0}, kInfinity};  // invalid: tried again
  const MeshEdge& edge = aim.InnerEdge(random);
  const Vec3d a = ToDouble(scene.positions[edge.a]), b = ToDouble(scene.positions[edge.b]);
  const Vec3d along = (b - a) * (1 / Length(b - a));
  Vec3d side[2];  // of each triangle: away from the edge, in its plane
  for (int i = 0; i < 2; ++i) {
    Vec3d out{0, 0, 0};
    for (uint32_t v : scene.triangles[edge.triangles[i]]) {
      const Vec3d d = ToDouble(scene.positions[v]) - a, across = d - along * Dot(d, along);
      if (Dot(across, across) > Dot(out, out)) out = across;
    }
    if (!(Dot(out, out) > 0)) return none;
    side[i] = Normalize(out);
  }
  Vec3d normal[2] = {Cross(along, side[0]), Cross(along, side[1])};
  for (int i = 0; i < 2; ++i)
    if (Dot(normal[i], side[1 - i]) < 0) normal[i] = -normal[i];
  const double share = random.NextDouble();
  const Vec3d n = normal[0] * share + normal[1] * (1 - share);
  if (!(Dot(n, side[0]) > 0 && Dot(n, side[1]) > 0)) return none;  // the two triangles are one plane
  const Vec3d across = Normalize(Cross(along, n));
  const double slant = Between(random, -0.7, 0.7);
  const Vec3d away = (random.Below(2) ? across : -across) + along * slant;
  Vec3f target = aim.PointOn(edge, random);
  const double distance = aim.size() * Between(random, 1, 3);
  const Vec3f org = ToFloat(ToDouble(target) + Normalize(away) * distance);
  for (int k = 0; k < 3; ++k)
    target[k] += float(std::ldexp(distance, -23)) * float(int64_t(random.Below(9)) - 4);
  return Aim::Towards(org, target, random);
}

rb_ray AxisParallelRay(const Aim& aim, Random& random) {
  Vec3f target = aim.Target(random);
  const int zero = int(random.Below(3));
  if (random.Below(2)) target[zero] = random.Below(2) ? aim.bounds().hi[zero] : aim.bounds().lo[zero];
  return aim.Parallel(target, zero, random.Below(2) != 0, random);
}

rb_ray GrazingRay(const Aim& aim, Random& random) {
  const Scene& scene = aim.scene();
  const auto& t = scene.triangles[random.Below(scene.triangles.size())];
  const Vec3d a = ToDouble(scene.positions[t[0]]), e = ToDouble(scene.positions[t[1]]) - a,
              f = ToDouble(scene.positions[t[2]]) - a;
  double u = random.NextDouble(), v = random.NextDouble();
  if (u + v > 1) {
    u = 1 - u;
    v = 1 - v;
  }
  const double x = Between(random, -1, 1), y = Between(random, -1, 1);
  const Vec3d inside = a + e * u + f * v, way = e * x + f * y;
  const double length = Length(way);
  if (!(length > 0)) return {{0, 0, 0}, 0, {0, 0, 0}, kInfinity};
  // From as far as the scene is large down to a thousandth.
  const double distance = std::ldexp(aim.size(), -int(random.Below(11)));
  Vec3f org = ToFloat(inside - way * (distance / length));
  const int axis = int(random.Below(3));
  org[axis] = Ulps(org[axis], int64_t(random.Below(7)) - 3);
  return Aim::Towards(org, ToFloat(inside), random);
}

rb_ray FarRay(const Aim& aim, Random& random) {
  const double power = PowerOfTen(3 + random.Below(3)),
               distance = aim.size() * power * Between(random, 1, 10);
  const Vec3f org = ToFloat(aim.center() + random.UnitVector() * distance);
  return Aim::Towards(org, aim.Target(random), random);
}

AimedSet CameraSet(const Scene& scene, uint64_t count) {
  uint32_t side = 1;
  while (uint64_t{side} * side < count) ++side;
  const auto fill = [&scene, side](uint64_t first, std::span<rb_ray> rays, uint32_t threads) {
    PixelRays(scene, side, side, first, rays, threads);
  };
  return {"camera", fill, {}};
}

/// A seeded sample of a tree's boxes, and all of the upper levels, which most rays meet.
class Boxes {
 public:
  Boxes(const Tree& tree, uint64_t seed) : random_(seed) {
    tree.structure().visit(
        tree.get(),
        [](void* self, const rb_node* node) {
          static_cast<Boxes*>(self)->Add(*node);
          return 0;
        },
        this);
  }
  bool Empty() const { return sample_.empty(); }
  const Bounds3& Pick(Random& random) const {
    const std::vector<Bounds3>& from = !upper_.empty() && random.Below(4) == 0 ? upper_ : sample_;
    return from[random.Below(from.size())];
  }

 private:
  void Add(const rb_node& node) {
    if (node.shape != RB_SHAPE_BOX || node.bounds_count != 6) return;
    const Bounds3 box{LoadVec3(node.bounds), LoadVec3(node.bounds + 3)};
    if (box.Empty() || !std::all_of(node.bounds, node.bounds + 6, [](float x) { return std::isfinite(x); }))
      return;
    if (node.depth < 8 && upper_.size() < 4096) upper_.push_back(box);
    // Vitter 1985, algorithm R.
    if (++seen_; sample_.size() < kBoxes) {
      sample_.push_back(box);
    } else if (const uint64_t place = random_.Below(seen_); place < kBoxes) {
      sample_[place] = box;
    }
  }

  Random random_;
  uint64_t seen_ = 0;
  std::vector<Bounds3> sample_, upper_;
};

rb_ray PlaneRay(const Aim& aim, const Boxes& boxes, Random& random) {
  const Bounds3& box = boxes.Pick(random);
  // On a face, an edge or a corner: one, two or three coordinates are those of the box.
  Vec3f target;
  const int axis = int(random.Below(3)), fixed = 1 + int(random.Below(3));
  for (int i = 0; i < 3; ++i) {
    const int k = (axis + i) % 3;
    target[k] =
        i < fixed ? (random.Below(2) ? box.lo[k] : box.hi[k]) : float(Between(random, box.lo[k], box.hi[k]));
  }
  if (random.Below(2)) return Aim::Towards(aim.Origin(random), target, random);
  return aim.Parallel(target, axis, fixed >= 2 && random.Below(2), random);
}

/// What a family presupposes.
enum class Needs { kNothing, kTriangles, kInnerEdges, kBoxesOfATree };

struct Family {
  const char* name;
  Needs needs;
  rb_ray (*make)(const Aim&, Random&);  ///< nullptr: not ray by ray, or not without a tree
  const char* doc;
};

/// All that can be asked for, in the order of the tables.
constexpr Family kAimed[] = {
    {"random", Needs::kNothing, [](const Aim& aim, Random& r) { return RandomRay(aim.bounds(), r); },
     "isotropic lines through the bounding sphere"},
    {"camera", Needs::kNothing, nullptr, "one per pixel of a square picture"},
    {"aimed_vertex", Needs::kTriangles,
     [](const Aim& aim, Random& r) {
       const Vec3f org = aim.Origin(r);
       return Aim::Towards(org, aim.Vertex(r), r);
     },
     "at vertices"},
    {"aimed_edge", Needs::kInnerEdges,
     [](const Aim& aim, Random& r) {
       const Vec3f org = aim.Origin(r);
       return Aim::Towards(org, aim.PointOn(aim.InnerEdge(r), r), r);
     },
     "at midpoints and other points of edges inside a surface, rounded to float"},
    {"silhouette", Needs::kInnerEdges, &SilhouetteRay,
     "from outside at edges where one triangle hides the other, and up to 4 ulp beside"},
    {"axis_parallel", Needs::kNothing, &AxisParallelRay,
     "one or two components +0 or -0, at vertices and edges and in faces of the scene's bounds"},
    {"grazing", Needs::kTriangles, &GrazingRay, "in a triangle's plane but for a few ulp"},
    {"planes", Needs::kBoxesOfATree, nullptr,
     "at faces, edges and corners of boxes of the tested tree, across and within them"},
    {"far", Needs::kNothing, &FarRay, "from 1e3 to 1e6 scene sizes away, at vertices and edges"}};

}  // namespace

std::vector<RayFamily> AimedFamilies() {
  std::vector<RayFamily> families;
  for (const Family& family : kAimed) families.push_back({family.name, "closest and any", family.doc});
  return families;
}

std::vector<AimedSet> SharedSets(const Scene& scene, std::span<const MeshEdge> edges, uint64_t count,
                                 uint64_t seed) {
  const auto aim = std::make_shared<const Aim>(scene, edges);
  std::vector<AimedSet> sets;
  for (const Family& family : kAimed) {
    if (family.needs == Needs::kBoxesOfATree) continue;
    if (family.needs != Needs::kNothing && scene.triangles.empty()) {
      sets.push_back(Absent(family.name, "the scene has no triangles"));
    } else if (family.needs == Needs::kInnerEdges && !aim->HasInnerEdges()) {
      sets.push_back(Absent(family.name, "no edge belongs to two triangles"));
    } else if (family.make == nullptr) {
      sets.push_back(CameraSet(scene, count));
    } else {
      // Each family keeps what it aims by.
      sets.push_back(PerRay(family.name, seed,
                            [aim, make = family.make](Random& random) { return make(*aim, random); }));
    }
  }
  return sets;
}

AimedSet PlanesSet(const Scene& scene, const Tree& tree, uint64_t seed) {
  if (tree.structure().visit == nullptr) return Absent("planes", "no visitor");
  const auto boxes = std::make_shared<const Boxes>(tree, seed);
  if (boxes->Empty()) return Absent("planes", "the tree shows no boxes");
  const auto aim = std::make_shared<const Aim>(scene, std::span<const MeshEdge>());
  return PerRay("planes", seed, [aim, boxes](Random& random) { return PlaneRay(*aim, *boxes, random); });
}

}  // namespace raybench
