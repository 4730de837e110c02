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

#include <cstdint>
#include <vector>

#include "datasets/scene/scene.h"
#include "harness/truth/box_tree.h"

namespace raybench {

struct Spot {
  uint32_t prim;  ///< a triangle
  float u, v;     ///< in it, see SpotOf()
  double side;    ///< 1: towards the normal by winding; -1
};

/// The spot of barycentrics as a structure answers them: the nearest that lie in the triangle.
Spot SpotOf(uint32_t prim, float u, float v, double side);

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
  const BoxTree tree_;
};

}  // namespace raybench
