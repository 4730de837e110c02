// octree: cells halved at their centres along all three axes at once, until little is left in them.
//
// The idea: detail decides where space is cut fine, and what is empty is not cut at all (Glassner 1984,
// "Space subdivision for fast ray tracing"). Unlike a kd-tree's, the planes are given by the cell, so
// nothing is searched while building, and a node says nothing about where its planes are that its parent has
// not said.
//
// Node, 64 bytes, one cache line:
//
//     center x y z | filled: one bit a child | child[8]: node, or first block | count[8]: 2 bytes each
//
// Traversal is top-down with the parameters of planes, after Revelles, Urena, Lastra (2000), but not as they
// do it: t of a centre plane is computed from the plane, never as the mean of its neighbours' (inf - inf for
// parallel rays), and rays are not mirrored, which would round their origins. A ray carries the t of its
// cell's six planes; the centre adds three, each twice, rounded down where it is an entry and up where it is
// an exit. Entry and exit of all eight children are the maxima and minima of three of them, in four lanes at
// once. Numbering children by the halves in the order in which the ray meets them, that is by `child xor
// signs`, makes 0..7 an order from front to back.
//
// No hit is lost: these are the slab tests of ray/bounds.h. Where a primitive lies across a centre plane it
// stands in both halves, and at any t >= 0 the slackened intervals of the two leave no gap between them, so
// by induction down the tree a leaf that holds it is open at its t.
//
// Parameters: depth and leaf_size end the subdivision, and so does `growth`, where it would only copy
// references (center_tree.h). What goes into a cell: insertion.h.
//
// Invariants: a primitive stands in every leaf that it meets; depth below the traversal stack's; the same
// tree at any thread count.

#include "accel/base/simd.h"
#include "accel/space/center_structure.h"

namespace raybench {
namespace {

struct alignas(64) OctreeNode {
  float center[3];
  uint32_t filled;
  uint32_t child[8];
  uint16_t count[8];
};
static_assert(sizeof(OctreeNode) == 64);

class Octree : public CenterStructure<Octree, OctreeNode> {
 public:
  struct Config {
    double growth, references;
    int64_t depth, leaf_size;
    uint32_t numerics, insertion;
  };
  static constexpr const char* kName = "octree";
  static constexpr const char* kDoc = "octree over bounds, all children of a node tested at once";
  static constexpr const char* kSource = "Glassner 1984: Space subdivision for fast ray tracing";
  static constexpr Kind kKind = {"octree", "O(N log N)", "SIMD leaves"};
  static std::span<const rb_param> Params() {
    static const rb_param params[] = {NumericsParam(offsetof(Config, numerics)),
                                      CenterDepthParam(offsetof(Config, depth)),
                                      CenterLeafSizeParam(offsetof(Config, leaf_size)),
                                      CenterGrowthParam(offsetof(Config, growth), 9, 3),
                                      CenterReferencesParam(offsetof(Config, references)),
                                      InsertionParam(offsetof(Config, insertion))};
    return params;
  }

  Octree(const rb_geometry& geometry, const rb_build_options& options, const Config& config)
      : CenterStructure(geometry, config) {
    Build(options, config, [](const Insertion&) { return CenterTreeOptions(); });
  }

 private:
  friend CenterStructure;

  /// A cell on the way of a ray: t of the planes by which it enters and leaves, by axis.
  struct Entry {
    Float4 enter, leave;  // the fourth lane of `enter` holds the ref's index, that of `leave` its count
    CenterChild ref() const {
      uint32_t index, count;
      std::memcpy(&index, reinterpret_cast<const char*>(&enter) + 12, 4);
      std::memcpy(&count, reinterpret_cast<const char*>(&leave) + 12, 4);
      return {index, uint16_t(count)};
    }
    void Refer(uint32_t index, uint32_t count) {
      std::memcpy(reinterpret_cast<char*>(&enter) + 12, &index, 4);
      std::memcpy(reinterpret_cast<char*>(&leave) + 12, &count, 4);
    }
  };
  static constexpr size_t kStack = 7 * kMaxCenterDepth + 8;

  void LayOut(const CenterTree&, const CenterTree::Node& from, OctreeNode& node) const {
    node.filled = 0;
    for (int a = 0; a < 3; ++a) node.center[a] = CenterOf(from.box, a);
    for (uint32_t k = 0; k < 8; ++k) node.filled |= uint32_t(node.count[k] != CenterChild::kEmpty) << k;
  }
  Bounds3 ChildBox(const OctreeNode& node, uint32_t k, Bounds3 box) const {
    for (int a = 0; a < 3; ++a) ((k >> a & 1) != 0 ? box.lo : box.hi)[a] = node.center[a];
    return box;
  }

  /// Bit r of the result is bit (r xor signs) of `bits`.
  static unsigned Reorder(unsigned bits, unsigned signs) {
    bits = (signs & 1) != 0 ? (bits & 0x55u) << 1 | (bits >> 1 & 0x55u) : bits;
    bits = (signs & 2) != 0 ? (bits & 0x33u) << 2 | (bits >> 2 & 0x33u) : bits;
    return (signs & 4) != 0 ? (bits & 0x0Fu) << 4 | bits >> 4 : bits;
  }

