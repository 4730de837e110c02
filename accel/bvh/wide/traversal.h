// How rays walk wide BVHs, and how these are laid out. A width, a node format and a leaf test make one loop; width4.cpp
// and its neighbours hold them all.
#pragma once

#include <algorithm>
#include <stdexcept>
#include <type_traits>
#include <vector>

#include "accel/base/huge_array.h"
#include "accel/base/parallel.h"
#include "accel/bvh/wide/interleaved.h"
#include "accel/bvh/wide/leaf_test.h"
#include "accel/bvh/wide/nodes.h"
#include "accel/bvh/wide/packet.h"
#include "accel/bvh/wide/ray.h"
#include "accel/bvh/wide/wide_bvh.h"
#include "accel/contract/counting.h"

namespace raybench {

template <int kWidth, class Node>
class WideBvhOf final : public WideBvh {
  template <class Tree, bool kAnyHit>
  friend class Interleaved;
  template <class Tree, bool kAnyHit>
  friend class Packets;
  static constexpr int kChildren = kWidth, kLanes = int(LeafLanes(kWidth)), kLeafLanes = kLanes;
  using F = FloatN<kWidth>;
  using Block = typename LeafBlocks<kLanes>::Block;

 public:
  WideBvhOf(const rb_geometry& geometry, const BinaryTree& tree, const WideTopology& topology,
            const WideOptions& options)
      : geometry_(geometry),
        clipped_(tree.clipped),
        needs_uv_(options.needs_uv),
        batch_(options.batch),
        codec_(LeafCodec<kLanes>::Of(options.leaves)),
        steps_(options.steps),
        leaf_lines_(codec_ == nullptr ? LinesOf(sizeof(Block)) : LinesOf(codec_->bytes)),
        node_count_(topology.nodes()) {
    bounds_ = BoundsOf(tree.nodes[0]);
    if (node_count_ == 0) {
      Allocate(leaf_lines_);
      leaf_count_ = 1, root_ = kLeafBit;
      Fill(0, tree, topology.children[0]);
      return;
    }
    std::vector<Place> places(node_count_);
    uint64_t lines = 0;
    const auto take = [&](uint32_t n) {
      const uint32_t first = uint32_t(std::min<uint64_t>(lines, kLeafBit));
      lines += n;
      return first;
    };
    if (Node::kSiblingsTogether) places[0].node = take(kNodeLines);
    for (uint32_t i = 0; i < node_count_; ++i) {
      if (!Node::kSiblingsTogether) places[i].node = take(kNodeLines);
      places[i].leaves = take(0);
      for (const WideTopology::Child& child : topology.ChildrenOf(i)) {
        if (child.count > 0) {
          take(leaf_lines_), ++leaf_count_;
        } else if (Node::kSiblingsTogether) {
          places[child.first].node = take(kNodeLines);
        }
      }
    }
    Allocate(lines);
    root_ = 0;
    ParallelFor(Range<size_t>(0, node_count_, 256), [&](const auto& range) {
      for (size_t i = range.begin(); i < range.end(); ++i) LayOut(uint32_t(i), places, tree, topology);
    });
  }

  void Query(uint32_t numerics, const rb_query& query, bool counted) const override {
    if (batch_ != Batch::kSingle && !counted && root_ == 0 && query.n > 1 &&
        Numerics(numerics) == Numerics::kWatertight && HoldsTriangles()) {
      query.kind == RB_ANY ? QueryTogether<true>(query) : QueryTogether<false>(query);
      return;
    }
    WithNumerics(numerics, [&]<class Test>() {
      counted ? QueryWith<Test, Counting>(query) : QueryWith<Test, NoCounting>(query);
    });
  }

  MemoryUse Memory() const override {
    const uint64_t leaves = leaf_count_ * leaf_lines_ * sizeof(Line);
    return {lines_.bytes() - leaves, leaves,
            geometry_.procedural_count > 0 || (codec_ != nullptr && codec_->bytes_outside > 0)};
  }

  int Visit(const std::function<int(const rb_node&)>& node) const override {
    return VisitBelow(root_, bounds_, 0, node);
  }

