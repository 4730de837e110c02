// Discrete oriented polytopes (Kay and Kajiya 1986; Klosowski et al. 1998): K/2 slabs in fixed directions,
// the three axes first, so that a k-DOP is a box with some corners and edges cut off.
//
//   k    directions besides the axes
//   6    none
//   14   (1,1,1) (1,-1,1) (1,1,-1) (1,-1,-1)               cut corners
//   18   (1,1,0) (1,0,1) (0,1,1) (1,-1,0) (1,0,-1) (0,1,-1)   cut edges
//   26   both
//
// The axes are tested as every box is (ray/bounds.h), in float. Along an oblique n the error of n.o is
// absolute, so n.o and n.d are taken in double, four directions at once. Let u = 2^-24, |.| the sum of
// absolute components. A triangle whose test accepts the ray may lie 6 u |p-o| beside it along each axis, so
// 18 u |p-o| along n, and |p-o| <= t |d|: the ray gets to the slab as if n.d were larger by 18 u |d|, and
// leaves it as if n.d were smaller by that; where nothing is left of n.d, it does not leave. We take 32 u. At
// build the slabs are padded by 32 u E for the triangle's extent E, more than the 6 u E of a box along three
// axes, and rounded outward.
//
// The ends along the axes are floats, rounded among subnormal ones by up to 2^-150: they may cross ends in
// double by that.
//
// A computed t may lie anywhere in the primitive's box (ray/primitive.h), in the corners that are cut off,
// too. So the oblique slabs decide whether the ray's line passes the polytope, and the axes alone where it enters:
// only that is compared with t, and with tnear, where a ray goes on from a hit.
#pragma once

#include "accel/base/simd.h"
#include "accel/ray/bounds.h"

namespace raybench {

template <int K>
struct KdopBound {
  static_assert(K == 6 || K == 14 || K == 18 || K == 26);
  static constexpr uint32_t kShape = K == 6 ? RB_SHAPE_BOX : RB_SHAPE_KDOP;
  static constexpr uint32_t kFloats = K;
  static constexpr int kOblique = K / 2 - 3;
  /// Rounded up to whole vectors; the lanes behind repeat the last direction.
  static constexpr int kVectors = (kOblique + 3) / 4;

  float lo[3 + 4 * kVectors], hi[3 + 4 * kVectors];

  /// Oblique direction i: components are -1, 0 or 1.
  static constexpr Vec3d Direction(int i) {
    constexpr Vec3d kCorners[] = {{1, 1, 1}, {1, -1, 1}, {1, 1, -1}, {1, -1, -1}};
    constexpr Vec3d kEdges[] = {{1, 1, 0}, {1, 0, 1}, {0, 1, 1}, {1, -1, 0}, {1, 0, -1}, {0, 1, -1}};
    constexpr int corners = K == 18 ? 0 : 4;
    i = i < kOblique ? i : kOblique - 1;
    return i < corners ? kCorners[i] : kEdges[i - corners];
  }

  /// Encloses primitives prims[0] ... prims[count - 1], count > 0; for conservative traversal with `padded`.
  static KdopBound Around(const rb_geometry& g, const uint32_t* prims, size_t count, bool padded) {
    Bounds3 all;
    double low[4 * kVectors + 1], high[4 * kVectors + 1];
    for (int i = 0; i < 4 * kVectors; ++i)
      low[i] = std::numeric_limits<double>::infinity(), high[i] = -low[i];
    for (size_t k = 0; k < count; ++k) {
      const uint32_t prim = prims[k];
      const Bounds3 tight = PrimBounds(g, prim);
      all.Extend(padded ? PaddedPrimBounds(g, prim) : tight);
      const bool is_triangle = prim < g.triangle_count;
      const Vec3f e = tight.Extent();
      const double pad = padded && is_triangle ? 0x1p-19 * std::max(e.x, std::max(e.y, e.z)) : 0;
      for (int corner = 0; corner < (is_triangle ? 3 : 8); ++corner) {
        const Vec3d p =
            is_triangle ? ToDouble(Vertex(g, prim, corner))
                        : Vec3d{corner & 1 ? tight.lo.x : tight.hi.x, corner & 2 ? tight.lo.y : tight.hi.y,
                                corner & 4 ? tight.lo.z : tight.hi.z};
        for (int i = 0; i < 4 * kVectors; ++i) {
          const double along = Dot(Direction(i), p);
          low[i] = std::min(low[i], along - pad), high[i] = std::max(high[i], along + pad);
        }
      }
    }
    KdopBound b;
    for (int a = 0; a < 3; ++a) b.lo[a] = all.lo[a], b.hi[a] = all.hi[a];
    constexpr float kInf = std::numeric_limits<float>::infinity();
    for (int i = 0; i < 4 * kVectors; ++i)
      b.lo[3 + i] = std::nextafter(float(low[i]), -kInf), b.hi[3 + i] = std::nextafter(float(high[i]), kInf);
    return b;
  }
  void Extend(const KdopBound& o) {
    for (int i = 0; i < 3 + 4 * kVectors; ++i)
      lo[i] = std::min(lo[i], o.lo[i]), hi[i] = std::max(hi[i], o.hi[i]);
  }
  /// K/2 lower ends, then K/2 upper ones.
  void CopyTo(float (&floats)[kFloats]) const {
    for (int i = 0; i < K / 2; ++i) floats[i] = lo[i], floats[i + K / 2] = hi[i];
  }

