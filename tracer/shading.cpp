#include "tracer/shading.h"

#include <algorithm>
#include <cmath>

namespace raybench {

double Power(double base, double exponent) {
  const auto whole = exponent >= 0 && exponent < 65536 ? uint32_t(exponent) : 0;
  if (double(whole) != exponent) return std::pow(base, exponent);
  double result = 1;
  for (uint32_t bits = whole; bits != 0; bits >>= 1, base *= base)
    if (bits & 1) result *= base;
  return result;
}

bool Refract(Vec3d view, Vec3d normal, double eta, Vec3d& refracted) {
  const double cosine = -Dot(normal, view);
  const double cos_squared = 1 - eta * eta * (1 - cosine * cosine);
  if (cos_squared < 0) return false;
  refracted = Normalize(view * eta + normal * (eta * cosine - std::sqrt(cos_squared)));
  return true;
}

double FresnelReflectance(double cosine, double eta) {
  const double sin_squared = eta * eta * (1 - cosine * cosine);  // on the other side
  if (sin_squared >= 1) return 1;
  const double other = std::sqrt(1 - sin_squared);
  const double across = (eta * cosine - other) / (eta * cosine + other),
               along = (cosine - eta * other) / (cosine + eta * other);
  return 0.5 * (across * across + along * along);
}

}  // namespace raybench
