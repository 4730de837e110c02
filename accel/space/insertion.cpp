#include "accel/space/insertion.h"

#include <algorithm>
#include <cmath>

#include "accel/base/parallel.h"
#include "accel/contract/structure.h"

namespace raybench {

Insertion::Insertion(const rb_geometry& geometry, bool exact, bool padded)
    : geometry_(geometry), exact_(exact), padded_(padded), boxes_(PrimCount(geometry)) {
  scene_ = ParallelReduce(
      Range<size_t>(0, boxes_.size(), 8192), Bounds3{},
      [&](const auto& range, Bounds3 sum) {
        for (size_t i = range.begin(); i < range.end(); ++i) {
          boxes_[i] = padded ? PaddedPrimBounds(geometry, uint32_t(i)) : PrimBounds(geometry, uint32_t(i));
          sum.Extend(boxes_[i]);
        }
        return sum;
      },
      [](Bounds3 a, const Bounds3& b) {
        a.Extend(b);
        return a;
      });
  for (int a = 0; a < 3; ++a)
    rounding_ = std::max({rounding_, std::fabs(double(scene_.lo[a])), std::fabs(double(scene_.hi[a]))});
  rounding_ *= 0x1p-44;
}

bool Insertion::TriangleMeets(uint32_t prim, Vec3d lo, Vec3d hi) const {
  const Vec3d center = (lo + hi) * 0.5;
  Vec3d half = (hi - lo) * 0.5, v[3];
  for (int c = 0; c < 3; ++c) v[c] = ToDouble(Vertex(geometry_, prim, c)) - center;
  double pad = rounding_;
  if (padded_) {
    const Vec3f extent = boxes_[prim].Extent();
    pad += double(std::max({extent.x, extent.y, extent.z})) * 0x1p-20;
  }
  half = half + Vec3d{pad, pad, pad};
  Vec3d sides[3];
  for (int e = 0; e < 3; ++e) {
    const Vec3d side = sides[e] = v[(e + 1) % 3] - v[e];
    for (int a = 0; a < 3; ++a) {  // the axis: unit vector a x side
      const int b = (a + 1) % 3, c = (a + 2) % 3;
      const double p = side[b] * v[e][c] - side[c] * v[e][b];  // the side's two vertices
      const int other = (e + 2) % 3;
      const double q = side[b] * v[other][c] - side[c] * v[other][b];
      const double reach = half[b] * std::fabs(side[c]) + half[c] * std::fabs(side[b]);
      if (std::min(p, q) > reach || std::max(p, q) < -reach) return false;
    }
  }
  // The triangle's plane. A sliver's normal is known only to within the rounding of its products.
  double distance = 0, reach = 0;
  for (int a = 0; a < 3; ++a) {
    const int b = (a + 1) % 3, c = (a + 2) % 3;
    const double bc = sides[0][b] * sides[1][c], cb = sides[0][c] * sides[1][b], normal = bc - cb;
    distance += normal * v[0][a];
    reach += std::fabs(normal) * half[a] +
             0x1p-49 * (std::fabs(bc) + std::fabs(cb)) * (std::fabs(v[0][a]) + half[a]);
  }
  return std::fabs(distance) <= reach;
}

}  // namespace raybench
