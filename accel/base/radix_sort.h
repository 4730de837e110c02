// Sorting by integer keys in linear time, the same at any thread count.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "accel/base/huge_array.h"
#include "accel/base/parallel.h"

namespace raybench {

/// Sorts `items` by the lowest `key_bits` bits of key(item), stably, least significant digit first. `scratch`
/// is as large; the result stands in `items`. Parallel over blocks.
template <class Item, class Key>
void RadixSort(HugeArray<Item>& items, HugeArray<Item>& scratch, int key_bits, Key&& key) {
  constexpr int kDigitBits = 11;
  constexpr size_t kDigits = size_t{1} << kDigitBits;
  // Small inputs are cut, too; but counting digits shall cost little beside moving items.
  const size_t n = items.size(), block = std::clamp(n / 16, size_t{1} << 14, size_t{1} << 16),
               blocks = (n + block - 1) / block;
  // Not a power of two: a digit's numbers would drive each other out of the cache.
  std::vector<std::array<uint32_t, kDigits + 16>> starts(blocks);
  for (int shift = 0; shift < key_bits; shift += kDigitBits) {
    auto digit = [&](const Item& item) { return size_t(key(item) >> shift) & (kDigits - 1); };
    ParallelFor(size_t{0}, blocks, [&](size_t b) {
      starts[b].fill(0);
      for (size_t i = b * block; i < std::min(n, (b + 1) * block); ++i) ++starts[b][digit(items[i])];
    });
    uint32_t sum = 0;
    bool sorted = false;  // by this digit: all items have the same
    for (size_t d = 0; d < kDigits; ++d) {
      const uint32_t before = sum;
      for (auto& s : starts) sum += std::exchange(s[d], sum);
      sorted |= sum - before == n;
    }
    if (sorted) continue;
    ParallelFor(size_t{0}, blocks, [&](size_t b) {
      for (size_t i = b * block; i < std::min(n, (b + 1) * block); ++i)
        scratch[starts[b][digit(items[i])]++] = items[i];
    });
    std::swap(items, scratch);
  }
}

}  // namespace raybench
