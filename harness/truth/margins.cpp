// Margins of procedural primitives. The principle is that of verdict.cpp: a float test is allowed what it
// would answer for the same primitive moved by less than its error bound. With u = 2^-24:
//
// - Sphere: the foot of the perpendicular from the centre is found to within 16u of the centre's distance.
// - Cone: the ray is found to within 16u of the distance of the cone's middle and of its size. So the answer
//   lies between those for the cone grown and shrunk by that much, and over the rims by as much.
// - Polygon: vertices move as those of triangles do (verdict.cpp); t errs by what 16u of the farthest vertex
//   moves the plane by, but never leaves the range of the vertices.
#include "harness/truth/margins.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

namespace raybench {
namespace {

constexpr double kU = 0x1p-24;
constexpr double kTiny = 0x1p-148;  // rounding of subnormal floats

Appraisal AppraiseSphere(const rb_ray& ray, const Sphere& sphere, int root) {
  const Vec3d d = ToDouble(LoadVec3(ray.dir)), f = ToDouble(LoadVec3(ray.org)) - ToDouble(sphere.center);
  const double length = Length(d), middle = -Dot(f, d) / (length * length), r = std::fabs(sphere.radius);
  const double foot = Length(f + middle * d), shift = 16 * kU * (Length(f) + r);
  const double chord = r * r - foot * foot, error = (2 * foot + shift) * shift + 16 * kU * r * r;
  Appraisal result;
  result.possible = chord >= -error && (root == 1 || sphere.radius > 0);
  result.grazing = chord <= error;
  const auto half = [&](double square) { return std::sqrt(std::max(square, 0.0)) / length; };
  result.t = root == 0 ? middle - half(chord) : middle + half(chord);
  result.t_error = half(chord + error) - half(chord - error) + shift / length + 16 * kU * std::fabs(middle);
  return result;
}

/// A ray against the endless double cone around a cone's axis, about where the ray is nearest to its middle.
class ConeChord {
 public:
  ConeChord(const Cone& c, const rb_ray& ray) {
    const Vec3d base = ToDouble(c.base), d = ToDouble(LoadVec3(ray.dir));
    axis_ = ToDouble(c.apex) - base;
    height_ = Length(axis_);
    const double r0 = std::fabs(c.base_radius), r1 = std::fabs(c.apex_radius);
    mean_ = 0.5 * (r0 + r1);
    slope_ = (r1 - r0) / height_;
    const Vec3d from = ToDouble(LoadVec3(ray.org)) - (base + axis_ * 0.5);
    start = -Dot(from, d) / Dot(d, d);
    const Vec3d q = from + d * start;
    h0_ = Dot(q, axis_) / height_;
    h1_ = Dot(d, axis_) / height_;
    q_ = q - axis_ * (h0_ / height_);
    d_ = d - axis_ * (h1_ / height_);
    length = Length(d);
    shift = 16 * kU * (Length(from) + height_ + std::max(r0, r1));
  }

  /// Where the ray enters (0) or leaves (1) when the surface is moved outward by `growth`; none if it misses.
  std::optional<double> Root(int which, double growth) const {
    const double r = mean_ + growth * std::sqrt(1 + slope_ * slope_) + slope_ * h0_, dr = slope_ * h1_;
    const double a = Dot(d_, d_) - dr * dr, b = Dot(q_, d_) - r * dr, c = Dot(q_, q_) - r * r;
    // b b - a c by Lagrange's identity: along the axis both products are the same but for rounding.
    const Vec3d turned = d_ * r - q_ * dr, moment = Cross(d_, q_);
    const double discriminant = Dot(turned, turned) - Dot(moment, moment);
    if (!(discriminant >= 0)) return {};
    const double signed_root = which == 1 ? std::sqrt(discriminant) : -std::sqrt(discriminant);
    // (-b + signed_root) / a, or its other form where that cancels.
    const double t = b * signed_root <= 0 ? (signed_root - b) / a : -c / (b + signed_root);
    // On the mirrored half, and not by rounding at the apex.
    if (!std::isfinite(t) || r + t * dr < -shift) return {};
    return t;
  }
  /// How far beyond a rim the ray is at t; negative: between them.
  double Beyond(double t) const { return std::fabs(h0_ + t * h1_) - 0.5 * height_; }
  double ClimbRate() const { return std::fabs(h1_); }
  /// The ray is in the surface from rim to rim, and t (counted from the origin) between them.
  bool HoldsRayAt(double t) const {
    const auto gap = [&](double at) {
      return std::fabs(Length(q_ + d_ * at) - (mean_ + slope_ * (h0_ + at * h1_)));
    };
    const double to_base = (-0.5 * height_ - h0_) / h1_, to_apex = (0.5 * height_ - h0_) / h1_;
    const double slack = shift * 0x1p-4;
    return gap(to_base) <= slack && gap(to_apex) <= slack && Beyond(t - start) <= shift;
  }

