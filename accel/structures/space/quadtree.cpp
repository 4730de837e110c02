// quadtree: the octree's planar relative for height fields and what is like them.
//
// The idea: where things lie beside each other in a plane and never far apart across it, only the plane's two
// axes are worth cutting (Finkel and Bentley 1974); each cell keeps the height of what it holds, so that a
// ray passes above and below most of them (Musgrave 1988, "Grid tracing", does the like over one grid;
// Mitsuba and others trace height fields by quadtrees of minima and maxima).
//
// Node, 64 bytes, one cache line; heights are lower and upper bounds along the axis that is not cut:
//
//     height: lower[4] upper[4] | center[2] | child[4]: node, or first block | count[4]: 2 bytes each
//
// Traversal is the octree's (octree.cpp) with two axes: the four children's entries and exits are four lanes,
// in the order in which the ray meets them, and their heights' slabs limit them further. No hit is lost for
// the same reason; the heights enclose the boxes of all that is in the cell.
//
// Parameters: `axis` is the one that is not cut. By itself the tree takes that along which the fewest boxes
// stand behind one another, on average over lines parallel to it. depth, leaf_size and growth end the
// subdivision (center_tree.h; a child has about a third of its parent's surface here).
//
// Invariants: a primitive stands in every leaf whose square it meets; depth below the traversal stack's; the
// same tree at any thread count.

#include "accel/base/simd.h"
#include "accel/space/center_structure.h"

namespace raybench {
namespace {

constexpr const char* kAxisChoices[] = {"auto", "x", "y", "z", nullptr};

/// The axis parallel to which a line meets the fewest boxes, on average over the scene's box.
int HeightAxis(const Insertion& insertion) {
  const Vec3f size = insertion.Scene().Extent();
  int axis = 2;
  double fewest = std::numeric_limits<double>::infinity();
  for (int a : {2, 1, 0}) {
    const int b = (a + 1) % 3, c = (a + 2) % 3;
    double met = 0;
    for (uint32_t i = 0; i < insertion.size(); ++i) {
      const Vec3f e = insertion.Box(i).Extent();
      met += double(e[b]) * double(e[c]);
    }
    met /= double(size[b]) * double(size[c]);
    if (met < fewest) fewest = met, axis = a;  // false for NaN: a scene without any area
  }
  return axis;
}

struct alignas(64) QuadtreeNode {
  float lower[4], upper[4];
  float center[2];
  uint32_t child[4];
  uint16_t count[4];
};
static_assert(sizeof(QuadtreeNode) == 64);

class Quadtree : public CenterStructure<Quadtree, QuadtreeNode> {
 public:
  struct Config {
    double growth, references;
    int64_t depth, leaf_size;
    uint32_t numerics, insertion, axis;
  };
  static constexpr const char* kName = "quadtree";
  static constexpr const char* kDoc = "quadtree in a plane, heights in its cells: for height fields";
  static constexpr const char* kSource =
      "Finkel and Bentley 1974: Quad trees, a data structure for retrieval on composite keys";
  static constexpr Kind kKind = {"quadtree", "O(N log N)", "SIMD leaves"};
  static std::span<const rb_param> Params() {
    static const rb_param params[] = {
        NumericsParam(offsetof(Config, numerics)),
        ChoiceParam(
            "axis",
            "of height, which is not cut; auto: along which the fewest boxes stand behind one another",
            offsetof(Config, axis), kAxisChoices, 0),
        CenterDepthParam(offsetof(Config, depth)),
        CenterLeafSizeParam(offsetof(Config, leaf_size)),
        CenterGrowthParam(offsetof(Config, growth), 5, 2.5),
        CenterReferencesParam(offsetof(Config, references)),
        InsertionParam(offsetof(Config, insertion))};
    return params;
  }

  Quadtree(const rb_geometry& geometry, const rb_build_options& options, const Config& config)
      : CenterStructure(geometry, config) {
    Build(options, config, [&](const Insertion& insertion) {
      const int height = config.axis == 0 ? HeightAxis(insertion) : int(config.axis) - 1;
      for (int k = 0; k < 3; ++k) axes_[k] = (height + 1 + k) % 3;
      return CenterTreeOptions{.axes = {axes_[0], axes_[1], axes_[2]}, .axis_count = 2};
    });
  }

 private:
  friend CenterStructure;

  /// A cell on the way of a ray: t of the planes by which it enters and leaves it along both axes.
  struct Entry {
    float enter[2], leave[2];
    float tnear;  // the heights' slab included
    CenterChild ref;
  };
  static constexpr size_t kStack = 3 * kMaxCenterDepth + 4;

