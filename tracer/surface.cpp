// Error-bound offset of ray origins (the idea: Pharr, Jakob, Humphreys, Physically Based Rendering, section
// "Managing Rounding Error"; the bounds here are our own). u = 2^-24 is the unit roundoff of float.
//
// A ray that starts at a hit must not hit the same primitive again, at any scale and any place. These
// errors count:
//
// 1. Rounding the origin to float moves component i by at most u |q_i|, so its distance from the tangent
//    plane changes by at most u sum |n_i q_i|. The point itself is an affine combination of the vertices in
//    double (1-u-v is exact to 2^-53): its own error is 2^-29 times that and is covered by enlarging the
//    bound by 2^-20.
//
// 2. The structure's float test finds t with an error.
//    - Triangles: in float tests (Moeller-Trumbore, Woop) the numerator of t is a sum of triple products of
//      vertices relative to the origin; at a point of the triangle these are no longer than its longest edge
//      L, so the sum is wrong by about u L^3. The true numerator of a ray starting at distance e from the
//      plane is 2 A e, A the area. The sign of t, all that matters here, is right if e > c u L^3 / 2A. Over
//      random triangles of aspect 1 to 1e5, with grazing rays, c = 1 sufficed for both tests; c = 2 is taken.
//      For a sliver of aspect k this grows as k u L; from k = 1024 on it is held at 2^-13 L, since a larger
//      step would leap over neighbours. (There only `double` and `exact` numerics are safe.)
//    - Spheres of radius r: the constant term |o-c|^2 - r^2 (true: 2 r e) is wrong by at most 4 u r^2 and a
//      little more: e = 4 u r is twice what is needed.
//    - Cones are tested in double about a point near their middle; the discriminant and the coefficients are
//      those of a cone whose radius is off by a few 2^-52 of its size: e = 2^-44 of it is plenty.
//    - Polygons are tested against their plane in double, but a neighbour's plane at a shared edge is off by
//      the rounding of vertices: e = 2 u of the extent, as for triangles of aspect 1.
//
// 3. On a curved surface the origin also moves along the tangent plane, by at most delta = u |q|, and there
//    the surface bends away by delta^2 / 2r, never by more than delta.
//
// The origin is moved by the sum of these, so that after rounding it is at least the second away from
// the surface.
#include "tracer/surface.h"

