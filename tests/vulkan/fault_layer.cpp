// A Vulkan layer between a program and its driver that makes faults which no driver makes when it is asked to:
// VK_ADD_LAYER_PATH=FOLDER VK_INSTANCE_LAYERS=VK_LAYER_RAYBENCH_faults, and RAYBENCH_TEST_FAULT as one of
//   lost=N      the N-th submission of the process loses its device, and so does every later one on that device
//   memory=N    from the N-th allocation of device memory on there is none left
//   limits=P,I  an acceleration structure holds P primitives, and I instances
// How a layer is loaded: https://vulkan.lunarg.com/doc/sdk/latest/linux/LoaderLayerInterface.html
#include <vulkan/vk_layer.h>
#include <vulkan/vulkan.h>

#include <atomic>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>
#include <mutex>
#include <string_view>

namespace {

/// The number after `name=` in the variable, and a second one after a comma; 0 if it does not say so.
struct Fault {
  unsigned long first = 0, second = 0;
  explicit Fault(std::string_view name) {
    const char* const text = std::getenv("RAYBENCH_TEST_FAULT");
    if (text == nullptr || std::strncmp(text, name.data(), name.size()) != 0) return;
    std::sscanf(text + name.size(), "=%lu,%lu", &first, &second);
  }
};

// There is one driver in a test, and so one function of each name below this layer.
PFN_vkGetInstanceProcAddr next_instance;
PFN_vkGetDeviceProcAddr next_device;
PFN_vkGetPhysicalDeviceProperties2 next_properties;
PFN_vkQueueSubmit next_submit;
PFN_vkAllocateMemory next_allocate;

std::mutex mutex;
std::map<void*, bool> lost;  ///< by what the loader puts first into a device and into its queues
std::atomic<unsigned long> submissions, allocations;

/// The loader's link to the next layer, which each layer moves on by one.
template <class Link, class Info>
Link* FindLink(const Info* info, VkStructureType type) {
  for (auto* at = static_cast<const VkBaseInStructure*>(info->pNext); at != nullptr; at = at->pNext) {
    auto* link = reinterpret_cast<Link*>(const_cast<VkBaseInStructure*>(at));
    if (at->sType == type && link->function == VK_LAYER_LINK_INFO) return link;
  }
  return nullptr;
}

VKAPI_ATTR VkResult VKAPI_CALL CreateInstance(const VkInstanceCreateInfo* info,
                                              const VkAllocationCallbacks* a, VkInstance* instance) {
  auto* const link = FindLink<VkLayerInstanceCreateInfo>(info, VK_STRUCTURE_TYPE_LOADER_INSTANCE_CREATE_INFO);
  next_instance = link->u.pLayerInfo->pfnNextGetInstanceProcAddr;
  link->u.pLayerInfo = link->u.pLayerInfo->pNext;
  const auto create = reinterpret_cast<PFN_vkCreateInstance>(next_instance(nullptr, "vkCreateInstance"));
  const VkResult result = create(info, a, instance);
  if (result == VK_SUCCESS)
    next_properties = reinterpret_cast<PFN_vkGetPhysicalDeviceProperties2>(
        next_instance(*instance, "vkGetPhysicalDeviceProperties2"));
  return result;
}

VKAPI_ATTR VkResult VKAPI_CALL CreateDevice(VkPhysicalDevice physical, const VkDeviceCreateInfo* info,
                                            const VkAllocationCallbacks* a, VkDevice* device) {
  auto* const link = FindLink<VkLayerDeviceCreateInfo>(info, VK_STRUCTURE_TYPE_LOADER_DEVICE_CREATE_INFO);
  const PFN_vkGetInstanceProcAddr instance = link->u.pLayerInfo->pfnNextGetInstanceProcAddr;
  next_device = link->u.pLayerInfo->pfnNextGetDeviceProcAddr;
  link->u.pLayerInfo = link->u.pLayerInfo->pNext;
  const auto create = reinterpret_cast<PFN_vkCreateDevice>(instance(nullptr, "vkCreateDevice"));
  const VkResult result = create(physical, info, a, device);
  if (result != VK_SUCCESS) return result;
  next_submit = reinterpret_cast<PFN_vkQueueSubmit>(next_device(*device, "vkQueueSubmit"));
  next_allocate = reinterpret_cast<PFN_vkAllocateMemory>(next_device(*device, "vkAllocateMemory"));
  const std::lock_guard lock(mutex);
  lost[*reinterpret_cast<void**>(*device)] = false;
  return result;
}

VKAPI_ATTR VkResult VKAPI_CALL QueueSubmit(VkQueue queue, uint32_t count, const VkSubmitInfo* infos,
                                           VkFence fence) {
  static const Fault fault("lost");
  {
    const std::lock_guard lock(mutex);
    bool& is_lost = lost[*reinterpret_cast<void**>(queue)];
    is_lost |= ++submissions == fault.first;
    if (is_lost) return VK_ERROR_DEVICE_LOST;
  }
  return next_submit(queue, count, infos, fence);
}

VKAPI_ATTR VkResult VKAPI_CALL AllocateMemory(VkDevice device, const VkMemoryAllocateInfo* info,
                                              const VkAllocationCallbacks* a, VkDeviceMemory* memory) {
  static const Fault fault("memory");
  if (fault.first != 0 && ++allocations >= fault.first) return VK_ERROR_OUT_OF_DEVICE_MEMORY;
  return next_allocate(device, info, a, memory);
}

VKAPI_ATTR void VKAPI_CALL GetPhysicalDeviceProperties2(VkPhysicalDevice device,
                                                        VkPhysicalDeviceProperties2* properties) {
  static const Fault fault("limits");
  next_properties(device, properties);
  if (fault.first == 0) return;
  for (auto* at = static_cast<VkBaseOutStructure*>(properties->pNext); at != nullptr; at = at->pNext) {
    if (at->sType != VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_PROPERTIES_KHR) continue;
    auto* const limits = reinterpret_cast<VkPhysicalDeviceAccelerationStructurePropertiesKHR*>(at);
    limits->maxPrimitiveCount = fault.first, limits->maxInstanceCount = fault.second;
  }
}

}  // namespace

