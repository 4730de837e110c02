#include "accel/vulkan/scene.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <stdexcept>
#include <string>

#include "accel/contract/cancel.h"
#include "accel/contract/structure.h"
#include "accel/ray/bounds.h"

namespace raybench::vulkan {
namespace {

constexpr VkBufferUsageFlags kInput =
    VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR | VK_BUFFER_USAGE_TRANSFER_DST_BIT;
constexpr VkBufferUsageFlags kData = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT;

/// Polygon of shaders/common.glsl.
struct Polygon {
  Vec3d normal, center;
  Vec3f lo, hi;
  uint32_t first, count;
};
static_assert(sizeof(Polygon) == 80);

/// SceneData of shaders/common.glsl.
struct SceneData {
  VkDeviceAddress spheres, cones, polygons, corners, positions, first_prims;
  uint32_t triangle_count, sphere_count, cone_count, unused = 0;
};

/// Whether procedural primitives came as data, too.
bool HasTypedData(const rb_geometry& g) {
  return g.struct_size >= offsetof(rb_geometry, polygon_vertex_count) + sizeof g.polygon_vertex_count &&
         g.sphere_count + g.cone_count + g.polygon_count == g.procedural_count;
}

/// The plane through the corners' mean with Newell's normal, as datasets/scene/procedural.cpp has it.
Polygon PlaneOf(const rb_geometry& g, uint64_t index) {
  const rb_polygon& polygon = g.polygons[index];
  const auto corner = [&](uint32_t i) {
    return ToDouble(LoadVec3(g.positions[g.polygon_vertices[polygon.first + i]]) + Vec3f{0, 0, 0});
  };
  Vec3d sum{0, 0, 0}, normal{0, 0, 0};
  for (uint32_t i = 0; i < polygon.count; ++i) sum = sum + corner(i);
  const Vec3d center = sum * (1 / double(polygon.count));
  Vec3d a = corner(polygon.count - 1) - center;
  for (uint32_t i = 0; i < polygon.count; ++i) {
    const Vec3d b = corner(i) - center;
    normal = normal + Cross(a, b);
    a = b;
  }
  const Bounds3 box = PrimBounds(g, uint32_t(g.triangle_count + g.sphere_count + g.cone_count + index));
  return {normal, center, box.lo, box.hi, polygon.first, polygon.count};
}

VkBuildAccelerationStructureFlagsKHR FlagsOf(const BuildChoice& choice) {
  constexpr VkBuildAccelerationStructureFlagsKHR kFlags[] = {
      VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_TRACE_BIT_KHR,
      VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_BUILD_BIT_KHR,
      VK_BUILD_ACCELERATION_STRUCTURE_LOW_MEMORY_BIT_KHR};
  return kFlags[uint32_t(choice.build_for)] |
         (choice.compaction ? VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_COMPACTION_BIT_KHR : 0);
}

}  // namespace

Structure::Structure(const Device& device, VkDeviceSize bytes, VkAccelerationStructureTypeKHR type)
    : device_(&device), buffer_(device, bytes, VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR) {
  VkAccelerationStructureCreateInfoKHR info{};
  info.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_CREATE_INFO_KHR;
  info.buffer = buffer_.get();
  info.size = bytes;
  info.type = type;
  Check(device.functions().create_acceleration_structure(device.get(), &info, nullptr, &structure_),
        "making an acceleration structure");
}

Structure& Structure::operator=(Structure&& other) noexcept {
  std::swap(device_, other.device_);
  std::swap(buffer_, other.buffer_);
  std::swap(structure_, other.structure_);
  return *this;
}

Structure::~Structure() {
  if (structure_ != VK_NULL_HANDLE)
    device_->functions().destroy_acceleration_structure(device_->get(), structure_, nullptr);
}

VkDeviceAddress Structure::address() const {
  VkAccelerationStructureDeviceAddressInfoKHR info{};
  info.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_DEVICE_ADDRESS_INFO_KHR;
  info.accelerationStructure = structure_;
  return device_->functions().address_of(device_->get(), &info);
}

SceneOnDevice::SceneOnDevice(const Device& device, const rb_geometry& geometry,
                             const rb_build_options& options, const BuildChoice& choice)
    : device_(device),
      choice_(choice),
      has_procedural_(geometry.procedural_count > 0),
      parts_(Parts(geometry)) {
  if (has_procedural_ && !HasTypedData(geometry))
    throw std::runtime_error(
        "the procedural primitives are callbacks only; a device needs spheres, cones and polygons as data");
  if (has_procedural_ && !device.has_double())
    throw std::runtime_error(device.name() + " has no doubles in shaders, which procedural primitives need");
  RequireWithinLimit(geometry.vertex_count * sizeof(float[3]) +
                         geometry.triangle_count * sizeof(uint32_t[3]) +
                         geometry.procedural_count * sizeof(VkAabbPositionsKHR),
                     options);
  if (parts_.empty()) return;
  BuildBottoms(geometry, options);
  BuildTop(options);
  CopyData(geometry);
  RequireWithinLimit(structure_bytes() + data_bytes(), options);
}

std::vector<SceneOnDevice::Part> SceneOnDevice::Parts(const rb_geometry& geometry) const {
  const uint64_t most = device_.structure_limits().maxPrimitiveCount;
  std::vector<Part> parts;
  const auto add = [&](VkGeometryTypeKHR type, uint64_t count, uint64_t first, VkDeviceSize bytes) {
    for (uint64_t at = 0; at < count; at += most)
      parts.push_back({type, at * bytes, uint32_t(first + at), uint32_t(std::min(most, count - at))});
  };
  add(VK_GEOMETRY_TYPE_TRIANGLES_KHR, geometry.triangle_count, 0, sizeof(uint32_t[3]));
  add(VK_GEOMETRY_TYPE_AABBS_KHR, geometry.procedural_count, geometry.triangle_count,
      sizeof(VkAabbPositionsKHR));
  if (parts.size() > device_.structure_limits().maxInstanceCount)
    throw std::runtime_error(std::to_string(PrimCount(geometry)) + " primitives; the device takes at most " +
                             std::to_string(most) + " in each of " +
                             std::to_string(device_.structure_limits().maxInstanceCount) + " instances");
  return parts;
}

Buffer SceneOnDevice::Uploaded(const void* from, VkDeviceSize bytes, VkBufferUsageFlags usage) {
  if (bytes == 0) return {};
  Buffer buffer(device_, bytes, usage);
  device_.Upload(buffer, from, bytes, clock_.copies);
  return buffer;
}

void SceneOnDevice::BuildBottoms(const rb_geometry& geometry, const rb_build_options& options) {
  positions_ = Uploaded(geometry.positions, geometry.vertex_count * sizeof(float[3]), kInput | kData);
  const Buffer triangles =
      Uploaded(geometry.triangles, geometry.triangle_count * sizeof(uint32_t[3]), kInput);
  std::vector<VkAabbPositionsKHR> boxes(geometry.procedural_count);
  for (uint64_t i = 0; i < boxes.size(); ++i) {
    if (i % 4096 == 0) CheckCancel(options.cancel);
    const Bounds3 box = PrimBounds(geometry, uint32_t(geometry.triangle_count + i));
    // Whether a driver's box test is conservative is not known: a little more room.
    const Bounds3 b = PaddedBounds(box, 8);
    boxes[i] = {b.lo.x, b.lo.y, b.lo.z, b.hi.x, b.hi.y, b.hi.z};
  }
  const Buffer bounds = Uploaded(boxes.data(), boxes.size() * sizeof boxes[0], kInput);
  for (const Part& part : parts_) {
    CheckCancel(options.cancel);
    VkAccelerationStructureGeometryKHR g{};
    g.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_KHR;
    g.geometryType = part.type;
    g.flags = choice_.opaque ? VK_GEOMETRY_OPAQUE_BIT_KHR : 0;
    // Where light passes surfaces, a picture's shadow rays multiply what they meet (shaders/wave.comp).
    if ((options.needs & RB_NEED_AFTER) != 0) g.flags |= VK_GEOMETRY_NO_DUPLICATE_ANY_HIT_INVOCATION_BIT_KHR;
    if (part.type == VK_GEOMETRY_TYPE_TRIANGLES_KHR) {
      VkAccelerationStructureGeometryTrianglesDataKHR& t = g.geometry.triangles;
      t.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_TRIANGLES_DATA_KHR;
      t.vertexFormat = VK_FORMAT_R32G32B32_SFLOAT;
      t.vertexData.deviceAddress = positions_.address();
      t.vertexStride = sizeof(float[3]);
      t.maxVertex = uint32_t(geometry.vertex_count - 1);
      t.indexType = VK_INDEX_TYPE_UINT32;
      t.indexData.deviceAddress = triangles.address() + part.first_byte;
    } else {
      VkAccelerationStructureGeometryAabbsDataKHR& b = g.geometry.aabbs;
      b.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_AABBS_DATA_KHR;
      b.data.deviceAddress = bounds.address() + part.first_byte;
      b.stride = sizeof(VkAabbPositionsKHR);
    }
    bottoms_.push_back(Build(g, part.count, VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR, options));
  }
}

void SceneOnDevice::BuildTop(const rb_build_options& options) {
  std::vector<VkAccelerationStructureInstanceKHR> instances(parts_.size());
  std::vector<uint32_t> first_prims;
  for (size_t i = 0; i < parts_.size(); ++i) {
    VkAccelerationStructureInstanceKHR& instance = instances[i];
    for (int row = 0; row < 3; ++row) instance.transform.matrix[row][row] = 1;
    instance.instanceCustomIndex = uint32_t(i) & 0xFFFFFF;
    instance.mask = 0xFF;
    instance.instanceShaderBindingTableRecordOffset = parts_[i].type == VK_GEOMETRY_TYPE_AABBS_KHR ? 1 : 0;
    instance.flags = VK_GEOMETRY_INSTANCE_TRIANGLE_FACING_CULL_DISABLE_BIT_KHR;
    instance.accelerationStructureReference = bottoms_[i].address();
    first_prims.push_back(parts_[i].first_prim);
  }
  const Buffer uploaded = Uploaded(instances.data(), instances.size() * sizeof instances[0], kInput);
  first_prims_ = Uploaded(first_prims.data(), first_prims.size() * sizeof first_prims[0], kData);
  VkAccelerationStructureGeometryKHR g{};
  g.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_KHR;
  g.geometryType = VK_GEOMETRY_TYPE_INSTANCES_KHR;
  g.geometry.instances.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_INSTANCES_DATA_KHR;
  g.geometry.instances.data.deviceAddress = uploaded.address();
  top_ = Build(g, uint32_t(instances.size()), VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR, options);
}

Structure SceneOnDevice::Build(const VkAccelerationStructureGeometryKHR& geometry, uint32_t count,
                               VkAccelerationStructureTypeKHR type, const rb_build_options& options) {
  const bool is_bottom = type == VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR;
  VkAccelerationStructureBuildGeometryInfoKHR info{};
  info.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_GEOMETRY_INFO_KHR;
  info.type = type;
  info.flags = FlagsOf({choice_.build_for, choice_.compaction && is_bottom, choice_.opaque});
  info.mode = VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR;
  info.geometryCount = 1, info.pGeometries = &geometry;
  VkAccelerationStructureBuildSizesInfoKHR sizes{};
  sizes.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_SIZES_INFO_KHR;
  device_.functions().build_sizes(device_.get(), VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR, &info,
                                  &count, &sizes);
  RequireWithinLimit(structure_bytes() + sizes.accelerationStructureSize + sizes.buildScratchSize, options);
  Structure structure(device_, sizes.accelerationStructureSize, type);
  const VkDeviceSize alignment = device_.structure_limits().minAccelerationStructureScratchOffsetAlignment;
  const Buffer scratch(device_, sizes.buildScratchSize + alignment, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
  info.dstAccelerationStructure = structure.get();
  info.scratchData.deviceAddress = (scratch.address() + alignment - 1) / alignment * alignment;
  const VkAccelerationStructureBuildRangeInfoKHR range = {count, 0, 0, 0};
  const VkAccelerationStructureBuildRangeInfoKHR* const ranges = &range;
  clock_.work += device_.Submit("building", [&](Commands& commands) {
    commands.Stamp();
    device_.functions().build(commands.get(), 1, &info, &ranges);
    commands.Stamp();
  })[0];
  return is_bottom && choice_.compaction ? Compacted(std::move(structure)) : std::move(structure);
}

Structure SceneOnDevice::Compacted(Structure structure) {
  VkQueryPoolCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO;
  info.queryType = VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR;
  info.queryCount = 1;
  VkQueryPool pool;
  Check(vkCreateQueryPool(device_.get(), &info, nullptr, &pool), "compacting");
  const std::unique_ptr<VkQueryPool_T, std::function<void(VkQueryPool)>> owner(
      pool, [&](VkQueryPool p) { vkDestroyQueryPool(device_.get(), p, nullptr); });
  const VkAccelerationStructureKHR from = structure.get();
  clock_.work += device_.Submit("compacting", [&](Commands& commands) {
    commands.Stamp();
    vkCmdResetQueryPool(commands.get(), pool, 0, 1);
    device_.functions().write_properties(commands.get(), 1, &from,
                                         VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR, pool, 0);
    commands.Stamp();
  })[0];
  VkDeviceSize bytes = 0;
  Check(vkGetQueryPoolResults(device_.get(), pool, 0, 1, sizeof bytes, &bytes, sizeof bytes,
                              VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WAIT_BIT),
        "compacting");
  Structure smaller(device_, bytes, VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR);
  VkCopyAccelerationStructureInfoKHR copy{};
  copy.sType = VK_STRUCTURE_TYPE_COPY_ACCELERATION_STRUCTURE_INFO_KHR;
  copy.src = from, copy.dst = smaller.get();
  copy.mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_COMPACT_KHR;
  clock_.work += device_.Submit("compacting", [&](Commands& commands) {
    commands.Stamp();
    device_.functions().copy(commands.get(), &copy);
    commands.Stamp();
  })[0];
  return smaller;
}

void SceneOnDevice::CopyData(const rb_geometry& g) {
  if (has_procedural_) {
    std::vector<Polygon> polygons(g.polygon_count);
    for (uint64_t i = 0; i < polygons.size(); ++i) polygons[i] = PlaneOf(g, i);
    spheres_ = Uploaded(g.spheres, g.sphere_count * sizeof(rb_sphere), kData);
    cones_ = Uploaded(g.cones, g.cone_count * sizeof(rb_cone), kData);
    polygons_ = Uploaded(polygons.data(), polygons.size() * sizeof polygons[0], kData);
    corners_ = Uploaded(g.polygon_vertices, g.polygon_vertex_count * sizeof(uint32_t), kData);
  }
  // Only polygons are tested by their vertices here; the driver has a copy of its own of the triangles'.
  if (!polygons_) positions_ = {};
  const SceneData data = {spheres_.address(),
                          cones_.address(),
                          polygons_.address(),
                          corners_.address(),
                          positions_.address(),
                          first_prims_.address(),
                          uint32_t(g.triangle_count),
                          has_procedural_ ? uint32_t(g.sphere_count) : 0,
                          has_procedural_ ? uint32_t(g.cone_count) : 0};
  data_ = Uploaded(&data, sizeof data, kData);
}

uint64_t SceneOnDevice::structure_bytes() const {
  uint64_t bytes = top_.bytes();
  for (const Structure& bottom : bottoms_) bytes += bottom.bytes();
  return bytes;
}

uint64_t SceneOnDevice::data_bytes() const {
  uint64_t bytes = 0;
  for (const Buffer* b : {&positions_, &first_prims_, &spheres_, &cones_, &polygons_, &corners_, &data_})
    bytes += b->bytes();
  return bytes;
}

}  // namespace raybench::vulkan
