// Geometry on a device, and the driver's acceleration structures over it.
//
// A driver's bottom level holds one kind of geometry and no more primitives than the device allows. So there are some
// of triangles and some of boxes, each under one instance of the top level; the instance's custom index says with
// which primitive it begins, and its offset into the shader binding table is that of its kind.
#pragma once

#include <cstdint>
#include <vector>

#include "accel/contract/raybench.h"
#include "accel/vulkan/device.h"

namespace raybench::vulkan {

enum class BuildFor : uint32_t { kFastTrace, kFastBuild, kLowMemory };

struct BuildChoice {
  BuildFor build_for = BuildFor::kFastTrace;
  bool compaction = false;
  bool opaque =
      true;  ///< the geometry's flag: no shader looks at triangles that are hit, unless a ray asks for it
};

/// An acceleration structure in a buffer of its own.
class Structure {
 public:
  Structure() = default;
  Structure(const Device& device, VkDeviceSize bytes, VkAccelerationStructureTypeKHR type);
  Structure(Structure&& other) noexcept { *this = std::move(other); }
  Structure& operator=(Structure&& other) noexcept;
  ~Structure();

  VkAccelerationStructureKHR get() const { return structure_; }
  VkDeviceAddress address() const;
  VkDeviceSize bytes() const { return buffer_.bytes(); }

 private:
  const Device* device_ = nullptr;
  Buffer buffer_;
  VkAccelerationStructureKHR structure_ = VK_NULL_HANDLE;
};

/// Seconds by the device's clock.
struct Clock {
  double work = 0, copies = 0;
};

class SceneOnDevice {
 public:
  /// Copies and builds. Throws where the device cannot hold the geometry, where that takes more than the memory limit
  /// and when it is cancelled. The caller holds the device's mutex.
  SceneOnDevice(const Device& device, const rb_geometry& geometry, const rb_build_options& options,
                const BuildChoice& choice);

  bool is_empty() const { return bottoms_.empty(); }
  bool has_procedural() const { return has_procedural_; }
  VkDeviceAddress tlas() const { return top_.address(); }
  VkDeviceAddress data() const { return data_.address(); }  ///< SceneData of shaders/common.glsl
  const Clock& clock() const { return clock_; }
  uint64_t structure_bytes() const;
  uint64_t data_bytes() const;  ///< of what shaders read beside the structures

 private:
  /// What a bottom level is made of.
  struct Part {
    VkGeometryTypeKHR type;
    VkDeviceSize first_byte;  ///< of its indices or boxes
    uint32_t first_prim, count;
  };

  Buffer Uploaded(const void* from, VkDeviceSize bytes, VkBufferUsageFlags usage);
  std::vector<Part> Parts(const rb_geometry& geometry) const;
  Structure Build(const VkAccelerationStructureGeometryKHR& geometry, uint32_t count,
                  VkAccelerationStructureTypeKHR type, const rb_build_options& options);
  Structure Compacted(Structure structure);
  void BuildBottoms(const rb_geometry& geometry, const rb_build_options& options);
  void BuildTop(const rb_build_options& options);
  void CopyData(const rb_geometry& geometry);

  const Device& device_;
  BuildChoice choice_;
  bool has_procedural_;
  std::vector<Part> parts_;
  std::vector<Structure> bottoms_;
  Structure top_;
  Buffer positions_, first_prims_, spheres_, cones_, polygons_, corners_, data_;
  Clock clock_;
};

}  // namespace raybench::vulkan
