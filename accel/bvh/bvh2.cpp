#include "accel/bvh/bvh2.h"

#include <algorithm>
#include <cstring>
#include <stdexcept>
#include <vector>

#include "accel/base/parallel.h"
#include "accel/base/simd.h"

namespace raybench {
namespace {

/// The first three lanes of four vectors, one row an axis.
void Transpose3(Float4 p0, Float4 p1, Float4 p2, Float4 p3, float (&rows)[3][4]) {
  const Float4 xy01 = __builtin_shufflevector(p0, p1, 0, 4, 1, 5),
               xy23 = __builtin_shufflevector(p2, p3, 0, 4, 1, 5),
               z01 = __builtin_shufflevector(p0, p1, 2, 6, 2, 6),
               z23 = __builtin_shufflevector(p2, p3, 2, 6, 2, 6);
  const Float4 out[3] = {__builtin_shufflevector(xy01, xy23, 0, 1, 4, 5),
                         __builtin_shufflevector(xy01, xy23, 2, 3, 6, 7),
                         __builtin_shufflevector(z01, z23, 0, 1, 4, 5)};
  std::memcpy(rows, out, sizeof out);
}

}  // namespace

Bvh2::Bvh2(const rb_geometry& geometry, const BinaryTree& tree)
    : geometry_(geometry), clipped_(tree.clipped) {
  static_assert(LeafRef(kMaxLeaf, kMostFirstBlock) != kEmpty &&
                LeafRef(kMaxLeaf, kMostFirstBlock + 1) == kEmpty);
  // First pass, in depth-first order: give nodes and leaf blocks their places.
  struct Leaf {
    uint32_t slot, block;
  };
  struct Pending {
    uint32_t slot, parent, side, depth;
  };
  std::vector<Leaf> leaves;
  std::vector<uint32_t> inner;  // slots
  std::vector<uint32_t> refs;   // two children an inner node
  uint32_t blocks = 0;
  std::vector<Pending> stack{{0, kEmpty, 0, 0}};
  while (!stack.empty()) {
    const Pending p = stack.back();
    stack.pop_back();
    if (p.depth >= kMaxTreeDepth) throw std::runtime_error("the tree is deeper than the traversal stack");
    const BuildNode& node = tree.nodes[p.slot];
    uint32_t ref;
    if (node.count > 0) {
      if (node.count > kMaxLeaf || blocks > kMostFirstBlock) throw std::runtime_error("too many primitives");
      ref = LeafRef(node.count, blocks);
      leaves.push_back({p.slot, blocks});
      blocks += (node.count + kLanes - 1) / kLanes;
    } else {
      ref = uint32_t(inner.size());
      inner.push_back(p.slot);
      refs.resize(2 * inner.size());
      stack.push_back({node.right, ref, 1, p.depth + 1});
      stack.push_back({p.slot + 1, ref, 0, p.depth + 1});
    }
    if (p.parent == kEmpty) {
      root_ = ref;
    } else {
      refs[2 * p.parent + p.side] = ref;
    }
  }
  const BuildNode& root = tree.nodes[0];
  bounds_ = {LoadVec3(root.lo), LoadVec3(root.hi)};

  // Second pass, in parallel: fill them.
  nodes_ = HugeArray<Node>(inner.size());
  blocks_ = HugeArray<Block>(blocks);
  ParallelFor(Range<size_t>(0, inner.size(), 1024), [&](const auto& range) {
    for (size_t i = range.begin(); i < range.end(); ++i) {
      Node& node = nodes_[i];
      const BuildNode& from = tree.nodes[inner[i]];
      const BuildNode* children[2] = {&from + 1, &tree.nodes[from.right]};
      for (int c = 0; c < 2; ++c) {
        for (int a = 0; a < 3; ++a)
          node.bounds[a][c] = children[c]->lo[a], node.bounds[a][c + 2] = children[c]->hi[a];
        node.child[c] = refs[2 * i + size_t(c)];
        node.unused[c] = 0;
      }
    }
  });
  ParallelFor(Range<size_t>(0, leaves.size(), 1024), [&](const auto& range) {
    // Vertices stand anywhere: asked for some leaves ahead, in two steps, since their numbers do too.
    constexpr size_t kAhead = 8;
    auto each_triangle = [&](size_t leaf, auto&& fn) {
      if (leaf >= range.end()) return;
      const BuildNode& from = tree.nodes[leaves[leaf].slot];
      for (uint32_t k = 0; k < from.count; ++k) {
        const uint32_t prim = tree.order[from.first + k];
        if (prim < geometry.triangle_count) fn(geometry.triangles[prim]);
      }
    };
    for (size_t i = range.begin(); i < range.end(); ++i) {
      each_triangle(i + 2 * kAhead, [](const uint32_t* corners) { __builtin_prefetch(corners); });
      each_triangle(i + kAhead, [&](const uint32_t* corners) {
        for (int c = 0; c < 3; ++c) __builtin_prefetch(geometry.positions[corners[c]]);
      });
      const BuildNode& leaf = tree.nodes[leaves[i].slot];
      const uint32_t last = leaf.count - 1;
      for (uint32_t k = 0; k < leaf.count; k += kLanes) {
        Block& block = blocks_[leaves[i].block + k / kLanes];
        for (uint32_t lane = 0; lane < kLanes; ++lane)
          block.prim[lane] = tree.order[leaf.first + std::min(k + lane, last)];
        for (int c = 0; c < 3; ++c) {
          auto corner = [&](int lane) {
            const uint32_t prim = block.prim[lane];
            return prim < geometry.triangle_count
                       ? Load<Float4>(geometry.positions[geometry.triangles[prim][c]])
                       : Float4{};
          };
          Transpose3(corner(0), corner(1), corner(2), corner(3), block.v[c]);
        }
      }
    }
  });
}

}  // namespace raybench
