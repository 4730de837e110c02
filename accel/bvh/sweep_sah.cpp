// Three copies of the records, one an axis, are kept in order. A node sweeps each from the right, noting the
// cost of what lies right of each cut, then from the left. The best cut splits its own order as it stands;
// the other two are split stably by a mark on each primitive.
#include "accel/bvh/sweep_sah.h"

#include <cmath>

#include "accel/base/parallel.h"
#include "accel/base/radix_sort.h"
#include "accel/bvh/build_records.h"
#include "accel/bvh/node_store.h"

namespace raybench {
namespace {

class SweepBuilder {
 public:
  SweepBuilder(const rb_geometry& geometry, const SahCosts& costs, bool padded, const volatile int* cancel)
      : costs_(costs), goes_left_(PrimCount(geometry)) {
    const size_t n = PrimCount(geometry);
    HugeArray<Record> records(n);
    MakeRecords(geometry, padded, records);
    ParallelFor(0, 3, [&](int axis) {
      Sort(records, axis);
      scratch_[axis] = HugeArray<Record>(n);
      right_cost_[axis] = HugeArray<float>(n);
    });
    records = {};
    NodeStore store(n);
    const NodeStore::Subtree all = BuildDown(
        Work{0, n, 0}, [this](auto&&... of) { return Divide(of...); }, store, cancel);
    tree_.order = HugeArray<uint32_t>(n);
    ForBlocks(0, n, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) tree_.order[i] = by_[0][i].id();
    });
    for (int axis = 0; axis < 3; ++axis) by_[axis] = {}, scratch_[axis] = {}, right_cost_[axis] = {};
    tree_.nodes = store.Take(all);
  }
  BinaryTree Take() { return std::move(tree_); }

 private:
  struct Cut {
    float cost = std::numeric_limits<float>::infinity();  // of both sides, times area
    size_t lefts = 0;
    Box4 box = Box4::Empty();  // of the whole range
  };

  /// by_[axis]: the records in the order of their centres, then ids.
  void Sort(const HugeArray<Record>& records, int axis) {
    struct Item {
      uint32_t key, id;
    };
    const size_t n = records.size();
    HugeArray<Item> items(n), scratch(n);
    ForBlocks(0, n, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        const float centre = records[i].Centroid2()[axis] + 0.0f;  // -0 and 0 are the same
        int32_t bits;
        std::memcpy(&bits, &centre, sizeof bits);
        // Order of floats as order of integers: negative ones are reversed.
        items[i] = {uint32_t(bits) ^ (uint32_t(bits >> 31) | 0x80000000u), uint32_t(i)};
      }
    });
    RadixSort(items, scratch, 32, [](const Item& item) { return item.key; });
    by_[axis] = HugeArray<Record>(n);
    ForBlocks(0, n, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) by_[axis][i] = records[items[i].id];
    });
  }

  struct Work {
    size_t begin = 0, end = 0;
    uint32_t depth = 0;

    size_t size() const { return end - begin; }
    size_t room() const { return size(); }
  };

  /// As BuildDown() wants it.
  bool Divide(const Work& work, BuildNode& node, Work& left, Work& right) {
    const auto [begin, end, depth] = work;
    const size_t n = end - begin;
    if (n == 1 || costs_.NeverPays(n)) {
      Box4 box = Box4::Empty();
      for (size_t i = begin; i < end; ++i) box.Extend({by_[0][i].lo, by_[0][i].hi});
      SetBounds(node, box), SetLeaf(node, begin, n);
      return false;
    }
    Cut cuts[3];
    EachAxis(n, [&](int axis) { cuts[axis] = BestCut(axis, begin, end); });
    int best = 0;
    for (int axis = 1; axis < 3; ++axis) {
      if (cuts[axis].cost < cuts[best].cost) best = axis;
    }
    SetBounds(node, cuts[0].box);
    if (n <= costs_.leaf_size && !costs_.Pays(cuts[best].cost, n, cuts[0].box.HalfArea())) {
      SetLeaf(node, begin, n);
      return false;
    }
    const size_t lefts = depth < kSahDepth ? cuts[best].lefts : n / 2, middle = begin + lefts;
    const auto mark = [&](size_t from, size_t to) {
      for (size_t i = from; i < to; ++i) goes_left_[by_[best][i].id()] = i < middle;
    };
    n >= kParallelRange ? ForBlocks(begin, end, mark) : mark(begin, end);
    EachAxis(n, [&](int axis) {
      if (axis != best) Partition(axis, begin, end);
    });
    left = {begin, middle, depth + 1}, right = {middle, end, depth + 1};
    return true;
  }

  template <class Fn>
  static void EachAxis(size_t n, Fn&& fn) {
    if (n >= kParallelRange) {
      ParallelFor(0, 3, fn);
    } else {
      for (int axis = 0; axis < 3; ++axis) fn(axis);
    }
  }

  Cut BestCut(int axis, size_t begin, size_t end) {
    const Record* const records = &by_[axis][0];
    float* const right_cost = &right_cost_[axis][0];
    Cut best;
    for (size_t i = end - 1; i > begin; --i) {
      best.box.Extend({records[i].lo, records[i].hi});
      right_cost[i] = best.box.HalfArea() * costs_.Blocks(end - i);
    }
    best.box.Extend({records[begin].lo, records[begin].hi});
    auto unevenness = [n = end - begin](size_t lefts) { return std::max(lefts, n - lefts); };
    Box4 left = Box4::Empty();
    for (size_t i = begin + 1; i < end; ++i) {
      left.Extend({records[i - 1].lo, records[i - 1].hi});
      const size_t lefts = i - begin;
      const float cost = left.HalfArea() * costs_.Blocks(lefts) + right_cost[i];
      if (cost < best.cost || (cost == best.cost && unevenness(lefts) < unevenness(best.lefts)))
        best.cost = cost, best.lefts = lefts;
    }
    return best;
  }

  void Partition(int axis, size_t begin, size_t end) {
    Record* const records = &by_[axis][0];
    Record* const rights = &scratch_[axis][begin];
    size_t l = begin, r = 0;
    for (size_t i = begin; i < end; ++i) {
      const Record record = records[i];
      const bool is_left = goes_left_[record.id()] != 0;
      records[l] = record, rights[r] = record;
      l += is_left, r += !is_left;
    }
    std::memcpy(static_cast<void*>(&records[l]), rights, r * sizeof(Record));
  }

  SahCosts costs_;
  HugeArray<Record> by_[3], scratch_[3];
  HugeArray<float> right_cost_[3];
  HugeArray<uint8_t> goes_left_;  // by id
  BinaryTree tree_;
};

}  // namespace

BinaryTree BuildSweepSah(const rb_geometry& geometry, const SahCosts& costs, bool padded,
                         const volatile int* cancel) {
  return SweepBuilder(geometry, costs, padded, cancel).Take();
}

uint64_t SweepSahPeakBytes(uint64_t prims) {
  const uint64_t records = prims * 3 * (2 * sizeof(Record) + sizeof(float));
  return NodeStore::Bytes(prims) + std::max(records, NodeStore::Bytes(prims)) +
         prims * (sizeof(uint32_t) + 1);
}

}  // namespace raybench
