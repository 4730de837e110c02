// "Model only what a scene requires": what a scene asks of loader, tracer and structures.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "datasets/scene/scene.h"

namespace raybench {

/// One decision with its reason, for people.
struct Need {
  const char* name;  ///< "refraction_rays", "transmittance", ...: a key of `needs` in run.json
  bool needed;
  std::string why;  ///< "2 of 5 materials in use transmit", "no material in use transmits"
};

/// What a picture of the scene needs, at any depth of recursion and without overrides such as Fresnel's
/// equations for all. Only materials that some primitive uses count.
struct SceneNeeds {
  bool shadow_rays = false;      ///< some light shines, and some material scatters light
  bool reflection_rays = false;  ///< some material reflects, or may reflect totally or by Fresnel
  bool refraction_rays = false;  ///< some material transmits, thin ones included
  /// Shadow rays must gather the transmittance of what they pass (resuming, `after`); otherwise they stop at
  /// the first blocker (any-hit).
  bool transmittance = false;
  bool uv = false;  ///< barycentrics of hits are read: there are triangles, whose hit points come from them
  bool textures = false;        ///< some triangle's material reads a texture, and there are coordinates
  bool smooth_normals = false;  ///< some shading normal is not the geometric one
  bool alpha = false;           ///< some material is cut out by its alpha
  bool dispersion = false;      ///< channels are refracted apart
  bool environment = false;     ///< rays that miss look up a map
  std::vector<Need> list;       ///< all of the above, in this order

  std::vector<uint32_t> textured;  ///< materials whose textures are read, ascending

  uint64_t BuildNeeds() const;  ///< RB_NEED_* for rb_build_options::needs
};

/// Of a scene on which Finish() has run. Linear in the primitives: cheap next to loading. Figures of the
/// shape (closed, smallest feature, spread of sizes) take longer and stand in SceneFacts.
SceneNeeds NeedsOf(const Scene& scene);

/// What a renderer does that does not look at the scene: all that the data which are there allow. The picture
/// is the same but for rounding; what it takes longer shows what NeedsOf() saves. `list` stays empty.
SceneNeeds AllNeedsOf(const Scene& scene);

/// Leaves out texture coordinates, textures and shading normals that NeedsOf() says nothing reads, and adds
/// what they took to stats.saved_bytes. The geometry and its hash stay.
void DropUnread(Scene& scene);

}  // namespace raybench
