#include "accel/vulkan/pipelines.h"

#include <cstddef>
#include <cstring>
#include <stdexcept>

// Made of the files in shaders/ by glslangValidator: SPIR-V as arrays kSPIRV_STAGE.
#include "accel/vulkan/shaders/advance.comp.h"
#include "accel/vulkan/shaders/query.comp.h"
#include "accel/vulkan/shaders/trace.rahit.h"
#include "accel/vulkan/shaders/trace.rchit.h"
#include "accel/vulkan/shaders/trace.rgen.h"
#include "accel/vulkan/shaders/trace.rint.h"
#include "accel/vulkan/shaders/trace.rmiss.h"
#include "accel/vulkan/shaders/wave.comp.h"

namespace raybench::vulkan {
namespace {

constexpr VkShaderStageFlags kStages = VK_SHADER_STAGE_RAYGEN_BIT_KHR | VK_SHADER_STAGE_MISS_BIT_KHR |
                                       VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR | VK_SHADER_STAGE_ANY_HIT_BIT_KHR |
                                       VK_SHADER_STAGE_INTERSECTION_BIT_KHR;

constexpr VkSpecializationMapEntry kConstants[] = {{0, offsetof(Variant, any_hit), sizeof(VkBool32)},
                                                   {1, offsetof(Variant, filtered), sizeof(VkBool32)},
                                                   {2, offsetof(Variant, procedural), sizeof(VkBool32)},
                                                   {3, offsetof(Variant, counts_calls), sizeof(VkBool32)}};

/// Shader modules that live until pipelines are made of them.
class Modules {
 public:
  Modules(const Device& device, const Variant& variant) : device_(device) {
    constants_ = {4, kConstants, sizeof variant, &variant};
  }
  Modules(const Modules&) = delete;
  ~Modules() {
    for (const VkPipelineShaderStageCreateInfo& s : stages_)
      vkDestroyShaderModule(device_.get(), s.module, nullptr);
  }

  template <size_t kWords>
  void Add(VkShaderStageFlagBits stage, const uint32_t (&words)[kWords]) {
    VkShaderModuleCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO;
    info.codeSize = sizeof words, info.pCode = words;
    VkPipelineShaderStageCreateInfo made{};
    made.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
    made.stage = stage;
    made.pName = "main";
    made.pSpecializationInfo = &constants_;
    Check(vkCreateShaderModule(device_.get(), &info, nullptr, &made.module), "loading a shader");
    stages_.push_back(made);
  }
  const std::vector<VkPipelineShaderStageCreateInfo>& stages() const { return stages_; }

