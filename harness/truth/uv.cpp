#include "harness/truth/uv.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "harness/truth/sheared.h"

namespace raybench {

double UvTruth::Error(const rb_hit& answer) const {
  if (!std::isfinite(answer.u) || !std::isfinite(answer.v)) return std::numeric_limits<double>::infinity();
  return std::max(std::fabs(answer.u - u) / u_bound, std::fabs(answer.v - v) / v_bound);
}

namespace {

UvTruth TrueUvAlong(int axis, const Scene& scene, const rb_ray& ray, uint32_t prim) {
  const Sheared s(ray, CornersOf(scene, prim), axis);
  const double det = s.edge[0] + s.edge[1] + s.edge[2], slack = s.bound[0] + s.bound[1] + s.bound[2];
  const double rest = std::fabs(det) - slack;
  if (!(rest > 0)) return {};
  const auto bound = [&](int i, double weight) {
    const double own = s.bound[i], others = slack - own;
    const double edges = (std::fabs(1 - weight) * own + std::fabs(weight) * others) / rest;
    return edges + 4 * kFloatEps * std::max(1.0, std::fabs(weight));
  };
  UvTruth uv{true, s.edge[1] / det, s.edge[2] / det};
  uv.u_bound = bound(1, uv.u);
  uv.v_bound = bound(2, uv.v);
  return uv;
}

}  // namespace

UvTruth TrueUv(const Scene& scene, const rb_ray& ray, const rb_hit& answer) {
  if (answer.prim >= scene.triangles.size()) return {};
  UvTruth uv;
  for (int axis : MainAxes(ray)) {
    const UvTruth along = TrueUvAlong(axis, scene, ray, answer.prim);
    if (!along.known) return {};
    if (!uv.known) uv = along;
    uv.u_bound = std::max(uv.u_bound, along.u_bound);
    uv.v_bound = std::max(uv.v_bound, along.v_bound);
  }
  return uv;
}

}  // namespace raybench
