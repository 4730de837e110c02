// A BVH that is halved at the median of centroids, with boxes or other bounds.
#pragma once

#include "tests/plugins/saboteurs/structure.h"

namespace raybench::saboteurs {

/// Boxes are stored as they are, and widened for each ray by what PaddedBounds() adds at build elsewhere: it
/// grows with the box, so that boxes stay inside each other. Along an axis to which the ray is perpendicular
/// they are not: its test subtracts the origin and nothing else, and the signs of that are exact.
struct WideningSlab : SlabRay {
  bool across[3];

  WideningSlab(const rb_ray& ray, Slack slack) : SlabRay(ray, slack) {
    for (int a = 0; a < 3; ++a) across[a] = ray.dir[a] == 0;
  }
  Bounds3 Widened(const Bounds3& box) const {
    Bounds3 wide = PaddedBounds(box);
    for (int a = 0; a < 3; ++a) {
      if (across[a]) wide.lo[a] = box.lo[a], wide.hi[a] = box.hi[a];
    }
    return wide;
  }
  void Interval(const Bounds3& box, float& tnear, float& tfar) const {
    SlabRay::Interval(Widened(box), tnear, tfar);
  }
};

/// Bounds as accel/bvh/bound_tree.h wants them, with a slab test of one's own.
template <class Slab>
struct BoxOf {
  static constexpr uint32_t kShape = RB_SHAPE_BOX, kFloats = 6;
  Bounds3 box;

  static BoxOf Around(const rb_geometry& g, const uint32_t* prims, size_t count) {
    BoxOf b;
    for (size_t i = 0; i < count; ++i) b.box.Extend(PrimBounds(g, prims[i]));
    return b;
  }
  void CopyTo(float (&floats)[kFloats]) const {
    for (int a = 0; a < 3; ++a) floats[a] = box.lo[a], floats[a + 3] = box.hi[a];
  }

  class Ray {
   public:
    Ray(const SlabRay&, const rb_ray& ray, Slack slack) : slab_(ray, slack), tnear_(ray.tnear) {}
    bool Meets(const BoxOf& b, float tfar, float& entry) const {
      float exit;
      slab_.Interval(b.box, entry, exit);
      entry = std::max(entry, tnear_);
      return entry <= std::min(exit, tfar);
    }

   private:
    Slab slab_;
    float tnear_;
  };
};
using Box = BoxOf<WideningSlab>;

struct HonestBvh : Honest {
  using Bound = Box;
  static constexpr uint32_t kStack = 64;  ///< halving 2^32 primitives takes 32

  /// What is stored for a bound below that of its parent.
  template <class B>
  static B Stored(const B& bound, const B& /*parent*/) {
    return bound;
  }
  /// How many of `count` primitives, at least two, go to the left.
  static size_t LeftOf(size_t count, const rb_build_options&) { return count / 2; }
};

template <class Fault>
class Bvh : public Structure<Fault, Bvh<Fault>> {
  using Base = Structure<Fault, Bvh<Fault>>;
  using Bound = typename Fault::Bound;

 public:
  Bvh(const rb_geometry& geometry, const rb_build_options& options, const typename Base::Config& config)
      : Base(geometry), prims_(PrimCount(geometry)) {
    const size_t n = prims_.size();
    CheckBuild<Fault>(options, n * (2 * sizeof(Node) + sizeof(uint32_t) + sizeof(Vec3f)));
    if (n == 0) return;
    waste_.assign(n * Fault::kWastePerPrim, 1);
    std::vector<Vec3f> centers(n);
    for (uint32_t i = 0; i < n; ++i) {
      const Bounds3 b = PrimBounds(geometry, i);
      prims_[i] = i, centers[i] = b.lo + b.hi;
    }
    nodes_.reserve(2 * n);
    Build(centers, options, size_t(config.leaf_size), 0, n, nullptr);
  }

