// Procedural primitives, known by a formula instead of triangles: spheres, cones (cylinders among them) and
// n-gons. What DXR calls procedural geometry with an intersection shader.
//
// All are tested in one arithmetic, whatever a structure's `numerics`: curved ones in double, n-gons with the
// sheared float vertices of the watertight triangle test and exact signs. Negative radii show only the
// inside, as in NFF; everything else is seen from both sides.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "accel/base/vec3.h"
#include "accel/contract/raybench.h"

namespace raybench {

/// Its surface. radius < 0: rays that come from outside pass through.
struct Sphere {
  Vec3f center;
  float radius;
};

/// The side of a truncated cone, without its two discs; with equal radii a cylinder. One radius may be 0: an
/// apex. Radii of different sign are not allowed; negative ones show only the inside.
struct Cone {
  Vec3f base;
  float base_radius;
  Vec3f apex;
  float apex_radius;
};

/// A flat polygon of any shape, counter-clockwise as seen from where its normal points: `count` corners from
/// `first` on in an array of vertex indices. A point is inside if it is enclosed an odd number of times
/// (even-odd rule), so holes may be cut by a bridge of two equal edges.
struct Polygon {
  uint32_t first, count;
};

/// What is worked out once for each polygon. Vertices need not lie in a plane exactly; then the plane through
/// their mean with Newell's normal (Sutherland, Sproull, Schumacker 1974) stands for them.
struct PolygonPlane {
  Vec3d normal;    ///< twice the area long; zero: the polygon has no area
  Vec3d center;    ///< mean of the corners
  Bounds3 bounds;  ///< padded as those of triangles
};
PolygonPlane PlaneOf(std::span<const Vec3f> positions, std::span<const uint32_t> corners);

/// Bounds rounded outward. Those of cones are padded as well: see Intersect().
Bounds3 BoundsOf(const Sphere& sphere);
Bounds3 BoundsOf(const Cone& cone);

/// Nearest t with ray.tnear < t <= ray.tfar at which the ray meets the primitive; false if there is none.
/// Curved primitives reject only the root they depart from, so a ray that starts on one finds its far side.
bool Intersect(const Sphere& sphere, const rb_ray& ray, float& t);
/// A cone reaches over its rims by 2^-48 of the distance, so that cones that share a rim leave no slit.
bool Intersect(const Cone& cone, const rb_ray& ray, float& t);
/// Two polygons that share an edge never both miss a ray that passes it, whether flat or not, nor do a
/// polygon and a triangle under watertight numerics.
bool Intersect(const PolygonPlane& plane, std::span<const Vec3f> positions, std::span<const uint32_t> corners,
               const rb_ray& ray, float& t);

/// Outward normal at a point of the surface, not normalised. Zero at a cone's apex.
inline Vec3d NormalAt(const Sphere& sphere, Vec3d point) { return point - ToDouble(sphere.center); }
Vec3d NormalAt(const Cone& cone, Vec3d point);

/// What makes the primitive unusable, as in "has radius 0; ..."; empty if nothing does.
std::string Flaw(const Sphere& sphere);
std::string Flaw(const Cone& cone);

/// The largest |coordinate| that the primitive may have.
double Reach(const Sphere& sphere);
double Reach(const Cone& cone);

}  // namespace raybench
