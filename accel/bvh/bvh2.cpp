#include "accel/bvh/bvh2.h"

#include <stdexcept>
#include <vector>

#include "accel/base/parallel.h"

namespace raybench {

/// In depth-first order: a subtree, or the root alone of one that is too large to be laid out by one thread.
struct Bvh2::Part {
  uint32_t slot, end;  // its slots
  uint32_t depth;
  uint32_t parent, side;  // which part's root it is a child of
  bool is_whole;
  uint32_t inner = 0, blocks = 0;  // nodes and leaf blocks: their numbers, then the first ones
};

Bvh2::Bvh2(const rb_geometry& geometry, const BinaryTree& tree)
    : clipped_(tree.clipped), geometry_(geometry) {
  static_assert(LeafRef(kMaxLeaf, kMostFirstBlock) != kEmpty &&
                LeafRef(kMaxLeaf, kMostFirstBlock + 1) == kEmpty);
  const BuildNode& root = tree.nodes[0];
  bounds_ = {LoadVec3(root.lo), LoadVec3(root.hi)};
  std::vector<Part> parts = Divide(tree);
  ParallelFor(size_t{0}, parts.size(), [&](size_t i) { Count(tree, parts[i]); });
  uint32_t inner = 0;
  uint64_t blocks = 0;
  for (Part& part : parts) {
    inner += std::exchange(part.inner, inner);
    const uint64_t first = blocks;
    blocks += part.blocks;
    part.blocks = uint32_t(first);
  }
  if (blocks > uint64_t{kMostFirstBlock} + 1) throw std::runtime_error("too many primitives");
  nodes_ = HugeArray<Node>(inner);
  leaves_ = Blocks(geometry, blocks);
  ParallelFor(size_t{0}, parts.size(), [&](size_t i) { LayOut(tree, parts, parts[i]); });
}

std::vector<Bvh2::Part> Bvh2::Divide(const BinaryTree& tree) {
  constexpr uint32_t kWholeSlots = 1u << 11;
  std::vector<Part> parts;
  std::vector<Part> stack{{0, uint32_t(tree.nodes.size()), 0, kEmpty, 0, false}};
  while (!stack.empty()) {
    Part part = stack.back();
    stack.pop_back();
    const BuildNode& node = tree.nodes[part.slot];
    part.is_whole = node.count > 0 || part.end - part.slot < kWholeSlots;
    if (!part.is_whole) {
      const uint32_t own = uint32_t(parts.size());
      stack.push_back({node.right, part.end, part.depth + 1, own, 1, false});
      stack.push_back({part.slot + 1, node.right, part.depth + 1, own, 0, false});
    }
    parts.push_back(part);
  }
  return parts;
}

void Bvh2::Count(const BinaryTree& tree, Part& part) {
  if (!part.is_whole) {
    part.inner = 1;
    return;
  }
  std::vector<std::pair<uint32_t, uint32_t>> stack{{part.slot, part.depth}};
  while (!stack.empty()) {
    const auto [slot, depth] = stack.back();
    stack.pop_back();
    if (depth >= kMaxTreeDepth) throw std::runtime_error("the tree is deeper than the traversal stack");
    const BuildNode& node = tree.nodes[slot];
    if (node.count > kMaxLeaf) throw std::runtime_error("too many primitives");
    if (node.count > 0) {
      part.blocks += uint32_t(Blocks::BlocksOf(node.count));
    } else {
      ++part.inner;
      stack.push_back({node.right, depth + 1});
      stack.push_back({slot + 1, depth + 1});
    }
  }
}

void Bvh2::LayOut(const BinaryTree& tree, const std::vector<Part>& parts, const Part& part) {
  struct Leaf {
    uint32_t slot, block;
  };
  struct Pending {
    uint32_t slot, parent, side;
  };
  const uint32_t parent = part.parent == kEmpty ? kEmpty : parts[part.parent].inner;
  std::vector<Leaf> leaves;
  std::vector<Pending> stack{{part.slot, parent, part.side}};
  uint32_t inner = part.inner, block = part.blocks;
  while (!stack.empty()) {
    const Pending p = stack.back();
    stack.pop_back();
    const BuildNode& from = tree.nodes[p.slot];
    uint32_t& ref = p.parent == kEmpty ? root_ : nodes_[p.parent].child[p.side];
    if (from.count > 0) {
      ref = LeafRef(from.count, block);
      leaves.push_back({p.slot, block});
      block += uint32_t(Blocks::BlocksOf(from.count));
      continue;
    }
    ref = inner++;
    Node& node = nodes_[ref];
    const BuildNode* children[2] = {&from + 1, &tree.nodes[from.right]};
    for (int c = 0; c < 2; ++c) {
      for (int a = 0; a < 3; ++a)
        node.bounds[a][c] = children[c]->lo[a], node.bounds[a][c + 2] = children[c]->hi[a];
      node.stand_in[c] = 0;
    }
    if (!part.is_whole) return;  // children write their references
    stack.push_back({from.right, ref, 1});
    stack.push_back({p.slot + 1, ref, 0});
  }
  leaves_.Fill(0, leaves.size(), [&](size_t i) {
    const BuildNode& leaf = tree.nodes[leaves[i].slot];
    return std::pair(leaves[i].block, std::span(&tree.order[leaf.first], leaf.count));
  });
}

}  // namespace raybench
