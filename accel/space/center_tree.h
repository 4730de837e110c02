// Builder for octrees and quadtrees: cells that are halved at their centres, along three axes or two at once.
//
// Level by level: each open cell's references are looked at in parallel chunks, which note for every
// reference the children it goes into and count them; then prefix sums give each child its place and the
// chunks fill it. Everything keeps the order of references, so the tree is the same at any thread count, and
// references in a leaf ascend.
//
// A cell becomes a leaf when it holds at most `leaf_size` primitives, at the depth limit, or when its
// children would hold `growth` times its references or more. By the surface area heuristic (MacDonald and
// Booth 1990) subdividing a cube stops to pay at 4, since a child has a quarter of its surface. Where a level
// would bring the tree beyond `references` per primitive, those cells of it are divided that grow least, as
// far as that goes: so depth, memory and time are bounded whatever lies across what.
#pragma once

#include <cstdint>
#include <vector>

#include "accel/base/vec3.h"
#include "accel/contract/raybench.h"
#include "accel/ray/leaf_blocks.h"
#include "accel/space/insertion.h"

namespace raybench {

struct CenterTreeOptions {
  int axes[3] = {0, 1, 2};  ///< the first `axis_count` of them are halved
  int axis_count = 3;       ///< 2 or 3
  uint32_t depth = 12;      ///< of the deepest leaf; the root has 0
  uint32_t leaf_size = 8;
  double growth = 3;
  double references = 16;
};

inline constexpr uint32_t kMaxCenterDepth = 24;  ///< floats have as many bits

struct CenterTree {
  static constexpr uint32_t kNone = 0xFFFFFFFFu;
  struct Node {
    Bounds3 box;  ///< along axes that are not halved: around the boxes of its primitives; may be empty
    uint32_t child = kNone;  ///< the first of 2^axis_count, in order of bits: bit k: upper half along axes[k]
    uint32_t count = 0;      ///< leaf: primitives
    uint64_t first = 0;      ///< leaf: the first in `refs`
    bool IsLeaf() const { return child == kNone; }
  };
  std::vector<Node> nodes;  ///< the root first; children stand together
  std::vector<uint32_t> refs;
  uint32_t children = 8;  ///< of an inner node: 4 or 8
};

/// Where a cell is halved along axis a. A cell too thin for that goes to its lower half as a whole.
inline float CenterOf(const Bounds3& box, int a) {
  const float c = 0.5f * (box.lo[a] + box.hi[a]);
  return box.lo[a] < c && c < box.hi[a] ? c : box.hi[a];
}

/// Runs inside the caller's task arena. Throws std::runtime_error when cancelled, over the memory limit, or
/// with more references than 32 bits can number.
CenterTree BuildCenterTree(const Insertion& insertion, const CenterTreeOptions& tree,
                           const rb_build_options& options);

/// A child as traversals refer to it, in six bytes of a node: what it is, and where.
struct CenterChild {
  static constexpr uint16_t kEmpty = 0, kMostCounted = 0xFFFD, kLarge = 0xFFFE, kInner = 0xFFFF;
  uint32_t index = 0;       ///< inner: node; leaf: its first block; large leaf: place in the list of them
  uint16_t count = kEmpty;  ///< leaf: primitives, up to kMostCounted
};

/// The leaves of a built tree, and the order of its inner nodes: depth first.
class CenterLeaves {
 public:
  CenterLeaves() = default;
  /// Runs inside the caller's task arena.
  CenterLeaves(const rb_geometry& geometry, const CenterTree& tree);

  /// By slot of the builder's node.
  CenterChild Child(uint32_t slot) const { return children_[slot]; }
  const std::vector<uint32_t>& inner() const { return inner_; }  ///< their slots, in order
  /// Frees what only building needs.
  void Forget() { children_ = {}, inner_ = {}; }

  template <bool kProcedural, bool kAnyHit, class Test, class Counter, class Box>
  bool Intersect(CenterChild leaf, const RayState<Test>& ray, rb_hit& best, Counter& counter,
                 Box& mailbox) const {
    const Leaf l = Of(leaf);
    counter.Leaf(false);
    return blocks_.template Intersect<kProcedural, kAnyHit>(l.block, l.count, ray, best, counter, mailbox);
  }
  void Append(CenterChild leaf, std::vector<uint32_t>& prims) const {
    const Leaf l = Of(leaf);
    if (l.count > 0) blocks_.Append(l.block, l.count, prims);
  }
  const void* Address(CenterChild leaf) const { return blocks_.Address(Of(leaf).block); }
  uint64_t bytes() const { return blocks_.bytes(); }

 private:
  struct Leaf {
    uint32_t block, count;
  };
  Leaf Of(CenterChild c) const {
    return c.count == CenterChild::kLarge ? large_[c.index] : Leaf{c.index, c.count};
  }

  LeafBlocks<> blocks_;
  std::vector<Leaf> large_;
  std::vector<CenterChild> children_;
  std::vector<uint32_t> inner_;
};

}  // namespace raybench
