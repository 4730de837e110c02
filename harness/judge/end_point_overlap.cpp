#include "harness/judge/end_point_overlap.h"

#include <numeric>
#include <vector>

#include "accel/base/parallel.h"
#include "accel/contract/structure.h"
#include "harness/plan/plan.h"

namespace raybench {
namespace {

/// A tree as an array in pre-order: a subtree is a run of nodes, its references a run of references.
struct FlatTree {
  struct Node {
    Bounds3 box;
    float cost;
    uint32_t end;                          // the node after the subtree
    uint64_t first_reference, references;  // of the whole subtree
  };
  std::vector<Node> nodes;
  std::vector<std::pair<uint32_t, uint64_t>> references;  // primitive, place in pre-order; sorted
  bool all_boxes = true;

  explicit FlatTree(const Tree& tree) {
    tree.structure().visit(
        tree.get(),
        [](void* self, const rb_node* node) {
          static_cast<FlatTree*>(self)->Add(*node);
          return 0;
        },
        this);
    Close(0);
    std::sort(references.begin(), references.end());
  }

  /// Whether some leaf of the subtree holds the primitive.
  bool Holds(const Node& node, uint32_t prim) const {
    const auto it =
        std::lower_bound(references.begin(), references.end(), std::pair(prim, node.first_reference));
    return it != references.end() && it->first == prim && it->second < node.first_reference + node.references;
  }

 private:
  void Add(const rb_node& n) {
    Close(n.depth);
    all_boxes = all_boxes && n.shape == RB_SHAPE_BOX && n.bounds_count == 6;
    if (!all_boxes) return;
    open_.push_back(uint32_t(nodes.size()));
    nodes.push_back({{LoadVec3(n.bounds), LoadVec3(n.bounds + 3)},
                     n.is_leaf ? float(n.prim_count) : 1.0f,
                     0,
                     references.size(),
                     0});
    for (uint32_t i = 0; i < n.prim_count; ++i) references.emplace_back(n.prims[i], references.size());
  }
  /// Ends the subtrees at this depth and below.
  void Close(uint32_t depth) {
    for (; open_.size() > depth; open_.pop_back()) {
      Node& node = nodes[open_.back()];
      node.end = uint32_t(nodes.size());
      node.references = references.size() - node.first_reference;
    }
  }

  std::vector<uint32_t> open_;
};

/// A triangle cut by boxes: nine corners at most.
struct Piece {
  int size = 0;
  Vec3d corner[9];

  double Area() const {
    Vec3d sum{0, 0, 0};
    for (int i = 2; i < size; ++i) sum = sum + Cross(corner[i - 1] - corner[0], corner[i] - corner[0]);
    return 0.5 * Length(sum);
  }

  /// What lies on the inner side of one plane of a box (Sutherland, Hodgman 1974).
  Piece Cut(int axis, double plane, double side) const {
    Piece result;
    for (int i = 0; i < size; ++i) {
      const Vec3d a = corner[i], b = corner[(i + 1) % size];
      const double da = side * (a[axis] - plane), db = side * (b[axis] - plane);
      if (da >= 0) result.corner[result.size++] = a;
      if ((da < 0) != (db < 0)) result.corner[result.size++] = a + (b - a) * (da / (da - db));
    }
    return result;
  }
  Piece Within(const Bounds3& box) const {
    Piece piece = *this;
    for (int axis = 0; axis < 3 && piece.size > 0; ++axis)
      piece = piece.Cut(axis, box.lo[axis], 1).Cut(axis, box.hi[axis], -1);
    return piece;
  }
};

double CostOfStrangers(const FlatTree& tree, uint32_t prim, const Piece& triangle, const Bounds3& bounds) {
  double cost = 0;
  for (uint32_t i = 0; i < tree.nodes.size();) {
    const FlatTree::Node& node = tree.nodes[i];
    const bool apart = bounds.lo.x > node.box.hi.x || bounds.hi.x < node.box.lo.x ||
                       bounds.lo.y > node.box.hi.y || bounds.hi.y < node.box.lo.y ||
                       bounds.lo.z > node.box.hi.z || bounds.hi.z < node.box.lo.z;
    if (apart) {
      i = node.end;
      continue;
    }
    if (!tree.Holds(node, prim)) {
      const double area = triangle.Within(node.box).Area();
      if (area == 0) {
        i = node.end;
        continue;
      }
      cost += double(node.cost) * area;
    }
    ++i;
  }
  return cost;
}

}  // namespace

std::optional<double> EndPointOverlap(const Tree& tree, const rb_geometry& geometry, uint64_t samples,
                                      uint64_t seed) {
  if (tree.structure().visit == nullptr || geometry.procedural_count > 0 || geometry.triangle_count == 0)
    return std::nullopt;
  const FlatTree flat(tree);
  if (!flat.all_boxes || flat.nodes.empty()) return std::nullopt;
  const std::vector<uint32_t> picks = PickSample(geometry.triangle_count, samples, seed, "epo");
  std::vector<double> areas(picks.size()), costs(picks.size());
  ParallelFor(Range<size_t>(0, picks.size(), 64), [&](const auto& range) {
    for (size_t i = range.begin(); i < range.end(); ++i) {
      Piece triangle;
      triangle.size = 3;
      for (int c = 0; c < 3; ++c) triangle.corner[c] = ToDouble(Vertex(geometry, picks[i], c));
      areas[i] = triangle.Area();
      costs[i] = CostOfStrangers(flat, picks[i], triangle, PrimBounds(geometry, picks[i]));
    }
  });
  const double area = std::accumulate(areas.begin(), areas.end(), 0.0);
  if (!(area > 0)) return std::nullopt;
  return std::accumulate(costs.begin(), costs.end(), 0.0) / area;
}

}  // namespace raybench
