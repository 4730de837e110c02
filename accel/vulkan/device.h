// A Vulkan device with ray tracing, and as much of Vulkan as is needed to work on it: buffers, one queue, a clock.
//
// Devices are made on demand, one for each index, and live as long as the process; a forked child, in which a
// driver's threads are gone, makes its own. One that was lost is opened anew for the next tree. All errors are std::runtime_error of one line. With the variable
// RAYBENCH_VULKAN_VALIDATION=1 the Khronos validation layer looks at every call, and what it says is such an error.
#pragma once

#include <vulkan/vulkan.h>

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

namespace raybench::vulkan {

/// Throws unless `result` is VK_SUCCESS: what the device was doing, and why it cannot.
void Check(VkResult result, const std::string& doing);

/// Functions of extensions, which the loader does not export; null where the device lacks the extension.
struct Functions {
  PFN_vkCreateAccelerationStructureKHR create_acceleration_structure;
  PFN_vkDestroyAccelerationStructureKHR destroy_acceleration_structure;
  PFN_vkGetAccelerationStructureBuildSizesKHR build_sizes;
  PFN_vkCmdBuildAccelerationStructuresKHR build;
  PFN_vkCmdCopyAccelerationStructureKHR copy;
  PFN_vkCmdWriteAccelerationStructuresPropertiesKHR write_properties;
  PFN_vkGetAccelerationStructureDeviceAddressKHR address_of;
  PFN_vkCreateRayTracingPipelinesKHR create_pipelines;
  PFN_vkGetRayTracingShaderGroupHandlesKHR group_handles;
  PFN_vkCmdTraceRaysKHR trace;
};

class Device;

/// A buffer with memory and a device address of its own; nothing if default-made.
class Buffer {
 public:
  enum class Place { kDevice, kHost };  ///< kHost: mapped, for copies to and from the device

  Buffer() = default;
  Buffer(const Device& device, VkDeviceSize bytes, VkBufferUsageFlags usage, Place place = Place::kDevice);
  Buffer(Buffer&& other) noexcept { *this = std::move(other); }
  Buffer& operator=(Buffer&& other) noexcept;
  ~Buffer();

  explicit operator bool() const { return buffer_ != VK_NULL_HANDLE; }
  VkBuffer get() const { return buffer_; }
  VkDeviceSize bytes() const { return bytes_; }
  VkDeviceAddress address() const { return address_; }
  void* mapped() const { return mapped_; }

 private:
  const Device* device_ = nullptr;
  VkBuffer buffer_ = VK_NULL_HANDLE;
  VkDeviceMemory memory_ = VK_NULL_HANDLE;
  VkDeviceSize bytes_ = 0;
  VkDeviceAddress address_ = 0;
  void* mapped_ = nullptr;
};

/// Commands of one submission. Everything recorded before Then() is done and visible to what comes after it.
class Commands {
 public:
  explicit Commands(VkCommandBuffer commands, VkQueryPool clock) : commands_(commands), clock_(clock) {}

  VkCommandBuffer get() const { return commands_; }
  void Copy(const Buffer& from, const Buffer& to, VkDeviceSize bytes, VkDeviceSize at = 0) const;
  void Then() const;
  /// Reads the device's clock when all before is done; at most kStamps of them.
  void Stamp();
  uint32_t stamps() const { return stamps_; }
  static constexpr uint32_t kStamps = 8;

 private:
  VkCommandBuffer commands_;
  VkQueryPool clock_;
  uint32_t stamps_ = 0;
};

/// Pipelines of one device (pipelines.h), made when they are first used.
class Pipelines;

class Device {
 public:
  /// The device of that index: those that can trace rays, GPUs first, software drivers last; only those whose name
  /// contains the text of RAYBENCH_VULKAN_DEVICE, if that variable is set.
  static Device& Get(int64_t index);
  /// One line that says why there is none; empty: there is one.
  static const std::string& WhyNone();

  Device(const Device&) = delete;

  VkDevice get() const { return device_; }
  const std::string& name() const { return name_; }  ///< of device and driver
  bool is_software() const { return is_software_; }
  bool has_query() const { return has_query_; }        ///< VK_KHR_ray_query
  bool has_pipeline() const { return has_pipeline_; }  ///< VK_KHR_ray_tracing_pipeline
  bool has_double() const { return has_double_; }      ///< doubles in shaders
  /// What was on it is gone, and it does nothing any more.
  bool is_lost() const { return is_lost_; }
  const VkPhysicalDeviceLimits& limits() const { return limits_; }
  const VkPhysicalDeviceAccelerationStructurePropertiesKHR& structure_limits() const { return structures_; }
  const VkPhysicalDeviceRayTracingPipelinePropertiesKHR& pipeline_limits() const { return pipeline_; }
  uint64_t largest_buffer() const { return largest_buffer_; }
  const Functions& functions() const { return functions_; }
  Pipelines& pipelines() const { return *pipelines_; }

  /// Who uses the device holds this: it does one thing at a time.
  std::mutex& mutex() const { return mutex_; }
  /// Records, submits and waits. Seconds between one stamp and the next, by the device's clock.
  std::vector<double> Submit(const std::string& doing, const std::function<void(Commands&)>& record) const;
  /// Check(), and remembers if the device is lost.
  void CheckWork(VkResult result, const std::string& doing) const;
  /// Copies to a buffer of the device, in portions; adds the seconds that the copying took on the device.
  void Upload(const Buffer& to, const void* from, VkDeviceSize bytes, double& seconds) const;

  uint32_t MemoryType(uint32_t allowed, VkMemoryPropertyFlags wanted) const;

 private:
  friend class Instance;
  explicit Device(VkPhysicalDevice device);

  VkPhysicalDevice physical_;
  VkDevice device_ = VK_NULL_HANDLE;
  VkQueue queue_ = VK_NULL_HANDLE;
  VkCommandPool pool_ = VK_NULL_HANDLE;
  VkCommandBuffer commands_ = VK_NULL_HANDLE;
  VkFence fence_ = VK_NULL_HANDLE;
  VkQueryPool clock_ = VK_NULL_HANDLE;
  std::string name_;
  bool is_software_ = false, has_query_ = false, has_pipeline_ = false, has_double_ = false;
  VkPhysicalDeviceLimits limits_{};
  VkPhysicalDeviceAccelerationStructurePropertiesKHR structures_{};
  VkPhysicalDeviceRayTracingPipelinePropertiesKHR pipeline_{};
  VkPhysicalDeviceMemoryProperties memory_{};
  uint64_t largest_buffer_ = 0;
  Functions functions_{};
  mutable std::unique_ptr<Pipelines> pipelines_;
  mutable std::mutex mutex_;
  mutable std::atomic<bool> is_lost_ = false;
  mutable Buffer staging_;
};

}  // namespace raybench::vulkan
