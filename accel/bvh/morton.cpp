#include "accel/bvh/morton.h"

#include "accel/base/parallel.h"
#include "accel/base/radix_sort.h"

namespace raybench {
namespace {

/// Puts two zero bits above each of the lowest 21 bits.
uint64_t Spread(uint64_t x) {
  x = (x | x << 32) & 0x1F00000000FFFFull;
  x = (x | x << 16) & 0x1F0000FF0000FFull;
  x = (x | x << 8) & 0x100F00F00F00F00Full;
  x = (x | x << 4) & 0x10C30C30C30C30C3ull;
  return (x | x << 2) & 0x1249249249249249ull;
}

}  // namespace

HugeArray<MortonItem> SortByMorton(const HugeArray<Record>& records, const Box4& centroids) {
  const Float4 e = centroids.hi - centroids.lo;
  const float cells = 0x1p21f, extent = std::max(e[0], std::max(e[1], e[2]));
  const float fit = cells / extent, scale = fit <= std::numeric_limits<float>::max() ? fit : 0;
  HugeArray<MortonItem> items(records.size()), scratch(records.size());
  ForBlocks(0, items.size(), [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const Float4 at = (records[i].Centroid2() - centroids.lo) * scale;
      uint64_t code = 0;
      for (int a = 0; a < 3; ++a) code |= Spread(uint64_t(std::min(at[a], cells - 1))) << (2 - a);
      items[i] = {code, uint32_t(i)};
    }
  });
  // The high half puts nearly all in place; few items agree in it.
  constexpr int kLowBits = 30;
  auto high = [&](size_t i) { return items[i].code >> kLowBits; };
  RadixSort(items, scratch, kMortonBits - kLowBits,
            [](const MortonItem& item) { return item.code >> kLowBits; });
  ForBlocks(0, items.size(), [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end;) {
      size_t next = i + 1;
      while (next < items.size() && high(next) == high(i)) ++next;
      // A run belongs to the block in which it begins.
      if (next > i + 1 && (i != begin || i == 0 || high(i - 1) != high(i)))
        ParallelSort(&items[i], &items[i] + (next - i), [](const MortonItem& a, const MortonItem& b) {
          return a.code != b.code ? a.code < b.code : a.prim < b.prim;
        });
      i = next;
    }
  });
  return items;
}

}  // namespace raybench