 private:
  struct alignas(32) Line {
    std::byte bytes[32];
  };
  static constexpr uint32_t LinesOf(size_t bytes) {
    return uint32_t((bytes + sizeof(Line) - 1) / sizeof(Line));
  }
  static constexpr uint32_t kNodeLines = LinesOf(sizeof(Node));
  static_assert(sizeof(Block) % sizeof(Line) == 0);

  // --- layout ---

  void Allocate(uint64_t lines) {
    if (lines >= kLeafBit) throw std::runtime_error("too many primitives");
    lines_ = HugeArray<Line>(lines);
  }
  static Bounds3 BoundsOf(const BuildNode& node) { return {LoadVec3(node.lo), LoadVec3(node.hi)}; }

  void Fill(uint32_t line, const BinaryTree& tree, const WideTopology::Child& leaf) {
    const std::span prims(&tree.order[leaf.first], leaf.count);
    if (codec_ != nullptr) return codec_->encode(geometry_, steps_, prims, &lines_[line]);
    LeafBlocks<kLanes>::FillBlock(geometry_, prims, reinterpret_cast<Block&>(lines_[line]));
  }

  /// Lines at which a node and its leaves begin.
  struct Place {
    uint32_t node = 0, leaves = 0;
  };

  void LayOut(uint32_t i, const std::vector<Place>& places, const BinaryTree& tree,
              const WideTopology& topology) {
    Node& node = reinterpret_cast<Node&>(lines_[places[i].node]);
    Bounds3 boxes[kWidth];
    uint32_t refs[kWidth] = {}, leaf = places[i].leaves, n = 0;
    for (const WideTopology::Child& child : topology.ChildrenOf(i)) {
      boxes[n] = BoundsOf(tree.nodes[child.slot]);
      if (child.count > 0) {
        Fill(leaf, tree, child);
        refs[n] = kLeafBit | leaf;
        leaf += leaf_lines_;
      } else {
        refs[n] = places[child.first].node;
      }
      ++n;
    }
    node.SetBoxes({boxes, n});
    node.SetChildren({refs, n}, leaf_lines_, kNodeLines);
  }

  [[gnu::always_inline]] uint32_t ChildOf(const Node& node, unsigned lane) const {
    return node.Child(lane, leaf_lines_, kNodeLines);
  }

  static bool IsLeaf(uint32_t ref) { return (ref & kLeafBit) != 0; }
  const Node& NodeOf(uint32_t ref) const { return reinterpret_cast<const Node&>(lines_[ref]); }
  /// Of a copied leaf.
  const Block& BlockOf(uint32_t ref) const { return reinterpret_cast<const Block&>(lines_[ref & ~kLeafBit]); }
  const void* LeafOf(uint32_t ref) const { return &lines_[ref & ~kLeafBit]; }
  const uint32_t* PrimsOf(uint32_t ref) const {
    return codec_ == nullptr ? BlockOf(ref).prim : static_cast<const uint32_t*>(LeafOf(ref));
  }
  /// Leaves are copied, and hold triangles alone.
  bool HoldsTriangles() const { return codec_ == nullptr && geometry_.procedural_count == 0; }

  /// The lanes behind a leaf's last primitive repeat it.
  uint32_t LeafSize(uint32_t ref) const {
    const uint32_t* prim = PrimsOf(ref);
    uint32_t n = 1;
    while (prim[n - 1] != prim[kLanes - 1]) ++n;
    return n;
  }
  /// What a test of its `prims` primitives reads.
  uint64_t LeafBytes(uint32_t prims) const {
    return codec_ == nullptr ? sizeof(Block) : codec_->bytes + uint64_t{prims} * codec_->bytes_outside;
  }

