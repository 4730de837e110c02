#include "datasets/scene/procedural.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "accel/ray/bounds.h"
#include "accel/ray/exact.h"
#include "accel/ray/triangle.h"

namespace raybench {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr float kMaxFloat = std::numeric_limits<float>::max();

/// Times a triangle's padding: 7.8 u of the largest extent at least, more than the tests of cones and polygons err by.
constexpr float kRoom = 5;

bool IsFinite(Vec3f v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

std::string Text(Vec3f v) { return fmt::format("({}, {}, {})", v.x, v.y, v.z); }

double MaxAbs(Vec3f v) { return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)}); }

float RoundedDown(double x) {
  const float f = float(x);
  return f > x ? std::nextafter(f, -kInfinity) : f;
}
float RoundedUp(double x) { return -RoundedDown(-x); }

Vec3f RoundedDown(Vec3d v) { return {RoundedDown(v.x), RoundedDown(v.y), RoundedDown(v.z)}; }
Vec3f RoundedUp(Vec3d v) { return {RoundedUp(v.x), RoundedUp(v.y), RoundedUp(v.z)}; }

/// False for NaN.
bool InInterval(const rb_ray& ray, float t) { return t > ray.tnear && t <= ray.tfar && t <= kMaxFloat; }

}  // namespace

// --- Sphere

Bounds3 BoundsOf(const Sphere& sphere) {
  const double r = std::fabs(sphere.radius);
  Bounds3 box;
  for (int a = 0; a < 3; ++a) {
    // A small radius far from 0 is less than the rounding of a sum in double.
    double below, above;
    const double lo = exact::TwoSum(sphere.center[a], -r, below),
                 hi = exact::TwoSum(sphere.center[a], r, above);
    box.lo[a] = RoundedDown(below < 0 ? std::nextafter(lo, -HUGE_VAL) : lo);
    box.hi[a] = RoundedUp(above > 0 ? std::nextafter(hi, HUGE_VAL) : hi);
  }
  return box;
}

/// The discriminant from the distance of the centre to the line and the roots from the product form, so that
/// neither small far spheres nor large near ones cancel (Hearn and Baker 2004; Haines et al. 2019).
bool Intersect(const Sphere& sphere, const rb_ray& ray, float& t) {
  const Vec3d d = ToDouble(LoadVec3(ray.dir)), f = ToDouble(LoadVec3(ray.org)) - ToDouble(sphere.center);
  const double r2 = double(sphere.radius) * sphere.radius, a = Dot(d, d), b = -Dot(f, d);
  const Vec3d nearest = f + d * (b / a);
  const double discriminant = r2 - Dot(nearest, nearest);
  if (!(discriminant >= 0)) return false;
  const double q = b + std::copysign(std::sqrt(a * discriminant), b);
  double t0 = q / a, t1 = q == 0 ? t0 : (Dot(f, f) - r2) / q;
  if (t0 > t1) std::swap(t0, t1);
  if (sphere.radius > 0 && InInterval(ray, float(t0))) return t = float(t0), true;
  if (InInterval(ray, float(t1))) return t = float(t1), true;
  return false;
}

std::string Flaw(const Sphere& s) {
  if (IsFinite(s.center) && s.radius != 0 && Reach(s) <= kMaxFloat) return {};
  return fmt::format("has centre {} and radius {}; it must be finite, and the radius not 0", Text(s.center),
                     s.radius);
}

double Reach(const Sphere& s) { return MaxAbs(s.center) + std::fabs(s.radius); }

// --- Cone
//
// Points are p = middle + s axis + radial with axis from base to apex, s in [-1/2, 1/2], radial across; the
// radius is r(s) = mean + s widening, the surface |radial|^2 = r(s)^2. Along a ray that is a quadratic.

namespace {

struct Frame {
  Vec3d middle, axis;
  double square, mean, widening;  ///< |axis|^2; radii

  explicit Frame(const Cone& c)
      : middle((ToDouble(c.base) + ToDouble(c.apex)) * 0.5),
        axis(ToDouble(c.apex) - ToDouble(c.base)),
        square(Dot(axis, axis)),
        mean(0.5 * (double(c.base_radius) + double(c.apex_radius))),
        widening(double(c.apex_radius) - double(c.base_radius)) {}
};

}  // namespace

