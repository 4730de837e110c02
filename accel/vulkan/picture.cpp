#include "accel/vulkan/picture.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <span>
#include <stdexcept>
#include <string>

#include "accel/vulkan/pipelines.h"

namespace raybench::vulkan {
namespace {

constexpr uint64_t kBand = 1u << 18;         ///< camera rays traced together
constexpr uint64_t kSmallestBand = 1u << 8;  ///< after that, what does not fit is refused

// As in shaders/picture.glsl; rb_material and rb_light lie there as they are.
struct Path {
  float weight[3];
  uint32_t sample;
  rb_ray ray;
};
struct Wave {
  VkDispatchIndirectCommand groups;
  uint32_t rays, hits, shadow, blocked, reflections, refractions;
};
struct PictureData {
  VkDeviceAddress materials, material_of, positions, normals, triangles, lights, sums, paths[2], waves;
  uint32_t light_count, max_depth, capacity, fresnel;
  VkBool32 smooth_normals, gathers, shadow_rays;
  float min_contribution, ambient[3], background[3];
};
struct PicturePush {
  VkDeviceAddress tlas, scene, picture;
  uint32_t wave;
};
static_assert(sizeof(rb_material) == 88 && sizeof(rb_light) == 56 && sizeof(Path) == 48 &&
              sizeof(Wave) == 36 && sizeof(PictureData) == 136 && sizeof(PicturePush) <= sizeof(Push));

constexpr VkBufferUsageFlags kInput = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT,
                             kOutput = kInput | VK_BUFFER_USAGE_TRANSFER_SRC_BIT;

class Drawing {
 public:
  Drawing(const Device& device, const SceneOnDevice& scene, rb_picture& picture)
      : device_(device), scene_(scene), picture_(picture), band_(std::min(kBand, picture.ray_count)) {
    const rb_geometry& g = *picture.geometry;
    const uint64_t prims = g.triangle_count + g.procedural_count;
    materials_ = Uploaded(picture.materials, picture.material_count * sizeof(rb_material));
    material_of_ = Uploaded(picture.material_of, prims * sizeof(uint32_t));
    positions_ = Uploaded(g.positions, g.vertex_count * sizeof(float[3]));
    if (picture.normals != nullptr) normals_ = Uploaded(picture.normals, g.vertex_count * sizeof(float[3]));
    triangles_ = Uploaded(g.triangles, g.triangle_count * sizeof(uint32_t[3]));
    lights_ = Uploaded(picture.lights, picture.light_count * sizeof(rb_light));
    capacity_ = std::max<uint64_t>(2 * band_, 4096);
    for (Buffer& paths : paths_) paths = Buffer(device, capacity_ * sizeof(Path), kOutput);
    sums_ = Buffer(device, band_ * sizeof(uint32_t[6]), kOutput);
    waves_ = Buffer(device, WaveBytes(), kOutput | VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT);
    results_ =
        Buffer(device, sums_.bytes() + WaveBytes(), VK_BUFFER_USAGE_TRANSFER_DST_BIT, Buffer::Place::kHost);
    const PictureData data = {materials_.address(),
                              material_of_.address(),
                              positions_.address(),
                              normals_.address(),
                              triangles_.address(),
                              lights_.address(),
                              sums_.address(),
                              {paths_[0].address(), paths_[1].address()},
                              waves_.address(),
                              picture.light_count,
                              picture.max_depth,
                              uint32_t(capacity_),
                              picture.fresnel,
                              picture.normals != nullptr,
                              picture.transmittance,
                              picture.shadow_rays,
                              picture.min_contribution,
                              {picture.ambient[0], picture.ambient[1], picture.ambient[2]},
                              {picture.background[0], picture.background[1], picture.background[2]}};
    data_ = Uploaded(&data, sizeof data);
  }

  void Run() {
    std::fill_n(picture_.waves, picture_.max_depth + 1, rb_wave{});
    for (uint64_t at = 0; at < picture_.ray_count;) {
      const uint64_t n = std::min(band_, picture_.ray_count - at);
      if (TraceBand(at, n)) {
        TakeResults(at, n);
        at += n;
      } else if (band_ / 2 < kSmallestBand) {
        throw std::runtime_error("the paths of " + std::to_string(band_) +
                                 " pixels do not fit into a queue of " + std::to_string(capacity_) + " rays");
      } else {
        band_ /= 2;
      }
    }
  }

