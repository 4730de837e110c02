#include "accel/bvh/binned_sah.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "accel/bvh/binning.h"
#include "accel/bvh/build_records.h"
#include "accel/bvh/node_store.h"

namespace raybench {
namespace {

class Builder {
 public:
  Builder(const rb_geometry& geometry, const BinnedSahOptions& options, const volatile int* cancel)
      : options_(options) {
    const size_t n = PrimCount(geometry);
    tree_.order = HugeArray<uint32_t>(n);
    NodeStore store(n);
    NodeStore::Subtree all;
    {
      HugeArray<Record> records(n), other;
      if (n >= kParallelRange) other = HugeArray<Record>(n);
      const RecordRange range = MakeRecords(geometry, options.padded, records);
      all = BuildDown(
          Work{range, {records.data(), other.data()}, 0}, [this](auto&&... of) { return Divide(of...); },
          store, cancel);
    }
    tree_.nodes = store.Take(all);
  }
  BinaryTree Take() { return std::move(tree_); }

 private:
  /// Where records stand, and room for them that long ranges are partitioned to.
  struct Arrays {
    Record *records, *other;
  };
  struct Work {
    RecordRange range;
    Arrays in;
    uint32_t depth;

    size_t size() const { return range.size(); }
    size_t room() const { return size(); }
  };

  /// As BuildDown() wants it.
  bool Divide(const Work& work, BuildNode& node, Work& left, Work& right) {
    const RecordRange& range = work.range;
    const Arrays& in = work.in;
    const size_t n = range.size();
    SetBounds(node, range.box);
    if (n == 1 || options_.costs.NeverPays(n)) return Leaf(work, node);

    const Binning binning(range.centroids, std::min(options_.bins, uint32_t(4 + n / 4)));
    BlockBins blocks;
    Split split;
    if (work.depth < kSahDepth) split = FindSplit(in.records, range, binning, options_.costs, blocks);
    if (n <= options_.costs.leaf_size && !options_.costs.Pays(split.cost, n, range.box.HalfArea()))
      return Leaf(work, node);

    left = {{range.begin, range.begin, split.left}, in, work.depth + 1};
    right = {{range.end, range.end, split.right}, in, work.depth + 1};
    if (split.axis < 0) {
      Halve(in.records, range, left.range, right.range);
    } else if (n >= kParallelRange) {
      PartitionInParallel(range, in, binning, split, blocks, left.range, right.range);
      left.in = right.in = {in.other, in.records};
    } else {
      Partition(range, in.records, binning, split, left.range, right.range);
    }
    return true;
  }

  bool Leaf(const Work& work, BuildNode& node) {
    SetLeaf(node, work.range.begin, work.range.size());
    for (size_t i = work.range.begin; i < work.range.end; ++i) tree_.order[i] = work.in.records[i].id();
    return false;
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

  static void Partition(const RecordRange& range, Record* records, const Binning& binning, const Split& split,
                        RecordRange& left, RecordRange& right) {
    Sides sides(binning, split);
    size_t l = range.begin;
    for (size_t i = range.begin; i < range.end; ++i) {
      const Record r = records[i];
      records[i] = records[l];
      records[l] = r;
      l += sides.Add(r);
    }
    left.end = right.begin = l;
    sides.Into(left, right);
  }

  /// Stable: bins tell how many of a block go left, so each block moves its records to where they belong.
  static void PartitionInParallel(const RecordRange& range, const Arrays& in, const Binning& binning,
                                  const Split& split, const BlockBins& blocks, RecordRange& left,
                                  RecordRange& right) {
    std::vector<size_t> lefts(blocks.size());  // before each block
    size_t sum = 0;
    for (size_t b = 0; b < blocks.size(); ++b) {
      lefts[b] = sum;
      for (uint32_t bin = 0; bin < uint32_t(split.bin); ++bin)
        sum += size_t(blocks[b].Count(split.axis, bin));
    }
    left.end = right.begin = range.begin + sum;
    std::vector<Sides> sides(blocks.size(), Sides(binning, split));
    ForBlocks(range.begin, range.end, [&](size_t begin, size_t end) {
      const size_t block = (begin - range.begin) / kParallelBlock;
      Sides own = sides[block];
      size_t l = range.begin + lefts[block], r = right.begin + (begin - l);
      for (size_t i = begin; i < end; ++i) {
        const Record record = in.records[i];
        const bool is_left = own.Add(record);
        in.other[is_left ? l : r] = record;
        l += is_left;
        r += !is_left;
      }
      sides[block] = own;
    });
    for (const Sides& own : sides) own.Into(left, right);
  }

  BinnedSahOptions options_;
  BinaryTree tree_;
};

}  // namespace

BinaryTree BuildBinnedSah(const rb_geometry& geometry, const BinnedSahOptions& options,
                          const volatile int* cancel) {
  return Builder(geometry, options, cancel).Take();
}

uint64_t BinnedSahPeakBytes(uint64_t prims) {
  const uint64_t records = 2 * prims * sizeof(Record) + BlocksIn(prims) * sizeof(Bins);
  return NodeStore::Bytes(prims) + std::max(records, NodeStore::Bytes(prims)) + prims * sizeof(uint32_t);
}

}  // namespace raybench