Bounds3 BoundsOf(const Cone& cone) {
  // A disc of radius r around the unit axis a reaches r sqrt(1 - a_i^2) along axis i.
  const Frame frame(cone);
  Vec3d disc;
  for (int i = 0; i < 3; ++i) {
    const double along = frame.axis[i] * frame.axis[i] / frame.square;
    disc[i] = std::sqrt(std::max(0.0, 1 - along)) + 0x1p-40;
  }
  const Vec3d base = ToDouble(cone.base), apex = ToDouble(cone.apex);
  const Vec3d base_reach = disc * std::fabs(double(cone.base_radius)),
              apex_reach = disc * std::fabs(double(cone.apex_radius));
  return PaddedBounds({RoundedDown(Min(base - base_reach, apex - apex_reach)),
                       RoundedUp(Max(base + base_reach, apex + apex_reach))},
                      kRoom);
}

/// The origin is first moved along the ray to where it is nearest to the cone's middle, so that distance does
/// not cancel. With d and q the parts across the axis of direction and moved origin, r0 and r1 the radius at
/// that origin and its change along the ray, the discriminant is |r0 d - r1 q|^2 - |d x q|^2 (Lagrange's
/// identity): the difference of two squares that are each known to a few ulp.
bool Intersect(const Cone& cone, const rb_ray& ray, float& t) {
  const Frame frame(cone);
  const Vec3d dir = ToDouble(LoadVec3(ray.dir)), from = ToDouble(LoadVec3(ray.org)) - frame.middle;
  const double shift = -Dot(from, dir) / Dot(dir, dir);
  const Vec3d nearest = from + dir * shift;
  const double s0 = Dot(nearest, frame.axis) / frame.square, s1 = Dot(dir, frame.axis) / frame.square;
  const Vec3d d = dir - frame.axis * s1, q = nearest - frame.axis * s0;
  const double r0 = frame.mean + frame.widening * s0, r1 = frame.widening * s1;
  const Vec3d turned = d * r0 - q * r1, moment = Cross(d, q);
  const double discriminant = Dot(turned, turned) - Dot(moment, moment);
  if (!(discriminant >= 0)) return false;

  const double a = Dot(d, d) - r1 * r1, b = Dot(q, d) - r0 * r1, c = Dot(q, q) - r0 * r0;
  const double sum = -(b + std::copysign(std::sqrt(discriminant), b));
  const bool inside_only = cone.base_radius < 0 || cone.apex_radius < 0;
  bool found = false;
  const auto take = [&](double root, bool is_leaving) {
    const float candidate = float(shift + root);
    if (!InInterval(ray, candidate) || (inside_only && !is_leaving) || (found && candidate >= t)) return;
    const double beyond = std::fabs(s0 + root * s1) - 0.5;
    const double size = Dot(from, from) + frame.square + frame.mean * frame.mean;
    if (!(beyond <= 0) && !(beyond * beyond * frame.square <= 0x1p-96 * size)) return;
    t = candidate;
    found = true;
  };
  // A root of a t^2 + 2 b t + c leaves the cone if a t + b > 0; at sum / a that is a root of the sign of -b.
  take(sum / a, std::signbit(b));
  take(c / sum, !std::signbit(b));
  return found;
}

Vec3d NormalAt(const Cone& cone, Vec3d point) {
  const Frame frame(cone);
  const Vec3d p = point - frame.middle;
  const double s = Dot(p, frame.axis) / frame.square, r = frame.mean + frame.widening * s;
  return (p - frame.axis * s) - frame.axis * (r * frame.widening / frame.square);
}

std::string Flaw(const Cone& c) {
  const bool is_finite = IsFinite(c.base) && IsFinite(c.apex) && Reach(c) <= kMaxFloat;
  if (is_finite && !(c.base == c.apex) && (c.base_radius != 0 || c.apex_radius != 0) &&
      !(c.base_radius < 0 && c.apex_radius > 0) && !(c.base_radius > 0 && c.apex_radius < 0))
    return {};
  return fmt::format(
      "goes from {} with radius {} to {} with radius {}; it must be finite, its ends apart, its radii of one "
      "sign and not both 0",
      Text(c.base), c.base_radius, Text(c.apex), c.apex_radius);
}

