// Private to the oracles: what float arithmetic may make of one ray and one triangle. VERDICTS.md derives it.
#pragma once

#include <algorithm>
#include <cmath>
#include <initializer_list>

#include "accel/ray/exact.h"
#include "datasets/scene/scene.h"
#include "harness/truth/margins.h"

namespace raybench {

inline constexpr double kFloatEps = 0x1p-24;    // u of VERDICTS.md
inline constexpr double kFloatTiny = 0x1p-148;  // rounding of subnormal floats

inline exact::Corners CornersOf(const Scene& scene, uint32_t triangle) {
  const auto& v = scene.triangles[triangle];
  return {ToDouble(scene.positions[v[0]]), ToDouble(scene.positions[v[1]]), ToDouble(scene.positions[v[2]])};
}

/// A triangle in Woop's coordinates, with the errors that float arithmetic may have made.
struct Sheared {
  double x[3], y[3], z[3];  // z in units of t
  double dx[3], dy[3];
  double edge[3], bound[3];  // edge i lies opposite vertex i

  /// `kz`: one of the ray's MainAxes.
  Sheared(const rb_ray& ray, const exact::Corners& p, int kz) {
    const Vec3d o = ToDouble(LoadVec3(ray.org)), d = ToDouble(LoadVec3(ray.dir));
    const int kx = (kz + 1) % 3, ky = (kz + 2) % 3;
    const double sx = d[kx] / d[kz], sy = d[ky] / d[kz];
    for (size_t i = 0; i < 3; ++i) {
      const Vec3d a = p[i] - o;
      x[i] = a[kx] - sx * a[kz];
      dx[i] = 4 * kFloatEps * (std::fabs(a[kx]) + std::fabs(sx * a[kz])) + kFloatTiny;
      y[i] = a[ky] - sy * a[kz];
      dy[i] = 4 * kFloatEps * (std::fabs(a[ky]) + std::fabs(sy * a[kz])) + kFloatTiny;
      z[i] = a[kz] / d[kz];
    }
    for (int i = 0; i < 3; ++i) {
      const int b = (i + 1) % 3, c = (i + 2) % 3;
      const double first = x[c] * y[b], second = y[c] * x[b];
      edge[i] = first - second;
      bound[i] = std::fabs(x[c]) * dy[b] + std::fabs(y[b]) * dx[c] + std::fabs(y[c]) * dx[b] +
                 std::fabs(x[b]) * dy[c] + dx[c] * dy[b] + dy[c] * dx[b] +
                 4 * kFloatEps * (std::fabs(first) + std::fabs(second)) + kFloatTiny;
    }
  }

  /// The ray lies in the widened box of these vertices.
  bool BoxHolds(std::initializer_list<int> vertices) const {
    bool left = false, right = false, below = false, above = false;
    for (int i : vertices) {
      left |= x[i] - dx[i] <= 0;
      right |= x[i] + dx[i] >= 0;
      below |= y[i] - dy[i] <= 0;
      above |= y[i] + dy[i] >= 0;
    }
    return left && right && below && above;
  }
  bool NearEdge(int i) const {
    return std::fabs(edge[i]) <= bound[i] && BoxHolds({(i + 1) % 3, (i + 2) % 3});
  }
  bool Possible() const {
    bool positive = true, negative = true;
    for (int i = 0; i < 3; ++i) {
      positive &= edge[i] >= -bound[i];
      negative &= edge[i] <= bound[i];
    }
    return (positive || negative) && BoxHolds({0, 1, 2});
  }
  /// Parity of how often the triangle covers the ray.
  bool Covers() const {
    bool odd = false;
    for (int a = 0; a < 3; ++a) {
      const int b = (a + 1) % 3;
      const double turn = x[a] * y[b] - y[a] * x[b];
      if (y[a] <= 0 && y[b] > 0) odd ^= turn > 0;
      if (y[b] <= 0 && y[a] > 0) odd ^= turn < 0;
    }
    return odd;
  }
  Appraisal Appraise() const {
    Appraisal result;
    result.possible = Possible();
    const double det = edge[0] + edge[1] + edge[2], slack = bound[0] + bound[1] + bound[2];
    const auto [lo, hi] = std::minmax({z[0], z[1], z[2]});
    const double rounding = 12 * kFloatEps * std::max(std::fabs(lo), std::fabs(hi));
    result.t = 0.5 * (lo + hi);
    result.t_error = 0.5 * (hi - lo) + rounding;
    if (std::fabs(det) <= 2 * slack) return result;
    double t = 0, weighted = 0;
    for (int i = 0; i < 3; ++i) t += edge[i] * z[i];
    t /= det;
    for (int i = 0; i < 3; ++i) weighted += bound[i] * std::fabs(z[i] - t);
    const double error = weighted / (std::fabs(det) - slack) + rounding;
    if (error < result.t_error) {
      result.t = t;
      result.t_error = error;
    }
    return result;
  }
};

}  // namespace raybench