  class Ray {
    using Double4 = Vec<double, 4>;
    using Long4 = Vec<int64_t, 4>;

   public:
    Ray(const SlabRay& slab, const rb_ray& ray, Slack slack) : slab_(slab), tnear_(ray.tnear) {
      const Vec3d o = ToDouble(LoadVec3(ray.org)), d = ToDouble(LoadVec3(ray.dir));
      const Vec3d abs_o{std::fabs(o.x), std::fabs(o.y), std::fabs(o.z)};
      const double drift =
          slack == Slack::kNone ? 0 : 0x1p-19 * (std::fabs(d.x) + std::fabs(d.y) + std::fabs(d.z));
      for (int i = 0; i < 4 * kVectors; ++i) {
        const Vec3d n = Direction(i), abs_n{std::fabs(n.x), std::fabs(n.y), std::fabs(n.z)};
        const double along = Dot(n, d), at = Dot(n, o), speed = std::fabs(along);
        const double error = slack == Slack::kNone ? 0 : 0x1p-50 * Dot(abs_n, abs_o);
        Vector& v = vectors_[i / 4];
        v.backward[i % 4] = along < 0 ? -1 : 0;
        v.from[i % 4] = along < 0 ? -at : at;
        v.error[i % 4] = error;
        v.inv_near[i % 4] = 1 / (speed + drift);
        const bool leaves = speed > drift || slack == Slack::kNone;
        v.inv_far[i % 4] = leaves ? 1 / (speed - drift) : 0;
        v.stays[i % 4] = leaves ? 0 : std::numeric_limits<double>::infinity();
      }
    }

    bool Meets(const KdopBound& b, float tfar, float& entry) const {
      float enter, exit;
      slab_.Interval({{b.lo[0], b.lo[1], b.lo[2]}, {b.hi[0], b.hi[1], b.hi[2]}}, enter, exit);
      entry = std::max(enter, tnear_);
      if (!(entry <= std::min(exit, tfar))) return false;
      if constexpr (kVectors > 0) {
        Double4 last_entry = Splat<Double4>(enter), first_exit = Splat<Double4>(exit);
        for (int i = 0; i < kVectors; ++i) {
          const Vector& v = vectors_[i];
          const Double4 lo = __builtin_convertvector(Load<Float4>(b.lo + 3 + 4 * i), Double4),
                        hi = __builtin_convertvector(Load<Float4>(b.hi + 3 + 4 * i), Double4);
          const Double4 front = (v.backward ? -hi : lo) - v.from, back = (v.backward ? -lo : hi) - v.from;
          const Double4 n = (front - v.error) * v.inv_near, f = (back + v.error) * v.inv_far + v.stays;
          // A NaN is 0 x inf: the origin on a plane of a parallel slab, which bounds nothing.
          last_entry = MaxOrSecond(n, last_entry);
          first_exit = MinOrSecond(f, first_exit);
        }
        const double from =
            std::max(std::max(last_entry[0], last_entry[1]), std::max(last_entry[2], last_entry[3]));
        const double to =
            std::min(std::min(first_exit[0], first_exit[1]), std::min(first_exit[2], first_exit[3]));
        return from <= to + kRounding;
      }
      return true;
    }

   private:
    static constexpr double kRounding = 0x1p-149;

    struct Vector {
      Long4 backward;  // n.d < 0: the upper plane is met first
      Double4 from, error, inv_near, inv_far, stays;
    };

    const SlabRay& slab_;
    float tnear_;
    Vector vectors_[kVectors > 0 ? kVectors : 1];
  };
};

}  // namespace raybench
