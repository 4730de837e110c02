#include "harness/fuzz/lattice.h"

#include <algorithm>
#include <cmath>

namespace raybench::fuzz {
namespace {

using Vec3i = Vec3<int64_t>;

bool ToIntegers(const float* p, int most, Vec3i& out) {
  for (int k = 0; k < 3; ++k) {
    if (!(std::fabs(p[k]) <= float(most)) || p[k] != std::trunc(p[k])) return false;
    out[k] = int64_t(p[k]);
  }
  return true;
}

}  // namespace

std::optional<std::vector<LatticeHit>> LatticeHits(const Case& c, const rb_ray& ray) {
  Vec3i org, dir;
  if (!ToIntegers(ray.org, 2 * kLattice, org) || !ToIntegers(ray.dir, kLattice, dir)) return std::nullopt;
  std::vector<LatticeHit> hits;
  for (uint32_t prim = 0; prim < c.triangles.size(); ++prim) {
    Vec3i p[3];
    for (int k = 0; k < 3; ++k) {
      if (!ToIntegers(&c.positions[c.triangles[prim][size_t(k)]].x, kLattice, p[k])) return std::nullopt;
      p[k] = p[k] - org;
    }
    // Volumes of the ray's line with the edges: their signs say on which side it passes.
    int64_t side[3];
    for (int k = 0; k < 3; ++k) side[k] = Dot(dir, Cross(p[k], p[(k + 1) % 3]));
    const bool some_negative = side[0] < 0 || side[1] < 0 || side[2] < 0;
    const bool some_positive = side[0] > 0 || side[1] > 0 || side[2] > 0;
    if (some_negative && some_positive)
      continue;  // clear of the triangle: two edges at least tell them apart
    if (side[0] == 0 || side[1] == 0 || side[2] == 0) return std::nullopt;
    const Vec3i normal = Cross(p[1] - p[0], p[2] - p[0]);
    int64_t den = Dot(normal, dir), num = Dot(normal, p[0]);
    if (den < 0) den = -den, num = -num;
    if (num == 0) return std::nullopt;
    if (num > 0) hits.push_back({num, den, prim});
  }
  std::sort(hits.begin(), hits.end(), [](const LatticeHit& a, const LatticeHit& b) {
    const int64_t left = a.num * b.den, right = b.num * a.den;
    return left != right ? left < right : a.prim < b.prim;
  });
  return hits;
}

}  // namespace raybench::fuzz
