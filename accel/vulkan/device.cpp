#include "accel/vulkan/device.h"

#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <map>
#include <stdexcept>
#include <string_view>

#include "accel/vulkan/pipelines.h"

namespace raybench::vulkan {
namespace {

constexpr VkDeviceSize kPortion = VkDeviceSize{16} << 20;  ///< of a copy to the device

const char* Meaning(VkResult result) {
  switch (result) {
    case VK_ERROR_OUT_OF_HOST_MEMORY:
      return "out of memory";
    case VK_ERROR_OUT_OF_DEVICE_MEMORY:
      return "out of device memory";
    case VK_ERROR_DEVICE_LOST:
      return "the device is lost";
    case VK_ERROR_INITIALIZATION_FAILED:
      return "it cannot be initialised";
    case VK_ERROR_LAYER_NOT_PRESENT:
      return "a layer is not installed (VK_LAYER_KHRONOS_validation)";
    case VK_ERROR_EXTENSION_NOT_PRESENT:
    case VK_ERROR_FEATURE_NOT_PRESENT:
      return "the driver lacks what it said it has";
    case VK_ERROR_INCOMPATIBLE_DRIVER:
      return "no Vulkan driver is installed";
    case VK_ERROR_TOO_MANY_OBJECTS:
      return "too many allocations";
    default:
      return "the driver reports an error";
  }
}

/// What the validation layer has said; the first is enough.
std::mutex message_mutex;
std::string first_message;

VKAPI_ATTR VkBool32 VKAPI_CALL KeepMessage(VkDebugUtilsMessageSeverityFlagBitsEXT,
                                           VkDebugUtilsMessageTypeFlagsEXT,
                                           const VkDebugUtilsMessengerCallbackDataEXT* data, void*) {
  const std::lock_guard lock(message_mutex);
  if (first_message.empty()) {
    first_message = data->pMessage;
    std::replace(first_message.begin(), first_message.end(), '\n', ' ');
  }
  return VK_FALSE;
}

void ThrowMessages() {
  const std::lock_guard lock(message_mutex);
  if (!first_message.empty()) throw std::runtime_error("Vulkan's validation layer: " + first_message);
}

bool Validates() {
  const char* const value = std::getenv("RAYBENCH_VULKAN_VALIDATION");
  return value != nullptr && std::string_view(value) != "0" && *value != 0;
}

std::vector<VkPhysicalDevice> DevicesOf(VkInstance instance) {
  uint32_t count = 0;
  vkEnumeratePhysicalDevices(instance, &count, nullptr);
  std::vector<VkPhysicalDevice> devices(count);
  vkEnumeratePhysicalDevices(instance, &count, devices.data());
  devices.resize(count);
  return devices;
}

std::vector<std::string> ExtensionsOf(VkPhysicalDevice device) {
  uint32_t count = 0;
  vkEnumerateDeviceExtensionProperties(device, nullptr, &count, nullptr);
  std::vector<VkExtensionProperties> found(count);
  vkEnumerateDeviceExtensionProperties(device, nullptr, &count, found.data());
  std::vector<std::string> names;
  for (const VkExtensionProperties& e : found) names.push_back(e.extensionName);
  return names;
}

bool Has(const std::vector<std::string>& names, const char* name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

/// What is asked of a device, chained for Vulkan to fill in or to enable.
struct Features {
  VkPhysicalDeviceFeatures2 base{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2, nullptr, {}};
  VkPhysicalDeviceVulkan12Features v12{};
  VkPhysicalDeviceAccelerationStructureFeaturesKHR structures{};
  VkPhysicalDeviceRayQueryFeaturesKHR query{};
  VkPhysicalDeviceRayTracingPipelineFeaturesKHR pipeline{};

  explicit Features(const std::vector<std::string>& extensions) {
    v12.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES;
    structures.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_FEATURES_KHR;
    query.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_QUERY_FEATURES_KHR;
    pipeline.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_TRACING_PIPELINE_FEATURES_KHR;
    void* last = nullptr;
    const auto chain = [&](auto& s) { s.pNext = std::exchange(last, &s); };
    if (Has(extensions, VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME)) chain(pipeline);
    if (Has(extensions, VK_KHR_RAY_QUERY_EXTENSION_NAME)) chain(query);
    if (Has(extensions, VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME)) chain(structures);
    chain(v12);
    base.pNext = last;
  }
};

/// Empty if the device can do it.
std::string Lack(VkPhysicalDevice device, const VkPhysicalDeviceProperties& properties) {
  if (properties.apiVersion < VK_API_VERSION_1_2) return "speaks no Vulkan 1.2";
  const std::vector<std::string> extensions = ExtensionsOf(device);
  for (const char* name :
       {VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME, VK_KHR_DEFERRED_HOST_OPERATIONS_EXTENSION_NAME})
    if (!Has(extensions, name)) return std::string("lacks ") + name;
  Features features(extensions);
  vkGetPhysicalDeviceFeatures2(device, &features.base);
  if (!features.structures.accelerationStructure) return "builds no acceleration structures";
  if (!features.query.rayQuery && !features.pipeline.rayTracingPipeline)
    return "has neither ray queries nor pipelines";
  if (!features.v12.bufferDeviceAddress || !features.v12.scalarBlockLayout) return "lacks buffer addresses";
  return {};
}

}  // namespace

void Check(VkResult result, const std::string& doing) {
  if (result == VK_SUCCESS) return;
  throw std::runtime_error(doing + ": " + Meaning(result) + " (VkResult " + std::to_string(int(result)) +
                           ")");
}

/// Vulkan in this process, and its devices.
class Instance {
 public:
  static Instance& Get() {
    // Never destroyed: trees may live longer than what static destructors would take down.
    static std::mutex mutex;
    static Instance* instance = nullptr;
    const std::lock_guard lock(mutex);
    if (instance == nullptr || instance->pid_ != getpid()) instance = new Instance;
    return *instance;
  }

