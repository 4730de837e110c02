#include "accel/bvh/bvh2.h"

#include <stdexcept>
#include <vector>

#include "accel/base/parallel.h"

namespace raybench {

Bvh2::Bvh2(const rb_geometry& geometry, const BinaryTree& tree)
    : clipped_(tree.clipped), geometry_(geometry) {
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
      blocks += uint32_t(Blocks::BlocksOf(node.count));
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
  leaves_ = Blocks(geometry, blocks);
  ParallelFor(Range<size_t>(0, inner.size(), 1024), [&](const auto& range) {
    for (size_t i = range.begin(); i < range.end(); ++i) {
      Node& node = nodes_[i];
      const BuildNode& from = tree.nodes[inner[i]];
      const BuildNode* children[2] = {&from + 1, &tree.nodes[from.right]};
      for (int c = 0; c < 2; ++c) {
        for (int a = 0; a < 3; ++a)
          node.bounds[a][c] = children[c]->lo[a], node.bounds[a][c + 2] = children[c]->hi[a];
        node.child[c] = refs[2 * i + size_t(c)];
        node.stand_in[c] = 0;
      }
    }
  });
  ParallelFor(Range<size_t>(0, leaves.size(), 1024), [&](const auto& range) {
    leaves_.Fill(range.begin(), range.end(), [&](size_t i) {
      const BuildNode& leaf = tree.nodes[leaves[i].slot];
      return std::pair(leaves[i].block, std::span(&tree.order[leaf.first], leaf.count));
    });
  });
}

}  // namespace raybench