  double start = 0, length = 0, shift = 0;

 private:
  Vec3d axis_, q_, d_;
  double height_, mean_, slope_, h0_, h1_;
};

Appraisal AppraiseCone(const rb_ray& ray, const Cone& cone, int root) {
  const ConeChord chord(cone, ray);
  const auto grown = chord.Root(root, chord.shift), exact = chord.Root(root, 0),
             shrunk = chord.Root(root, -chord.shift);
  Appraisal result;
  if (!grown) return result;
  const double rounding = chord.shift / chord.length + 16 * kU * std::fabs(chord.start);
  // The answer lies between the root of the grown cone and that of the shrunk one; where there is none, the
  // grown cone's other one. At an apex the exact cone may have none where both others have.
  const double other = (shrunk ? shrunk : chord.Root(1 - root, chord.shift)).value_or(exact.value_or(*grown));
  double t;
  if (exact) {
    t = *exact;
    result.t_error = std::max(std::fabs(*grown - t), std::fabs(other - t)) + rounding;
  } else {
    t = 0.5 * (*grown + other);
    result.t_error = 0.5 * std::fabs(other - *grown) + rounding;
  }
  const double slack = chord.shift + result.t_error * chord.ClimbRate();
  result.possible =
      chord.Beyond(t) <= slack && (root == 1 || !(cone.base_radius < 0 || cone.apex_radius < 0));
  result.grazing = !exact || !shrunk || chord.Beyond(t) >= -slack;
  result.t = chord.start + t;
  return result;
}

/// Whether the ray passes inside the polygon's outline and whether within the bound of it, and the range of
/// its vertices' t along the ray's main axis. Coordinates and bounds as in verdict.cpp's Sheared.
struct Outline {
  bool inside = false, near_edge = false;
  double lo = std::numeric_limits<double>::infinity(), hi = -lo;
  double reach = 0;  // of the farthest vertex from the origin

