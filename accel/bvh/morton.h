// Primitives along Morton's curve, 21 bits an axis: what builders start from that need no more than a
// neighbourhood. Lauterbach et al. (2009), "Fast BVH construction on GPUs".
#pragma once

#include "accel/bvh/build_records.h"

namespace raybench {

inline constexpr int kMortonBits = 63;

/// Numbers the cells of space; cells are cubes.
class MortonGrid {
 public:
  /// Around the centres, as MakeRecords finds them.
  explicit MortonGrid(const Box4& centroids);
  /// kMortonBits bits: of the cell of the box's centre.
  uint64_t Code(const Record& record) const;

 private:
  Float4 origin_;
  float scale_;
};

/// Primitives along the curve.
class MortonOrder {
 public:
  MortonOrder() = default;
  /// `records`: as MakeRecords leaves them. Parallel, the same at any thread count.
  MortonOrder(const HugeArray<Record>& records, const Box4& centroids);

  size_t size() const { return items_.size(); }
  /// Sorted by code, then by number.
  uint32_t prim(size_t i) const { return items_[i].prim; }
  /// Where the highest bit of the code that changes within [begin, end) does; `begin` if none does.
  size_t Cut(size_t begin, size_t end) const;

  /// Bytes it takes at its peak.
  static constexpr uint64_t kBytesPerPrim = 2 * 2 * sizeof(uint32_t) + sizeof(uint32_t);

 private:
  /// The code's upper bits sort nearly all.
  static constexpr int kLowBits = 31;
  struct Item {
    uint32_t high, prim;
  };
  /// Of entries that agree in the upper bits.
  void SortRun(size_t begin, size_t end);

  HugeArray<Item> items_;
  HugeArray<uint32_t> low_;  // by primitive: the code's lower bits
};

}  // namespace raybench
