// The axis-aligned box as one kind of bound among others (bound_tree.h says what a bound must offer).
#pragma once

#include "accel/ray/bounds.h"

namespace raybench {

struct BoxBound {
  static constexpr uint32_t kShape = RB_SHAPE_BOX;
  static constexpr uint32_t kFloats = 6;

  float lo[3], hi[3];

  /// Encloses primitives prims[0] ... prims[count - 1], count > 0; for conservative traversal with `padded`.
  static BoxBound Around(const rb_geometry& g, const uint32_t* prims, size_t count, bool padded) {
    Bounds3 box;
    for (size_t i = 0; i < count; ++i)
      box.Extend(padded ? PaddedPrimBounds(g, prims[i]) : PrimBounds(g, prims[i]));
    return {{box.lo.x, box.lo.y, box.lo.z}, {box.hi.x, box.hi.y, box.hi.z}};
  }
  void Extend(const BoxBound& o) {
    for (int a = 0; a < 3; ++a) lo[a] = std::min(lo[a], o.lo[a]), hi[a] = std::max(hi[a], o.hi[a]);
  }
  void CopyTo(float (&floats)[kFloats]) const {
    for (int a = 0; a < 3; ++a) floats[a] = lo[a], floats[a + 3] = hi[a];
  }

  class Ray {
   public:
    Ray(const SlabRay& slab, const rb_ray& ray, Slack) : slab_(slab), tnear_(ray.tnear) {}
    bool Meets(const BoxBound& b, float tfar, float& entry) const {
      float exit;
      slab_.Interval({LoadVec3(b.lo), LoadVec3(b.hi)}, entry, exit);
      entry = std::max(entry, tnear_);
      return entry <= std::min(exit, tfar);
    }

   private:
    const SlabRay& slab_;
    float tnear_;
  };
};

}  // namespace raybench
