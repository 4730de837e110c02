#include "tracer/self_intersection.h"

#include <bit>
#include <cmath>

namespace raybench {
namespace {

/// Waechter and Binder, "A Fast and Robust Method for Avoiding Self-Intersection" (Ray Tracing Gems 2019):
/// each coordinate is moved by up to 256 units in the last place, as the normal's component says, so that the
/// step grows with the coordinate as its rounding does; near 0, where such units vanish, by up to 2^-16.
float MovedByUnits(float x, float n) {
  constexpr float kOrigin = 1.0f / 32, kUnits = 256, kNear = 1.0f / 65536;
  if (std::fabs(x) < kOrigin) return x + kNear * n;
  const auto units = int32_t(kUnits * n);
  return std::bit_cast<float>(std::bit_cast<int32_t>(x) + (x < 0 ? -units : units));
}

}  // namespace

Departure Depart(const SurfacePoint& surface, double side, SelfIntersection cure, double size, uint32_t prim,
                 bool flat) {
  const Vec3d normal = surface.normal * (side < 0 ? -1.0 : 1.0);
  const Vec3f point = ToFloat(surface.point);
  switch (cure) {
    case SelfIntersection::kErrorBound:
      break;
    case SelfIntersection::kNone:
      return {point};
    case SelfIntersection::kFixedTnear:
      return {point, size};
    case SelfIntersection::kNormalOffset:
      return {ToFloat(surface.point + normal * size)};
    case SelfIntersection::kIntegerOffset: {
      const Vec3f n = ToFloat(normal);
      return {{MovedByUnits(point.x, n.x), MovedByUnits(point.y, n.y), MovedByUnits(point.z, n.z)}};
    }
    case SelfIntersection::kSkip:
      if (flat) return {point, 0, prim};
      break;
  }
  return {surface.Origin(side)};
}

}  // namespace raybench