  template <bool kAny, class Ray, class Counter>
  void Trace(const Ray& ray, rb_hit& best, Counter& counter) const {
    if (nodes_.empty()) return;
    const typename Bound::Ray bounds(ray.slab, ray.query.ray, Fault::Test::kSlack);
    struct Entry {
      uint32_t node;
      float entry;
    } stack[HonestBvh::kStack];
    uint32_t top = 0;
    Entry at{0, 0};
    counter.Bounds(1);
    if (!bounds.Meets(nodes_[0].bound, best.t, at.entry)) return;
    for (;;) {
      const Node& node = nodes_[at.node];
      counter.Step(sizeof(Node));
      if (node.count > 0) {
        counter.Leaf(false);
        if (this->template TestPrims<kAny>(ray, &prims_[node.index], node.count, best, counter) && kAny)
          return;
      } else {
        Entry near{at.node + 1, 0}, far{node.index, 0};
        counter.Bounds(2);
        const bool left = bounds.Meets(nodes_[near.node].bound, best.t, near.entry),
                   right = bounds.Meets(nodes_[far.node].bound, best.t, far.entry);
        if (left && right) {
          if (far.entry < near.entry) std::swap(near, far);
          if (top < Fault::kStack) stack[top++] = far;
          at = near;
          continue;
        }
        if (left || right) {
          at = left ? near : far;
          continue;
        }
      }
      do {
        if (top == 0) return;
        at = stack[--top];
      } while (at.entry > best.t);
    }
  }

  MemoryUse Memory() const {
    return {nodes_.size() * sizeof(Node) + prims_.size() * sizeof(uint32_t) + waste_.size(), 0, true};
  }

  template <class Fn>
  int VisitNodes(Fn& node) const {
    return nodes_.empty() ? 0 : VisitBelow(0, 0, node);
  }

 private:
  struct Node {
    Bound bound;
    uint32_t index;  // leaf: the first of `prims_`; else the right child. The left one follows its parent.
    uint32_t count;  // leaf: primitives; else 0
  };

  void Build(const std::vector<Vec3f>& centers, const rb_build_options& options, size_t leaf_size,
             size_t first, size_t count, const Bound* parent) {
    CheckBuild<Fault>(options, 0);
    const Bound tight = Bound::Around(this->geometry_, &prims_[first], count);
    const Bound bound = Fault::Stored(tight, parent != nullptr ? *parent : tight);
    const size_t at = nodes_.size();
    nodes_.push_back({bound, uint32_t(first), uint32_t(count)});
    if (count <= leaf_size) return;
    Bounds3 b;
    for (size_t i = first; i < first + count; ++i) b.Extend(centers[prims_[i]]);
    const Vec3f e = b.Extent();
    const int axis = e.x >= e.y && e.x >= e.z ? 0 : e.y >= e.z ? 1 : 2;
    std::sort(prims_.begin() + long(first), prims_.begin() + long(first + count),
              [&](uint32_t p, uint32_t q) {
                const float x = centers[p][axis], y = centers[q][axis];
                return x != y ? x < y : p < q;
              });
    const size_t left = Fault::LeftOf(count, options);
    nodes_[at].count = 0;
    Build(centers, options, leaf_size, first, left, &bound);
    nodes_[at].index = uint32_t(nodes_.size());
    Build(centers, options, leaf_size, first + left, count - left, &bound);
  }

  template <class Fn>
  int VisitBelow(uint32_t at, uint32_t depth, Fn& node) const {
    const Node& n = nodes_[at];
    float bounds[Bound::kFloats];
    n.bound.CopyTo(bounds);
    const bool leaf = n.count > 0;
    if (int stop = node(rb_node{depth, leaf, 0, Bound::kShape, bounds, Bound::kFloats, n.count,
                                leaf ? &prims_[n.index] : nullptr}))
      return stop;
    if (leaf) return 0;
    if (int stop = VisitBelow(at + 1, depth + 1, node)) return stop;
    return VisitBelow(n.index, depth + 1, node);
  }

  std::vector<Node> nodes_;
  std::vector<uint32_t> prims_;
  std::vector<char> waste_;
};

}  // namespace raybench::saboteurs
