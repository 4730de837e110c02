#include "harness/judge/cover.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace raybench {
namespace {

using ConvexPolygon = std::vector<Vec3d>;  // plane

class Cover {
 public:
  explicit Cover(double eps) : eps_(eps) {}

  bool Covers(const std::vector<const Bounds3*>& boxes, ConvexPolygon rest) const {
    if (Negligible(rest)) return true;
    const Bounds3* const chosen = AmongThem(boxes, rest);
    if (chosen == nullptr) return false;
    const Bounds3& box = *chosen;
    // What of `rest` lies beyond one face after the other; the remainder is inside.
    for (int face = 0; face < 6; ++face) {
      const int axis = face / 2;
      const double sign = face % 2 == 0 ? -1 : 1, plane = face % 2 == 0 ? box.lo[axis] : box.hi[axis];
      ConvexPolygon outside, inside;
      bool beyond = false;
      for (size_t i = 0; i < rest.size(); ++i) {
        const Vec3d p = rest[i], q = rest[(i + 1) % rest.size()];
        const double dp = sign * (p[axis] - plane), dq = sign * (q[axis] - plane);
        beyond |= dp > eps_;
        if (dp >= -eps_) outside.push_back(p);
        if (dp <= eps_) inside.push_back(p);
        if (std::min(dp, dq) >= -eps_ || std::max(dp, dq) <= eps_) continue;
        Vec3d cut = p + (q - p) * (dp / (dp - dq));
        cut[axis] = plane;
        outside.push_back(cut);
        inside.push_back(cut);
      }
      if (beyond && !Negligible(outside) && !Covers(Meeting(boxes, outside, &box), outside)) return false;
      rest = std::move(inside);
      if (Negligible(rest)) return true;
    }
    return true;
  }

  /// The boxes, but for `without`, whose bounds meet those of the polygon, and its plane.
  std::vector<const Bounds3*> Meeting(const std::vector<const Bounds3*>& boxes, const ConvexPolygon& polygon,
                                      const Bounds3* without) const {
    Vec3d lo = polygon[0], hi = lo;
    for (Vec3d p : polygon) {
      lo = Min(lo, p);
      hi = Max(hi, p);
    }
    const Vec3d normal = Area(polygon);
    const double extent = Length(hi - lo);
    std::vector<const Bounds3*> meeting;
    for (const Bounds3* box : boxes) {
      bool meets = box != without;
      // The polygon's plane against the part of the box within the bounds; a sliver's normal is known only to
      // within the rounding of its products.
      double distance = 0, reach = 0x1p-46 * extent * extent * extent;
      for (int k = 0; k < 3 && meets; ++k) {
        const double from = std::max(double(box->lo[k]), lo[k]) - eps_,
                     to = std::min(double(box->hi[k]), hi[k]) + eps_;
        meets = box->lo[k] <= hi[k] + eps_ && box->hi[k] >= lo[k] - eps_;
        distance += normal[k] * (0.5 * (from + to) - polygon[0][k]);
        reach += std::fabs(normal[k]) * (0.5 * (to - from) + 2 * eps_);
      }
      meets = meets && std::fabs(distance) <= reach;
      if (meets) meeting.push_back(box);
    }
    return meeting;
  }

 private:
  /// A box in which some of the polygon may lie, in the middle of the list if possible, so that what is left falls
  /// into halves. Those that the polygon passes by would only make the recursion deep.
  const Bounds3* AmongThem(const std::vector<const Bounds3*>& boxes, const ConvexPolygon& polygon) const {
    const size_t n = boxes.size(), middle = n / 2;
    for (size_t i = 0; i < n; ++i) {
      const size_t step = (i + 1) / 2, at = i % 2 == 0 ? middle + step : middle - step;
      if (at < n && !IsBeside(*boxes[at], polygon)) return boxes[at];
    }
    return nullptr;
  }
  /// Whether all of the polygon lies beyond one of the box's faces: with an edge on it at most, not within it.
  bool IsBeside(const Bounds3& box, const ConvexPolygon& polygon) const {
    for (int k = 0; k < 3; ++k) {
      double lo = polygon[0][k], hi = lo;
      for (Vec3d p : polygon) lo = std::min(lo, p[k]), hi = std::max(hi, p[k]);
      if (hi <= box.lo[k] + eps_ && lo < box.lo[k] - eps_) return true;
      if (lo >= box.hi[k] - eps_ && hi > box.hi[k] + eps_) return true;
    }
    return false;
  }
  /// Twice the area, along the normal.
  static Vec3d Area(const ConvexPolygon& polygon) {
    Vec3d area{0, 0, 0};
    for (size_t i = 1; i + 1 < polygon.size(); ++i)
      area = area + Cross(polygon[i] - polygon[0], polygon[i + 1] - polygon[0]);
    return area;
  }
  /// Thinner than eps: twice the area over the length around it.
  bool Negligible(const ConvexPolygon& polygon) const {
    double around = 0;
    for (size_t i = 0; i < polygon.size(); ++i)
      around += Length(polygon[(i + 1) % polygon.size()] - polygon[i]);
    return Length(Area(polygon)) <= eps_ * around;
  }

  double eps_;
};

}  // namespace

bool BoxesCover(std::span<const Bounds3> boxes, Vec3f p0, Vec3f p1, Vec3f p2) {
  double size = 0;
  for (Vec3f p : {p0, p1, p2})
    for (int k = 0; k < 3; ++k) size = std::max(size, std::fabs(double(p[k])));
  const Cover cover(size * 0x1p-44);
  const ConvexPolygon triangle = {ToDouble(p0), ToDouble(p1), ToDouble(p2)};
  std::vector<const Bounds3*> all;
  for (const Bounds3& box : boxes) all.push_back(&box);
  return cover.Covers(cover.Meeting(all, triangle, nullptr), triangle);
}

}  // namespace raybench