 private:
  VkDeviceSize WaveBytes() const { return (picture_.max_depth + 2) * sizeof(Wave); }
  std::span<const Wave> Waves() const {
    return {reinterpret_cast<const Wave*>(static_cast<const char*>(results_.mapped()) + sums_.bytes()),
            picture_.max_depth + size_t{1}};
  }

  Buffer Uploaded(const void* from, VkDeviceSize bytes) {
    if (bytes == 0) return {};
    Buffer buffer(device_, bytes, kInput);
    device_.Upload(buffer, from, bytes, picture_.copies);
    return buffer;
  }

  /// All waves of some camera rays, without the host in between. False: a queue was too short.
  bool TraceBand(uint64_t first, uint64_t n) {
    std::vector<Path> camera(n);
    for (uint64_t i = 0; i < n; ++i) {
      const rb_ray& ray = picture_.camera_rays[first + i];
      camera[i] = {{1, 1, 1}, uint32_t(i), ray};
    }
    device_.Upload(paths_[0], camera.data(), n * sizeof(Path), picture_.copies);
    const Pipeline& wave = device_.pipelines().Get({Program::kWave, 0, 0, scene_.has_procedural(), 0});
    const Pipeline& advance = device_.pipelines().Get({Program::kAdvance, 0, 0, 0, 0});
    const std::vector<double> seconds = device_.Submit("drawing", [&](Commands& commands) {
      vkCmdFillBuffer(commands.get(), waves_.get(), 0, VK_WHOLE_SIZE, 0);
      vkCmdFillBuffer(commands.get(), sums_.get(), 0, VK_WHOLE_SIZE, 0);
      commands.Then();
      const uint32_t rays = uint32_t(n);
      vkCmdUpdateBuffer(commands.get(), waves_.get(), offsetof(Wave, rays), sizeof rays, &rays);
      commands.Stamp();
      for (uint32_t w = 0; w <= picture_.max_depth; ++w) {
        const PicturePush push = {scene_.tlas(), scene_.data(), data_.address(), w};
        vkCmdPushConstants(commands.get(), device_.pipelines().layout(), device_.pipelines().PushStages(), 0,
                           sizeof push, &push);
        vkCmdBindPipeline(commands.get(), VK_PIPELINE_BIND_POINT_COMPUTE, advance.pipeline);
        vkCmdDispatch(commands.get(), 1, 1, 1);
        commands.Then();
        vkCmdBindPipeline(commands.get(), VK_PIPELINE_BIND_POINT_COMPUTE, wave.pipeline);
        vkCmdDispatchIndirect(commands.get(), waves_.get(), w * sizeof(Wave));
        commands.Then();
      }
      commands.Stamp();
      const VkBufferCopy sums = {0, 0, n * sizeof(uint32_t[6])}, waves = {0, sums_.bytes(), WaveBytes()};
      vkCmdCopyBuffer(commands.get(), sums_.get(), results_.get(), 1, &sums);
      vkCmdCopyBuffer(commands.get(), waves_.get(), results_.get(), 1, &waves);
      commands.Stamp();
    });
    picture_.seconds += seconds[0];
    picture_.copies += seconds[1];
    return std::all_of(Waves().begin(), Waves().end(), [&](const Wave& w) { return w.rays <= capacity_; });
  }

  void TakeResults(uint64_t first, uint64_t n) {
    const auto* sums = static_cast<const uint32_t(*)[6]>(results_.mapped());
    for (uint64_t i = 0; i < n; ++i)
      for (int k = 0; k < 3; ++k)
        picture_.pixels[first + i][k] =
            float(double(sums[i][2 * k + 1]) + std::ldexp(double(sums[i][2 * k]), -32));
    for (uint32_t w = 0; w <= picture_.max_depth; ++w) {
      const Wave& wave = Waves()[w];
      rb_wave& all = picture_.waves[w];
      all.rays += wave.rays, all.hits += wave.hits;
      all.shadow += wave.shadow, all.blocked += wave.blocked;
      all.reflections += wave.reflections, all.refractions += wave.refractions;
    }
  }

  const Device& device_;
  const SceneOnDevice& scene_;
  rb_picture& picture_;
  uint64_t band_, capacity_ = 0;
  Buffer materials_, material_of_, positions_, normals_, triangles_, lights_, paths_[2], sums_, waves_,
      results_, data_;
};

}  // namespace

void Draw(const Device& device, const SceneOnDevice& scene, rb_picture& picture) {
  picture.seconds = picture.copies = 0;
  if (picture.ray_count == 0) return;
  Drawing(device, scene, picture).Run();
}

}  // namespace raybench::vulkan
