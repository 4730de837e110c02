// The primitives of leaves, copied for traversal: blocks of four triangles, lane by lane, that the shared
// tests take at once. A leaf is (first block, number of primitives); the lanes behind its last primitive
// repeat it.
//
// Block, 160 bytes:
//
//     v: corner 0..2, axis 0..2, four lanes | prim: four ids
//
// Space partitions refer to a primitive from many cells. A mailbox keeps a ray from testing it again: here a
// small table for each ray, so that nothing is shared between threads (inverse mailboxing: Shevtsov,
// Soupikov, Kapustin 2007; hashed: Benthin 2006). A primitive whose place was taken by another is tested once
// more, which costs time and changes nothing.
#pragma once

#include <cstring>
#include <span>

#include "accel/base/huge_array.h"
#include "accel/base/simd.h"
#include "accel/ray/primitive.h"

namespace raybench {

/// No mailbox: every reference is tested.
struct NoMailbox {
  static constexpr bool kKeeps = false;
  unsigned Unseen(const uint32_t (&)[4]) const { return 15; }
};

/// Remembers the primitives that the ray was tested against, as far as they do not drive each other out.
class Mailbox {
 public:
  static constexpr bool kKeeps = true;
  Mailbox() { std::memset(seen_, 0xFF, sizeof seen_); }  // RAYBENCH_NONE everywhere

  /// Bit i: prim[i] has perhaps not been tested. From now on it has.
  unsigned Unseen(const uint32_t (&prim)[4]) {
    unsigned unseen = 0;
    for (unsigned i = 0; i < 4; ++i) {
      uint32_t& slot = seen_[prim[i] % kSize];
      unseen |= unsigned(slot != prim[i]) << i;
      slot = prim[i];
    }
    return unseen;
  }

 private:
  static constexpr uint32_t kSize = 32;
  uint32_t seen_[kSize];
};

class LeafBlocks {
 public:
  static constexpr uint32_t kLanes = 4;
  struct alignas(16) Block {
    float v[3][3][kLanes];  // corner, axis, lane
    uint32_t prim[kLanes];
  };
  static_assert(sizeof(Block) == 160);

  LeafBlocks() = default;
  LeafBlocks(const rb_geometry& geometry, size_t blocks) : geometry_(geometry), blocks_(blocks) {}

  static uint64_t BlocksOf(uint64_t prims) { return (prims + kLanes - 1) / kLanes; }

  /// Copies a leaf's primitives, at least one, to the blocks from `first` on.
  void Fill(size_t first, std::span<const uint32_t> prims) {
    const size_t padded = BlocksOf(prims.size()) * kLanes;
    for (size_t k = 0; k < padded; ++k) {
      const uint32_t prim = prims[std::min(k, prims.size() - 1)];
      Block& block = blocks_[first + k / kLanes];
      block.prim[k % kLanes] = prim;
      for (int c = 0; c < 3; ++c) {
        // Lanes of procedural primitives hold no vertices.
        const Vec3f v = prim < geometry_.triangle_count ? Vertex(geometry_, prim, c) : Vec3f{0, 0, 0};
        for (int a = 0; a < 3; ++a) block.v[c][a][k % kLanes] = v[a];
      }
    }
  }

  uint32_t prim(size_t first, uint32_t i) const { return blocks_[first + i / kLanes].prim[i % kLanes]; }

  /// Tests a leaf of `count` primitives. True if `best` changed; then kAnyHit returns at once.
  template <bool kProcedural, bool kAnyHit, class Test, class Counter, class Box>
  bool Intersect(size_t first, uint32_t count, const RayState<Test>& ray, rb_hit& best, Counter& counter,
                 Box&& mailbox) const {
    bool changed = false;
    const Block* block = &blocks_[first];
    for (uint32_t left = count;; ++block) {
      unsigned candidates = left < kLanes ? (1u << left) - 1 : 15u;
      candidates &= mailbox.Unseen(block->prim);
      if (!std::remove_reference_t<Box>::kKeeps || candidates != 0) {
        counter.Prims(uint64_t(__builtin_popcount(candidates)), sizeof(Block));
        if constexpr (!kProcedural) candidates &= ray.test.MayHit(Lanes{block->v});
        for (; candidates != 0; candidates &= candidates - 1) {
          const int i = __builtin_ctz(candidates);
          if constexpr (kProcedural) {
            changed |= ray.Primitive(geometry_, block->prim[i], best);
          } else {
            auto corner = [&](int c) {
              return Vec3f{block->v[c][0][i], block->v[c][1][i], block->v[c][2][i]};
            };
            changed |= ray.Triangle(corner(0), corner(1), corner(2), block->prim[i], best);
          }
          if (kAnyHit && changed) return true;
        }
      }
      if (left <= kLanes) return changed;
      left -= kLanes;
    }
  }

  /// The ids of a leaf, appended to `out`.
  template <class Vector>
  void Append(size_t first, uint32_t count, Vector& out) const {
    for (uint32_t i = 0; i < count; ++i) out.push_back(prim(first, i));
  }

  const Block* Address(size_t first) const { return &blocks_[first]; }
  uint64_t bytes() const { return blocks_.bytes(); }
  /// Queries read the borrowed geometry: there are procedural primitives.
  bool needs_geometry() const { return geometry_.procedural_count > 0; }

 private:
  rb_geometry geometry_{};
  HugeArray<Block> blocks_;
};

}  // namespace raybench
