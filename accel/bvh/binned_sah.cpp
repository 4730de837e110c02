#include "accel/bvh/binned_sah.h"

#include <algorithm>
#include <cstring>
#include <utility>
#include <vector>

#include "accel/bvh/binning.h"
#include "accel/bvh/build_records.h"

namespace raybench {
namespace {

class Builder {
 public:
  Builder(const rb_geometry& geometry, const BinnedSahOptions& options, const volatile int* cancel)
      : options_(options), cancel_(cancel), records_(PrimCount(geometry)) {
    if (records_.size() >= kParallelRange) scratch_ = HugeArray<Record>(records_.size());
    tree_.nodes = HugeArray<BuildNode>(2 * records_.size());
    Recurse(MakeRecords(geometry, options.padded, records_), 0, 0);
    tree_.order = HugeArray<uint32_t>(records_.size());
    ForBlocks(0, records_.size(), [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) tree_.order[i] = records_[i].id();
    });
  }
  BinaryTree Take() { return std::move(tree_); }

 private:
  void Recurse(const RecordRange& range, uint32_t slot, uint32_t depth) {
    const size_t n = range.size();
    if (n >= kTaskRange) CheckCancel(cancel_);
    BuildNode& node = tree_.nodes[slot];
    SetBounds(node, range.box);

    if (n == 1 || options_.costs.NeverPays(n)) {
      SetLeaf(node, range.begin, n);
      return;
    }
    const Binning binning(range.centroids, std::min(options_.bins, uint32_t(4 + n / 4)));
    Split split;
    if (depth < kSahDepth) split = FindSplit(&records_[0], range, binning, options_.costs);
    if (n <= options_.costs.leaf_size && !options_.costs.Pays(split.cost, n, range.box.HalfArea())) {
      SetLeaf(node, range.begin, n);
      return;
    }

    RecordRange left{range.begin, range.begin}, right{range.end, range.end};
    if (split.axis < 0) {
      Halve(&records_[0], range, left, right);
    } else if (n >= kParallelRange) {
      PartitionInParallel(range, binning, split, left, right);
    } else {
      Partition(range, binning, split, left, right);
    }
    const uint32_t right_slot = SetInner(node, slot, left.size());
    Both(
        n, [&] { Recurse(left, slot + 1, depth + 1); }, [&] { Recurse(right, right_slot, depth + 1); });
  }

  /// Both sides' centroids, collected without a branch: which side a record goes to is anybody's guess.
  class Sides {
    using Corners = FloatN<8>;  // a box as lo and -hi

   public:
    Sides(const Binning& binning, const Split& split)
        : axis_(split.axis), bin_(split.bin), origin_(binning.origin[axis_]), scale_(binning.scale[axis_]) {}

    bool Add(const Record& r) {
      const bool is_left = IsLeft(r);
      const Float4 c = r.Centroid2();
      const Corners corners = __builtin_shufflevector(c, -c, 0, 1, 2, 3, 4, 5, 6, 7),
                    none = Splat<Corners>(std::numeric_limits<float>::infinity());
      const IntN<8> mask = Splat<IntN<8>>(-int32_t(is_left));
      left_ = Smaller<8>(mask ? corners : none, left_);
      right_ = Smaller<8>(mask ? none : corners, right_);
      return is_left;
    }
    bool IsLeft(const Record& r) const {
      // As Binning::Of.
      return int32_t((r.Centroid2()[axis_] - origin_) * scale_) < bin_;
    }
    void Into(RecordRange& left, RecordRange& right) const {
      left.centroids.Extend(BoxOf(left_));
      right.centroids.Extend(BoxOf(right_));
    }

   private:
    static Box4 BoxOf(Corners c) {
      return {__builtin_shufflevector(c, c, 0, 1, 2, 3), -__builtin_shufflevector(c, c, 4, 5, 6, 7)};
    }
    int axis_, bin_;
    float origin_, scale_;
    Corners left_ = Splat<Corners>(std::numeric_limits<float>::infinity()), right_ = left_;
  };

  void Partition(const RecordRange& range, const Binning& binning, const Split& split, RecordRange& left,
                 RecordRange& right) {
    Sides sides(binning, split);
    size_t l = range.begin;
    for (size_t i = range.begin; i < range.end; ++i) {
      const Record r = records_[i];
      records_[i] = records_[l];
      records_[l] = r;
      l += sides.Add(r);
    }
    left.end = right.begin = l;
    left.box = split.left;
    right.box = split.right;
    sides.Into(left, right);
  }

  /// Stable: each block counts its left side, then all blocks move their records to where they belong.
  void PartitionInParallel(const RecordRange& range, const Binning& binning, const Split& split,
                           RecordRange& left, RecordRange& right) {
    const Sides empty(binning, split);
    std::vector<Sides> sides((range.size() + kParallelBlock - 1) / kParallelBlock, empty);
    std::vector<size_t> starts(sides.size());  // how many go left: in the block, then before it
    ForBlocks(range.begin, range.end, [&](size_t begin, size_t end) {
      const size_t block = (begin - range.begin) / kParallelBlock;
      Sides own = empty;
      size_t lefts = 0;
      for (size_t i = begin; i < end; ++i) lefts += own.Add(records_[i]);
      sides[block] = own;
      starts[block] = lefts;
    });
    size_t lefts = 0;
    for (size_t block = 0; block < sides.size(); ++block) {
      lefts += std::exchange(starts[block], lefts);
      sides[block].Into(left, right);
    }
    left.end = right.begin = range.begin + lefts;
    left.box = split.left;
    right.box = split.right;
    ForBlocks(range.begin, range.end, [&](size_t begin, size_t end) {
      size_t l = range.begin + starts[(begin - range.begin) / kParallelBlock];
      size_t r = right.begin + (begin - l);
      for (size_t i = begin; i < end; ++i) {
        const bool is_left = empty.IsLeft(records_[i]);
        scratch_[is_left ? l : r] = records_[i];
        l += is_left;
        r += !is_left;
      }
    });
    ForBlocks(range.begin, range.end, [&](size_t begin, size_t end) {
      std::memcpy(static_cast<void*>(&records_[begin]), &scratch_[begin], (end - begin) * sizeof(Record));
    });
  }

  BinnedSahOptions options_;
  const volatile int* cancel_;
  HugeArray<Record> records_, scratch_;
  BinaryTree tree_;
};

}  // namespace

BinaryTree BuildBinnedSah(const rb_geometry& geometry, const BinnedSahOptions& options,
                          const volatile int* cancel) {
  return Builder(geometry, options, cancel).Take();
}

uint64_t BinnedSahPeakBytes(uint64_t prims) {
  return prims * (2 * sizeof(Record) + 2 * sizeof(BuildNode) + sizeof(uint32_t));
}

}  // namespace raybench
