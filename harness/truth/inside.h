// Truth for a point: inside or outside of a closed mesh, exact, and independent of every structure under test.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "accel/base/random.h"
#include "accel/ray/exact.h"
#include "datasets/scene/scene.h"
#include "harness/truth/box_tree.h"

namespace raybench {

/// Sign of a - t, for the exact a at which the line meets the triangle's plane, to which it is not parallel.
int CompareT(const exact::Line& line, const exact::Corners& p, double t);

exact::Corners CornersOf(const Scene& scene, size_t triangle);

enum class Place : uint8_t { kOutside, kInside, kOnSurface };

/// Of a mesh of which every edge has an even number of distinct triangles.
///
/// A line in a direction that meets no edge, vertex or plane's inside ahead of the point crosses the surface
/// at each triangle that it meets; inside means an odd number. Whether it is such a line is told by exact
/// predicates (accel/ray/exact.h), as are the crossings; if not, another direction is taken. Triangles are
/// found by the oracle's tree of boxes, which finds too much and never too little.
class InsideTruth {
 public:
  /// The scene must outlive it, unmoved.
  explicit InsideTruth(const Scene& scene);

  /// Along a direction of `random`, the answer does not depend on which.
  Place Of(Vec3f point, Random& random) const;

  /// Derives the places of these points, none of them on the surface, along other directions and by integers
  /// (exact.h beside this file). Throws std::logic_error naming the first point where the two disagree.
  void Audit(std::span<const Vec3f> points, std::span<const Place> places, uint64_t seed) const;

  const std::vector<bool>& distinct() const { return distinct_; }  ///< DistinctTriangles()

 private:
  const Scene& scene_;
  const std::vector<bool> distinct_;
  std::vector<uint32_t> triangles_;  // the distinct ones
  const BoxTree tree_;
};

}  // namespace raybench
