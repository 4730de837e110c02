#include "harness/judge/end_point_overlap.h"

#include <algorithm>
#include <numeric>
#include <span>
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
    uint32_t run;                          // index of the longest run that begins here
  };
  /// Consecutive children of one node, and all that is below them.
  struct Run {
    Bounds3 box;
    uint32_t first, end;
  };
  std::vector<Node> nodes;
  std::vector<std::pair<uint32_t, uint64_t>> references;  // primitive, place in pre-order; sorted
  /// A grid is a node with millions of children: of these, kRun at a time, kRun of such runs at a time, and so on, can
  /// be passed over together. In pre-order, longer ones first.
  std::vector<Run> runs;
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
    if (all_boxes) FindRuns();
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
                     0,
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

  void FindRuns() {
    constexpr size_t kRun = 32;
    std::vector<uint32_t> children;
    for (uint32_t i = 0; i < nodes.size(); ++i) {
      children.clear();
      for (uint32_t c = i + 1; c < nodes[i].end; c = nodes[c].end) children.push_back(c);
      size_t longest = kRun;
      while (longest * kRun < children.size()) longest *= kRun;
      if (children.size() <= kRun) continue;
      for (size_t c = 0; c < children.size(); c += kRun)
        for (size_t length = longest; length >= kRun; length /= kRun)
          if (c % length == 0)
            runs.push_back(
                RunOf(std::span(children).subspan(c).first(std::min(length, children.size() - c))));
    }
    // Those of a node further down were found after those of its ancestors' later children.
    std::stable_sort(runs.begin(), runs.end(), [](const Run& a, const Run& b) { return a.first < b.first; });
    for (uint32_t i = 0, run = 0; i < nodes.size(); ++i) {
      while (run < runs.size() && runs[run].first < i) ++run;
      nodes[i].run = run;
    }
  }
  Run RunOf(std::span<const uint32_t> children) const {
    Run run{{}, children.front(), nodes[children.back()].end};
    for (uint32_t c : children) run.box.Extend(nodes[c].box);
    return run;
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

bool Apart(const Bounds3& a, const Bounds3& b) {
  return a.lo.x > b.hi.x || a.hi.x < b.lo.x || a.lo.y > b.hi.y || a.hi.y < b.lo.y || a.lo.z > b.hi.z ||
         a.hi.z < b.lo.z;
}

double CostOfStrangers(const FlatTree& tree, uint32_t prim, const Piece& triangle, const Bounds3& bounds) {
  double cost = 0;
  for (uint32_t i = 0; i < tree.nodes.size();) {
    const FlatTree::Node& node = tree.nodes[i];
    uint32_t run = node.run;
    while (run < tree.runs.size() && tree.runs[run].first == i && !Apart(bounds, tree.runs[run].box)) ++run;
    if (run < tree.runs.size() && tree.runs[run].first == i) {
      i = tree.runs[run].end;
      continue;
    }
    if (Apart(bounds, node.box)) {
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
