// Leaves as blocks of four triangles, vertices copied lane by lane, so that one filter sees four at once.
#pragma once

#include <algorithm>

#include "accel/huge_array.h"
#include "accel/ray_primitive.h"
#include "accel/simd.h"

namespace raybench {

class LeafBlocks {
 public:
  static constexpr uint32_t kLanes = 4;
  static constexpr uint32_t BlocksFor(uint32_t prims) { return (prims + kLanes - 1) / kLanes; }

  LeafBlocks() = default;
  /// Room for so many blocks; lanes of procedural primitives hold no vertices and are asked through
  /// `geometry`.
  LeafBlocks(const rb_geometry& geometry, size_t blocks) : geometry_(geometry), blocks_(blocks) {}

  /// Writes a leaf of prims[0] ... prims[count - 1], count > 0, from block `first` on. Thread-safe for
  /// different leaves.
  void Fill(size_t first, const uint32_t* prims, uint32_t count) {
    for (uint32_t k = 0; k < BlocksFor(count) * kLanes; ++k) {
      const uint32_t prim = prims[std::min(k, count - 1)];
      Block& block = blocks_[first + k / kLanes];
      block.prim[k % kLanes] = prim;
      for (int c = 0; c < 3; ++c) {
        const Vec3f v = prim < geometry_.triangle_count ? Vertex(geometry_, prim, c) : Vec3f{0, 0, 0};
        for (int a = 0; a < 3; ++a) block.v[c][a][k % kLanes] = v[a];
      }
    }
  }

  uint32_t prim(size_t first, uint32_t i) const { return blocks_[first + i / kLanes].prim[i % kLanes]; }
  uint64_t bytes() const { return blocks_.bytes(); }
  bool needs_geometry() const { return geometry_.procedural_count > 0; }

  /// Takes the hits among `count` primitives into `best`. True if it changed; with kAnyHit the first ends it.
  template <bool kProcedural, bool kAnyHit, class Test, class Counter>
  bool Intersect(size_t first, uint32_t count, const RayState<Test>& ray, rb_hit& best,
                 Counter& counter) const {
    counter.Prims(count, BlocksFor(count) * sizeof(Block));
    bool changed = false;
    const Block* block = &blocks_[first];
    for (uint32_t left = count;; ++block, left -= kLanes) {
      const unsigned lanes = (1u << std::min(left, kLanes)) - 1;
      unsigned candidates = kProcedural ? lanes : ray.test.MayHit(Lanes{block->v}) & lanes;
      for (; candidates != 0; candidates &= candidates - 1) {
        const int i = __builtin_ctz(candidates);
        if constexpr (kProcedural) {
          changed |= ray.Primitive(geometry_, block->prim[i], best);
        } else {
          auto corner = [&](int c) { return Vec3f{block->v[c][0][i], block->v[c][1][i], block->v[c][2][i]}; };
          changed |= ray.Triangle(corner(0), corner(1), corner(2), block->prim[i], best);
        }
        if (kAnyHit && changed) return true;
      }
      if (left <= kLanes) return changed;
    }
  }

 private:
  struct alignas(16) Block {
    float v[3][3][kLanes];  // corner, axis, lane
    uint32_t prim[kLanes];
  };
  static_assert(sizeof(Block) == 160);

  rb_geometry geometry_{};
  HugeArray<Block> blocks_;
};

}  // namespace raybench