  const std::string& why_none() const { return why_none_; }

  Device& At(int64_t index) {
    if (!why_none_.empty()) throw std::runtime_error(why_none_);
    if (index >= int64_t(usable_.size())) {
      std::string names;
      for (size_t i = 0; i < usable_.size(); ++i)
        names += (i == 0 ? "" : ", ") + std::to_string(i) + " " + usable_[i].name;
      throw std::runtime_error("there is no device " + std::to_string(index) + "; there are: " + names);
    }
    const std::lock_guard lock(mutex_);
    std::unique_ptr<Device>& device = made_[index];
    if (device && device->is_lost()) lost_.push_back(std::move(device));  // trees may have it still
    if (!device) device.reset(new Device(usable_[size_t(index)].device));
    return *device;
  }

 private:
  struct Usable {
    VkPhysicalDevice device;
    std::string name;
    int place;
  };

  Instance() : pid_(getpid()) {
    try {
      Make();
      FindDevices();
    } catch (const std::exception& e) {
      why_none_ = e.what();
    }
  }

  void Make() {
    VkApplicationInfo application{};
    application.sType = VK_STRUCTURE_TYPE_APPLICATION_INFO;
    application.pApplicationName = "raybench";
    application.apiVersion = VK_API_VERSION_1_2;
    VkInstanceCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO;
    info.pApplicationInfo = &application;
    const char* const layer = "VK_LAYER_KHRONOS_validation";
    const char* const debug = VK_EXT_DEBUG_UTILS_EXTENSION_NAME;
    VkDebugUtilsMessengerCreateInfoEXT messenger{};
    messenger.sType = VK_STRUCTURE_TYPE_DEBUG_UTILS_MESSENGER_CREATE_INFO_EXT;
    messenger.messageSeverity =
        VK_DEBUG_UTILS_MESSAGE_SEVERITY_WARNING_BIT_EXT | VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT;
    messenger.messageType = VK_DEBUG_UTILS_MESSAGE_TYPE_VALIDATION_BIT_EXT;
    messenger.pfnUserCallback = &KeepMessage;
    if (Validates()) {
      info.enabledLayerCount = info.enabledExtensionCount = 1;
      info.ppEnabledLayerNames = &layer;
      info.ppEnabledExtensionNames = &debug;
      info.pNext = &messenger;
    }
    Check(vkCreateInstance(&info, nullptr, &instance_), "starting Vulkan");
    if (!Validates()) return;
    const auto create = reinterpret_cast<PFN_vkCreateDebugUtilsMessengerEXT>(
        vkGetInstanceProcAddr(instance_, "vkCreateDebugUtilsMessengerEXT"));
    VkDebugUtilsMessengerEXT made;
    Check(create(instance_, &messenger, nullptr, &made), "asking for messages of validation");
  }

