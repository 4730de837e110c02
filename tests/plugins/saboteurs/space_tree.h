// A kd-tree, split at the median of the primitives' ends, and an octree, whose cells are halved along x, y and
// z in turn. Insertion by padded bounds and traversal with overlapping intervals, as accel/kd/tree.h has
// them and says why.
#pragma once

#include <bit>

#include "tests/plugins/saboteurs/structure.h"

namespace raybench::saboteurs {

/// What a plane makes of a ray's interval in a cell.
struct Crossing {
  bool right_is_near, near, far;  ///< which children are entered
  float leaves, enters;           ///< the near one, the far one
};

struct Plane {
  int axis;
  float split, lo, hi;  ///< of the cell, along the axis
};

struct HonestSpaceTree : Honest {
  static constexpr bool kOctree = false;

  static Crossing Cross(const SlabRay& ray, const Plane& plane, float tnear, float tfar) {
    const int a = plane.axis;
    const float distance = plane.split - ray.org[a];
    const float t0 = distance * ray.inv_near[a], t1 = distance * ray.inv_far[a];
    return {ray.negative(a), !(tnear > t1), !(tfar < t0), t1 < tfar ? t1 : tfar, t0 > tnear ? t0 : tnear};
  }
  /// Whether nothing in cells that begin at `entry` can come before `best`.
  static bool IsBehind(float entry, const rb_hit& best) { return entry > best.t; }
};
struct HonestKd : HonestSpaceTree {};
struct HonestOctree : HonestSpaceTree {
  static constexpr bool kOctree = true;
};

template <class Fault>
class SpaceTree : public Structure<Fault, SpaceTree<Fault>> {
  using Base = Structure<Fault, SpaceTree<Fault>>;

 public:
  SpaceTree(const rb_geometry& geometry, const rb_build_options& options, const typename Base::Config& config)
      : Base(geometry), options_(options), leaf_size_(size_t(config.leaf_size)) {
    const uint32_t n = uint32_t(PrimCount(geometry));
    if (n == 0) return;
    const int levels = std::bit_width(n);
    most_depth_ = Fault::kOctree ? 3 * (levels / 3 + 3) : 8 + levels + levels / 3;
    std::vector<uint32_t> all(n);
    boxes_.reserve(n);
    for (uint32_t i = 0; i < n; ++i) {
      all[i] = i, boxes_.push_back(PaddedPrimBounds(geometry, i));
      cell_.Extend(boxes_[i]);
    }
    Build(all, cell_, 0, n * sizeof(Bounds3));
    boxes_ = {};
  }

  template <bool kAny, class Ray, class Counter>
  void Trace(const Ray& ray, rb_hit& best, Counter& counter) const {
    if (nodes_.empty()) return;
    struct Entry {
      uint32_t node;
      float tnear, tfar;
    } stack[kMostDepth], at{0, 0, 0};
    uint32_t top = 0;
    ray.slab.Interval(cell_, at.tnear, at.tfar);
    counter.Bounds(1);
    at.tnear = std::max(at.tnear, ray.query.ray.tnear), at.tfar = std::min(at.tfar, best.t);
    if (!(at.tnear <= at.tfar)) return;
    for (;;) {
      while (!nodes_[at.node].IsLeaf()) {
        const Node& node = nodes_[at.node];
        counter.Step(sizeof(Node));
        counter.Bounds(1);
        const Crossing c = Fault::Cross(ray.slab, node.plane, at.tnear, at.tfar);
        const Entry near{c.right_is_near ? node.index : at.node + 1, at.tnear, c.far ? c.leaves : at.tfar},
            far{c.right_is_near ? at.node + 1 : node.index, c.near ? c.enters : at.tnear, at.tfar};
        if (c.near && c.far) stack[top++] = far;
        at = c.near ? near : far;
      }
      const Node& leaf = nodes_[at.node];
      counter.Step(sizeof(Node));
      counter.Leaf(leaf.count == 0);
      if (this->template TestPrims<kAny>(ray, prims_.data() + leaf.index, leaf.count, best, counter) && kAny)
        return;
      do {
        if (top == 0) return;
        at = stack[--top];
      } while (Fault::IsBehind(at.tnear, best));
      at.tfar = std::min(at.tfar, best.t);
    }
  }

  MemoryUse Memory() const {
    return {nodes_.size() * sizeof(Node) + prims_.size() * sizeof(uint32_t), 0, true};
  }

  template <class Fn>
  int VisitNodes(Fn& node) const {
    return nodes_.empty() ? 0 : VisitBelow(0, 0, cell_, node);
  }

 private:
  static constexpr int kMostDepth = 64;
  struct Node {
    Plane plane;     // axis 3: a leaf
    uint32_t index;  // leaf: the first of `prims_`; else the right child. The left one follows its parent.
    uint32_t count;  // leaf: primitives
    bool IsLeaf() const { return plane.axis == 3; }
  };

