#include "harness/judge/cover.h"

#include <cmath>
#include <vector>

namespace raybench {
namespace {

using Polygon = std::vector<Vec3d>;  // convex and plane

class Cover {
 public:
  explicit Cover(double eps) : eps_(eps) {}

  bool Covers(const std::vector<const Bounds3*>& boxes, Polygon rest) const {
    if (Negligible(rest)) return true;
    if (boxes.empty()) return false;
    const Bounds3& box = *boxes[boxes.size() / 2];
    // What of `rest` lies beyond one face after the other; the remainder is inside.
    for (int face = 0; face < 6; ++face) {
      const int axis = face / 2;
      const double sign = face % 2 == 0 ? -1 : 1, plane = face % 2 == 0 ? box.lo[axis] : box.hi[axis];
      Polygon outside, inside;
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

  /// The boxes, but for `without`, whose bounds meet those of the polygon.
  std::vector<const Bounds3*> Meeting(const std::vector<const Bounds3*>& boxes, const Polygon& polygon,
                                      const Bounds3* without) const {
    Vec3d lo = polygon[0], hi = lo;
    for (Vec3d p : polygon) {
      lo = Min(lo, p);
      hi = Max(hi, p);
    }
    std::vector<const Bounds3*> meeting;
    for (const Bounds3* box : boxes) {
      bool meets = box != without;
      for (int k = 0; k < 3; ++k) meets = meets && box->lo[k] <= hi[k] + eps_ && box->hi[k] >= lo[k] - eps_;
      if (meets) meeting.push_back(box);
    }
    return meeting;
  }

 private:
  /// Thinner than eps: twice the area over the length around it.
  bool Negligible(const Polygon& polygon) const {
    Vec3d area{0, 0, 0};
    double around = 0;
    for (size_t i = 0; i < polygon.size(); ++i) {
      const Vec3d p = polygon[i] - polygon[0], q = polygon[(i + 1) % polygon.size()] - polygon[0];
      area = area + Cross(p, q);
      around += Length(q - p);
    }
    return Length(area) <= eps_ * around;
  }

  double eps_;
};

}  // namespace

bool BoxesCover(std::span<const Bounds3> boxes, Vec3f p0, Vec3f p1, Vec3f p2) {
  double size = 0;
  for (Vec3f p : {p0, p1, p2})
    for (int k = 0; k < 3; ++k) size = std::max(size, std::fabs(double(p[k])));
  const Cover cover(size * 0x1p-44);
  const Polygon triangle = {ToDouble(p0), ToDouble(p1), ToDouble(p2)};
  std::vector<const Bounds3*> all;
  for (const Bounds3& box : boxes) all.push_back(&box);
  return cover.Covers(cover.Meeting(all, triangle, nullptr), triangle);
}

}  // namespace raybench