  int VisitBelow(uint32_t ref, const Bounds3& box, uint32_t depth,
                 const std::function<int(const rb_node&)>& node) const {
    const float bounds[6] = {box.lo.x, box.lo.y, box.lo.z, box.hi.x, box.hi.y, box.hi.z};
    rb_node shown{depth, 0, clipped_, RB_SHAPE_BOX, bounds, 6, 0, nullptr};
    if ((ref & kLeafBit) != 0) {
      shown.is_leaf = 1, shown.prims = PrimsOf(ref), shown.prim_count = LeafSize(ref);
      return node(shown);
    }
    if (int stop = node(shown)) return stop;
    const Node& n = NodeOf(ref);
    F rows[6];
    for (unsigned r = 0; r < 6; ++r) rows[r] = n.Row(r);
    for (unsigned c = 0; c < n.children(); ++c) {
      Bounds3 child{{rows[0][c], rows[1][c], rows[2][c]}, {rows[3][c], rows[4][c], rows[5][c]}};
      // A grid may reach beyond the node's own box, where no ray that enters the node is.
      child = {Max(child.lo, box.lo), Min(child.hi, box.hi)};
      if (int stop = VisitBelow(ChildOf(n, c), child, depth + 1, node)) return stop;
    }
    return 0;
  }

  // --- traversal ---

  template <bool kAnyHit>
  void QueryTogether(const rb_query& query) const {
    if (batch_ == Batch::kPacket) {
      Packets<WideBvhOf, kAnyHit>(*this, query).Run();
    } else {
      Interleaved<WideBvhOf, kAnyHit>(*this, query).Run();
    }
  }

  template <class Test, class Counter>
  void QueryWith(const rb_query& query) const {
    // Moved products find more than the shared test does, which the tests of `fast` notice; and counts shall not
    // depend on the machine.
    constexpr bool kMayMove = !Counter::kCounts && Test::kSlack != Slack::kNone;
    constexpr bool kInline = !Counter::kCounts && RayState<Test>::kInLanes;
    const bool in_lanes = kInline && HoldsTriangles();
    const auto trace = [&](auto any, const RayQuery& q, rb_hit& best, Counter& counter, const rb_ray& ray)
        __attribute__((always_inline)) {
      if constexpr (kInline) {
        if (in_lanes) {
          if constexpr (any.value) {
            TraceInLanes<Test, true, kMayMove>(q, ray, best);
          } else {
            TraceInLanesApart<Test, kMayMove>(q, ray, best);
          }
          return;
        }
      }
      TraceApart<Test, any.value, kMayMove>(q, best, counter);
    };
    ForEachRay<Counter>(query, trace);
  }

  /// A ray begins with a chain of steps that nothing else fills: from the caller's ray to the first node, without a call or
  /// a way through memory. `ray` is that of q.
  template <class Test, bool kAnyHit, bool kMayMove>
  [[gnu::always_inline]] void TraceInLanes(const RayQuery& q, const rb_ray& ray, rb_hit& best) const {
    const SlabRay slab(ray, Test::kSlack);
    if constexpr (kMayMove) {
      if (!MovedSlab::Fits(slab)) [[unlikely]] {
        TraceUnmoved<Test, kAnyHit>(q, slab, best);
        return;
      }
    }
    const auto make_leaf = [&]() [[gnu::always_inline]] {
      return InlinedLeafTest<kLanes, Test>(q, slab, needs_uv_);
    };
    NoCounting counter;
    TraceHere<kAnyHit>(WideRay<kWidth, kMayMove>(slab, NearWidening(Test::kSlack)), make_leaf, q, best,
                       counter);
  }
  /// Measured: closest-hit is no faster inlined.
  template <class Test, bool kMayMove>
  [[gnu::noinline]] void TraceInLanesApart(const RayQuery& q, const rb_ray& ray, rb_hit& best) const {
    TraceInLanes<Test, false, kMayMove>(q, ray, best);
  }

  /// In lanes, a ray that MovedSlab does not fit.
  template <class Test, bool kAnyHit>
  [[gnu::noinline]] void TraceUnmoved(const RayQuery& q, const SlabRay& slab, rb_hit& best) const {
    NoCounting counter;
    const auto make_leaf = [&]() [[gnu::always_inline]] {
      return InlinedLeafTest<kLanes, Test>(q, slab, needs_uv_);
    };
    TraceHere<kAnyHit>(WideRay<kWidth, false>(slab, NearWidening(Test::kSlack)), make_leaf, q, best, counter);
  }

