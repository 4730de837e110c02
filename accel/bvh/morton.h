// Primitives along Morton's curve, 21 bits an axis: what builders start from that need no more than a
// neighbourhood. Lauterbach et al. (2009), "Fast BVH construction on GPUs".
#pragma once

#include "accel/bvh/build_records.h"

namespace raybench {

struct MortonItem {
  uint64_t code;  ///< 63 bits of the cell of the box's centre; cells are cubes
  uint32_t prim;
};

inline constexpr int kMortonBits = 63;

/// Sorted by (code, prim). `records`: as MakeRecords leaves them. Parallel, the same at any thread count.
HugeArray<MortonItem> SortByMorton(const HugeArray<Record>& records, const Box4& centroids);

/// Bytes it takes at its peak.
inline constexpr uint64_t kMortonBytesPerPrim = 2 * sizeof(MortonItem);

}  // namespace raybench
