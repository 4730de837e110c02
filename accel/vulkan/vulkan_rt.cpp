// vulkan_rt: the acceleration structure of a Vulkan driver behind the contract, ray tracing in hardware where there is
// any (Vulkan 1.2, VK_KHR_acceleration_structure).
//
// The driver builds and traverses; what is here is the two ways to ask it, which are the two ways of DirectX
// Raytracing. Path `query`: inline ray queries from a compute shader (DXR 1.1). Path `pipeline`: all five kinds of
// shaders, called through a shader binding table (DXR 1.0).
//
// A batch goes to the device in portions: copied there, traced, copied back. Directions that are much longer or shorter
// than 1 are scaled by a power of two on the way, and t back. Rays that skip a primitive or resume, and all rays where
// `opaque` is off, have every candidate hit looked at by a shader, and take a second look at what else is at the t that
// was found, so that ties and `after` are as the contract has them whatever the driver's order. Else the driver decides
// alone, ties included.
//
// Nothing is known of a driver's triangle test, so it claims to be inexact. Queries of several threads take turns.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <optional>

#include "accel/contract/structure.h"
#include "accel/vulkan/picture.h"
#include "accel/vulkan/pipelines.h"
#include "accel/vulkan/scene.h"

namespace raybench::vulkan {
namespace {

constexpr uint32_t kPortion = 1u << 20;  ///< rays at once, on lavapipe a fourth of what a buffer may hold
constexpr float kLongest = 0x1p20f;      ///< of directions that go to the device as they are, and 1/kLongest

/// A ray that is not traced as it is: its place in the portion, and the power of two that its direction was divided by.
struct Odd {
  uint32_t index;
  int exponent;
};

/// Buffers for one portion of rays, kept from one query to the next.
struct Portion {
  uint32_t capacity = 0;
  Buffer rays, skip, after, answers, to_device, from_device, groups, calls;

  void Reserve(const Device& device, uint32_t count) {
    if (count <= capacity) return;
    const uint32_t size = std::bit_ceil(std::max(count, 4096u));
    constexpr VkBufferUsageFlags kInput =
                                     VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT,
                                 kOutput =
                                     VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_TRANSFER_SRC_BIT;
    capacity = 0;
    rays = Buffer(device, size * sizeof(rb_ray), kInput);
    skip = Buffer(device, size * sizeof(uint32_t), kInput);
    after = Buffer(device, size * sizeof(uint32_t), kInput);
    answers = Buffer(device, size * sizeof(rb_hit), kOutput);
    to_device = Buffer(device, size * (sizeof(rb_ray) + 2 * sizeof(uint32_t)),
                       VK_BUFFER_USAGE_TRANSFER_SRC_BIT, Buffer::Place::kHost);
    from_device =
        Buffer(device, size * sizeof(rb_hit), VK_BUFFER_USAGE_TRANSFER_DST_BIT, Buffer::Place::kHost);
    groups = Buffer(device, sizeof(VkDispatchIndirectCommand),
                    VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT);
    calls = Buffer(device, 5 * sizeof(uint32_t), kInput | kOutput);
    capacity = size;
  }
};

class VulkanRt {
 public:
  struct Config {
    int64_t device;
    uint32_t path, build, compaction, opaque;
  };
  static constexpr const char* kName = "vulkan_rt";
  static constexpr const char* kDoc = "a Vulkan driver's acceleration structure: ray tracing in hardware";
  static constexpr const char* kSource =
      "Khronos: VK_KHR_acceleration_structure, VK_KHR_ray_query, VK_KHR_ray_tracing_pipeline";
  static constexpr uint64_t kCapabilities =
      RB_CAN_PROCEDURAL | RB_CAN_AFTER | RB_CAN_SKIP | RB_NATIVE_BATCH | RB_DEVICE;
  static std::span<const rb_param> Params() {
    static const char* const kPaths[] = {"query", "pipeline", nullptr};
    static const char* const kBuilds[] = {"fast_trace", "fast_build", "low_memory", nullptr};
    static const rb_param params[] = {
        IntParam("device",
                 "which of the devices that trace rays, GPUs first; RAYBENCH_VULKAN_DEVICE=TEXT leaves only "
                 "those with TEXT in their names",
                 offsetof(Config, device), 0, 63, 0),
        ChoiceParam(
            "path",
            "query: ray queries in a compute shader; pipeline: five kinds of shaders and a binding table",
            offsetof(Config, path), kPaths, 0, RB_PARAM_SPEED_ONLY),
        ChoiceParam("build", "what the driver shall prefer", offsetof(Config, build), kBuilds, 0),
        BoolParam("compaction", "copy what was built into as little memory as it needs",
                  offsetof(Config, compaction), false, RB_PARAM_SPEED_ONLY),
        BoolParam(
            "opaque",
            "the driver alone decides about triangles; false: a shader looks at every hit, and of those "
            "at the same t the lowest primitive wins",
            offsetof(Config, opaque), true)};
    return params;
  }

