// Pictures traced in waves on the device, the next one's size written by the shaders of this one.
#pragma once

#include "accel/contract/picture.h"
#include "accel/vulkan/scene.h"

namespace raybench::vulkan {

/// Fills the results of `picture`. The caller holds the device's mutex.
void Draw(const Device& device, const SceneOnDevice& scene, rb_picture& picture);

}  // namespace raybench::vulkan
