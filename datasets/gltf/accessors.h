// The arrays of a glTF file: accessors over buffer views, strided, sparse, of integers that stand
// for fractions.
#pragma once

#include <tiny_gltf.h>

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "datasets/gltf/container.h"

namespace raybench {

/// One bit a component type: 1 << (type - TINYGLTF_COMPONENT_TYPE_BYTE).
using GltfTypes = uint32_t;
constexpr GltfTypes kGltfFloat = 1u << 6, kGltfBytes = 3u, kGltfShorts = 3u << 2, kGltfUnsignedInt = 1u << 5,
                    kGltfUnsignedByte = 1u << 1, kGltfUnsignedShort = 1u << 3;

class GltfAccessors {
 public:
  /// All outlive this. An accessor without a buffer view (all zeros, glTF 2.0, 3.6.2.1) has -1 or
  /// `zero_view` as its view.
  GltfAccessors(const tinygltf::Model& model, const int& zero_view, GltfContainer& container)
      : model_(model), zero_view_(zero_view), container_(container) {}

  /// Checks that accessor `index` has elements of N components of the allowed types, and that they and its
  /// sparse replacements lie inside their buffers. Returns their number. `what` ("POSITION") begins the
  /// messages of the InputErrors.
  uint64_t Check(int index, const char* what, int components, GltfTypes allowed);

  /// The elements as floats: normalised integers by glTF 2.0, 3.6.2.2, others by value. N is 2, 3 or 4.
  template <size_t N>
  std::vector<std::array<float, N>> Floats(int index, const char* what, GltfTypes allowed);
  /// Unsigned integers of one component.
  std::vector<uint32_t> Integers(int index, const char* what);

  /// The bytes of a buffer view.
  std::string_view View(int index, const std::string& what);

 private:
  struct Elements {
    const char* data;  // null: zeros
    uint64_t stride, count;
  };

  std::string Name(int index, const char* what) const;
  Elements Locate(int view_index, uint64_t offset, uint64_t count, uint64_t size, const std::string& what);
  template <size_t N, class T, class Out>
  void Read(const tinygltf::Accessor& accessor, const std::string& what, std::vector<Out>& out);

  const tinygltf::Model& model_;
  const int& zero_view_;
  GltfContainer& container_;
};

}  // namespace raybench
