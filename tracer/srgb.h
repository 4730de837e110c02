#pragma once

#include <cmath>

namespace raybench {

/// The transfer curve of IEC 61966-2-1, for encoded values in [0, 1].
inline float FromSrgb(double x) {
  return float(x <= 0.04045 ? x / 12.92 : std::pow((x + 0.055) / 1.055, 2.4));
}

}  // namespace raybench
