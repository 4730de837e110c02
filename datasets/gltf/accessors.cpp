#include "datasets/gltf/accessors.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <type_traits>

namespace raybench {
namespace {

constexpr const char* kTypeNames[] = {"byte", "unsigned byte", "short", "unsigned short",
                                      "int",  "unsigned int",  "float", "double"};

// VECn is n in tinygltf.
constexpr const char* kShapes[] = {"a matrix", "SCALAR", "VEC2", "VEC3", "VEC4"};

std::string TypeNames(GltfTypes types) {
  std::string text;
  for (size_t i = 0; i < std::size(kTypeNames); ++i)
    if (types >> i & 1) text += fmt::format("{}{}", text.empty() ? "" : " or ", kTypeNames[i]);
  return text;
}

/// One component as float. Signed normalised integers are symmetric: -128 and -127 are both -1.
template <class T>
float Component(T value, bool normalized) {
  if constexpr (std::is_floating_point_v<T>) {
    return value;
  } else {
    if (!normalized) return float(value);
    return float(std::max(double(value) / double(std::numeric_limits<T>::max()), -1.0));
  }
}

}  // namespace

std::string GltfAccessors::Name(int index, const char* what) const {
  return fmt::format("accessor {} ({})", index, what);
}

std::string_view GltfAccessors::View(int index, const std::string& what) {
  if (index < 0 || size_t(index) >= model_.bufferViews.size() || index == zero_view_)
    container_.Fail(fmt::format("{} refers to buffer view {}; there are {}", what, index,
                                model_.bufferViews.size() - (zero_view_ >= 0)));
  const tinygltf::BufferView& view = model_.bufferViews[size_t(index)];
  std::string_view buffer = container_.Buffer(view.buffer);
  if (view.byteOffset > buffer.size() || view.byteLength > buffer.size() - view.byteOffset)
    container_.Fail(fmt::format("buffer view {} has {} bytes at offset {} of buffer {}, which has {} bytes",
                                index, view.byteLength, view.byteOffset, view.buffer, buffer.size()));
  return buffer.substr(view.byteOffset, view.byteLength);
}

/// `count` elements of `size` bytes at `offset` in a buffer view; all of them lie inside it.
GltfAccessors::Elements GltfAccessors::Locate(int view_index, uint64_t offset, uint64_t count, uint64_t size,
                                              const std::string& what) {
  std::string_view view = View(view_index, what);
  const size_t declared = model_.bufferViews[size_t(view_index)].byteStride;
  const uint64_t stride = declared == 0 ? size : declared;
  if (stride < size || offset > view.size() ||
      (count > 0 && (size > view.size() - offset || (count - 1) > (view.size() - offset - size) / stride)))
    container_.Fail(
        fmt::format("{} needs {} elements of {} bytes (stride {}) at offset {} of buffer view {}, which has "
                    "{} bytes",
                    what, count, size, stride, offset, view_index, view.size()));
  return {view.data() + offset, stride, count};
}

uint64_t GltfAccessors::Check(int index, const char* what, int components, GltfTypes allowed) {
  const std::string name = Name(index, what);
  if (index < 0 || size_t(index) >= model_.accessors.size())
    container_.Fail(fmt::format("refers to {}; there are {}", name, model_.accessors.size()));
  const tinygltf::Accessor& a = model_.accessors[size_t(index)];
  const int found = a.type == TINYGLTF_TYPE_SCALAR ? 1 : a.type <= TINYGLTF_TYPE_VEC4 ? a.type : 0;
  const int type = a.componentType - TINYGLTF_COMPONENT_TYPE_BYTE;
  if (found != components || type < 0 || type >= int(std::size(kTypeNames)) || (allowed >> type & 1) == 0) {
    const std::string is =
        type >= 0 && type < int(std::size(kTypeNames)) ? kTypeNames[type] : std::to_string(a.componentType);
    container_.Fail(fmt::format("{} is {} of {}; allowed is {} of {}", name, kShapes[found], is,
                                kShapes[components], TypeNames(allowed)));
  }
  const uint64_t size =
      uint64_t(tinygltf::GetComponentSizeInBytes(uint32_t(a.componentType))) * uint64_t(found);
  if (a.bufferView >= 0 && a.bufferView != zero_view_) {
    Locate(a.bufferView, a.byteOffset, a.count, size, name);
  } else if (!a.sparse.isSparse) {
    container_.Fail(name + " has neither a buffer view nor sparse values");
  } else if (a.count > std::max<uint64_t>(container_.size(), 1 << 16)) {
    // Zeros cost the file nothing. This is more than any file needs, and no more than it can pay for.
    container_.Fail(
        fmt::format("{} says {} elements without a buffer view; at most as many as the file and "
                    "its buffers have bytes are allowed ({})",
                    name, a.count, container_.size()));
  }
  if (a.sparse.isSparse) {
    const int index_size = tinygltf::GetComponentSizeInBytes(uint32_t(a.sparse.indices.componentType));
    const int index_type = a.sparse.indices.componentType - TINYGLTF_COMPONENT_TYPE_BYTE;
    constexpr GltfTypes kUnsigned = kGltfUnsignedByte | kGltfUnsignedShort | kGltfUnsignedInt;
    if (index_type < 0 || index_type > 31 || (kUnsigned >> index_type & 1) == 0)
      container_.Fail(fmt::format("{} has sparse indices of type {}; allowed are {}", name,
                                  a.sparse.indices.componentType, TypeNames(kUnsigned)));
    const uint64_t n = uint64_t(a.sparse.count);
    if (n > a.count) container_.Fail(fmt::format("{} replaces {} of its {} elements", name, n, a.count));
    Locate(a.sparse.indices.bufferView, uint64_t(a.sparse.indices.byteOffset), n, uint64_t(index_size),
           name + ", sparse indices,");
    Locate(a.sparse.values.bufferView, uint64_t(a.sparse.values.byteOffset), n, size,
           name + ", sparse values,");
  }
  return a.count;
}

/// Elements of N components of type T, then their sparse replacements. Check() has passed.
template <size_t N, class T, class Out>
void GltfAccessors::Read(const tinygltf::Accessor& a, const std::string& what, std::vector<Out>& out) {
  auto convert = [&](const char* from, Out& to) {
    T components[N];
    std::memcpy(components, from, sizeof components);
    if constexpr (std::is_integral_v<Out>) {
      to = components[0];
    } else {
      for (size_t k = 0; k < N; ++k) to[k] = Component(components[k], a.normalized);
    }
  };
  out.resize(a.count);
  if (a.bufferView >= 0 && a.bufferView != zero_view_) {
    const Elements from = Locate(a.bufferView, a.byteOffset, a.count, sizeof(T) * N, what);
    for (size_t i = 0; i < a.count; ++i) convert(from.data + i * from.stride, out[i]);
  }
  if (!a.sparse.isSparse) return;
  const uint64_t n = uint64_t(a.sparse.count);
  const size_t index_size =
      size_t(tinygltf::GetComponentSizeInBytes(uint32_t(a.sparse.indices.componentType)));
  const Elements indices =
      Locate(a.sparse.indices.bufferView, uint64_t(a.sparse.indices.byteOffset), n, index_size, what);
  const Elements values =
      Locate(a.sparse.values.bufferView, uint64_t(a.sparse.values.byteOffset), n, sizeof(T) * N, what);
  for (uint64_t i = 0; i < n; ++i) {
    uint32_t index = 0;
    std::memcpy(&index, indices.data + i * indices.stride, index_size);
    if (index >= out.size())
      container_.Fail(fmt::format("{} replaces element {} (sparse index {}); allowed are 0 to {}", what,
                                  index, i, int64_t(out.size()) - 1));
    convert(values.data + i * values.stride, out[index]);
  }
}

template <size_t N>
std::vector<std::array<float, N>> GltfAccessors::Floats(int index, const char* what, GltfTypes allowed) {
  Check(index, what, int(N), allowed);
  const tinygltf::Accessor& a = model_.accessors[size_t(index)];
  const std::string name = Name(index, what);
  std::vector<std::array<float, N>> out;
  switch (a.componentType) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
      Read<N, int8_t>(a, name, out);
      break;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      Read<N, uint8_t>(a, name, out);
      break;
    case TINYGLTF_COMPONENT_TYPE_SHORT:
      Read<N, int16_t>(a, name, out);
      break;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      Read<N, uint16_t>(a, name, out);
      break;
    default:
      Read<N, float>(a, name, out);
  }
  return out;
}

template std::vector<std::array<float, 2>> GltfAccessors::Floats<2>(int, const char*, GltfTypes);
template std::vector<std::array<float, 3>> GltfAccessors::Floats<3>(int, const char*, GltfTypes);
template std::vector<std::array<float, 4>> GltfAccessors::Floats<4>(int, const char*, GltfTypes);

std::vector<uint32_t> GltfAccessors::Integers(int index, const char* what) {
  Check(index, what, 1, kGltfUnsignedByte | kGltfUnsignedShort | kGltfUnsignedInt);
  const tinygltf::Accessor& a = model_.accessors[size_t(index)];
  const std::string name = Name(index, what);
  std::vector<uint32_t> out;
  switch (a.componentType) {
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      Read<1, uint8_t>(a, name, out);
      break;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      Read<1, uint16_t>(a, name, out);
      break;
    default:
      Read<1, uint32_t>(a, name, out);
  }
  return out;
}

}  // namespace raybench
