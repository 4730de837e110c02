#include "harness/judge/tree_statistics.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <span>
#include <utility>
#include <vector>

#include "accel/base/hash.h"
#include "accel/base/parallel.h"
#include "accel/bvh/bounds/kdop.h"
#include "accel/contract/structure.h"
#include "harness/judge/cover.h"

namespace raybench {
namespace {

template <int K>
bool KdopHolds(const float* bounds, Vec3d p) {
  for (int i = 0; i < K / 2; ++i) {
    const double along = i < 3 ? p[i] : Dot(KdopBound<K>::Direction(i - 3), p);
    // Sums of three floats of very different sizes are rounded.
    const double slack = i < 3 ? 0 : 0x1p-50 * (std::fabs(p.x) + std::fabs(p.y) + std::fabs(p.z));
    if (!(along >= bounds[i] - slack && along <= bounds[i + K / 2] + slack)) return false;
  }
  return true;
}

/// Bounds of another shape than a box, as shown. Nothing is known of other numbers of floats than these.
struct OddBounds {
  uint32_t shape;
  std::vector<float> floats;

  bool Known() const {
    const size_t n = floats.size();
    return shape == RB_SHAPE_SPHERE ? n == 4 : shape == RB_SHAPE_KDOP && (n == 14 || n == 18 || n == 26);
  }
  bool Holds(Vec3f point) const {
    const Vec3d p = ToDouble(point);
    const float* b = floats.data();
    if (shape == RB_SHAPE_SPHERE) {
      const Vec3d d = p - ToDouble(LoadVec3(b));
      return Dot(d, d) <= double(b[3]) * b[3] * (1 + 0x1p-50);
    }
    return floats.size() == 14   ? KdopHolds<14>(b, p)
           : floats.size() == 18 ? KdopHolds<18>(b, p)
                                 : KdopHolds<26>(b, p);
  }
};

void AddTo(Hash64& digest, const rb_node& node) {
  const uint32_t whole[] = {node.depth, node.is_leaf,      node.space_partition,
                            node.shape, node.bounds_count, node.prim_count};
  digest.Add(whole, sizeof whole);
  digest.Add(node.bounds, node.bounds_count * sizeof(float));
  digest.Add(node.prims, node.prim_count * sizeof(uint32_t));
}

/// Collects the figures, and checks, while the tree is visited.
class Visitor {
 public:
  explicit Visitor(const rb_geometry& g) : geometry_(g), referenced_(PrimCount(g)) {}

  void Node(const rb_node& node) {
    TreeStatistics& s = statistics_;
    AddTo(digest_, node);
    CheckPlace(node);
    Bounds3 box;
    const bool is_box = node.shape == RB_SHAPE_BOX && node.bounds_count == 6;
    if (is_box) {
      box = {LoadVec3(node.bounds), LoadVec3(node.bounds + 3)};
      if (nodes_ == 0) root_area_ = box.HalfArea();
      weighted_area_ += double(box.HalfArea()) * (node.is_leaf ? node.prim_count : 1);
      if (node.is_leaf) {
        leaf_area_ += box.HalfArea();
        leaf_depths_ += double(box.HalfArea()) * node.depth;
      }
    } else {
      all_boxes_ = false;
    }
    CheckInsideParent(node, is_box ? std::optional(box) : std::nullopt);
    ++nodes_;
    last_depth_ = node.depth;
    last_is_leaf_ = node.is_leaf != 0;
    s.depth = std::max(s.depth, node.depth);
    if (!node.is_leaf) {
      ++s.inner_nodes;
      return;
    }
    ++s.leaf_nodes;
    s.empty_leaf_nodes += node.prim_count == 0;
    s.references += node.prim_count;
    if (node.space_partition && is_box && node.prim_count > 0) cells_.push_back(box);
    for (uint32_t i = 0; i < node.prim_count; ++i) Reference(node, node.prims[i], is_box ? &box : nullptr);
  }

  TreeStatistics Finish() {
    statistics_.digest = digest_.Hex();
    if (nodes_ == 0) {
      if (!referenced_.empty())
        Flaw(fmt::format("the visit shows no node, but there are {} primitives", referenced_.size()));
      return std::move(statistics_);
    }
    if (!last_is_leaf_)
      Flaw(fmt::format("node {} of the visit is an inner node without children", nodes_ - 1));
    for (size_t prim = 0; prim < referenced_.size(); ++prim)
      if (!referenced_[prim]) Flaw(fmt::format("no leaf holds primitive {}", prim));
    if (const auto prim = FirstUncovered())
      Flaw(fmt::format("the leaves of primitive {} leave out part of it", *prim));
    if (all_boxes_ && root_area_ > 0) statistics_.sah_cost = weighted_area_ / root_area_;
    if (all_boxes_ && leaf_area_ > 0) statistics_.leaf_depth = leaf_depths_ / leaf_area_;
    return std::move(statistics_);
  }

 private:
  void Flaw(std::string text) {
    if (statistics_.flaw.empty()) statistics_.flaw = std::move(text);
  }

