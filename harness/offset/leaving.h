// Truth for a ray that leaves a triangle: what lies between the surface and the place from which its hits count,
// and whether an answer is the surface that it leaves. Exact, and independent of every structure under test.
//
// A ray leaves from its spot: the point that barycentrics u and v name exactly (floats, cut down to the triangle
// where rounding put them beside it), towards one side of the triangle's plane. A cure against self-intersection
// lets hits count from another point on, its begin. Two things can go wrong, and both are decided here by
// predicates over these numbers as given, in double with a bound of the error and else in integers:
//
// - The straight way from spot to begin meets another triangle: a hit there is lost, and what lies behind it is seen
//   instead. Touching at the spot is none; neither is a triangle along whose plane the way runs.
// - The answer is one that no ray from the spot to that side can have: a self-hit. That is the case if the triangle
//   - is the one that is left,
//   - lies nowhere in front of its plane (neighbours on convex surfaces, copies),
//   - is not ahead of the begin, so that the structure's arithmetic alone saw a hit,
//   - has been leapt over, and is now hit from behind,
//   - or is hit at a point that is not in front of the plane that is left.
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "datasets/scene/scene.h"

namespace raybench {

struct Spot {
  uint32_t prim;  ///< a triangle
  float u, v;     ///< in it, see SpotOf()
  double side;    ///< 1: towards the normal by winding; -1
};

/// The spot of barycentrics as a structure answers them: the nearest that lie in the triangle.
Spot SpotOf(uint32_t prim, float u, float v, double side);

/// Boxes around halves of the triangles, for ways that are mostly short: finds too much, never too little.
class WayTree {
 public:
  explicit WayTree(const Scene& scene);

  /// Calls visit(triangle) for each triangle whose box the way from p to q may meet, until it returns true.
  template <class Visit>
  void Traverse(Vec3d p, Vec3d q, const Visit& visit) const {
    const Vec3d lo = Min(p, q), hi = Max(p, q), way = q - p;
    const Vec3d inverse = {1 / way.x, 1 / way.y, 1 / way.z};
    const auto apart = [&](const Node& node) {
      double from = 0, to = 1;
      for (int k = 0; k < 3; ++k) {
        if (node.lo[k] > hi[k] || node.hi[k] < lo[k]) return true;
        if (!(std::fabs(inverse[k]) < std::numeric_limits<double>::infinity())) continue;
        const double a = (node.lo[k] - p[k]) * inverse[k], b = (node.hi[k] - p[k]) * inverse[k];
        from = std::max(from, std::min(a, b));
        to = std::min(to, std::max(a, b));
      }
      return from > to;
    };
    uint32_t stack[64];
    int size = 0;
    if (!nodes_.empty()) stack[size++] = 0;
    while (size > 0) {
      const uint32_t index = stack[--size];
      const Node& node = nodes_[index];
      if (apart(node)) continue;
      for (uint32_t i = 0; i < node.count; ++i)
        if (visit(items_[node.first + i])) return;
      if (node.count > 0) continue;
      stack[size++] = node.first;
      stack[size++] = index + 1;
    }
  }

 private:
  struct Node {
    Vec3d lo, hi;
    uint32_t first;  ///< of its items; in an inner node its second child, the first one being the next node
    uint32_t count;  ///< 0: an inner node
  };
  void Split(const Scene& scene, double pad, uint32_t first, uint32_t count);

  std::vector<uint32_t> items_;
  std::vector<Node> nodes_;
};

class LeavingTruth {
 public:
  /// Of a scene of triangles, which must outlive it, unmoved.
  explicit LeavingTruth(const Scene& scene);

  /// Whether rays in this direction leave the plane towards the spot's side.
  bool Leaves(const Spot& spot, Vec3f dir) const;
  /// Whether the way from the spot to `begin`, that point included, meets another triangle.
  bool LeapsOver(const Spot& spot, Vec3d begin) const;
  /// Whether triangle `prim` as an answer to the ray from `begin` is a self-hit. `dir` must leave.
  bool IsSelfHit(const Spot& spot, Vec3d begin, Vec3f dir, uint32_t prim) const;

 private:
  const Scene& scene_;
  const WayTree tree_;
};

}  // namespace raybench
