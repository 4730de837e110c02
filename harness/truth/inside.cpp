#include "harness/truth/inside.h"

#include <fmt/format.h>

#include <optional>
#include <stdexcept>

#include "accel/base/parallel.h"
#include "harness/truth/exact.h"
#include "harness/truth/mesh_edges.h"

namespace raybench {
namespace {

/// Random lines are nearly all generic; a mesh that none is generic for is not what it is said to be.
constexpr int kTries = 256;

std::vector<uint32_t> IdsOf(const std::vector<bool>& distinct) {
  std::vector<uint32_t> ids;
  for (uint32_t t = 0; t < distinct.size(); ++t)
    if (distinct[t]) ids.push_back(t);
  return ids;
}

std::vector<BoxTree::Box> BoxesOf(const Scene& scene, const std::vector<uint32_t>& triangles) {
  std::vector<BoxTree::Box> boxes(triangles.size());
  for (size_t i = 0; i < boxes.size(); ++i)
    for (Vec3d p : CornersOf(scene, triangles[i])) boxes[i].Extend(p);
  return boxes;
}

rb_ray RayFrom(Vec3f point, Random& random) {
  const Vec3f dir = ToFloat(random.UnitVector());
  return {{point.x, point.y, point.z}, 0, {dir.x, dir.y, dir.z}, std::numeric_limits<float>::infinity()};
}

}  // namespace

int CompareT(const exact::Line& line, const exact::Corners& p, double t) {
  const auto [about, error] = exact::PlaneApproximate(line, p);
  // Twice: the differences are rounded, too.
  return about - t > 2 * error    ? 1
         : about - t < -2 * error ? -1
                                  : exact::Compare(exact::PlaneRatio(line, p), t);
}

exact::Corners CornersOf(const Scene& scene, size_t triangle) {
  const auto& v = scene.triangles[triangle];
  return {ToDouble(scene.positions[v[0]]), ToDouble(scene.positions[v[1]]), ToDouble(scene.positions[v[2]])};
}

InsideTruth::InsideTruth(const Scene& scene)
    : scene_(scene),
      distinct_(DistinctTriangles(scene)),
      triangles_(IdsOf(distinct_)),
      tree_(BoxesOf(scene, triangles_)) {}

Place InsideTruth::Of(Vec3f point, Random& random) const {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  for (int tries = 0; tries < kTries; ++tries) {
    const exact::Line line(RayFrom(point, random));
    bool generic = true, odd = false, on_surface = false;
    tree_.Traverse({line.org, line.dir, 0x1p-40}, 0, infinity, [&](uint32_t i) {
      const exact::Corners p = CornersOf(scene_, triangles_[i]);
      const exact::Meeting meeting = exact::Meet(line, p);
      if (meeting == exact::Meeting::kNone) return infinity;
      if (meeting == exact::Meeting::kInPlane) {
        generic = false;
        return infinity;
      }
      const int sign = CompareT(line, p, 0);
      on_surface |= sign == 0;
      if (sign > 0 && meeting == exact::Meeting::kInterior) odd = !odd;
      if (sign > 0 && meeting != exact::Meeting::kInterior) generic = false;
      return infinity;
    });
    if (on_surface) return Place::kOnSurface;
    if (generic) return odd ? Place::kInside : Place::kOutside;
  }
  throw std::logic_error("no line through a point is generic");
}

void InsideTruth::Audit(std::span<const Vec3f> points, std::span<const Place> places, uint64_t seed) const {
  const ExactTruth truth(scene_, 0);
  ParallelFor(size_t{0}, points.size(), [&](size_t i) {
    Random random(~seed, i);
    std::optional<Place> place;
    for (int tries = 0; tries < kTries && !place; ++tries) {
      bool odd = false, generic = true;
      for (const ExactTruth::Meeting& meeting : truth.All(RayFrom(points[i], random))) {
        generic &= meeting.feature == Feature::kInterior;
        odd ^= distinct_[meeting.prim];
      }
      if (generic) place = odd ? Place::kInside : Place::kOutside;
    }
    if (place != places[i])
      throw std::logic_error(fmt::format("integers disagree about the place of the point {:a}, {:a}, {:a}",
                                         points[i].x, points[i].y, points[i].z));
  });
}

}  // namespace raybench
