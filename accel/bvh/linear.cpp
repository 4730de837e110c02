#include "accel/bvh/linear.h"

#include "accel/bvh/morton.h"

namespace raybench {
namespace {

class MortonBuilder {
 public:
  MortonBuilder(const rb_geometry& geometry, const SahCosts& costs, bool padded, const volatile int* cancel)
      : costs_(costs), cancel_(cancel), records_(PrimCount(geometry)) {
    const size_t n = records_.size();
    const RecordRange all = MakeRecords(geometry, padded, records_);
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

}  // namespace

BinaryTree BuildLinear(const rb_geometry& geometry, const SahCosts& costs, bool padded,
                       const volatile int* cancel) {
  return MortonBuilder(geometry, costs, padded, cancel).Take();
}

uint64_t LinearPeakBytes(uint64_t prims) {
  return prims * (sizeof(Record) + kMortonBytesPerPrim + 2 * sizeof(BuildNode) + sizeof(uint32_t));
}

}  // namespace raybench