  void CheckPlace(const rb_node& node) {
    const auto flaw = [&](const char* what) { Flaw(fmt::format("node {} of the visit {}", nodes_, what)); };
    if (nodes_ == 0) {
      if (node.depth != 0) flaw("is the first, but its depth is not 0");
    } else if (node.depth == 0) {
      flaw("is a second root");
    } else if (last_is_leaf_ ? node.depth > last_depth_ : node.depth > last_depth_ + 1) {
      flaw("is deeper than a child of the one before it");
    } else if (!last_is_leaf_ && node.depth <= last_depth_) {
      Flaw(fmt::format("node {} of the visit is an inner node without children", nodes_ - 1));
    }
  }

  /// Boxes nest. Other shapes need not, since a sphere around spheres reaches farther than what they hold;
  /// there each primitive is looked for in all of them.
  void CheckInsideParent(const rb_node& node, std::optional<Bounds3> box) {
    if (node.depth > path_.size()) return;  // not pre-order: told already
    if (node.depth > 0 && box && path_[node.depth - 1] && !box->Empty() &&
        !path_[node.depth - 1]->Contains(*box))
      Flaw(fmt::format("the box of node {} of the visit is not inside its parent's", nodes_));
    path_.resize(node.depth);
    path_.push_back(box);
    odd_.resize(std::min<size_t>(odd_.size(), node.depth));
    if (box) return;
    odd_.resize(node.depth + 1);
    OddBounds& odd = odd_.back().emplace();
    odd.shape = node.shape;
    odd.floats.assign(node.bounds, node.bounds + node.bounds_count);
    if (!odd.Known() || geometry_.procedural_count > 0) ++statistics_.unchecked_nodes;
    if (!odd.Known()) odd_.back().reset();
  }

  bool HeldByOddBounds(uint32_t prim) const {
    if (prim >= geometry_.triangle_count) return true;  // only its box is known
    for (const std::optional<OddBounds>& odd : odd_)
      for (int corner = 0; odd && corner < 3; ++corner)
        if (!odd->Holds(Vertex(geometry_, prim, corner))) return false;
    return true;
  }

  void Reference(const rb_node& leaf, uint32_t prim, const Bounds3* box) {
    if (prim >= referenced_.size())
      return Flaw(fmt::format("a leaf refers to primitive {}, but there are {}", prim, referenced_.size()));
    referenced_[prim] = true;
    if (leaf.space_partition) {
      // A cell of another shape than a box may hold any part.
      parts_.push_back({prim, box != nullptr ? uint32_t(cells_.size() - 1) : RAYBENCH_NONE});
    } else if ((box != nullptr && !box->Contains(PrimBounds(geometry_, prim))) || !HeldByOddBounds(prim)) {
      Flaw(fmt::format("the bounds of a leaf{} leave out part of primitive {}",
                       odd_.empty() ? "" : " or of a node above it", prim));
    }
  }

  std::optional<uint32_t> FirstUncovered() {
    ParallelSort(parts_.begin(), parts_.end());
    std::vector<size_t> starts;
    for (size_t i = 0; i < parts_.size(); ++i)
      if (i == 0 || parts_[i].first != parts_[i - 1].first) starts.push_back(i);
    std::atomic<uint32_t> first = RAYBENCH_NONE;
    ParallelFor(size_t{0}, starts.size(), [&](size_t s) {
      const size_t end = s + 1 < starts.size() ? starts[s + 1] : parts_.size();
      const uint32_t prim = parts_[starts[s]].first;
      if (prim >= first || Covered(prim, std::span(parts_).subspan(starts[s], end - starts[s]))) return;
      for (uint32_t seen = first; prim < seen && !first.compare_exchange_weak(seen, prim);) {
      }
    });
    return first == RAYBENCH_NONE ? std::nullopt : std::optional(first.load());
  }

  using Part = std::pair<uint32_t, uint32_t>;  // primitive, cell

  bool Covered(uint32_t prim, std::span<const Part> parts) const {
    const Bounds3 whole = PrimBounds(geometry_, prim);
    std::vector<Bounds3> boxes;
    Bounds3 all;
    for (const auto& [same_prim, cell] : parts) {
      if (cell == RAYBENCH_NONE || cells_[cell].Contains(whole)) return true;
      boxes.push_back(cells_[cell]);
      all.Extend(cells_[cell]);
    }
    if (!all.Contains(whole)) return false;
    if (prim >= geometry_.triangle_count) return true;
    return BoxesCover(boxes, Vertex(geometry_, prim, 0), Vertex(geometry_, prim, 1),
                      Vertex(geometry_, prim, 2));
  }

  const rb_geometry& geometry_;
  TreeStatistics statistics_;
  Hash64 digest_;
  double weighted_area_ = 0, root_area_ = 0, leaf_area_ = 0, leaf_depths_ = 0;
  uint64_t nodes_ = 0;
  uint32_t last_depth_ = 0;
  bool last_is_leaf_ = false, all_boxes_ = true;
  std::vector<std::optional<Bounds3>> path_;   // from the root to the last node
  std::vector<std::optional<OddBounds>> odd_;  // the same, for what is no box
  std::vector<bool> referenced_;
  std::vector<Bounds3> cells_;  // leaves of a space partition, and what they refer to
  std::vector<Part> parts_;
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
  return visitor.Finish();
}

std::string TreeDigest(const Tree& tree) {
  if (tree.structure().visit == nullptr) return {};
  Hash64 digest;
  tree.structure().visit(
      tree.get(),
      [](void* context, const rb_node* node) {
        AddTo(*static_cast<Hash64*>(context), *node);
        return 0;
      },
      &digest);
  return digest.Hex();
}

}  // namespace raybench