  void FindDevices() {
    const char* const wanted = std::getenv("RAYBENCH_VULKAN_DEVICE");
    std::string lacks;
    for (VkPhysicalDevice device : DevicesOf(instance_)) {
      VkPhysicalDeviceProperties properties;
      vkGetPhysicalDeviceProperties(device, &properties);
      const std::string name = properties.deviceName;
      if (wanted != nullptr && name.find(wanted) == name.npos) {
        lacks += (lacks.empty() ? "" : ", ") + name + " is not wanted (RAYBENCH_VULKAN_DEVICE)";
      } else if (const std::string lack = Lack(device, properties); !lack.empty()) {
        lacks += (lacks.empty() ? "" : ", ") + name + " " + lack;
      } else {
        constexpr VkPhysicalDeviceType kOrder[] = {
            VK_PHYSICAL_DEVICE_TYPE_DISCRETE_GPU, VK_PHYSICAL_DEVICE_TYPE_INTEGRATED_GPU,
            VK_PHYSICAL_DEVICE_TYPE_VIRTUAL_GPU, VK_PHYSICAL_DEVICE_TYPE_OTHER};
        const auto place = std::find(std::begin(kOrder), std::end(kOrder), properties.deviceType);
        usable_.push_back({device, name, int(place - std::begin(kOrder))});
      }
    }
    std::stable_sort(usable_.begin(), usable_.end(),
                     [](const Usable& a, const Usable& b) { return a.place < b.place; });
    if (usable_.empty())
      why_none_ = lacks.empty() ? "Vulkan shows no device" : "no Vulkan device can trace rays: " + lacks;
  }

