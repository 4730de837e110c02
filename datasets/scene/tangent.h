// The tangent of a camera's angle without libm, so that cameras are the same on every machine.
#pragma once

namespace raybench {

/// |angle| < pi / 2, in radians. From the Taylor series and the double-angle formula.
inline double Tangent(double angle) {
  const double h = angle / 64, h2 = h * h;
  double t = h * (1 + h2 * (1.0 / 3 + h2 * (2.0 / 15 + h2 * (17.0 / 315 + h2 * (62.0 / 2835)))));
  for (int i = 0; i < 6; ++i) t = 2 * t / (1 - t * t);
  return t;
}

}  // namespace raybench