  void LayOut(const CenterTree& tree, const CenterTree::Node& from, QuadtreeNode& node) const {
    for (int k = 0; k < 2; ++k) node.center[k] = CenterOf(from.box, axes_[k]);
    for (uint32_t k = 0; k < 4; ++k) {
      const Bounds3& box = tree.nodes[from.child + k].box;
      node.lower[k] = box.lo[axes_[2]], node.upper[k] = box.hi[axes_[2]];
    }
  }
  /// An empty cell has no height: it is shown flat.
  Bounds3 ChildBox(const QuadtreeNode& node, uint32_t k, Bounds3 box) const {
    for (int a = 0; a < 2; ++a) ((k >> a & 1) != 0 ? box.lo : box.hi)[axes_[a]] = node.center[a];
    const int z = axes_[2];
    const bool empty = !(node.lower[k] <= node.upper[k]);
    box.hi[z] = empty ? box.lo[z] : node.upper[k];
    if (!empty) box.lo[z] = node.lower[k];
    return box;
  }

  template <bool kProcedural, bool kAnyHit, class Test, class Counter>
  void Trace(const RayState<Test>& ray, rb_hit& best, Counter& counter) const {
    if (root_.count == CenterChild::kEmpty) return;
    const SlabRay slab = ray.SlabOfParts();
    const int x = axes_[0], y = axes_[1], z = axes_[2];
    const unsigned signs = unsigned(slab.negative(x)) | unsigned(slab.negative(y)) << 1;
    const LaneXor<4> in_order{int(signs)};
    const float tnear = ray.query.ray.tnear;

    Entry stack[kStack], now;
    int top = 0;
    counter.Bounds(1);
    float tfar;
    slab.Interval(bounds_, now.tnear, tfar);
    if (!(std::max(now.tnear, tnear) <= std::min(tfar, best.t))) return;
    for (int k = 0; k < 2; ++k) {
      const int a = axes_[k];
      now.enter[k] = ((slab.negative(a) ? bounds_.hi : bounds_.lo)[a] - slab.org[a]) * slab.inv_near[a];
      now.leave[k] = ((slab.negative(a) ? bounds_.lo : bounds_.hi)[a] - slab.org[a]) * slab.inv_far[a];
    }
    now.ref = root_;
    NoMailbox none;
    for (;;) {
      while (now.ref.count == CenterChild::kInner) {
        const QuadtreeNode& node = nodes_[now.ref.index];
        counter.Step(sizeof node);
        counter.Bounds(4);
        const float dx = node.center[0] - slab.org[x], dy = node.center[1] - slab.org[y];
        const float enter_x = dx * slab.inv_near[x], leave_x = dx * slab.inv_far[x];
        const float enter_y = dy * slab.inv_near[y], leave_y = dy * slab.inv_far[y];
        const Float4 first = Load<Float4>(slab.negative(z) ? node.upper : node.lower),
                     last = Load<Float4>(slab.negative(z) ? node.lower : node.upper);
        // NaN (a parallel ray in a plane) limits nothing, being the first operand.
        Float4 enter = (in_order(first) - slab.org[z]) * slab.inv_near[z];
        enter = MaxOrSecond(enter, Splat<Float4>(tnear));
        enter = MaxOrSecond(Float4{now.enter[0], enter_x, now.enter[0], enter_x}, enter);
        enter = MaxOrSecond(Float4{now.enter[1], now.enter[1], enter_y, enter_y}, enter);
        Float4 leave = (in_order(last) - slab.org[z]) * slab.inv_far[z];
        leave = MinOrSecond(leave, Splat<Float4>(best.t));
        leave = MinOrSecond(Float4{leave_x, now.leave[0], leave_x, now.leave[0]}, leave);
        leave = MinOrSecond(Float4{leave_y, leave_y, now.leave[1], now.leave[1]}, leave);
        unsigned hit = Mask(enter <= leave);
        if (hit == 0) {
          now.ref.count = CenterChild::kEmpty;
          break;
        }
        const Entry parent = now;
        auto child = [&](unsigned r) {
          const unsigned k = r ^ signs;
          return Entry{{(r & 1) != 0 ? enter_x : parent.enter[0], (r & 2) != 0 ? enter_y : parent.enter[1]},
                       {(r & 1) != 0 ? parent.leave[0] : leave_x, (r & 2) != 0 ? parent.leave[1] : leave_y},
                       enter[r],
                       {node.child[k], node.count[k]}};
        };
        while ((hit & (hit - 1)) != 0) {
          const unsigned r = 31u - unsigned(__builtin_clz(hit));
          stack[top++] = child(r);
          hit ^= 1u << r;
        }
        now = child(unsigned(__builtin_ctz(hit)));
      }
      if (now.ref.count != CenterChild::kEmpty) {
        counter.Step(0);
        if (leaves_.Intersect<kProcedural, kAnyHit>(now.ref, ray, best, counter, none) && kAnyHit) return;
      }
      do {
        if (top == 0) return;
        now = stack[--top];
      } while (now.tnear > best.t);
    }
  }

  int axes_[3] = {0, 1, 2};  // the two that are cut, then that of height
};

}  // namespace

RAYBENCH_STRUCTURE(quadtree, Quadtree)

}  // namespace raybench
