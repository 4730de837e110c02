#include "accel/kd_tree.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <stdexcept>

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
    blocks += (nodes_[i].count() + kLanes - 1) / kLanes;
    if (nodes_[i].count() > 0) leaves.push_back(uint32_t(i));
  }
  if (blocks > UINT32_MAX) throw std::runtime_error("the kd-tree has too many leaves");
  const uint64_t bytes = nodes_.bytes() + leaves.size() * sizeof(uint32_t) + blocks * sizeof(Block);
  if (memory_limit > 0 && built.bytes() + bytes > memory_limit)
    throw std::runtime_error("the kd-tree exceeds the memory limit");

  blocks_ = HugeArray<Block>(blocks);
  tbb::parallel_for(tbb::blocked_range<size_t>(0, leaves.size(), 1024), [&](const auto& range) {
    for (size_t leaf = range.begin(); leaf < range.end(); ++leaf) {
      const KdNode& node = nodes_[leaves[leaf]];
      const uint32_t* prims = &built.prims[built.nodes[leaves[leaf]].first];
      const uint32_t padded = (node.count() + kLanes - 1) / kLanes * kLanes;
      for (uint32_t k = 0; k < padded; ++k) {
        const uint32_t prim = prims[std::min(k, node.count() - 1)];
        Block& block = blocks_[node.first + k / kLanes];
        block.prim[k % kLanes] = prim;
        for (int c = 0; c < 3; ++c) {
          const Vec3f v = prim < geometry.triangle_count ? Vertex(geometry, prim, c) : Vec3f{0, 0, 0};
          for (int a = 0; a < 3; ++a) block.v[c][a][k % kLanes] = v[a];
        }
      }
    }
  });
}

}  // namespace raybench