extern "C" __attribute__((visibility("default"))) VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL
FaultsGetDeviceProcAddr(VkDevice device, const char* name) {
  const std::string_view wanted = name;
  if (wanted == "vkGetDeviceProcAddr") return reinterpret_cast<PFN_vkVoidFunction>(&FaultsGetDeviceProcAddr);
  if (wanted == "vkQueueSubmit") return reinterpret_cast<PFN_vkVoidFunction>(&QueueSubmit);
  if (wanted == "vkAllocateMemory") return reinterpret_cast<PFN_vkVoidFunction>(&AllocateMemory);
  return next_device(device, name);
}

extern "C" __attribute__((visibility("default"))) VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL
FaultsGetInstanceProcAddr(VkInstance instance, const char* name) {
  const std::string_view wanted = name;
  if (wanted == "vkGetInstanceProcAddr")
    return reinterpret_cast<PFN_vkVoidFunction>(&FaultsGetInstanceProcAddr);
  if (wanted == "vkCreateInstance") return reinterpret_cast<PFN_vkVoidFunction>(&CreateInstance);
  if (wanted == "vkCreateDevice") return reinterpret_cast<PFN_vkVoidFunction>(&CreateDevice);
  if (wanted == "vkGetPhysicalDeviceProperties2")
    return reinterpret_cast<PFN_vkVoidFunction>(&GetPhysicalDeviceProperties2);
  if (wanted == "vkGetDeviceProcAddr" || wanted == "vkQueueSubmit" || wanted == "vkAllocateMemory")
    return FaultsGetDeviceProcAddr(nullptr, name);
  return next_instance(instance, name);
}