  VulkanRt(const rb_geometry& geometry, const rb_build_options& options, const Config& config)
      : device_(vulkan::Device::Get(config.device)),
        program_(Program(config.path)),
        opaque_(config.opaque != 0) {
    if (program_ == Program::kQuery ? !device_.has_query() : !device_.has_pipeline())
      throw std::runtime_error(device_.name() + " has no " +
                               (program_ == Program::kQuery ? "ray queries" : "pipelines") +
                               "; try path=" + (program_ == Program::kQuery ? "pipeline" : "query"));
    const std::lock_guard lock(device_.mutex());
    scene_.emplace(device_, geometry, options,
                   BuildChoice{BuildFor(config.build), config.compaction != 0, config.opaque != 0});
  }
  ~VulkanRt() {
    const std::lock_guard lock(device_.mutex());
    scene_.reset();
  }

  template <class Counter>
  void Query(const rb_query& query) const {
    if (scene_->is_empty())
      return ForEachRay<Counter>(query, [](auto, const RayQuery&, rb_hit&, Counter&) {});
    const std::lock_guard lock(device_.mutex());
    for (size_t at = 0; at < query.n; at += kPortion) {
      rb_query part = query;
      part.n = std::min<size_t>(query.n - at, kPortion);
      part.rays += at;
      if (part.skip != nullptr) part.skip += at;
      if (part.after != nullptr) part.after += at;
      if (part.kind == RB_ANY) {
        part.occluded += at;
      } else {
        part.hits += at;
      }
      Trace(part);
    }
  }

  uint32_t Claims() const { return RB_CLAIM_INEXACT; }
  MemoryUse Memory() const { return {scene_->structure_bytes(), scene_->data_bytes(), false}; }
  rb_device Device() const {
    const std::lock_guard lock(device_.mutex());
    return {sizeof(rb_device),      device_.is_software(), device_.name().c_str(), scene_->clock().work,
            scene_->clock().copies, clock_.work,           clock_.copies};
  }
  static const char* Unavailable() {
    const std::string& why = vulkan::Device::WhyNone();
    return why.empty() ? nullptr : why.c_str();
  }

  void DrawPicture(rb_picture& picture) const {
    if (program_ != Program::kQuery) throw std::runtime_error("pictures in waves take path=query");
    if (scene_->is_empty()) throw std::runtime_error("there is nothing to be seen");
    const std::lock_guard lock(device_.mutex());
    Draw(device_, *scene_, picture);
  }

  /// For tests: from now on how often each kind of shader runs is counted, in the order of shaders/common.glsl.
  void CountCalls(uint64_t (&calls)[5]) const {
    const std::lock_guard lock(device_.mutex());
    calls_ = calls;
  }

 private:
  /// Rays as the device gets them.
  static std::vector<Odd> Pack(const rb_query& query, rb_ray* rays) {
    std::vector<Odd> odd;
    for (uint32_t i = 0; i < query.n; ++i) {
      rays[i] = query.rays[i];
      if (IsRayWithin(rays[i], std::numeric_limits<float>::max(), kLongest, 1 / kLongest)) [[likely]]
        continue;
      if (!IsValidRay(rays[i])) {
        rays[i] = InvalidRayStandIn();
        odd.push_back({i, 0});
        continue;
      }
      int e = 0;
      const float* const d = query.rays[i].dir;
      std::frexp(std::fmax(std::fabs(d[0]), std::fmax(std::fabs(d[1]), std::fabs(d[2]))), &e);
      for (float& x : rays[i].dir) x = std::ldexp(x, -e);
      rays[i].tnear = std::ldexp(rays[i].tnear, e);
      rays[i].tfar = std::ldexp(std::fmin(rays[i].tfar, std::numeric_limits<float>::max()), e);
      odd.push_back({i, e});
    }
    return odd;
  }
  /// The answer to a ray that was scaled, as TraceRescaled() of accel/contract/structure.h has it.
  static void Unscale(const rb_query& query, const Odd& odd) {
    rb_hit& hit = query.hits[odd.index];
    const rb_ray& ray = query.rays[odd.index];
    if (hit.prim == RAYBENCH_NONE) {
      hit.t = ray.tfar;
      return;
    }
    const bool resumes = query.after != nullptr && query.after[odd.index] != RAYBENCH_NONE;
    const float first =
        resumes ? ray.tnear : std::nextafter(ray.tnear, std::numeric_limits<float>::infinity());
    hit.t = std::fmin(std::fmax(std::ldexp(hit.t, -odd.exponent), first), ray.tfar);
  }

