#include "accel/bvh/linear.h"

#include "accel/bvh/morton.h"
#include "accel/bvh/node_store.h"

namespace raybench {
namespace {

class MortonBuilder {
 public:
  MortonBuilder(const rb_geometry& geometry, const SahCosts& costs, bool padded, const volatile int* cancel)
      : costs_(costs), cancel_(cancel), records_(PrimCount(geometry)) {
    const size_t n = records_.size();
    const RecordRange all = MakeRecords(geometry, padded, records_);
    order_ = MortonOrder(records_, all.centroids);
    tree_.order = HugeArray<uint32_t>(n);
    NodeStore store(n);
    const Large whole = Build(0, n, store);
    records_ = {}, order_ = {};
    tree_.nodes = store.Take(whole.nodes);
  }
  BinaryTree Take() { return std::move(tree_); }

 private:
  static_assert(kMortonBits <= kDecideDepth);
  static constexpr size_t kAhead = 32;

  struct Subtree {
    Box4 box;
    float cost;  // times area
  };
  struct Large {
    Subtree sum;
    NodeStore::Subtree nodes;
  };

  Large Build(size_t begin, size_t end, NodeStore& store) {
    const size_t n = end - begin;
    if (n < kTaskRange) {
      NodeList nodes(n);
      const Subtree sum = BuildSmall(begin, end, nodes);
      return {sum, store.Put(nodes.nodes())};
    }
    static_assert(kTaskRange > 256);  // hence larger than a leaf
    CheckCancel(cancel_);
    const size_t middle = Middle(begin, end);
    Large left, right;
    ParallelInvoke([&] { left = Build(begin, middle, store); }, [&] { right = Build(middle, end, store); });
    const Subtree sum = Above(left.sum, right.sum);
    BuildNode node;
    SetBounds(node, sum.box);
    return {sum, store.Join(node, left.nodes, right.nodes)};
  }

  Subtree BuildSmall(size_t begin, size_t end, NodeList& nodes) {
    const size_t n = end - begin;
    const uint32_t node = nodes.Add();
    if (n == 1 || costs_.NeverPays(n)) return Leaf(begin, n, nodes[node]);
    const size_t middle = Middle(begin, end);
    const Subtree left = BuildSmall(begin, middle, nodes);
    nodes.SetRight(node);
    const Subtree right = BuildSmall(middle, end, nodes), sum = Above(left, right);
    const float area = sum.box.HalfArea();
    SetBounds(nodes[node], sum.box);
    nodes[node].first = nodes[node].count = 0;
    if (n > costs_.leaf_size || costs_.Pays(left.cost + right.cost, n, area)) return sum;
    nodes.CutBehind(node);
    SetLeaf(nodes[node], begin, n);
    return {sum.box, costs_.Blocks(n) * area};
  }

  Subtree Above(const Subtree& left, const Subtree& right) const {
    Box4 box = left.box;
    box.Extend(right.box);
    return {box, left.cost + right.cost + costs_.traversal * box.HalfArea()};
  }

  Subtree Leaf(size_t first, size_t n, BuildNode& node) {
    Box4 box = Box4::Empty();
    for (size_t i = first; i < first + n; ++i) {
      // Leaves come in Morton order, their records stand anywhere.
      __builtin_prefetch(&records_[order_.prim(std::min(i + kAhead, order_.size() - 1))]);
      tree_.order[i] = order_.prim(i);
      const Record& record = records_[order_.prim(i)];
      box.Extend({record.lo, record.hi});
    }
    SetBounds(node, box), SetLeaf(node, first, n);
    return {box, costs_.Blocks(n) * box.HalfArea()};
  }

  /// Centres in one cell are halved.
  size_t Middle(size_t begin, size_t end) const {
    const size_t cut = order_.Cut(begin, end);
    return cut > begin ? cut : begin + (end - begin) / 2;
  }

  SahCosts costs_;
  const volatile int* cancel_;
  HugeArray<Record> records_;
  MortonOrder order_;
  BinaryTree tree_;
};

}  // namespace

BinaryTree BuildLinear(const rb_geometry& geometry, const SahCosts& costs, bool padded,
                       const volatile int* cancel) {
  return MortonBuilder(geometry, costs, padded, cancel).Take();
}

uint64_t LinearPeakBytes(uint64_t prims) {
  const uint64_t records = prims * (sizeof(Record) + MortonOrder::kBytesPerPrim);
  return NodeStore::Bytes(prims) + std::max(records, NodeStore::Bytes(prims)) + prims * sizeof(uint32_t);
}

}  // namespace raybench
