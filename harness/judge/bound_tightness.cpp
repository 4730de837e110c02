#include "harness/judge/bound_tightness.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "accel/base/random.h"
#include "accel/bvh/bounds/kdop.h"
#include "accel/ray/primitive.h"

namespace raybench {
namespace {

struct Interval {
  double lo = -std::numeric_limits<double>::infinity(), hi = std::numeric_limits<double>::infinity();

  /// Cuts off where org + t dir is not in [from, to].
  void Slab(double org, double dir, double from, double to) {
    if (dir == 0) {
      if (!(org >= from && org <= to)) hi = -std::numeric_limits<double>::infinity();
      return;
    }
    const double a = (from - org) / dir, b = (to - org) / dir;
    lo = std::max(lo, std::min(a, b));
    hi = std::min(hi, std::max(a, b));
  }
};

/// The bounds of a leaf, as shown, and what it holds.
struct Leaf {
  uint32_t shape, bounds_count;
  size_t first_bound, first_prim, prim_count;
};

struct Leaves {
  std::vector<Leaf> leaves;
  std::vector<float> bounds;
  std::vector<uint32_t> prims;
  bool known = true;

  int Add(const rb_node& node) {
    if (!node.is_leaf || node.prim_count == 0) return 0;
    const uint32_t n = node.bounds_count;
    known = known && (node.shape == RB_SHAPE_BOX      ? n == 6
                      : node.shape == RB_SHAPE_SPHERE ? n == 4
                                                      : n == 14 || n == 18 || n == 26);
    if (!known) return 1;
    leaves.push_back({node.shape, n, bounds.size(), prims.size(), node.prim_count});
    bounds.insert(bounds.end(), node.bounds, node.bounds + n);
    prims.insert(prims.end(), node.prims, node.prims + node.prim_count);
    return 0;
  }

  /// A sphere around the leaf's bounds.
  std::pair<Vec3d, double> Ball(const Leaf& leaf) const {
    const float* b = &bounds[leaf.first_bound];
    if (leaf.shape == RB_SHAPE_SPHERE) return {ToDouble(LoadVec3(b)), b[3]};
    const Vec3d lo = ToDouble(LoadVec3(b)), hi = ToDouble(LoadVec3(b + leaf.bounds_count / 2));
    return {(lo + hi) * 0.5, 0.5 * Length(hi - lo)};
  }

  template <int K>
  static Interval WithinKdop(const float* b, Vec3d org, Vec3d dir) {
    Interval t;
    for (int i = 0; i < 3; ++i) t.Slab(org[i], dir[i], b[i], b[i + K / 2]);
    for (int i = 3; i < K / 2; ++i) {
      const Vec3d n = KdopBound<K>::Direction(i - 3);
      t.Slab(Dot(n, org), Dot(n, dir), b[i], b[i + K / 2]);
    }
    return t;
  }
  Interval Within(const Leaf& leaf, Vec3d org, Vec3d dir) const {
    const float* b = &bounds[leaf.first_bound];
    if (leaf.shape == RB_SHAPE_SPHERE) {
      const Vec3d to = ToDouble(LoadVec3(b)) - org;
      const double middle = Dot(to, dir) / Dot(dir, dir), square = double(b[3]) * b[3];
      const Vec3d off = to - dir * middle;
      const double half = (square - Dot(off, off)) / Dot(dir, dir);
      if (!(half >= 0)) return {0, -1};
      return {middle - std::sqrt(half), middle + std::sqrt(half)};
    }
    return leaf.bounds_count == 6    ? WithinKdop<6>(b, org, dir)
           : leaf.bounds_count == 14 ? WithinKdop<14>(b, org, dir)
           : leaf.bounds_count == 18 ? WithinKdop<18>(b, org, dir)
                                     : WithinKdop<26>(b, org, dir);
  }
};

bool HitsWithin(const Leaves& all, const Leaf& leaf, const rb_geometry& geometry, rb_ray ray, Interval t) {
  ray.tnear = std::max(0.0f, std::nextafter(float(t.lo), -1.0f));
  ray.tfar = std::nextafter(float(t.hi), std::numeric_limits<float>::infinity());
  const RayState<DoubleTest> state{RayQuery{ray}};
  rb_hit best{ray.tfar, 0, 0, RAYBENCH_NONE};
  for (size_t i = 0; i < leaf.prim_count; ++i)
    if (state.Primitive(geometry, all.prims[leaf.first_prim + i], best)) return true;
  return false;
}

}  // namespace

std::optional<double> BoundTightness(const Tree& tree, const rb_geometry& geometry, uint64_t samples,
                                     uint64_t seed) {
  if (tree.structure().visit == nullptr) return std::nullopt;
  Leaves all;
  tree.structure().visit(
      tree.get(), [](void* self, const rb_node* node) { return static_cast<Leaves*>(self)->Add(*node); },
      &all);
  if (!all.known || all.leaves.empty()) return std::nullopt;
  // Lines through a ball are as frequent as its cross-section is large.
  std::vector<double> sums;
  double sum = 0;
  for (const Leaf& leaf : all.leaves) {
    const double radius = all.Ball(leaf).second;
    sums.push_back(sum += radius * radius);
  }
  uint64_t bound_hits = 0, prim_hits = 0;
  for (uint64_t i = 0; i < samples; ++i) {
    Random random(seed, i);
    const size_t pick = std::upper_bound(sums.begin(), sums.end(), random.NextDouble() * sum) - sums.begin();
    const Leaf& leaf = all.leaves[std::min(pick, sums.size() - 1)];
    const auto [centre, radius] = all.Ball(leaf);
    const Vec3d dir = random.UnitVector(), other = random.UnitVector();
    const Vec3d side = Cross(dir, other);  // uniform in angle
    const double length = Length(side);
    if (!(length > 0)) continue;
    const Vec3d org = centre + side * (radius * std::sqrt(random.NextDouble()) / length) - dir * (2 * radius);
    const rb_ray ray{{float(org.x), float(org.y), float(org.z)},
                     0,
                     {float(dir.x), float(dir.y), float(dir.z)},
                     std::numeric_limits<float>::infinity()};
    const Interval t = all.Within(leaf, ToDouble(LoadVec3(ray.org)), ToDouble(LoadVec3(ray.dir)));
    if (!(t.lo <= t.hi)) continue;
    ++bound_hits;
    prim_hits += HitsWithin(all, leaf, geometry, ray, t);
  }
  if (bound_hits == 0) return std::nullopt;
  return double(prim_hits) / double(bound_hits);
}

}  // namespace raybench
