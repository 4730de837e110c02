// Leaves of wide trees that take less memory than a LeafBlocks block of copied vertices. A ray that comes to one makes
// the block from it, on its stack, and tests that: the same tests, and no traversal of its own.
//
//   indexed                  primitive ids; vertices come from the caller's arrays: the same answers to the bit
//   quantized16, quantized8  ids, and vertices as offsets of so many bits on a grid whose step is the leaf's
//   snapped16, snapped8      the same, but the step is that of the leaf that needs the largest
//
// A grid has as its points the multiples of its step, a power of two an axis, wherever the leaf is; a vertex moves to
// the nearest one. So a vertex is the same in all leaves of equal steps. Snapped surfaces therefore move but stay closed;
// quantised ones follow small triangles better, and open cracks where steps change. (One step, and offsets from an anchor
// a block: Barczak, Benthin, McAllister 2024, "DGF: a dense, hardware-friendly geometry format". Vertices as integers on
// the grid of a tree's leaf: Segovia and Ernst 2010, "Memory efficient ray tracing with hierarchical mesh
// quantization".)
//
// Points have at most 24 bits, so that they are floats: where a step would be finer, it is the float's own, and nothing
// moves. Making a float of an offset is exact, fused or not.
#pragma once

#include <cstdint>
#include <span>

#include "accel/bvh/wide/collapse.h"
#include "accel/ray/leaf_blocks.h"

namespace raybench {

/// How leaves hold their triangles.
enum class Leaves : uint32_t { kCopied, kIndexed, kQuantized16, kQuantized8, kSnapped16, kSnapped8 };
inline constexpr const char* kLeafForms[] = {"copied",    "indexed",  "quantized16", "quantized8",
                                             "snapped16", "snapped8", nullptr};
constexpr bool IsQuantized(Leaves leaves) { return leaves >= Leaves::kQuantized16; }

/// The finest steps that grids may have, as the exponent of a float a axis.
struct GridSteps {
  uint8_t exponent[3] = {1, 1, 1};
};

/// The steps for quantised leaves. Extends the boxes of `tree` so that they also enclose the triangles as these leaves
/// will hold them. Triangles alone, not clipped. Runs inside the caller's task arena.
GridSteps ChooseGrids(const rb_geometry& geometry, const WideTopology& topology, Leaves leaves,
                      BinaryTree& tree);

/// A form of leaves that is not copied. Leaves begin with kLanes ids, as those of a block.
template <int kLanes>
struct LeafCodec {
  using Block = typename LeafBlocks<kLanes>::Block;

  uint32_t bytes;          ///< of a leaf
  uint32_t bytes_outside;  ///< read in the caller's arrays for each triangle
  void (*encode)(const rb_geometry& geometry, const GridSteps& steps, std::span<const uint32_t> prims,
                 void* leaf);
  void (*decode)(const rb_geometry& geometry, const void* leaf, Block& out);

  /// nullptr for copied ones.
  static const LeafCodec* Of(Leaves leaves);
};

extern template struct LeafCodec<4>;
extern template struct LeafCodec<8>;

}  // namespace raybench