  /// One portion: rays there, answers back. The caller holds the device.
  void Trace(const rb_query& query) const {
    const uint32_t n = uint32_t(query.n);
    const bool any = query.kind == RB_ANY;
    const size_t ray_bytes = n * sizeof(rb_ray), id_bytes = n * sizeof(uint32_t),
                 answer_bytes = n * (any ? sizeof(uint32_t) : sizeof(rb_hit));
    portion_.Reserve(device_, n);
    char* const to = static_cast<char*>(portion_.to_device.mapped());
    const std::vector<Odd> odd = Pack(query, reinterpret_cast<rb_ray*>(to));
    if (query.skip != nullptr) std::memcpy(to + ray_bytes, query.skip, id_bytes);
    if (query.after != nullptr) std::memcpy(to + ray_bytes + id_bytes, query.after, id_bytes);

    const bool filtered = !opaque_ || query.skip != nullptr || query.after != nullptr;
    const Pipeline& pipeline =
        device_.pipelines().Get({program_, any, filtered, scene_->has_procedural(), calls_ != nullptr});
    const Push push = {scene_->tlas(),           scene_->data(),
                       portion_.rays.address(),  portion_.skip.address(),
                       portion_.after.address(), portion_.answers.address(),
                       portion_.calls.address(), n,
                       query.skip != nullptr,    query.after != nullptr};
    const std::vector<double> seconds = device_.Submit("tracing", [&](Commands& commands) {
      commands.Stamp();
      commands.Copy(portion_.to_device, portion_.rays, ray_bytes);
      const auto copy_ids = [&](const Buffer& ids, size_t at) {
        const VkBufferCopy region = {at, 0, id_bytes};
        vkCmdCopyBuffer(commands.get(), portion_.to_device.get(), ids.get(), 1, &region);
      };
      if (query.skip != nullptr) copy_ids(portion_.skip, ray_bytes);
      if (query.after != nullptr) copy_ids(portion_.after, ray_bytes + id_bytes);
      const VkDispatchIndirectCommand groups = {(n + kGroup - 1) / kGroup, 1, 1};
      vkCmdUpdateBuffer(commands.get(), portion_.groups.get(), 0, sizeof groups, &groups);
      if (calls_ != nullptr) vkCmdFillBuffer(commands.get(), portion_.calls.get(), 0, VK_WHOLE_SIZE, 0);
      commands.Stamp();
      vkCmdPushConstants(commands.get(), device_.pipelines().layout(), device_.pipelines().PushStages(), 0,
                         sizeof push, &push);
      if (program_ == Program::kQuery) {
        vkCmdBindPipeline(commands.get(), VK_PIPELINE_BIND_POINT_COMPUTE, pipeline.pipeline);
        vkCmdDispatchIndirect(commands.get(), portion_.groups.get(), 0);
      } else {
        vkCmdBindPipeline(commands.get(), VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR, pipeline.pipeline);
        device_.functions().trace(commands.get(), &pipeline.generation, &pipeline.miss, &pipeline.hit,
                                  &pipeline.callable, n, 1, 1);
      }
      commands.Stamp();
      commands.Copy(portion_.answers, portion_.from_device, answer_bytes);
      commands.Stamp();
    });
    clock_.work += seconds[1];
    clock_.copies += seconds[0] + seconds[2];
    const void* const answers = portion_.from_device.mapped();
    if (any) {
      for (uint32_t i = 0; i < n; ++i) query.occluded[i] = static_cast<const uint32_t*>(answers)[i] != 0;
    } else {
      std::memcpy(query.hits, answers, answer_bytes);
      for (const Odd& o : odd) Unscale(query, o);
    }
    if (calls_ != nullptr) ReadCalls();
  }

  void ReadCalls() const {
    constexpr size_t kBytes = sizeof(uint32_t[5]);
    device_.Submit("counting", [&](Commands& commands) {
      commands.Copy(portion_.calls, portion_.from_device, kBytes);
      commands.Then();
    });
    for (int k = 0; k < 5; ++k) calls_[k] += static_cast<const uint32_t*>(portion_.from_device.mapped())[k];
  }

  vulkan::Device& device_;
  Program program_;
  bool opaque_;
  std::optional<SceneOnDevice> scene_;
  mutable Portion portion_;
  mutable Clock clock_;
  mutable uint64_t* calls_ = nullptr;
};

}  // namespace
}  // namespace raybench::vulkan

/// For tests: counts how often each kind of shader runs from now on, adding to `calls`; the tree is of this plugin.
extern "C" __attribute__((visibility("default"))) void raybench_vulkan_count_calls(const rb_tree* tree,
                                                                                   uint64_t (*calls)[5]) {
  reinterpret_cast<const raybench::vulkan::VulkanRt*>(tree)->CountCalls(*calls);
}

extern "C" __attribute__((visibility("default"))) int raybench_picture(const rb_tree* tree,
                                                                       rb_picture* picture, char* error,
                                                                       size_t error_size) {
  try {
    reinterpret_cast<const raybench::vulkan::VulkanRt*>(tree)->DrawPicture(*picture);
    return 0;
  } catch (const std::exception& e) {
    std::snprintf(error, error_size, "%s", e.what());
    return 1;
  }
}

RAYBENCH_PLUGIN(raybench::vulkan::VulkanRt)
