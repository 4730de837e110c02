// What the generators of Haines' Standard Procedural Databases share: balls, gears, mount, rings, teapot,
// tetra, tree, lattice. They make the scenes that his programs of version 3.15 print as NFF, primitive by
// primitive and in that order, but with coordinates that have not been rounded to six digits.
#pragma once

#include <initializer_list>
#include <span>

#include "datasets/generators/generators.h"

namespace raybench {

struct SpdConfig {
  int64_t size;
};

/// The databases' only parameter.
constexpr rb_param SpdSize(const char* doc, int lo, int hi, int published) {
  return IntParam("size", doc, offsetof(SpdConfig, size), double(lo), double(hi), double(published));
}
inline int64_t SpdSizeOf(const void* config) { return static_cast<const SpdConfig*>(config)->size; }

constexpr char kSpdSource[] =
    "Haines, A proposal for standard graphics environments, IEEE CG&A 7(11), 1987; SPD 3.15";

constexpr Generator SpdGenerator(const char* name, const char* doc, const rb_param (&params)[1],
                                 uint64_t (*count)(const void*),
                                 Scene (*generate)(const void*, const LoadOptions&)) {
  return {name, doc, kSpdSource, params, 1, sizeof(SpdConfig), count, generate};
}

/// An empty scene with the databases' sky, a camera whose picture spans `degrees`, and lights without
/// fall-off, of intensity 1 / sqrt(number of lights).
Scene SpdScene(Vec3d eye, Vec3d at, Vec3d up, double degrees, std::initializer_list<Vec3d> lights);

/// A surface of NFF.
struct SpdSurface {
  const char* name;
  Vec3d color;
  double kd = 1, ks = 0;
  double highlight =
      0;  ///< degrees off the mirror direction where the highlight is half as bright; 0: no width
  double transmittance = 0, ior = 0;
};
/// Adds it, as the NFF reader understands it, and returns its index.
uint32_t AddSurface(Scene& scene, const SpdSurface& surface);

void AddSphere(Scene& scene, Vec3d center, double radius, uint32_t material);
void AddCone(Scene& scene, Vec3d base, double base_radius, Vec3d apex, double apex_radius, uint32_t material);
uint32_t AddVertex(Scene& scene, Vec3d position);
void AddTriangle(Scene& scene, std::array<uint32_t, 3> corners, uint32_t material);
void AddPolygon(Scene& scene, std::span<const uint32_t> corners, uint32_t material);
/// A square of side 2 `half` around the z axis, seen from above.
void AddGround(Scene& scene, double half, double z, uint32_t material);

/// An angle by its sine and cosine.
struct Angle {
  double sine, cosine;
};
Angle Degrees(double degrees);
/// `v` turned around the unit vector `axis`, counter-clockwise seen against it (Rodrigues' formula).
inline Vec3d Turn(Vec3d v, Vec3d axis, Angle angle) {
  return v * angle.cosine + Cross(axis, v) * angle.sine + axis * (Dot(axis, v) * (1 - angle.cosine));
}
constexpr Vec3d kXAxis{1, 0, 0}, kZAxis{0, 0, 1};

/// Natural logarithm of a normal number x > 0 without libm, to about 1e-15 of it.
double NaturalLog(double x);

}  // namespace raybench
