// The primitives of leaves, copied for traversal: blocks of as many triangles as there are lanes, one lane
// each, that the shared tests take at once. A leaf is (first block, number of primitives); the lanes behind
// its last primitive repeat it.
//
// Block, 40 bytes a lane:
//
//     v: corner 0..2, axis 0..2, a float a lane | prim: an id a lane
//
// Space partitions refer to a primitive from many cells. A mailbox keeps a ray from testing it again: here a
// small table for each ray, so that nothing is shared between threads (inverse mailboxing: Shevtsov,
// Soupikov, Kapustin 2007; hashed: Benthin 2006). A primitive whose place was taken by another is tested once
// more, which costs time and changes nothing.
#pragma once

#include <cstring>
#include <span>
#include <utility>

#include "accel/base/huge_array.h"
#include "accel/base/simd.h"
#include "accel/ray/primitive.h"

namespace raybench {

/// No mailbox: every reference is tested.
struct NoMailbox {
  static constexpr bool kKeeps = false;
  template <size_t kLanes>
  unsigned Unseen(const uint32_t (&)[kLanes]) const {
    return kAllLanes<kLanes>;
  }
};

/// Remembers the primitives that the ray was tested against, as far as they do not drive each other out.
class Mailbox {
 public:
  static constexpr bool kKeeps = true;
  Mailbox() { std::memset(seen_, 0xFF, sizeof seen_); }  // RAYBENCH_NONE everywhere

