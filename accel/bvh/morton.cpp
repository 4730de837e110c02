#include "accel/bvh/morton.h"

#include <vector>

#include "accel/base/parallel.h"
#include "accel/base/radix_sort.h"

namespace raybench {
namespace {

/// Puts two zero bits above each of the lowest 21 bits.
uint64_t Spread(uint64_t x) {
#if defined(__BMI2__)
  return _pdep_u64(x, 0x1249249249249249ull);
#else
  x = (x | x << 32) & 0x1F00000000FFFFull;
  x = (x | x << 16) & 0x1F0000FF0000FFull;
  x = (x | x << 8) & 0x100F00F00F00F00Full;
  x = (x | x << 4) & 0x10C30C30C30C30C3ull;
  return (x | x << 2) & 0x1249249249249249ull;
#endif
}

constexpr float kCells = 0x1p21f;  // along an axis

}  // namespace

MortonGrid::MortonGrid(const Box4& centroids) : origin_(centroids.lo) {
  const Float4 e = centroids.hi - centroids.lo;
  const float fit = kCells / std::max(e[0], std::max(e[1], e[2]));
  scale_ = fit <= std::numeric_limits<float>::max() ? fit : 0;
}

uint64_t MortonGrid::Code(const Record& record) const {
  const Float4 at = Smaller<4>((record.Centroid2() - origin_) * scale_, Splat<Float4>(kCells - 1));
  const Int4 cell = __builtin_convertvector(at, Int4);
  return Spread(uint32_t(cell[0])) << 2 | Spread(uint32_t(cell[1])) << 1 | Spread(uint32_t(cell[2]));
}

MortonOrder::MortonOrder(const HugeArray<Record>& records, const Box4& centroids)
    : items_(records.size()), low_(records.size()) {
  const MortonGrid grid(centroids);
  ForBlocks(0, items_.size(), [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const uint64_t code = grid.Code(records[i]);
      items_[i] = {uint32_t(code >> kLowBits), uint32_t(i)};
      low_[i] = uint32_t(code) & ((1u << kLowBits) - 1);
    }
  });
  HugeArray<Item> scratch(items_.size());
  RadixSort(items_, scratch, kMortonBits - kLowBits, [](const Item& item) { return item.high; });
  const auto same = [&](size_t a, size_t b) { return items_[a].high == items_[b].high; };
  ForBlocks(0, items_.size(), [&](size_t begin, size_t end) {
    // A run of equal ones belongs to the block in which it begins.
    size_t i = begin;
    while (i > 0 && i < end && same(i - 1, i)) ++i;
    while (i < end) {
      size_t next = i + 1;
      while (next < items_.size() && same(i, next)) ++next;
      if (next > i + 1) SortRun(i, next);
      i = next;
    }
  });
}

void MortonOrder::SortRun(size_t begin, size_t end) {
  constexpr size_t kShort = 16;
  uint64_t few[kShort];
  std::vector<uint64_t> many(end - begin > kShort ? end - begin : 0);
  uint64_t* const keys = many.empty() ? few : many.data();
  for (size_t i = begin; i < end; ++i)
    keys[i - begin] = uint64_t{low_[items_[i].prim]} << 32 | items_[i].prim;
  if (many.empty()) {
    std::sort(keys, keys + (end - begin));
  } else {
    ParallelSort(keys, keys + (end - begin));
  }
  for (size_t i = begin; i < end; ++i) items_[i].prim = uint32_t(keys[i - begin]);
}

size_t MortonOrder::Cut(size_t begin, size_t end) const {
  const auto cut = [&](const auto& code) {
    const uint32_t changes = code(begin) ^ code(end - 1);
    if (changes == 0) return begin;
    const uint32_t bit = uint32_t{1} << (31 - __builtin_clz(changes));
    size_t zeros = begin, ones = end - 1;  // the bit is 0 at `zeros`, 1 at `ones`
    while (ones - zeros > 1) {
      const size_t middle = zeros + (ones - zeros) / 2;
      ((code(middle) & bit) == 0 ? zeros : ones) = middle;
    }
    return ones;
  };
  const size_t ones = cut([&](size_t i) { return items_[i].high; });
  return ones > begin || end - begin < 2 ? ones : cut([&](size_t i) { return low_[items_[i].prim]; });
}

}  // namespace raybench
