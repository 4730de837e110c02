// The compiled shaders of one device, in the variants that queries need.
#pragma once

#include <vulkan/vulkan.h>

#include <compare>
#include <cstdint>
#include <map>

#include "accel/vulkan/device.h"

namespace raybench::vulkan {

enum class Path : uint32_t { kQuery, kPipeline };

/// Constants of specialisation, as in shaders/common.glsl.
struct Variant {
  Path path;
  VkBool32 any_hit, filtered, procedural, counts_calls;
  auto operator<=>(const Variant&) const = default;
};

/// What all shaders are given (shaders/common.glsl).
struct Push {
  VkDeviceAddress tlas, scene, rays, skip, after, answers, calls;
  uint32_t count;
  VkBool32 has_skip, has_after;
};

/// Rays of a workgroup of the path `query`.
inline constexpr uint32_t kGroup = 64;

struct Pipeline {
  VkPipeline pipeline = VK_NULL_HANDLE;
  Buffer table;  ///< shader binding table of the path `pipeline`
  VkStridedDeviceAddressRegionKHR generation{}, miss{}, hit{}, callable{};
};

class Pipelines {
 public:
  explicit Pipelines(const Device& device);

  VkPipelineLayout layout() const { return layout_; }
  VkShaderStageFlags PushStages() const;  ///< that are given Push
  /// Compiles it where it is not there yet. The caller holds the device's mutex.
  const Pipeline& Get(const Variant& variant);

 private:
  Pipeline MakeQuery(const Variant& variant) const;
  Pipeline MakePipeline(const Variant& variant) const;

  const Device& device_;
  VkPipelineLayout layout_ = VK_NULL_HANDLE;
  std::map<Variant, Pipeline> made_;
};

}  // namespace raybench::vulkan