  Outline(const Scene& scene, const rb_ray& ray, const Polygon& polygon, int kz) {
    const Vec3d o = ToDouble(LoadVec3(ray.org)), d = ToDouble(LoadVec3(ray.dir));
    const int kx = (kz + 1) % 3, ky = (kz + 2) % 3;
    struct Corner {
      double x, y, dx, dy;
    };
    const auto corner_of = [&](uint32_t vertex) {
      const Vec3d a = ToDouble(scene.positions[vertex]) - o;
      const double shear_x = d[kx] / d[kz] * a[kz], shear_y = d[ky] / d[kz] * a[kz], z = a[kz] / d[kz];
      lo = std::min(lo, z);
      hi = std::max(hi, z);
      reach = std::max(reach, Length(a));
      return Corner{a[kx] - shear_x, a[ky] - shear_y,
                    4 * kU * (std::fabs(a[kx]) + std::fabs(shear_x)) + kTiny,
                    4 * kU * (std::fabs(a[ky]) + std::fabs(shear_y)) + kTiny};
    };
    const auto corners = scene.CornersOf(polygon);
    Corner a = corner_of(corners.back());
    for (uint32_t vertex : corners) {
      const Corner b = corner_of(vertex);
      const double first = a.x * b.y, second = a.y * b.x, edge = first - second;
      const double bound = std::fabs(a.x) * b.dy + std::fabs(b.y) * a.dx + std::fabs(a.y) * b.dx +
                           std::fabs(b.x) * a.dy + a.dx * b.dy + a.dy * b.dx +
                           4 * kU * (std::fabs(first) + std::fabs(second)) + kTiny;
      near_edge |= std::fabs(edge) <= bound && std::min(a.x - a.dx, b.x - b.dx) <= 0 &&
                   std::max(a.x + a.dx, b.x + b.dx) >= 0 && std::min(a.y - a.dy, b.y - b.dy) <= 0 &&
                   std::max(a.y + a.dy, b.y + b.dy) >= 0;
      if ((a.y > 0) != (b.y > 0)) inside ^= (edge > 0) == (b.y > 0);
      a = b;
    }
  }
};

/// The t interval inside a box, empty if lo > hi.
std::pair<double, double> Inside(const rb_ray& ray, const Bounds3& box) {
  double lo = -std::numeric_limits<double>::infinity(), hi = -lo;
  for (int k = 0; k < 3; ++k) {
    const double a = double(box.lo[k]) - ray.org[k], b = double(box.hi[k]) - ray.org[k], d = ray.dir[k];
    if (d == 0) {
      if (a > 0 || b < 0) return {1, 0};
      continue;
    }
    lo = std::max(lo, std::min(a / d, b / d));
    hi = std::min(hi, std::max(a / d, b / d));
  }
  return {lo, hi};
}

/// Of the corners alone, without the padding that structures get to see.
Bounds3 TightBounds(const Scene& scene, const Polygon& polygon) {
  Bounds3 box;
  for (uint32_t vertex : scene.CornersOf(polygon)) box.Extend(scene.positions[vertex]);
  return box;
}

Appraisal AppraisePolygon(const Scene& scene, const rb_ray& ray, uint32_t index, int axis) {
  const Outline outline(scene, ray, scene.polygons[index], axis);
  Appraisal result;
  result.possible = outline.inside || outline.near_edge;
  result.grazing = outline.near_edge;
  const double rounding = 12 * kU * std::max(std::fabs(outline.lo), std::fabs(outline.hi));
  result.t = 0.5 * (outline.lo + outline.hi);
  result.t_error = 0.5 * (outline.hi - outline.lo) + rounding;
  const PolygonPlane& plane = scene.PlaneOfPolygon(index);
  const double toward = Dot(plane.normal, ToDouble(LoadVec3(ray.dir)));
  const double t = Dot(plane.normal, plane.center - ToDouble(LoadVec3(ray.org))) / toward;
  const double error = 16 * kU * outline.reach * Length(plane.normal) / std::fabs(toward) + rounding;
  const auto [lo, hi] = Inside(ray, TightBounds(scene, scene.polygons[index]));
  if (t >= lo && t <= hi && error < result.t_error) {
    result.t = t;
    result.t_error = error;
  }
  return result;
}

bool LiesInPolygon(const Scene& scene, const rb_ray& ray, uint32_t polygon, double t) {
  const PolygonPlane& plane = scene.PlaneOfPolygon(polygon);
  const Vec3d d = ToDouble(LoadVec3(ray.dir)), f = plane.center - ToDouble(LoadVec3(ray.org));
  const double length = Length(plane.normal);
  if (std::fabs(Dot(plane.normal, d)) > 1e-8 * length * Length(d) ||
      std::fabs(Dot(plane.normal, f)) > 1e-8 * length * Length(f))
    return false;
  const auto [lo, hi] = Inside(ray, plane.bounds);
  const double slack = 0x1p-18 * std::fabs(t);
  return t >= lo - slack && t <= hi + slack;
}

}  // namespace

MainAxes::MainAxes(const rb_ray& ray) {
  const float longest = std::max({std::fabs(ray.dir[0]), std::fabs(ray.dir[1]), std::fabs(ray.dir[2])});
  for (int k = 0; k < 3; ++k)
    if (std::fabs(ray.dir[k]) == longest) axis[count++] = k;
}

Appraisal Either(const Appraisal& a, const Appraisal& b) {
  if (a.possible != b.possible) return a.possible ? a : b;
  const double lo = std::min(a.t - a.t_error, b.t - b.t_error),
               hi = std::max(a.t + a.t_error, b.t + b.t_error);
  return {a.possible, a.grazing || b.grazing, 0.5 * (lo + hi), 0.5 * (hi - lo)};
}

Appraisal AppraiseProcedural(const Scene& scene, const rb_ray& ray, uint32_t prim, int root) {
  const auto [kind, i] = scene.Locate(prim);
  if (kind == PrimKind::kSphere) return AppraiseSphere(ray, scene.spheres[i], root);
  if (kind == PrimKind::kCone) return AppraiseCone(ray, scene.cones[i], root);
  const MainAxes axes(ray);
  Appraisal result = AppraisePolygon(scene, ray, i, axes.axis[0]);
  for (int k = 1; k < axes.count; ++k) result = Either(result, AppraisePolygon(scene, ray, i, axes.axis[k]));
  return result;
}

int RootCount(const Scene& scene, uint32_t prim) {
  const PrimKind kind = scene.Locate(prim).kind;
  return kind == PrimKind::kSphere || kind == PrimKind::kCone ? 2 : 1;
}

bool LiesInSurface(const Scene& scene, const rb_ray& ray, uint32_t prim, double t) {
  const auto [kind, i] = scene.Locate(prim);
  if (kind == PrimKind::kPolygon) return LiesInPolygon(scene, ray, i, t);
  return kind == PrimKind::kCone && ConeChord(scene.cones[i], ray).HoldsRayAt(t);
}

}  // namespace raybench
