// Figures of a built tree, read through the node visitor, and of samples of time.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "accel/registry.h"

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
  /// The first primitive found that no leaf holds or that leaf bounds leave out, in words; empty if there is
  /// none. In an object partition every leaf must enclose its primitives; in a space partition the box around
  /// all leaves that reference a primitive must.
  std::string enclosure_flaw;
};

/// Absent when the structure shows no nodes.
std::optional<TreeStatistics> ReadTree(const Tree& tree, const rb_geometry& geometry);

/// Median and its distribution-free confidence interval between two order statistics (David, Nagaraja
/// 2003, 7.1).
struct MedianInterval {
  double median = 0;
  std::optional<double> lo, hi;  ///< absent below 6 samples: no interval of 95 % exists then
  double coverage = 0;           ///< confidence of the interval, at least 0.95; 0 without one
};

/// `values` in any order, at least one. The interval is the narrowest symmetric one with a confidence of at
/// least 95 %.
MedianInterval MedianOf(std::span<const double> values);

}  // namespace raybench
