// The same scene larger or smaller, as files in other units are: each coordinate times a factor, rounded to float
// once. What goes wrong by a fixed length, such as an offset of 1e-4, shows here.

#include <fmt/format.h>

#include <cmath>
#include <cstddef>

#include "datasets/modifiers/modifiers.h"

namespace raybench {
namespace {

struct Config {
  double factor;
};

const rb_param kParams[] = {FloatParam("factor", "that each coordinate is multiplied by",
                                       offsetof(Config, factor), 1e-12, 1e12, 1, RB_PARAM_LOG)};

Scene Apply(Scene scene, const void* config, const LoadOptions& options) {
  const double factor = static_cast<const Config*>(config)->factor;
  const auto scaled = [&](float x) {
    const double y = double(x) * factor;
    // Positions stand for themselves times 2^-scale_exponent; there they must be floats as well.
    if (!std::isfinite(float(std::ldexp(y, -scene.scale_exponent))))
      throw InputError(fmt::format("scale: {}: factor {} leads out of float's range", scene.name, factor));
    return float(y);
  };
  const auto scale = [&](Vec3f& p) { p = {scaled(p.x), scaled(p.y), scaled(p.z)}; };
  for (Vec3f& p : scene.positions) scale(p);
  for (Sphere& sphere : scene.spheres) scale(sphere.center), sphere.radius = scaled(sphere.radius);
  for (Cone& cone : scene.cones) {
    scale(cone.base);
    scale(cone.apex);
    cone.base_radius = scaled(cone.base_radius);
    cone.apex_radius = scaled(cone.apex_radius);
  }
  for (Camera& camera : scene.cameras) scale(camera.eye), scale(camera.at);
  for (Light& light : scene.lights) {
    scale(light.position);
    if (std::isfinite(light.range)) light.range = scaled(light.range);
    // So that the light that arrives stays the same.
    if (light.falloff) light.intensity = light.intensity * float(factor * factor);
  }
  scene.Finish(options.drop_bad);
  return scene;
}

}  // namespace

const Modifier kScaleModifier = {"scale",
                                 "each coordinate times a factor; the picture stays",
                                 "a change of units",
                                 kParams,
                                 std::size(kParams),
                                 sizeof(Config),
                                 Apply};

}  // namespace raybench
