// The tracer's waves on a device: structures whose plugin exports RAYBENCH_PICTURE_ENTRY draw the picture there.
#pragma once

#include "accel/host/registry.h"
#include "datasets/scene/scene.h"
#include "tracer/tracer.h"

namespace raybench {

struct DevicePicture {
  TraceResult result;              ///< without what only the host counts: ray sets, shadow_resumed
  double seconds = 0, copies = 0;  ///< by the device's clock
};

/// Throws InputError, one line, for what the device does not do: textures, alpha, environment maps, several samples a
/// pixel, other rules and cures than the default; and for structures that do not draw.
void RequireDeviceWaves(const Registry& registry, const Contestant& contestant, const Scene& scene,
                        const TraceOptions& options);
/// After that. Throws BuildError with what the device says.
DevicePicture TraceOnDevice(const Registry& registry, const Scene& scene, const Tree& tree,
                            const TraceOptions& options);

}  // namespace raybench
