#include "accel/kd/tree.h"

#include <stdexcept>

#include "accel/base/parallel.h"

namespace raybench {

KdTree::KdTree(const rb_geometry& geometry, const Bounds3& cell, const KdSubtree& built,
               uint64_t memory_limit)
    : geometry_(geometry), cell_(cell) {
  if (built.nodes.size() >= kMaxNodes) throw std::runtime_error("the kd-tree has too many nodes");
  std::vector<uint32_t> leaves;
  size_t blocks = 0;
  nodes_ = HugeArray<KdNode>(built.nodes.size());
  for (size_t i = 0; i < built.nodes.size(); ++i) {
    nodes_[i] = built.nodes[i];
    if (!nodes_[i].IsLeaf()) continue;
    nodes_[i].first = uint32_t(blocks);
    blocks += LeafBlocks<>::BlocksOf(nodes_[i].count());
    if (nodes_[i].count() > 0) leaves.push_back(uint32_t(i));
  }
  if (blocks > UINT32_MAX) throw std::runtime_error("the kd-tree has too many leaves");
  const uint64_t bytes =
      nodes_.bytes() + leaves.size() * sizeof(uint32_t) + blocks * sizeof(LeafBlocks<>::Block);
  if (memory_limit > 0 && built.bytes() + bytes > memory_limit)
    throw std::runtime_error("the kd-tree exceeds the memory limit");

  blocks_ = LeafBlocks<>(geometry, blocks);
  ParallelFor(Range<size_t>(0, leaves.size(), 1024), [&](const auto& range) {
    blocks_.Fill(range.begin(), range.end(), [&](size_t i) {
      const KdNode& leaf = nodes_[leaves[i]];
      return std::pair(leaf.first, std::span(&built.prims[built.nodes[leaves[i]].first], leaf.count()));
    });
  });
}

}  // namespace raybench
