// The point of a hit, and where rays that leave it start.
#pragma once

#include "accel/contract/raybench.h"
#include "datasets/scene/scene.h"

namespace raybench {

/// A hit point in double with what is needed to leave the surface safely.
struct SurfacePoint {
  Vec3d point;  ///< on the primitive, up to the roundings of double
  Vec3d
      normal;  ///< geometric, unit; triangles and polygons by winding (right hand), spheres and cones outward
  double offset;  ///< distance along the normal that makes float origins safe, see SurfaceAt()

  /// Start of a ray that leaves the surface towards +normal (side > 0) or -normal (side < 0).
  Vec3f Origin(double side) const { return ToFloat(point + normal * (side < 0 ? -offset : offset)); }
};

/// The point of `hit` (not a miss; hit.prim < scene.primitive_count()) of `ray`. Triangles: from the
/// barycentrics u, v, so that its error does not grow with the distance travelled; procedural primitives:
/// re-projected onto the surface.
SurfacePoint SurfaceAt(const Scene& scene, const rb_ray& ray, const rb_hit& hit);

/// The unit normal that shading goes by: vertex normals interpolated over triangles (barycentrics) and
/// polygons (mean value coordinates, Floater 2003) that have them, else the geometric one of `surface`. It
/// may point to the other side than that one. Needs scene.normals.
Vec3d ShadingNormal(const Scene& scene, const rb_hit& hit, const SurfacePoint& surface);

/// Texture coordinates of a hit on a triangle. Needs scene.uvs.
Vec2f UvAt(const Scene& scene, const rb_hit& hit);

}  // namespace raybench
