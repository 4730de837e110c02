#include "tests/plugins/saboteurs/kdop.h"

using namespace raybench;
using namespace raybench::saboteurs;

namespace {

/// 16 significant bits of x, rounded down or, by way of -x, up.
float Down(float x) {
  if (std::fabs(x) < 0x1p-100f) return x;
  const float unit = std::ldexp(1.0f, std::ilogb(x) - 15);
  return std::floor(x / unit) * unit;
}

struct Fault : HonestKdop {
  static constexpr const char* kName = "kdop_inward";
  static constexpr const char* kDoc = "oblique planes of 14-DOPs in 16 bits, rounded inward";
  static Kdop Stored(Kdop bound, const Kdop&) {
    for (int i = 3; i < 3 + Kdop::kOblique; ++i)
      bound.lo[i] = -Down(-bound.lo[i]), bound.hi[i] = Down(bound.hi[i]);
    return bound;
  }
};

}  // namespace

RAYBENCH_PLUGIN(Bvh<Fault>)
