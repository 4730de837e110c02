// Bounding spheres (Whitted 1980; Rubin and Whitted 1980): the cheapest bound to store, seldom a tight one.
//
// A sphere encloses the boxes of its primitives, not only the primitives: a computed t may lie anywhere in
// the primitive's box (ray/primitive.h), and no sphere around it may begin behind that.
//
// The test is in double: the foot of the perpendicular from the centre, then Pythagoras from there, so that
// neither small far spheres nor large near ones cancel. An accepted ray may pass 6 u |p-o| beside the box, u
// = 2^-24 (ray/bounds.h); |p-o| is at most the centre's distance and the radius together.
#pragma once

#include "accel/bvh/bounds/box.h"

namespace raybench {

struct SphereBound {
  static constexpr uint32_t kShape = RB_SHAPE_SPHERE;
  static constexpr uint32_t kFloats = 4;

  float center[3], radius;

  /// About the middle of the box around all; as BoxBound::Around otherwise.
  static SphereBound Around(const rb_geometry& g, const uint32_t* prims, size_t count, bool padded) {
    const BoxBound all = BoxBound::Around(g, prims, count, padded);
    SphereBound s;
    for (int a = 0; a < 3; ++a) s.center[a] = float(0.5 * (double(all.lo[a]) + double(all.hi[a])));
    double square = 0;
    for (size_t i = 0; i < count; ++i) {
      const Bounds3 box = padded ? PaddedPrimBounds(g, prims[i]) : PrimBounds(g, prims[i]);
      double farthest = 0;
      for (int a = 0; a < 3; ++a) {
        const double reach =
            std::max(std::fabs(double(box.lo[a]) - s.center[a]), std::fabs(double(box.hi[a]) - s.center[a]));
        farthest += reach * reach;
      }
      square = std::max(square, farthest);
    }
    s.radius = std::nextafter(float(std::sqrt(square)), std::numeric_limits<float>::infinity());
    return s;
  }
  void CopyTo(float (&floats)[kFloats]) const {
    for (int a = 0; a < 3; ++a) floats[a] = center[a];
    floats[3] = radius;
  }

  class Ray {
   public:
    Ray(const SlabRay&, const rb_ray& ray, Slack slack)
        : org_(ToDouble(LoadVec3(ray.org))),
          dir_(ToDouble(LoadVec3(ray.dir))),
          inv_square_(1 / Dot(dir_, dir_)),
          inv_length_(std::sqrt(inv_square_)),
          slack_(slack == Slack::kNone ? 0 : 0x1p-19),
          tnear_(ray.tnear) {}

    bool Meets(const SphereBound& s, float tfar, float& entry) const {
      const Vec3d f = ToDouble(LoadVec3(s.center)) - org_;
      const double middle = Dot(f, dir_) * inv_square_;
      const Vec3d foot = f - dir_ * middle;
      double radius = s.radius;
      if (slack_ > 0) radius += slack_ * (radius + Length(f));
      const double square = radius * radius - Dot(foot, foot);
      if (!(square >= 0)) return false;
      const double half = std::sqrt(square) * inv_length_;
      // Towards smaller t: rounding to float must not move the entry behind a hit. A subnormal entry may have
      // been rounded up all the same, by 2^-150.
      entry = std::max(float((middle - half) * (1 - slack_)), tnear_);
      return double(entry) <= middle + half + 0x1p-149 && entry <= tfar;
    }

   private:
    Vec3d org_, dir_;
    double inv_square_, inv_length_, slack_;
    float tnear_;
  };
};

}  // namespace raybench
