// Figures of a built tree, and what is wrong with it, read through the node visitor.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "accel/host/registry.h"

namespace raybench {

/// Static statistics in Havran's (2000) terms.
struct TreeStatistics {
  uint64_t inner_nodes = 0;       ///< N_G
  uint64_t leaf_nodes = 0;        ///< N_E, empty ones included
  uint64_t empty_leaf_nodes = 0;  ///< N_EE
  uint64_t references = 0;        ///< N_ER: primitives referenced by leaves, repeats included
  uint32_t depth = 0;             ///< of the deepest node; the root has 0
  /// Sum over nodes of area / root area x (1 for an inner node, primitives for a leaf) (MacDonald, Booth
  /// 1990). Absent when a node is not a box or the root has no area.
  std::optional<double> sah_cost;
  /// Depth of the leaves that a random line through the root meets, mean: weighted by their areas. Absent as
  /// sah_cost is.
  std::optional<double> leaf_depth;
  /// 16 hex digits over all nodes in the order of the visit, with their bounds to the bit.
  std::string digest;
  /// No boxes, and either of a shape that is not known (spheres and k-DOPs are) or perhaps around a
  /// procedural primitive, of which only the box is known: whether they enclose it is not checked.
  uint64_t unchecked_nodes = 0;
  /// The first thing found that makes the tree lose rays or is not as the contract says, in words; empty if
  /// there is none:
  /// - not pre-order: a root of another depth than 0, more than one root, a node that is deeper than a child
  ///   of the node before it, an inner node without children;
  /// - a box that is not inside the box of its parent;
  /// - a primitive that no leaf holds, or a reference to one that does not exist;
  /// - object partition: a primitive that is not inside the bounds of its leaf, or of a node above it that is
  ///   no box;
  /// - space partition: part of a triangle that lies in none of the leaves that refer to it (triangle minus
  ///   boxes, in double: a gap is seen when it is wider than 2^-44 of the coordinates, and floats that differ
  ///   do so by 2^-24); of a procedural primitive, part of its bounds outside the box around these leaves.
  std::string flaw;
};

/// Absent when the structure shows no nodes. Keeps the leaves of a space partition in memory while it runs.
std::optional<TreeStatistics> ReadTree(const Tree& tree, const rb_geometry& geometry);

/// The same digest alone, without any check; empty when the structure shows no nodes.
std::string TreeDigest(const Tree& tree);

}  // namespace raybench
