#include "tests/plugins/saboteurs/bvh.h"

using namespace raybench;
using namespace raybench::saboteurs;

namespace {

struct SkippingSlab : WideningSlab {
  using WideningSlab::WideningSlab;
  void Interval(const Bounds3& box, float& tnear, float& tfar) const {
    WideningSlab::Interval(box, tnear, tfar);
    const bool filled = box.lo.x <= box.hi.x && box.lo.y <= box.hi.y && box.lo.z <= box.hi.z;
    if (!filled) tnear = std::numeric_limits<float>::infinity(), tfar = -tnear;
  }
};

struct Fault : HonestBvh {
  static constexpr const char* kName = "nan_ancestor";
  static constexpr const char* kDoc =
      "boxes relative to their parent: where it is flat, 0 x inf makes a NaN of them, and they count as "
      "empty";
  using Bound = BoxOf<SkippingSlab>;

  static Bound Stored(const Bound& bound, const Bound& parent) {
    Bound relative = bound;
    if (&bound == &parent) return relative;
    for (int a = 0; a < 3; ++a) {
      const float from = parent.box.lo[a], extent = parent.box.hi[a] - from, scale = 1 / extent;
      auto there_and_back = [&](float x) { return from + (x - from) * scale * extent; };
      // Outward, but not beyond the parent: std::min and std::max keep a NaN that comes first.
      float &lo = relative.box.lo[a], &hi = relative.box.hi[a];
      lo = std::max(std::min(there_and_back(lo), lo), from);
      hi = std::min(std::max(there_and_back(hi), hi), parent.box.hi[a]);
    }
    return relative;
  }
};

}  // namespace

RAYBENCH_PLUGIN(Bvh<Fault>)
