#include "harness/statistics.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "accel/structure.h"

namespace raybench {
namespace {

/// Collects the figures while the tree is visited.
struct Visitor {
  explicit Visitor(const rb_geometry& g) : geometry(g), referenced(PrimCount(g)) {}

  const rb_geometry& geometry;
  TreeStatistics statistics;
  double weighted_area = 0, root_area = 0;
  bool all_boxes = true, any_node = false;
  std::vector<bool> referenced;
  std::vector<Bounds3> covered;  // space partitions: the box around all leaves of a primitive

  void Flaw(std::string text) {
    if (statistics.enclosure_flaw.empty()) statistics.enclosure_flaw = std::move(text);
  }

  void Node(const rb_node& node) {
    TreeStatistics& s = statistics;
    Bounds3 box;
    const bool is_box = node.shape == RB_SHAPE_BOX && node.bounds_count == 6;
    if (is_box) {
      box = {LoadVec3(node.bounds), LoadVec3(node.bounds + 3)};
      if (!any_node) root_area = box.HalfArea();
      weighted_area += double(box.HalfArea()) * (node.is_leaf ? node.prim_count : 1);
    } else {
      all_boxes = false;
    }
    any_node = true;
    s.depth = std::max(s.depth, node.depth);
    if (!node.is_leaf) {
      ++s.inner_nodes;
      return;
    }
    ++s.leaf_nodes;
    s.empty_leaf_nodes += node.prim_count == 0;
    s.references += node.prim_count;
    for (uint32_t i = 0; i < node.prim_count; ++i) Reference(node, node.prims[i], is_box ? &box : nullptr);
  }

  void Reference(const rb_node& leaf, uint32_t prim, const Bounds3* box) {
    if (prim >= referenced.size()) {
      Flaw(fmt::format("a leaf refers to primitive {}, but there are {}", prim, referenced.size()));
      return;
    }
    referenced[prim] = true;
    if (box == nullptr) return;
    if (leaf.space_partition) {
      if (covered.empty()) covered.resize(referenced.size());
      covered[prim].Extend(*box);
    } else if (!box->Contains(PrimBounds(geometry, prim))) {
      Flaw(fmt::format("the bounds of a leaf leave out part of primitive {}", prim));
    }
  }

  void Finish() {
    for (size_t prim = 0; prim < referenced.size(); ++prim) {
      if (!referenced[prim]) {
        Flaw(fmt::format("no leaf holds primitive {}", prim));
      } else if (!covered.empty() && !covered[prim].Empty() &&
                 !covered[prim].Contains(PrimBounds(geometry, uint32_t(prim)))) {
        Flaw(fmt::format("the leaves of primitive {} leave out part of it", prim));
      }
    }
    if (all_boxes && root_area > 0) statistics.sah_cost = weighted_area / root_area;
  }
};

}  // namespace

std::optional<TreeStatistics> ReadTree(const Tree& tree, const rb_geometry& geometry) {
  if (tree.structure().visit == nullptr) return std::nullopt;
  Visitor visitor(geometry);
  tree.structure().visit(
      tree.get(),
      [](void* context, const rb_node* node) {
        static_cast<Visitor*>(context)->Node(*node);
        return 0;
      },
      &visitor);
  if (!visitor.any_node) return TreeStatistics{};
  visitor.Finish();
  return visitor.statistics;
}

MedianInterval MedianOf(std::span<const double> values) {
  std::vector<double> sorted(values.begin(), values.end());
  std::sort(sorted.begin(), sorted.end());
  const size_t n = sorted.size();
  MedianInterval result;
  result.median = n % 2 == 1 ? sorted[n / 2] : 0.5 * (sorted[n / 2 - 1] + sorted[n / 2]);
  // The median lies below the k-th smallest value with probability P(Bin(n, 1/2) <= k - 1).
  double probability = std::exp2(-double(n)), tail = 0;
  for (size_t k = 1; 2 * k <= n; ++k) {
    tail += probability;
    if (1 - 2 * tail < 0.95) break;
    result.lo = sorted[k - 1], result.hi = sorted[n - k], result.coverage = 1 - 2 * tail;
    probability *= double(n - k + 1) / double(k);
  }
  return result;
}

}  // namespace raybench