  /// `held`: bytes that the build holds beside the tree. A vector that grows takes up to three times its size.
  void Build(const std::vector<uint32_t>& refs, const Bounds3& cell, int depth, uint64_t held) {
    held += refs.capacity() * sizeof(uint32_t);
    CheckBuild<Fault>(options_, held + 6 * refs.size() * sizeof(float) +
                                    3 * (nodes_.size() * sizeof(Node) + prims_.size() * sizeof(uint32_t)));
    const Plane plane = Fault::kOctree ? Halved(refs, cell, depth) : Median(refs, cell, depth);
    const size_t at = nodes_.size();
    nodes_.push_back({plane, uint32_t(prims_.size()), 0});
    if (nodes_[at].IsLeaf()) {
      nodes_[at].count = uint32_t(refs.size());
      prims_.insert(prims_.end(), refs.begin(), refs.end());
      return;
    }
    for (bool right : {false, true}) {
      Bounds3 child = cell;
      (right ? child.lo : child.hi)[plane.axis] = plane.split;
      if (right) nodes_[at].index = uint32_t(nodes_.size());
      Build(On(right, refs, plane.axis, plane.split), child, depth + 1, held);
    }
  }

  /// Those of the primitives that reach to one side of the plane, or into it.
  std::vector<uint32_t> On(bool right, const std::vector<uint32_t>& refs, int axis, float split) const {
    std::vector<uint32_t> on;
    for (uint32_t prim : refs) {
      const Bounds3& b = boxes_[prim];
      if (right ? b.hi[axis] >= split : b.lo[axis] <= split) on.push_back(prim);
    }
    return on;
  }

  /// The plane through the median of the primitives' ends, along the longest axis where it separates some.
  Plane Median(const std::vector<uint32_t>& refs, const Bounds3& cell, int depth) const {
    if (refs.size() <= leaf_size_ || depth >= most_depth_) return {3, 0, 0, 0};
    int axes[3] = {0, 1, 2};
    const Vec3f extent = cell.Extent();
    std::stable_sort(axes, axes + 3, [&](int a, int b) { return extent[a] > extent[b]; });
    for (int axis : axes) {
      std::vector<float> ends;
      for (uint32_t prim : refs) {
        const Bounds3 b = PrimBounds(this->geometry_, prim);
        for (float x : {b.lo[axis], b.hi[axis]}) {
          if (cell.lo[axis] < x && x < cell.hi[axis]) ends.push_back(x);
        }
      }
      if (ends.empty()) continue;
      std::sort(ends.begin(), ends.end());
      const float split = ends[ends.size() / 2];
      const size_t left = On(false, refs, axis, split).size(), right = On(true, refs, axis, split).size();
      if (5 * (left + right) <= 8 * refs.size()) return {axis, split, cell.lo[axis], cell.hi[axis]};
    }
    return {3, 0, 0, 0};
  }

  /// The middle of the cell. Whether it pays to make eight of it is asked before the first of three halvings.
  Plane Halved(const std::vector<uint32_t>& refs, const Bounds3& cell, int depth) const {
    const int axis = depth % 3;
    const float split = 0.5f * (cell.lo[axis] + cell.hi[axis]);
    if (!(cell.lo[axis] < split && split < cell.hi[axis])) return {3, 0, 0, 0};
    if (axis == 0) {
      if (refs.size() <= leaf_size_ || depth >= most_depth_) return {3, 0, 0, 0};
      size_t references = 0;
      for (uint32_t prim : refs) {
        size_t children = 1;
        for (int a = 0; a < 3; ++a) {
          const float middle = 0.5f * (cell.lo[a] + cell.hi[a]);
          children *= size_t(boxes_[prim].lo[a] <= middle) + size_t(boxes_[prim].hi[a] >= middle);
        }
        references += children;
      }
      if (depth > 0 && references >= 4 * refs.size()) return {3, 0, 0, 0};
    }
    return {axis, split, cell.lo[axis], cell.hi[axis]};
  }

  template <class Fn>
  int VisitBelow(uint32_t at, uint32_t depth, const Bounds3& cell, Fn& node) const {
    const Node& n = nodes_[at];
    const float bounds[6] = {cell.lo.x, cell.lo.y, cell.lo.z, cell.hi.x, cell.hi.y, cell.hi.z};
    if (int stop = node(rb_node{depth, n.IsLeaf(), 1, RB_SHAPE_BOX, bounds, 6, n.count,
                                n.count > 0 ? prims_.data() + n.index : nullptr}))
      return stop;
    if (n.IsLeaf()) return 0;
    Bounds3 left = cell, right = cell;
    left.hi[n.plane.axis] = right.lo[n.plane.axis] = n.plane.split;
    if (int stop = VisitBelow(at + 1, depth + 1, left, node)) return stop;
    return VisitBelow(n.index, depth + 1, right, node);
  }

  rb_build_options options_;
  size_t leaf_size_;
  int most_depth_ = 0;
  Bounds3 cell_;
  std::vector<Bounds3> boxes_;
  std::vector<Node> nodes_;
  std::vector<uint32_t> prims_;
};

}  // namespace raybench::saboteurs