  pid_t pid_;
  VkInstance instance_ = VK_NULL_HANDLE;
  std::string why_none_;
  std::vector<Usable> usable_;
  std::mutex mutex_;
  std::map<int64_t, std::unique_ptr<Device>> made_;
  std::vector<std::unique_ptr<Device>> lost_;
};

Device& Device::Get(int64_t index) { return Instance::Get().At(index); }

const std::string& Device::WhyNone() { return Instance::Get().why_none(); }

Device::Device(VkPhysicalDevice physical) : physical_(physical) {
  const std::vector<std::string> extensions = ExtensionsOf(physical);
  Features features(extensions);
  vkGetPhysicalDeviceFeatures2(physical, &features.base);
  has_query_ = features.query.rayQuery != 0;
  has_pipeline_ = features.pipeline.rayTracingPipeline != 0;
  has_double_ = features.base.features.shaderFloat64 != 0;

  VkPhysicalDeviceProperties2 properties{};
  properties.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2;
  VkPhysicalDeviceDriverProperties driver{};
  VkPhysicalDeviceMaintenance3Properties maintenance{};
  driver.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DRIVER_PROPERTIES;
  maintenance.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_MAINTENANCE_3_PROPERTIES;
  structures_.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_PROPERTIES_KHR;
  pipeline_.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_TRACING_PIPELINE_PROPERTIES_KHR;
  properties.pNext = &driver, driver.pNext = &maintenance, maintenance.pNext = &structures_;
  if (has_pipeline_) structures_.pNext = &pipeline_;
  vkGetPhysicalDeviceProperties2(physical, &properties);
  structures_.pNext = nullptr;
  limits_ = properties.properties.limits;
  name_ = std::string(properties.properties.deviceName) + ", " + driver.driverInfo;
  is_software_ = properties.properties.deviceType == VK_PHYSICAL_DEVICE_TYPE_CPU;
  largest_buffer_ = maintenance.maxMemoryAllocationSize;
  vkGetPhysicalDeviceMemoryProperties(physical, &memory_);

  uint32_t count = 0, family = 0;
  vkGetPhysicalDeviceQueueFamilyProperties(physical, &count, nullptr);
  std::vector<VkQueueFamilyProperties> families(count);
  vkGetPhysicalDeviceQueueFamilyProperties(physical, &count, families.data());
  while (family < count && ((families[family].queueFlags & VK_QUEUE_COMPUTE_BIT) == 0 ||
                            families[family].timestampValidBits == 0))
    ++family;
  if (family == count) throw std::runtime_error(name_ + ": no queue computes and has a clock");

  // Of all that it can, what is used.
  Features wanted(extensions);
  wanted.base.features.shaderFloat64 = features.base.features.shaderFloat64;
  wanted.v12.bufferDeviceAddress = wanted.v12.scalarBlockLayout = VK_TRUE;
  wanted.structures.accelerationStructure = VK_TRUE;
  wanted.query.rayQuery = has_query_;
  wanted.pipeline.rayTracingPipeline = has_pipeline_;
  std::vector<const char*> names = {VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME,
                                    VK_KHR_DEFERRED_HOST_OPERATIONS_EXTENSION_NAME};
  for (const char* name : {VK_KHR_RAY_QUERY_EXTENSION_NAME, VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME})
    if (Has(extensions, name)) names.push_back(name);
  const float priority = 1;
  VkDeviceQueueCreateInfo queue{};
  queue.sType = VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO;
  queue.queueFamilyIndex = family, queue.queueCount = 1, queue.pQueuePriorities = &priority;
  VkDeviceCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO;
  info.pNext = &wanted.base;
  info.queueCreateInfoCount = 1, info.pQueueCreateInfos = &queue;
  info.enabledExtensionCount = uint32_t(names.size()), info.ppEnabledExtensionNames = names.data();
  Check(vkCreateDevice(physical, &info, nullptr, &device_), "opening " + name_);
  vkGetDeviceQueue(device_, family, 0, &queue_);

  const auto load = [&](auto& function, const char* name) {
    function =
        reinterpret_cast<std::remove_reference_t<decltype(function)>>(vkGetDeviceProcAddr(device_, name));
  };
  load(functions_.create_acceleration_structure, "vkCreateAccelerationStructureKHR");
  load(functions_.destroy_acceleration_structure, "vkDestroyAccelerationStructureKHR");
  load(functions_.build_sizes, "vkGetAccelerationStructureBuildSizesKHR");
  load(functions_.build, "vkCmdBuildAccelerationStructuresKHR");
  load(functions_.copy, "vkCmdCopyAccelerationStructureKHR");
  load(functions_.write_properties, "vkCmdWriteAccelerationStructuresPropertiesKHR");
  load(functions_.address_of, "vkGetAccelerationStructureDeviceAddressKHR");
  load(functions_.create_pipelines, "vkCreateRayTracingPipelinesKHR");
  load(functions_.group_handles, "vkGetRayTracingShaderGroupHandlesKHR");
  load(functions_.trace, "vkCmdTraceRaysKHR");

  VkCommandPoolCreateInfo pool{};
  pool.sType = VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO;
  pool.flags = VK_COMMAND_POOL_CREATE_RESET_COMMAND_BUFFER_BIT;
  pool.queueFamilyIndex = family;
  Check(vkCreateCommandPool(device_, &pool, nullptr, &pool_), "making a command pool");
  VkCommandBufferAllocateInfo allocate{};
  allocate.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO;
  allocate.commandPool = pool_;
  allocate.commandBufferCount = 1;
  Check(vkAllocateCommandBuffers(device_, &allocate, &commands_), "making a command buffer");
  VkFenceCreateInfo fence{};
  fence.sType = VK_STRUCTURE_TYPE_FENCE_CREATE_INFO;
  Check(vkCreateFence(device_, &fence, nullptr, &fence_), "making a fence");
  VkQueryPoolCreateInfo clock{};
  clock.sType = VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO;
  clock.queryType = VK_QUERY_TYPE_TIMESTAMP;
  clock.queryCount = Commands::kStamps;
  Check(vkCreateQueryPool(device_, &clock, nullptr, &clock_), "making a clock");
  pipelines_ = std::make_unique<Pipelines>(*this);
  ThrowMessages();
}

uint32_t Device::MemoryType(uint32_t allowed, VkMemoryPropertyFlags wanted) const {
  for (uint32_t i = 0; i < memory_.memoryTypeCount; ++i)
    if ((allowed >> i & 1) != 0 && (memory_.memoryTypes[i].propertyFlags & wanted) == wanted) return i;
  throw std::runtime_error(name_ + ": it has no memory of the kind that is needed");
}

void Device::CheckWork(VkResult result, const std::string& doing) const {
  if (result == VK_ERROR_DEVICE_LOST) is_lost_ = true;
  Check(result, doing);
}

std::vector<double> Device::Submit(const std::string& doing,
                                   const std::function<void(Commands&)>& record) const {
  VkCommandBufferBeginInfo begin{};
  begin.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO;
  begin.flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT;
  CheckWork(vkResetCommandBuffer(commands_, 0),
            doing);  // an exception may have ended what was recorded before
  CheckWork(vkBeginCommandBuffer(commands_, &begin), doing);
  vkCmdResetQueryPool(commands_, clock_, 0, Commands::kStamps);
  Commands commands(commands_, clock_);
  record(commands);
  CheckWork(vkEndCommandBuffer(commands_), doing);
  ThrowMessages();
  VkSubmitInfo submit{};
  submit.sType = VK_STRUCTURE_TYPE_SUBMIT_INFO;
  submit.commandBufferCount = 1, submit.pCommandBuffers = &commands_;
  CheckWork(vkQueueSubmit(queue_, 1, &submit, fence_), doing);
  CheckWork(vkWaitForFences(device_, 1, &fence_, VK_TRUE, UINT64_MAX), doing);
  CheckWork(vkResetFences(device_, 1, &fence_), doing);
  ThrowMessages();
  std::vector<double> seconds;
  if (commands.stamps() < 2) return seconds;
  uint64_t ticks[Commands::kStamps];
  CheckWork(vkGetQueryPoolResults(device_, clock_, 0, commands.stamps(), sizeof ticks, ticks, sizeof ticks[0],
                                  VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WAIT_BIT),
            "reading the device's clock");
  for (uint32_t i = 1; i < commands.stamps(); ++i)
    seconds.push_back(double(ticks[i] - ticks[i - 1]) * limits_.timestampPeriod * 1e-9);
  return seconds;
}

void Device::Upload(const Buffer& to, const void* from, VkDeviceSize bytes, double& seconds) const {
  if (!staging_) staging_ = Buffer(*this, kPortion, VK_BUFFER_USAGE_TRANSFER_SRC_BIT, Buffer::Place::kHost);
  for (VkDeviceSize at = 0; at < bytes; at += kPortion) {
    const VkDeviceSize n = std::min(bytes - at, kPortion);
    std::memcpy(staging_.mapped(), static_cast<const char*>(from) + at, n);
    seconds += Submit("copying to the device", [&](Commands& commands) {
      commands.Stamp();
      commands.Copy(staging_, to, n, at);
      commands.Stamp();
    })[0];
  }
}

// Delegates, so that what was made is freed when a later step throws.
Buffer::Buffer(const Device& device, VkDeviceSize bytes, VkBufferUsageFlags usage, Place place) : Buffer() {
  device_ = &device, bytes_ = bytes;
  const std::string doing = "allocating " + std::to_string((bytes >> 20) + 1) + " MiB on the device";
  if (bytes > device.largest_buffer())
    throw std::runtime_error(doing + ": it allows at most " + std::to_string(device.largest_buffer() >> 20) +
                             " MiB at once");
  const bool is_host = place == Place::kHost;
  VkBufferCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO;
  info.size = std::max<VkDeviceSize>(bytes, 16);
  info.usage = is_host ? usage : usage | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;
  Check(vkCreateBuffer(device.get(), &info, nullptr, &buffer_), doing);
  VkMemoryRequirements needs;
  vkGetBufferMemoryRequirements(device.get(), buffer_, &needs);
  VkMemoryAllocateFlagsInfo flags{};
  flags.sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_FLAGS_INFO;
  flags.flags = VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT;
  VkMemoryAllocateInfo allocate{};
  allocate.sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO;
  allocate.pNext = is_host ? nullptr : &flags;
  allocate.allocationSize = needs.size;
  allocate.memoryTypeIndex =
      device.MemoryType(needs.memoryTypeBits,
                        is_host ? VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT
                                : VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT);
  Check(vkAllocateMemory(device.get(), &allocate, nullptr, &memory_), doing);
  Check(vkBindBufferMemory(device.get(), buffer_, memory_, 0), doing);
  if (is_host) {
    Check(vkMapMemory(device.get(), memory_, 0, VK_WHOLE_SIZE, 0, &mapped_), doing);
  } else {
    VkBufferDeviceAddressInfo at{};
    at.sType = VK_STRUCTURE_TYPE_BUFFER_DEVICE_ADDRESS_INFO;
    at.buffer = buffer_;
    address_ = vkGetBufferDeviceAddress(device.get(), &at);
  }
}

Buffer& Buffer::operator=(Buffer&& other) noexcept {
  std::swap(device_, other.device_);
  std::swap(buffer_, other.buffer_);
  std::swap(memory_, other.memory_);
  std::swap(bytes_, other.bytes_);
  std::swap(address_, other.address_);
  std::swap(mapped_, other.mapped_);
  return *this;
}

Buffer::~Buffer() {
  if (buffer_ == VK_NULL_HANDLE) return;
  vkDestroyBuffer(device_->get(), buffer_, nullptr);
  vkFreeMemory(device_->get(), memory_, nullptr);
}

void Commands::Copy(const Buffer& from, const Buffer& to, VkDeviceSize bytes, VkDeviceSize at) const {
  const VkBufferCopy region = {0, at, bytes};
  vkCmdCopyBuffer(commands_, from.get(), to.get(), 1, &region);
}

void Commands::Then() const {
  VkMemoryBarrier barrier{};
  barrier.sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER;
  barrier.srcAccessMask = VK_ACCESS_MEMORY_WRITE_BIT;
  barrier.dstAccessMask = VK_ACCESS_MEMORY_READ_BIT | VK_ACCESS_MEMORY_WRITE_BIT;
  vkCmdPipelineBarrier(commands_, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT,
                       VK_PIPELINE_STAGE_ALL_COMMANDS_BIT | VK_PIPELINE_STAGE_HOST_BIT, 0, 1, &barrier, 0,
                       nullptr, 0, nullptr);
}

void Commands::Stamp() {
  Then();
  vkCmdWriteTimestamp(commands_, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, clock_, stamps_++);
}

}  // namespace raybench::vulkan
