#include "datasets/scene/weld.h"

#include <bit>

#include "accel/contract/raybench.h"

namespace raybench {

std::vector<uint32_t> WeldVertices(std::span<const Vec3f> positions) {
  // Open addressing, at most two thirds full; filled in order, so the first of equals is found.
  const size_t size = std::bit_ceil(positions.size() + positions.size() / 2 + 1);
  std::vector<uint32_t> table(size, RAYBENCH_NONE), same(positions.size());
  const auto hash = [](Vec3f p) {
    uint64_t h = 0;
    for (int k = 0; k < 3; ++k) {
      h = (h ^ std::bit_cast<uint32_t>(p[k] + 0.0f)) * 0x9FB21C651E98DF25u;  // + 0: -0 becomes 0
      h ^= h >> 29;
    }
    return h;
  };
  for (size_t i = 0; i < positions.size(); ++i) {
    size_t slot = hash(positions[i]) & (size - 1);
    while (table[slot] != RAYBENCH_NONE && !(positions[table[slot]] == positions[i]))
      slot = (slot + 1) & (size - 1);
    if (table[slot] == RAYBENCH_NONE) table[slot] = uint32_t(i);
    same[i] = table[slot];
  }
  return same;
}

}  // namespace raybench