  /// Whatever is asked seldom: leaves are tested by a call, in a loop that is shared by several tests.
  template <class Test, bool kAnyHit, bool kMayMove, class Counter>
  [[gnu::noinline]] void TraceApart(const RayQuery& q, rb_hit& best, Counter& counter) const {
    const RayState<Test> state(q);
    const CalledLeafTest<kLanes> leaf(state, geometry_, codec_);
    const float widening = NearWidening(Test::kSlack);
    if constexpr (kMayMove) {
      if (MovedSlab::Fits(state.slab)) [[likely]] {
        TraceByCalls<kAnyHit>(WideRay<kWidth, true>(state.slab, widening), leaf, q, best, counter);
        return;
      }
    }
    TraceByCalls<kAnyHit>(WideRay<kWidth, false>(state.slab, widening), leaf, q, best, counter);
  }
  template <bool kAnyHit, class Ray, class Counter>
  [[gnu::noinline]] void TraceByCalls(const Ray& ray, const CalledLeafTest<kLanes>& leaf, const RayQuery& q,
                                      rb_hit& best, Counter& counter) const {
    TraceHere<kAnyHit>(
        ray, [&]() -> const CalledLeafTest<kLanes>& { return leaf; }, q, best, counter);
  }

  float NearWidening(Slack slack) const { return clipped_ ? SlabRay::Widening(slack) : 1; }

  /// With WatertightTest, a ray that MovedSlab does not fit.
  template <bool kAnyHit>
  void TraceAlone(const RayQuery& q, rb_hit& best) const {
    TraceUnmoved<WatertightTest, kAnyHit>(q, SlabRay(q.ray, WatertightTest::kSlack), best);
  }

  template <bool kAnyHit, class Ray, class MakeLeaf, class Counter>
  [[gnu::always_inline]] void TraceHere(const Ray& ray, const MakeLeaf& make_leaf, const RayQuery& q,
                                        rb_hit& best, Counter& counter) const {
    if (root_ != 0) {
      TakeLeaf<kAnyHit>(root_, make_leaf(), best, counter);
      return;
    }
    const F tnear = Splat<F>(q.ray.tnear + 0.0f),  // no -0, whose bits are the least integer
        tfar = Splat<F>(best.t);
    F entry;
    const unsigned children = Meets(NodeOf(0), ray, tnear, tfar, entry, counter);
    if (children == 0) return;  // before anything is made for the leaves
    const auto& leaf = make_leaf();
    if constexpr (kAnyHit) {
      Any(ray, leaf, tnear, tfar, children, best, counter);
    } else {
      Closest(ray, leaf, tnear, tfar, entry, children, best, counter);
    }
  }

  template <bool kAnyHit, class LeafTest, class Counter>
  [[gnu::always_inline]] bool TakeLeaf(uint32_t ref, const LeafTest& leaf, rb_hit& best,
                                       Counter& counter) const {
    counter.Step(0), counter.Leaf(false);
    if constexpr (Counter::kCounts) {
      const uint32_t prims = LeafSize(ref);
      counter.Prims(prims, LeafBytes(prims));
    }
    return leaf.template Take<kAnyHit>(LeafOf(ref), best);
  }

  template <class Ray, class Counter>
  [[gnu::always_inline]] static unsigned Meets(const Node& node, const Ray& ray, F tnear, F tfar, F& entry,
                                               Counter& counter) {
    counter.Step(sizeof(Node)), counter.Bounds(kWidth);
    __builtin_prefetch(node.References());  // needed last, and by then alone
    return node.WithChild(ray.Meets([&](unsigned row) { return node.Row(row); }, tnear, tfar, entry));
  }

  /// Asks the memory for a child that waits: large trees are bound by it.
  [[gnu::always_inline]] void Prefetch(const Node& node, unsigned waiting) const {
    if (waiting != 0) Prefetch(ChildOf(node, unsigned(__builtin_ctz(waiting))));
  }
  [[gnu::always_inline]] void Prefetch(uint32_t ref) const {
    const std::byte* at = lines_[ref & ~kLeafBit].bytes;
    for (size_t i = 0; i < std::max(sizeof(Node), sizeof(Block)); i += 64) __builtin_prefetch(at + i);
  }