double Reach(const Cone& c) {
  return std::max(MaxAbs(c.base) + std::fabs(c.base_radius), MaxAbs(c.apex) + std::fabs(c.apex_radius));
}

// --- Polygon

PolygonPlane PlaneOf(std::span<const Vec3f> positions, std::span<const uint32_t> corners) {
  Vec3d sum{0, 0, 0};
  Vec3f lo{kInfinity, kInfinity, kInfinity}, hi = -lo;
  for (uint32_t v : corners) {
    const Vec3f p = positions[v] + Vec3f{0, 0, 0};  // -0 becomes +0
    sum = sum + ToDouble(p);
    lo = Min(lo, p);
    hi = Max(hi, p);
  }
  PolygonPlane plane;
  plane.center = sum * (1 / double(corners.size()));
  plane.normal = {0, 0, 0};
  double size = 0;
  Vec3d a = ToDouble(positions[corners.back()]) - plane.center;
  for (uint32_t v : corners) {
    const Vec3d b = ToDouble(positions[v]) - plane.center;
    plane.normal = plane.normal + Cross(a, b);
    size += Length(a) * Length(b);
    a = b;
  }
  // What is left of collinear corners is rounding.
  if (!(Length(plane.normal) > 0x1p-45 * size)) plane.normal = {0, 0, 0};
  plane.bounds = PaddedBounds({lo, hi}, kRoom);
  return plane;
}

/// In the space where the ray is the z axis, the edges that cross the half-line y = 0, x > 0 are counted.
/// Whether an edge does depends on its two sheared vertices alone: one end has y > 0, the other has not, and
/// the sign of an edge function that merely changes sign with the edge's direction. So the two faces at an
/// edge agree about it, and of a closed surface an odd number of faces around any edge or vertex is met,
/// however their vertices were rounded: no leak. The vertices are sheared as the watertight triangle test
/// does it, and signs are exact given these. Therefore triangles and polygons that share an edge leave no
/// leak either.
bool Intersect(const PolygonPlane& plane, std::span<const Vec3f> positions, std::span<const uint32_t> corners,
               const rb_ray& ray, float& t) {
  float tnear, tfar;
  SlabRay(ray, Slack::kFarEnd).Interval(plane.bounds, tnear, tfar);
  if (!(tnear <= tfar && tfar > ray.tnear && tnear <= ray.tfar)) return false;

  const RayShear shear(ray);
  double zmin = kInfinity, zmax = -kInfinity;
  const auto sheared = [&](uint32_t v) {
    const Vec3d p = shear.Point(positions[v]);
    zmin = std::min(zmin, p.z);
    zmax = std::max(zmax, p.z);
    return p;
  };
  Vec3d a = sheared(corners.back());
  bool is_inside = false;
  for (uint32_t v : corners) {
    const Vec3d b = sheared(v);
    if ((a.y > 0) != (b.y > 0)) {
      const double edge = DifferenceOfProducts(a.x, b.y, a.y, b.x);
      is_inside ^= b.y > 0 ? edge > 0 : edge < 0;
    }
    a = b;
  }
  if (!is_inside) return false;

  // A ray in the plane, or nearly, has no certain t, but hits nothing in front of or behind all corners, nor
  // outside the polygon's bounds.
  const double toward = Dot(plane.normal, ToDouble(LoadVec3(ray.dir)));
  const double away = Dot(plane.normal, plane.center - ToDouble(LoadVec3(ray.org)));
  const double main = ray.dir[shear.kz], t0 = std::min(zmin / main, zmax / main),
               t1 = std::max(zmin / main, zmax / main);
  const double between = toward != 0 ? std::clamp(away / toward, t0, t1) : t0;
  const float candidate = std::clamp(float(between), tnear, tfar);
  if (!InInterval(ray, candidate)) return false;
  t = candidate;
  return true;
}

}  // namespace raybench
