// The illumination model (Whitted 1980), as functions of directions. All directions are unit unless said
// otherwise; `view` points from the eye to the surface, `normal` to the side of the eye.
//
//   L = emission + ambient * diffuse + sum over lights f_r v I cos + reflect L(mirrored) + transmit
//   L(refracted)
//
// with f_r cos = diffuse cos(normal, light) + specular cos^shininess(mirrored, light) (Phong 1975), both
// sides of a surface alike, and visibility v in [0, 1].
#pragma once

#include <algorithm>
#include <cmath>

#include "datasets/scene/scene.h"

namespace raybench {

/// How a light reaches a point, blockers left aside.
struct Incident {
  Vec3d to_light;   ///< from the point to the light, or to where a directional one comes from
  double distance;  ///< length of to_light; 1 for a directional light
  double share;     ///< what falloff, cone and range leave of its intensity; 0: none
};
inline Incident LightAt(const Light& light, Vec3d point) {
  if (light.kind == LightKind::kDirectional) return {-ToDouble(light.direction), 1, 1};
  const Vec3d to_light = ToDouble(light.position) - point;
  const double square = Dot(to_light, to_light), distance = std::sqrt(square);
  double share = light.falloff ? 1 / square : 1;
  if (light.kind == LightKind::kSpot) {
    const double cosine = -Dot(to_light, ToDouble(light.direction)) / distance, inner = light.cos_inner,
                 outer = light.cos_outer;
    const double ramp = cosine >= inner   ? 1
                        : cosine <= outer ? 0
                                          : (cosine - outer) / (inner - outer);  // inner > outer here
    share *= ramp * ramp;
  }
  if (std::isfinite(light.range)) {
    const double ratio = distance / light.range, fourth = ratio * ratio * ratio * ratio;
    share *= std::clamp(1 - fourth, 0.0, 1.0);
  }
  return {to_light, distance, share};
}

/// base^exponent for base in (0, 1]. Integral exponents, the usual ones, take a few products.
double Power(double base, double exponent);

/// The direction `view` mirrored at the plane of `normal`.
inline Vec3d Mirrored(Vec3d view, Vec3d normal) { return view + normal * (2 * -Dot(normal, view)); }

/// Snell's law; `eta` is the index on the side of the eye over that on the other side. False on total
/// internal reflection.
bool Refract(Vec3d view, Vec3d normal, double eta, Vec3d& refracted);

/// The share of unpolarised light that the interface of two dielectrics mirrors (Fresnel), in [0, 1]; 1 on
/// total internal reflection. `cosine` of the angle to the normal, in [0, 1]; `eta` as in Refract().
double FresnelReflectance(double cosine, double eta);

}  // namespace raybench