  /// Children in the order of lanes: leaves first, then by falling area, which is what blocks most. No distances.
  template <class Ray, class LeafTest, class Counter>
  [[gnu::always_inline]] void Any(const Ray& ray, const LeafTest& leaf, F tnear, F tfar, unsigned children,
                                  rb_hit& best, Counter& counter) const {
    struct Waiting {
      const Node* node;
      unsigned children;  // bits
    };
    Waiting stack[kMaxTreeDepth];
    Waiting* top = stack;
    const Node* node = &NodeOf(0);
    for (;;) {
      while (children == 0) {
        if (top == stack) return;
        --top;
        node = top->node, children = top->children;
      }
      const uint32_t ref = ChildOf(*node, unsigned(__builtin_ctz(children)));
      children &= children - 1;
      Prefetch(*node, children);
      if ((ref & kLeafBit) != 0) {
        if (TakeLeaf<true>(ref, leaf, best, counter)) return;
        continue;
      }
      *top = {node, children};
      top += children != 0;
      node = &NodeOf(ref);
      F entry;
      children = Meets(*node, ray, tnear, tfar, entry, counter);
    }
  }

  /// The nearest child first. The others wait together, with where the ray enters them: what lies behind a hit found
  /// meanwhile is dropped when their turn comes.
  template <class Ray, class LeafTest, class Counter>
  [[gnu::always_inline]] void Closest(const Ray& ray, const LeafTest& leaf, F tnear, F tfar, F entry,
                                      unsigned children, rb_hit& best, Counter& counter) const {
    struct Waiting {
      F entry;
      const Node* node;
      unsigned children;  // bits
    };
    Waiting stack[kMaxTreeDepth];
    Waiting* top = stack;
    const Node* node = &NodeOf(0);
    for (;;) {
      while (children == 0) {
        if (top == stack) return;
        --top;
        node = top->node, entry = top->entry;
        children = top->children & LessEqual<kWidth>(entry, tfar);
      }
      const bool is_one = (children & (children - 1)) == 0;
      const unsigned i = is_one ? unsigned(__builtin_ctz(children)) : LaneOfLeast<kWidth>(entry, children);
      const uint32_t ref = ChildOf(*node, i);
      children &= ~(1u << i);
      Prefetch(*node, children);
      if ((ref & kLeafBit) != 0) {
        if (TakeLeaf<false>(ref, leaf, best, counter)) {
          tfar = Splat<F>(best.t);
          children &= LessEqual<kWidth>(entry, tfar);
        }
        continue;
      }
      top->entry = entry, top->node = node, top->children = children;
      top += children != 0;
      node = &NodeOf(ref);
      children = Meets(*node, ray, tnear, tfar, entry, counter);
    }
  }

  rb_geometry geometry_;
  HugeArray<Line> lines_;
  uint32_t root_ = 0;
  Bounds3 bounds_;
  bool clipped_, needs_uv_;
  Batch batch_;
  const LeafCodec<kLanes>* codec_;  // nullptr: leaves are copied
  GridSteps steps_;
  uint32_t leaf_lines_;
  uint64_t node_count_ = 0, leaf_count_ = 0;
};

template <int kWidth>
std::unique_ptr<WideBvh> MakeWideBvhOf(const rb_geometry& geometry, const BinaryTree& tree,
                                       const WideTopology& topology, const WideOptions& options) {
  const auto make = [&]<class Node>() -> std::unique_ptr<WideBvh> {
    return std::make_unique<WideBvhOf<kWidth, Node>>(geometry, tree, topology, options);
  };
  switch (options.format) {
    case NodeFormat::kQuantized16:
      return make.template operator()<QuantizedNode<kWidth, uint16_t>>();
    case NodeFormat::kQuantized8:
      return make.template operator()<QuantizedNode<kWidth, uint8_t>>();
    default:
      return make.template operator()<FullNode<kWidth>>();
  }
}

}  // namespace raybench