namespace raybench {
namespace {

constexpr double kUnitRoundoff = 0x1p-24;

double RoundingOffset(Vec3d point, Vec3d normal) {
  return (1 + 0x1p-20) * kUnitRoundoff *
         (std::abs(normal.x * point.x) + std::abs(normal.y * point.y) + std::abs(normal.z * point.z));
}

SurfacePoint OnTriangle(const Scene& scene, const rb_hit& hit) {
  const auto& [i0, i1, i2] = scene.triangles[hit.prim];
  const Vec3d p0 = ToDouble(scene.positions[i0]), p1 = ToDouble(scene.positions[i1]),
              p2 = ToDouble(scene.positions[i2]);
  const Vec3d e1 = p1 - p0, e2 = p2 - p0, e3 = p2 - p1;
  const Vec3d cross = Cross(e1, e2);
  const double twice_area = Length(cross);
  const double u = hit.u, v = hit.v;

  SurfacePoint s;
  s.point = p0 * (1 - u - v) + p1 * u + p2 * v;
  s.normal = cross * (1 / twice_area);
  const double square = std::max({Dot(e1, e1), Dot(e2, e2), Dot(e3, e3)}), longest = std::sqrt(square);
  const double aspect = std::min(square / twice_area, 1024.0);  // L / h, as h = 2A / L
  s.offset = RoundingOffset(s.point, s.normal) + 2 * kUnitRoundoff * aspect * longest;
  return s;
}

/// How far rounding along the tangent plane leads away from a surface with this radius of curvature.
double CurvatureOffset(Vec3d point, double radius) {
  const double delta = kUnitRoundoff * Length(point);
  return std::min(delta, delta * delta / (2 * radius));
}

Vec3d PointAt(const rb_ray& ray, const rb_hit& hit) {
  return ToDouble(LoadVec3(ray.org)) + ToDouble(LoadVec3(ray.dir)) * double(hit.t);
}

SurfacePoint OnSphere(const Sphere& sphere, const rb_ray& ray, const rb_hit& hit) {
  const Vec3d center = ToDouble(sphere.center);
  const double radius = std::fabs(sphere.radius);
  SurfacePoint s;
  s.normal = Normalize(PointAt(ray, hit) - center);
  s.point = center + s.normal * radius;
  s.offset =
      RoundingOffset(s.point, s.normal) + CurvatureOffset(s.point, radius) + 4 * kUnitRoundoff * radius;
  return s;
}

/// Nearest in the cross section through the hit, between the rims.
SurfacePoint OnCone(const Cone& cone, const rb_ray& ray, const rb_hit& hit) {
  const Vec3d base = ToDouble(cone.base), axis = ToDouble(cone.apex) - base;
  const double r0 = std::fabs(cone.base_radius), r1 = std::fabs(cone.apex_radius), length = Length(axis);
  const Vec3d along = axis * (1 / length), p = PointAt(ray, hit) - base;
  const double height = std::clamp(Dot(p, along), 0.0, length), radius = r0 + (r1 - r0) * (height / length);
  Vec3d outward = p - along * Dot(p, along);
  // On the axis, at an apex: against the ray, as far as that is across.
  const Vec3d dir = ToDouble(LoadVec3(ray.dir));
  if (Dot(outward, outward) == 0) outward = along * Dot(dir, along) - dir;
  if (Dot(outward, outward) == 0) outward = Cross(along, Vec3d{along.y, along.z, along.x});
  if (Dot(outward, outward) == 0) outward = Vec3d{along.y, -along.x, 0};
  outward = Normalize(outward);
  SurfacePoint s;
  s.point = base + along * height + outward * radius;
  s.normal = Normalize(outward - along * ((r1 - r0) / length));
  s.offset = RoundingOffset(s.point, s.normal) + CurvatureOffset(s.point, radius) +
             0x1p-44 * (length + std::max(r0, r1));
  return s;
}

SurfacePoint OnPolygon(const PolygonPlane& plane, const rb_ray& ray, const rb_hit& hit) {
  const Vec3d p = PointAt(ray, hit);
  const Vec3f extent = plane.bounds.Extent();
  SurfacePoint s;
  s.normal = Normalize(plane.normal);
  s.point = p - s.normal * Dot(s.normal, p - plane.center);
  s.offset = RoundingOffset(s.point, s.normal) +
             2 * kUnitRoundoff * double(std::max({extent.x, extent.y, extent.z}));
  return s;
}

/// add(vertex, weight) for the corners of a polygon around a point of it, convex or not; the weights have the
/// sign of a positive sum.
template <class Add>
void MeanValueWeights(const Scene& scene, std::span<const uint32_t> corners, const SurfacePoint& surface,
                      const Add& add) {
  const size_t n = corners.size();
  const auto spoke = [&](size_t i) { return ToDouble(scene.positions[corners[i % n]]) - surface.point; };
  // tan(a / 2) of the angle a between spokes i and i + 1, from its sine and cosine; 0: they are parallel.
  const auto half_tangent = [&](size_t i) {
    const Vec3d a = spoke(i), b = spoke(i + 1);
    const double sine = Dot(Cross(a, b), surface.normal);
    return sine == 0 ? 0 : (Length(a) * Length(b) - Dot(a, b)) / sine;
  };
  for (size_t i = 0; i < n; ++i) {
    const Vec3d a = spoke(i), b = spoke(i + 1);
    const double to_a = Length(a), to_b = Length(b);
    if (to_a == 0) return add(corners[i], 1);
    // On an edge the tangent is infinite: its two corners alone count.
    if (Dot(a, b) < 0 && Length(Cross(a, b)) <= 0x1p-40 * to_a * to_b)
      return add(corners[i], to_b), add(corners[(i + 1) % n], to_a);
  }
  double before = half_tangent(n - 1);
  for (size_t i = 0; i < n; ++i) {
    const double after = half_tangent(i);
    add(corners[i], (before + after) / Length(spoke(i)));
    before = after;
  }
}

}  // namespace

SurfacePoint SurfaceAt(const Scene& scene, const rb_ray& ray, const rb_hit& hit) {
  const auto [kind, i] = hit.prim < scene.triangles.size() ? Scene::Place{PrimKind::kTriangle, hit.prim}
                                                           : scene.Locate(hit.prim);
  switch (kind) {
    case PrimKind::kTriangle:
      break;
    case PrimKind::kSphere:
      return OnSphere(scene.spheres[i], ray, hit);
    case PrimKind::kCone:
      return OnCone(scene.cones[i], ray, hit);
    case PrimKind::kPolygon:
      return OnPolygon(scene.PlaneOfPolygon(i), ray, hit);
  }
  return OnTriangle(scene, hit);
}

Vec3d ShadingNormal(const Scene& scene, const rb_hit& hit, const SurfacePoint& surface) {
  Vec3d sum{0, 0, 0};
  const auto add = [&](uint32_t vertex, double weight) {
    const Vec3d n = ToDouble(scene.normals[vertex]);
    const double square = Dot(n, n);
    if (square > 0) sum = sum + n * (weight / std::sqrt(square));
  };
  if (hit.prim < scene.triangles.size()) {
    const auto& corners = scene.triangles[hit.prim];
    const double u = hit.u, v = hit.v;
    add(corners[0], 1 - u - v);
    add(corners[1], u);
    add(corners[2], v);
  } else if (const auto [kind, i] = scene.Locate(hit.prim); kind == PrimKind::kPolygon) {
    MeanValueWeights(scene, scene.CornersOf(scene.polygons[i]), surface, add);
  }
  const double square = Dot(sum, sum);
  return square > 0 ? sum * (1 / std::sqrt(square)) : surface.normal;
}

Vec2f UvAt(const Scene& scene, const rb_hit& hit) {
  const auto& [i0, i1, i2] = scene.triangles[hit.prim];
  const Vec2f a = scene.uvs[i0], b = scene.uvs[i1], c = scene.uvs[i2];
  const double u = hit.u, v = hit.v, w = 1 - u - v;
  return {float(w * a.u + u * b.u + v * c.u), float(w * a.v + u * b.v + v * c.v)};
}

}  // namespace raybench
