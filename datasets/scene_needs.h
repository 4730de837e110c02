// "Model only what a scene requires": what a scene asks of loader, tracer and structures.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "datasets/scene.h"

namespace raybench {

/// One decision with its reason, for people.
struct Need {
  const char* name;  ///< "refraction_rays", "transmittance", ...: a key of `needs` in run.json
  bool needed;
  std::string why;  ///< "2 of 5 materials transmit", "no material transmits"
};

struct SceneNeeds {
  bool shadow_rays = true;       ///< some light can reach some surface
  bool reflection_rays = false;  ///< some primitive's material reflects, or may reflect totally
  bool refraction_rays = false;
  /// Shadow rays must gather the transmittance of what they pass (resuming, `after`); otherwise they stop at
  /// the first blocker (any-hit).
  bool transmittance = false;
  bool uv = false;  ///< barycentrics of hits are read: textures, interpolated normals, or the tracer's hit points
  bool textures = false, smooth_normals = false, alpha = false, dispersion = false, environment = false;
  bool closed = false;               ///< triangles form a closed surface; procedural primitives are not looked at
  double smallest_feature_ulp = 0;   ///< shortest positive edge or radius, in ulp of the largest coordinate
  double size_spread = 0;            ///< 99th over 1st percentile of triangle extents; 0: no triangles
  std::vector<Need> list;            ///< all of the above that are yes or no, in a fixed order

  uint64_t BuildNeeds() const;  ///< RB_NEED_* for rb_build_options::needs
};

/// Only materials that some primitive uses count. Cheap next to loading.
SceneNeeds NeedsOf(const Scene& scene);

}  // namespace raybench
