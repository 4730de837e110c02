// bvh_morton: a linear bounding volume hierarchy (LBVH), for the fastest build.
//
// The idea: sort the primitives along Morton's space-filling curve and cut the order where its codes' highest
// bits change (Lauterbach et al. 2009). That halves space again and again, as an octree does, and asks for no
// cost at all: building is sorting. Karras (2012) finds all nodes at once from the sorted codes, for GPUs; on
// a few cores going down from the root gives the same tree and meets each node's codes in cache. Centres in
// the same cell are halved by id.
//
// Boxes come on the way up; there a subtree becomes one leaf where that costs less by SAH. Layout and
// traversal: accel/bvh/bvh2.h.
//
// Invariants: every primitive stands in exactly one leaf, whose bounds enclose it; 63 levels at most split by
// codes, below them 32 halve; sorting is stable, so the tree is the same at any thread count.
#include "accel/bvh/morton.h"
#include "accel/bvh/structure.h"

namespace raybench {
namespace {

class MortonBuilder {
 public:
  static constexpr uint64_t kBytesPerPrim =
      sizeof(Record) + kMortonBytesPerPrim + 2 * sizeof(BuildNode) + sizeof(uint32_t);

  MortonBuilder(const rb_geometry& geometry, const BvhConfig& config, const volatile int* cancel)
      : costs_(config.Costs()), cancel_(cancel), records_(PrimCount(geometry)) {
    const size_t n = records_.size();
    const RecordRange all = MakeRecords(geometry, config.Padded(), records_);
    items_ = SortByMorton(records_, all.centroids);
    tree_.nodes = HugeArray<BuildNode>(2 * n);
    tree_.order = HugeArray<uint32_t>(n);
    Build(0, n, 0);
  }
  BinaryTree Take() { return std::move(tree_); }

 private:
  static_assert(kMortonBits <= kDecideDepth);
  static constexpr size_t kAhead = 32;

  struct Subtree {
    Box4 box;
    float cost;  // times area
  };

  Subtree Build(size_t begin, size_t end, uint32_t slot) {
    const size_t n = end - begin;
    BuildNode& node = tree_.nodes[slot];
    // Splitting costs at least an inner node.
    if (n == 1 || (n <= costs_.leaf_size && costs_.Blocks(n) <= costs_.traversal))
      return Leaf(begin, n, node);
    if (n >= kTaskRange) CheckCancel(cancel_);
    const size_t middle = Cut(begin, end);
    const uint32_t right_slot = SetInner(node, slot, middle - begin);
    Subtree left, right;
    Both(
        n, [&] { left = Build(begin, middle, slot + 1); }, [&] { right = Build(middle, end, right_slot); });
    Box4 box = left.box;
    box.Extend(right.box);
    SetBounds(node, box);
    const float area = box.HalfArea(), below = left.cost + right.cost;
    if (n > costs_.leaf_size || costs_.Pays(below, n, area)) return {box, below + costs_.traversal * area};
    SetLeaf(node, begin, n);
    return {box, costs_.Blocks(n) * area};
  }

  Subtree Leaf(size_t first, size_t n, BuildNode& node) {
    Box4 box = Box4::Empty();
    for (size_t i = first; i < first + n; ++i) {
      // Leaves come in Morton order, their records stand anywhere.
      __builtin_prefetch(&records_[items_[std::min(i + kAhead, items_.size() - 1)].prim]);
      tree_.order[i] = items_[i].prim;
      const Record& record = records_[items_[i].prim];
      box.Extend({record.lo, record.hi});
    }
    SetBounds(node, box), SetLeaf(node, first, n);
    return {box, costs_.Blocks(n) * box.HalfArea()};
  }

  /// Where the highest bit that changes within the range does.
  size_t Cut(size_t begin, size_t end) const {
    const uint64_t changes = items_[begin].code ^ items_[end - 1].code;
    if (changes == 0) return begin + (end - begin) / 2;
    const uint64_t bit = uint64_t{1} << (63 - __builtin_clzll(changes));
    size_t zeros = begin, ones = end - 1;  // the bit is 0 at `zeros`, 1 at `ones`
    while (ones - zeros > 1) {
      const size_t middle = zeros + (ones - zeros) / 2;
      ((items_[middle].code & bit) == 0 ? zeros : ones) = middle;
    }
    return ones;
  }

  SahCosts costs_;
  const volatile int* cancel_;
  HugeArray<Record> records_;
  HugeArray<MortonItem> items_;
  BinaryTree tree_;
};

class BvhMorton : public BvhStructure {
 public:
  struct Config {
    BvhConfig bvh;
  };
  static constexpr const char* kName = "bvh_morton";
  static constexpr const char* kDoc = "binary BVH along a space-filling curve (LBVH), the fastest to build";
  static constexpr const char* kSource = "Lauterbach et al. 2009: Fast BVH construction on GPUs";
  static constexpr Kind kKind = {"BVH", "O(N)", "SIMD leaves"};
  static std::span<const rb_param> Params() {
    static const rb_param params[] = {kBvhNumerics, BvhLeafSize(8), kBvhTraversalCost, kBvhReinsertion};
    return params;
  }

  BvhMorton(const rb_geometry& geometry, const rb_build_options& options, const Config& config)
      : BvhStructure(geometry, options, config.bvh, MortonBuilder::kBytesPerPrim * PrimCount(geometry),
                     [&] { return MortonBuilder(geometry, config.bvh, options.cancel).Take(); }) {}
};

}  // namespace

RAYBENCH_STRUCTURE(bvh_morton, BvhMorton)

}  // namespace raybench
