// The compiled shaders of one device, in the variants that queries need.
#pragma once

#include <vulkan/vulkan.h>

#include <compare>
#include <cstdint>
#include <map>

#include "accel/vulkan/device.h"

namespace raybench::vulkan {

/// The two paths of queries, and the two steps of a wave (picture.h).
enum class Program : uint32_t { kQuery, kPipeline, kWave, kAdvance };

/// Constants of specialisation, as in shaders/common.glsl.
struct Variant {
  Program program;
  VkBool32 any_hit, filtered, procedural, counts_calls;
  auto operator<=>(const Variant&) const = default;
};

/// What the shaders of a query are given (shaders/query.glsl).
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
  Pipeline MakeCompute(const Variant& variant) const;
  Pipeline MakePipeline(const Variant& variant) const;

  const Device& device_;
  VkPipelineLayout layout_ = VK_NULL_HANDLE;
  std::map<Variant, Pipeline> made_;
};

}  // namespace raybench::vulkan