 private:
  const Device& device_;
  VkSpecializationInfo constants_;
  std::vector<VkPipelineShaderStageCreateInfo> stages_;
};

}  // namespace

Pipelines::Pipelines(const Device& device) : device_(device) {
  VkPushConstantRange range{};
  range.stageFlags = PushStages();
  range.size = sizeof(Push);
  VkPipelineLayoutCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO;
  info.pushConstantRangeCount = 1, info.pPushConstantRanges = &range;
  Check(vkCreatePipelineLayout(device.get(), &info, nullptr, &layout_), "describing shaders");
}

VkShaderStageFlags Pipelines::PushStages() const {
  return VK_SHADER_STAGE_COMPUTE_BIT | (device_.has_pipeline() ? kStages : 0);
}

const Pipeline& Pipelines::Get(const Variant& variant) {
  const auto known = made_.find(variant);
  if (known != made_.end()) return known->second;
  Pipeline made = variant.program == Program::kPipeline ? MakePipeline(variant) : MakeCompute(variant);
  return made_.emplace(variant, std::move(made)).first->second;
}

Pipeline Pipelines::MakeCompute(const Variant& variant) const {
  Modules modules(device_, variant);
  switch (variant.program) {
    case Program::kWave:
      modules.Add(VK_SHADER_STAGE_COMPUTE_BIT, kWaveComp);
      break;
    case Program::kAdvance:
      modules.Add(VK_SHADER_STAGE_COMPUTE_BIT, kAdvanceComp);
      break;
    default:
      modules.Add(VK_SHADER_STAGE_COMPUTE_BIT, kQueryComp);
  }
  VkComputePipelineCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO;
  info.stage = modules.stages()[0];
  info.layout = layout_;
  Pipeline made;
  Check(vkCreateComputePipelines(device_.get(), VK_NULL_HANDLE, 1, &info, nullptr, &made.pipeline),
        "compiling a shader of ray queries");
  return made;
}

/// Groups: ray generation; miss; hits of triangles; hits of procedural primitives.
Pipeline Pipelines::MakePipeline(const Variant& variant) const {
  Modules modules(device_, variant);
  modules.Add(VK_SHADER_STAGE_RAYGEN_BIT_KHR, kTraceRgen);
  modules.Add(VK_SHADER_STAGE_MISS_BIT_KHR, kTraceRmiss);
  modules.Add(VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR, kTraceRchit);
  modules.Add(VK_SHADER_STAGE_ANY_HIT_BIT_KHR, kTraceRahit);
  if (variant.procedural) modules.Add(VK_SHADER_STAGE_INTERSECTION_BIT_KHR, kTraceRint);
  constexpr uint32_t kNo = VK_SHADER_UNUSED_KHR, kMost = 4;
  VkRayTracingShaderGroupCreateInfoKHR groups[kMost]{};
  for (VkRayTracingShaderGroupCreateInfoKHR& g : groups) {
    g.sType = VK_STRUCTURE_TYPE_RAY_TRACING_SHADER_GROUP_CREATE_INFO_KHR;
    g.type = VK_RAY_TRACING_SHADER_GROUP_TYPE_GENERAL_KHR;
    g.generalShader = g.closestHitShader = g.anyHitShader = g.intersectionShader = kNo;
  }
  groups[0].generalShader = 0;
  groups[1].generalShader = 1;
  groups[2].type = VK_RAY_TRACING_SHADER_GROUP_TYPE_TRIANGLES_HIT_GROUP_KHR;
  groups[3].type = VK_RAY_TRACING_SHADER_GROUP_TYPE_PROCEDURAL_HIT_GROUP_KHR;
  for (VkRayTracingShaderGroupCreateInfoKHR* g : {&groups[2], &groups[3]})
    g->closestHitShader = 2, g->anyHitShader = 3;
  groups[3].intersectionShader = 4;
  const uint32_t count = variant.procedural ? 4 : 3;

  VkRayTracingPipelineCreateInfoKHR info{};
  info.sType = VK_STRUCTURE_TYPE_RAY_TRACING_PIPELINE_CREATE_INFO_KHR;
  info.stageCount = uint32_t(modules.stages().size()), info.pStages = modules.stages().data();
  info.groupCount = count, info.pGroups = groups;
  info.maxPipelineRayRecursionDepth = 1;
  info.layout = layout_;
  Pipeline made;
  Check(device_.functions().create_pipelines(device_.get(), VK_NULL_HANDLE, VK_NULL_HANDLE, 1, &info, nullptr,
                                             &made.pipeline),
        "compiling the shaders of ray tracing");

  // The table: regions for ray generation, miss and hits, each where the device wants it.
  const auto& limits = device_.pipeline_limits();
  const auto aligned = [](VkDeviceSize x, VkDeviceSize to) { return (x + to - 1) / to * to; };
  const VkDeviceSize size = limits.shaderGroupHandleSize,
                     stride = aligned(size, limits.shaderGroupHandleAlignment),
                     base = limits.shaderGroupBaseAlignment, region = aligned(stride * 2, base);
  std::vector<unsigned char> handles(size * count), table(region * 3 + base);
  Check(device_.functions().group_handles(device_.get(), made.pipeline, 0, count, handles.size(),
                                          handles.data()),
        "reading shader handles");
  made.table = Buffer(device_, table.size(),
                      VK_BUFFER_USAGE_SHADER_BINDING_TABLE_BIT_KHR | VK_BUFFER_USAGE_TRANSFER_DST_BIT);
  const VkDeviceSize first = aligned(made.table.address(), base) - made.table.address();
  const VkDeviceSize place[kMost] = {first, first + region, first + 2 * region, first + 2 * region + stride};
  for (uint32_t i = 0; i < count; ++i) std::memcpy(&table[place[i]], &handles[i * size], size);
  double seconds = 0;
  device_.Upload(made.table, table.data(), table.size(), seconds);
  made.generation = {made.table.address() + place[0], stride, stride};
  made.miss = {made.table.address() + place[1], stride, stride};
  made.hit = {made.table.address() + place[2], stride, stride * (count - 2)};
  return made;
}

}  // namespace raybench::vulkan
