// A BVH whose nodes have 4, 8 or 16 children, each tested at once: one ray against many boxes (Wald, Benthin, Boulos
// 2008, "Getting rid of packets"; Ernst and Greiner 2008; Dammertz, Hanika, Keller 2008). Builders are those of binary
// trees; collapse.h makes wide nodes of what they hand over. Nodes are in nodes.h, the node test in ray.h, the loops in
// traversal.h, that for several rays at a time in interleaved.h, tests of leaves in leaf_test.h.
//
// Nodes and leaves stand in one array of lines, in depth-first order, the leaves of a node right behind it, or, where nodes
// are quantised, a node's children side by side, leaves first. A leaf is
// one block of triangles (ray/leaf_blocks.h), as many as the node has children, but no more than eight, or what such a
// block is made from (compact_leaves.h). A reference is a line's number; bit 31 tells leaves.
//
// Traversal is conservative when the test is: nothing that the primitive test accepts is culled, a box whose entry
// equals the best t is still visited, so that the lowest id wins ties, and the answer is that of `brute`.
#pragma once

#include <functional>
#include <memory>

#include "accel/bvh/wide/collapse.h"
#include "accel/bvh/wide/compact_leaves.h"
#include "accel/contract/structure.h"

namespace raybench {

enum class NodeFormat : uint32_t { kFull, kQuantized16, kQuantized8 };
inline constexpr const char* kNodeFormats[] = {"full", "quantized16", "quantized8", nullptr};

/// How many rays of a query a thread traces at a time: one, or several (interleaved.h, packet.h).
enum class Batch : uint32_t { kSingle, kInterleaved, kPacket };
inline constexpr const char* kBatches[] = {"single", "interleaved", "packet", nullptr};

struct WideOptions {
  uint32_t width;  ///< 4, 8 or 16
  NodeFormat format;
  Batch batch;  ///< other than single: with copied leaves
  bool needs_uv;
  Leaves leaves;
  GridSteps steps;  ///< of quantised leaves: what ChooseGrids said
};

class WideBvh {
 public:
  virtual ~WideBvh() = default;
  virtual void Query(uint32_t numerics, const rb_query& query, bool counted) const = 0;
  virtual MemoryUse Memory() const = 0;
  /// node(const rb_node&) in pre-order until it returns non-zero. Quantised boxes are shown as traversal sees them.
  virtual int Visit(const std::function<int(const rb_node&)>& node) const = 0;

  /// Primitives that a leaf tests at once.
  static constexpr uint32_t LeafLanes(uint32_t width) { return width < 8 ? width : 8; }
};

/// Lays out a tree. Runs inside the caller's task arena. Throws std::runtime_error if it is too large for references.
std::unique_ptr<WideBvh> MakeWideBvh(const rb_geometry& geometry, const BinaryTree& tree,
                                     const WideTopology& topology, const WideOptions& options);

// One file a width.
std::unique_ptr<WideBvh> MakeWideBvh4(const rb_geometry&, const BinaryTree&, const WideTopology&,
                                      const WideOptions&);
std::unique_ptr<WideBvh> MakeWideBvh8(const rb_geometry&, const BinaryTree&, const WideTopology&,
                                      const WideOptions&);
std::unique_ptr<WideBvh> MakeWideBvh16(const rb_geometry&, const BinaryTree&, const WideTopology&,
                                       const WideOptions&);

inline std::unique_ptr<WideBvh> MakeWideBvh(const rb_geometry& geometry, const BinaryTree& tree,
                                            const WideTopology& topology, const WideOptions& options) {
  if (options.width == 4) return MakeWideBvh4(geometry, tree, topology, options);
  if (options.width == 8) return MakeWideBvh8(geometry, tree, topology, options);
  return MakeWideBvh16(geometry, tree, topology, options);
}

}  // namespace raybench