  /// Bit i: prim[i] has perhaps not been tested. From now on it has.
  template <size_t kLanes>
  unsigned Unseen(const uint32_t (&prim)[kLanes]) {
    unsigned unseen = 0;
    for (unsigned i = 0; i < kLanes; ++i) {
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

/// kWidth: a multiple of four.
template <uint32_t kWidth = 4>
class LeafBlocks {
 public:
  static constexpr uint32_t kLanes = kWidth;
  struct alignas(4 * kLanes) Block {
    float v[3][3][kLanes];  // corner, axis, lane
    uint32_t prim[kLanes];
  };
  static_assert(kLanes % 4 == 0 && sizeof(Block) == 40 * kLanes);

  LeafBlocks() = default;
  LeafBlocks(const rb_geometry& geometry, size_t blocks) : geometry_(geometry), blocks_(blocks) {}

  static uint64_t BlocksOf(uint64_t prims) { return (prims + kLanes - 1) / kLanes; }

  /// Copies a leaf's primitives, at least one, to the blocks from `first` on.
  void Fill(size_t first, std::span<const uint32_t> prims) {
    for (size_t k = 0; k < prims.size(); k += kLanes)
      FillBlock(geometry_, prims.subspan(k, std::min<size_t>(kLanes, prims.size() - k)),
                blocks_[first + k / kLanes]);
  }

  /// Copies 1 to kLanes primitives to a block, which may stand anywhere.
  static void FillBlock(const rb_geometry& geometry, std::span<const uint32_t> prims, Block& block) {
    const size_t last = prims.size() - 1;
    for (uint32_t lane = 0; lane < kLanes; ++lane) block.prim[lane] = prims[std::min<size_t>(lane, last)];
    for (int c = 0; c < 3; ++c) {
      auto corner = [&](uint32_t lane) {
        // Lanes of procedural primitives hold no vertices.
        const uint32_t prim = block.prim[lane];
        return prim < geometry.triangle_count ? Load<Float4>(geometry.positions[geometry.triangles[prim][c]])
                                              : Float4{};
      };
      for (uint32_t lane = 0; lane < kLanes; lane += 4)
        StoreTransposed(corner(lane), corner(lane + 1), corner(lane + 2), corner(lane + 3), block.v[c], lane);
    }
  }

  /// Fills leaves `begin` to `end` - 1; leaf(i): (first block, primitives) of leaf i. Vertices stand anywhere:
  /// they are asked for some leaves ahead, in two steps, since their numbers do too.
  template <class Leaf>
  void Fill(size_t begin, size_t end, const Leaf& leaf) {
    constexpr size_t kAhead = 8;
    auto each_triangle = [&](size_t i, auto&& fn) {
      if (i >= end) return;
      for (const uint32_t prim : leaf(i).second)
        if (prim < geometry_.triangle_count) fn(geometry_.triangles[prim]);
    };
    for (size_t i = begin; i < end; ++i) {
      each_triangle(i + 2 * kAhead, [](const uint32_t* corners) { __builtin_prefetch(corners); });
      each_triangle(i + kAhead, [&](const uint32_t* corners) {
        for (int c = 0; c < 3; ++c) __builtin_prefetch(geometry_.positions[corners[c]]);
      });
      const auto [first, prims] = leaf(i);
      Fill(first, prims);
    }
  }

  uint32_t prim(size_t first, uint32_t i) const { return blocks_[first + i / kLanes].prim[i % kLanes]; }

  /// Tests a leaf of `count` primitives. True if `best` changed; then kAnyHit returns at once. Inlined whatever
  /// the compiler thinks of it: it would choose differently for one structure and another.
  template <bool kProcedural, bool kAnyHit, class Test, class Counter, class Box>
  [[gnu::always_inline]] bool Intersect(size_t first, uint32_t count, const RayState<Test>& ray, rb_hit& best,
                                        Counter& counter, Box&& mailbox) const {
    return IntersectBlocks<kProcedural, kAnyHit>(geometry_, &blocks_[first], count, ray, best, counter,
                                                 mailbox);
  }
  /// The same for blocks that stand anywhere.
  template <bool kProcedural, bool kAnyHit, class Test, class Counter, class Box>
  [[gnu::always_inline]] static bool IntersectBlocks(const rb_geometry& geometry, const Block* block,
                                                     uint32_t count, const RayState<Test>& ray, rb_hit& best,
                                                     Counter& counter, Box&& mailbox) {
    bool changed = false;
    for (uint32_t left = count;; ++block) {
      unsigned candidates = (1u << std::min(left, kLanes)) - 1;
      candidates &= mailbox.Unseen(block->prim);
      if (!std::remove_reference_t<Box>::kKeeps || candidates != 0) {
        counter.Prims(uint64_t(__builtin_popcount(candidates)), sizeof(Block));
        if constexpr (!kProcedural && RayState<Test>::kInLanes) {
          // The registers belong to traversal: what is needed here stays in memory.
          const RayState<Test>* state = &ray;
          asm("" : "+r"(state));
          changed |=
              state->lanes.template Take<kAnyHit>(*block, candidates, state->query, state->slab, true, best);
          if (kAnyHit && changed) return true;
        } else {
          if constexpr (!kProcedural) candidates &= ray.test.MayHit(Lanes<kLanes>{block->v});
          for (; candidates != 0; candidates &= candidates - 1) {
            const int i = __builtin_ctz(candidates);
            if constexpr (kProcedural) {
              changed |= ray.Primitive(geometry, block->prim[i], best);
            } else {
              auto corner = [&](int c) {
                return Vec3f{block->v[c][0][i], block->v[c][1][i], block->v[c][2][i]};
              };
              changed |= ray.Triangle(corner(0), corner(1), corner(2), block->prim[i], best);
            }
            if (kAnyHit && changed) return true;
          }
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
  /// The first three lanes of four vectors, one row an axis, from `lane` on.
  static void StoreTransposed(Float4 p0, Float4 p1, Float4 p2, Float4 p3, float (&rows)[3][kLanes],
                              uint32_t lane) {
    const Float4 xy01 = __builtin_shufflevector(p0, p1, 0, 4, 1, 5),
                 xy23 = __builtin_shufflevector(p2, p3, 0, 4, 1, 5),
                 z01 = __builtin_shufflevector(p0, p1, 2, 6, 2, 6),
                 z23 = __builtin_shufflevector(p2, p3, 2, 6, 2, 6);
    const Float4 out[3] = {__builtin_shufflevector(xy01, xy23, 0, 1, 4, 5),
                           __builtin_shufflevector(xy01, xy23, 2, 3, 6, 7),
                           __builtin_shufflevector(z01, z23, 0, 1, 4, 5)};
    for (int a = 0; a < 3; ++a) std::memcpy(&rows[a][lane], &out[a], sizeof out[a]);
  }

  rb_geometry geometry_{};
  HugeArray<Block> blocks_;
};

}  // namespace raybench