  template <bool kProcedural, bool kAnyHit, class Test, class Counter>
  void Trace(const RayState<Test>& ray, rb_hit& best, Counter& counter) const {
    static constexpr Int4 kHalf[8] = {{0, 0, 0, 0},  {-1, 0, 0, 0},  {0, -1, 0, 0},  {-1, -1, 0, 0},
                                      {0, 0, -1, 0}, {-1, 0, -1, 0}, {0, -1, -1, 0}, {-1, -1, -1, 0}};
    if (root_.count == CenterChild::kEmpty) return;
    const SlabRay slab = ray.SlabOfParts();
    const unsigned signs = slab.signs;
    const Float4 org{slab.org[0], slab.org[1], slab.org[2], 0};
    const Float4 inv_enter{slab.inv_near[0], slab.inv_near[1], slab.inv_near[2], 0};
    const Float4 inv_leave{slab.inv_far[0], slab.inv_far[1], slab.inv_far[2], 0};
    const float tnear = ray.query.ray.tnear;

    Entry stack[kStack], now;
    int top = 0;
    {
      Float4 first{}, last{};
      for (int a = 0; a < 3; ++a) {
        first[a] = slab.negative(a) ? bounds_.hi[a] : bounds_.lo[a];
        last[a] = slab.negative(a) ? bounds_.lo[a] : bounds_.hi[a];
      }
      now.enter = (first - org) * inv_enter, now.leave = (last - org) * inv_leave;
      now.Refer(root_.index, root_.count);
      counter.Bounds(1);
      float enter, leave;
      slab.Interval(bounds_, enter, leave);
      if (!(std::max(enter, tnear) <= std::min(leave, best.t))) return;
    }
    NoMailbox none;
    for (;;) {
      CenterChild ref = now.ref();
      while (ref.count == CenterChild::kInner) {
        const OctreeNode& node = nodes_[ref.index];
        counter.Step(sizeof node);
        counter.Bounds(3);
        const Float4 from_org = Float4(Int4(Load<Float4>(node.center)) & Int4{-1, -1, -1, 0}) - org;
        const Float4 enter2 = from_org * inv_enter, leave2 = from_org * inv_leave;
        const Float4 &e = now.enter, &l = now.leave;
        const Float4 enter_xy =
            MaxOrSecond(Float4{e[0], enter2[0], e[0], enter2[0]},
                        MaxOrSecond(Float4{e[1], e[1], enter2[1], enter2[1]}, Splat<Float4>(tnear)));
        // NaN (a parallel ray in the plane) limits nothing, being the first operand.
        const Float4 leave_xy =
            MinOrSecond(Float4{leave2[0], l[0], leave2[0], l[0]},
                        MinOrSecond(Float4{leave2[1], leave2[1], l[1], l[1]}, Splat<Float4>(best.t)));
        const Float4 enter_0 = MaxOrSecond(Splat<Float4>(e[2]), enter_xy),
                     enter_1 = MaxOrSecond(Splat<Float4>(enter2[2]), enter_xy);
        const Float4 leave_0 = MinOrSecond(Splat<Float4>(leave2[2]), leave_xy),
                     leave_1 = MinOrSecond(Splat<Float4>(l[2]), leave_xy);
        unsigned hit = Mask(enter_0 <= leave_0) | Mask(enter_1 <= leave_1) << 4;
        if constexpr (!Counter::kCounts) hit &= Reorder(node.filled, signs);
        if (hit == 0) {
          ref.count = CenterChild::kEmpty;
          break;
        }
        auto child = [&](unsigned r) {
          const unsigned k = r ^ signs;
          Entry c{kHalf[r] ? enter2 : e, kHalf[r] ? l : leave2};
          c.Refer(node.child[k], node.count[k]);
          return c;
        };
        while ((hit & (hit - 1)) != 0) {
          const unsigned r = 31u - unsigned(__builtin_clz(hit));
          stack[top++] = child(r);
          hit ^= 1u << r;
        }
        now = child(unsigned(__builtin_ctz(hit)));
        ref = now.ref();
        if (Counter::kCounts && ref.count == CenterChild::kEmpty) CountEmpty(counter);
      }
      if (ref.count != CenterChild::kEmpty) {
        counter.Step(0);
        if (leaves_.Intersect<kProcedural, kAnyHit>(ref, ray, best, counter, none) && kAnyHit) return;
      }
      for (;;) {
        if (top == 0) return;
        now = stack[--top];
        const float enter = std::max(std::max(now.enter[0], now.enter[1]), now.enter[2]);
        if (enter > best.t) continue;
        if (!Counter::kCounts || now.ref().count != CenterChild::kEmpty) break;
        CountEmpty(counter);
      }
    }
  }

  /// Empty children are looked for only when counting: they are traversed, but there is nothing to do.
  template <class Counter>
  static void CountEmpty(Counter& counter) {
    counter.Step(0);
    counter.Leaf(true);
  }
};

}  // namespace

RAYBENCH_STRUCTURE(octree, Octree)

}  // namespace raybench
