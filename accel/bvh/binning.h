// Splitting ranges of primitives at the planes between bins of their centroids (Wald 2007); shared
// by builders.
#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>

#include "accel/base/parallel.h"
#include "accel/bvh/build_records.h"

namespace raybench {

inline constexpr uint32_t kMaxBins = 64;

/// Maps centroids to bins; the same arithmetic bins and partitions.
struct Binning {
  Float4 origin, scale;
  Int4 last;
  uint32_t bins;

  Binning(const Box4& centroids, uint32_t count) : origin(centroids.lo), bins(count) {
    const Float4 extent = centroids.hi - centroids.lo;
    for (int a = 0; a < 4; ++a) {
      const float s = float(count) * 0.9999f / extent[a];
      scale[a] = a < 3 && extent[a] > 0 && s <= std::numeric_limits<float>::max() ? s : 0;
      last[a] = int32_t(count) - 1;
    }
  }
  bool Usable(int axis) const { return scale[axis] > 0; }
  Int4 Of(const Record& r) const {
    const Int4 bin = __builtin_convertvector((r.Centroid2() - origin) * scale, Int4);
    return bin < last ? bin : last;
  }
};

/// SahCosts::Blocks of four numbers at once.
class BlockCount {
 public:
  explicit BlockCount(const SahCosts& costs)
      : size_(int32_t(costs.block_size)),
        shift_(std::has_single_bit(costs.block_size) ? std::countr_zero(costs.block_size) : -1) {}
  Float4 operator()(Int4 prims) const {
    Int4 blocks = prims + (size_ - 1);
    if (shift_ >= 0) [[likely]] {
      blocks >>= shift_;
    } else {
      blocks /= size_;
    }
    return __builtin_convertvector(blocks, Float4);
  }

 private:
  int32_t size_, shift_;
};

/// What was found in each bin of each axis.
class alignas(64) Bins {
  /// A box as lo and -hi, so that one minimum extends it; an integer in the last lane counts.
  using Entry = FloatN<8>;

 public:
  explicit Bins(uint32_t bins) {
    constexpr float kInf = std::numeric_limits<float>::infinity();
    const Entry none = {kInf, kInf, kInf, kInf, kInf, kInf, kInf, 0};
    for (Entry(&axis)[kMaxBins] : entries_) std::fill_n(axis, bins, none);
  }
  void Add(const Record& r, const Binning& binning) {
    constexpr int32_t kSign = int32_t(0x80000000u);
    const Vec<uint32_t, 4> at = Vec<uint32_t, 4>(binning.Of(r)) * uint32_t(sizeof(Entry));
    const Entry corners = Entry(Load<IntN<8>>(reinterpret_cast<const int32_t*>(&r)) ^
                                IntN<8>{0, 0, 0, 0, kSign, kSign, kSign, kSign});
    for (int a = 0; a < 3; ++a) {
      Entry& sum = *reinterpret_cast<Entry*>(reinterpret_cast<std::byte*>(entries_[a]) + at[a]);
      sum = Sum(corners, sum, 1);
    }
  }
  void Merge(const Bins& o, uint32_t bins) {
    for (int a = 0; a < 3; ++a) {
      for (uint32_t b = 0; b < bins; ++b)
        entries_[a][b] = Sum(o.entries_[a][b], entries_[a][b], o.Count(a, b));
    }
  }
  int32_t Count(int axis, uint32_t bin) const { return IntN<8>(entries_[axis][bin])[7]; }
  Box4 Box(int axis, uint32_t from, uint32_t to) const {
    Entry e = entries_[axis][from];
    for (uint32_t b = from + 1; b < to; ++b) e = Smaller<8>(entries_[axis][b], e);
    return {__builtin_shufflevector(e, e, 0, 1, 2, 3), -__builtin_shufflevector(e, e, 4, 5, 6, 7)};
  }

  /// A sum over bins, of all axes.
  class Running {
   public:
    void Add(const Bins& bins, uint32_t bin) {
      for (int a = 0; a < 3; ++a) box_[a] = Smaller<8>(bins.entries_[a][bin], box_[a]);
      counts_ += Int4{bins.Count(0, bin), bins.Count(1, bin), bins.Count(2, bin), 0};
    }
    /// Lane a: of the sum along axis a. NaN if there is none.
    Float4 Cost(const BlockCount& blocks) const {
      const Float4 x = NegativeExtent(0), y = NegativeExtent(1), z = NegativeExtent(2);
      const Float4 low = __builtin_shufflevector(x, y, 0, 4, 1, 5),
                   high = __builtin_shufflevector(x, y, 2, 6, 2, 6),
                   e0 = __builtin_shufflevector(low, z, 0, 1, 4, 4),
                   e1 = __builtin_shufflevector(low, z, 2, 3, 5, 5),
                   e2 = __builtin_shufflevector(high, z, 0, 1, 6, 6);
      return (e0 * e1 + e1 * e2 + e2 * e0) * blocks(counts_);
    }

   private:
    Float4 NegativeExtent(int axis) const {
      const Entry e = box_[axis];
      return __builtin_shufflevector(e, e, 0, 1, 2, 3) + __builtin_shufflevector(e, e, 4, 5, 6, 7);
    }
    static constexpr float kInf = std::numeric_limits<float>::infinity();
    Entry box_[3] = {Splat<Entry>(kInf), Splat<Entry>(kInf), Splat<Entry>(kInf)};
    Int4 counts_{};
  };

 private:
  static Entry Sum(Entry box, Entry sum, int32_t count) {
    const IntN<8> is_count{0, 0, 0, 0, 0, 0, 0, -1};
    return is_count ? Entry(IntN<8>(sum) + IntN<8>{0, 0, 0, 0, 0, 0, 0, count}) : Smaller<8>(box, sum);
  }

  Entry entries_[3][kMaxBins];
};

struct Split {
  float cost = std::numeric_limits<float>::infinity();  // of both sides, times area
  int axis = -1;
  int bin = 0;  // the first bin of the right side
  Box4 left = Box4::Empty(), right = Box4::Empty();
};

/// The cheapest plane between bins. Sides without a primitive are none: they cost NaN.
inline Split BestSplit(const Bins& bins, uint32_t count, const SahCosts& costs) {
  const BlockCount blocks(costs);
  Float4 right_cost[kMaxBins];
  Bins::Running sum;
  for (uint32_t b = count - 1; b > 0; --b) {
    sum.Add(bins, b);
    right_cost[b] = sum.Cost(blocks);
  }
  sum = {};
  Float4 best_cost = Splat<Float4>(std::numeric_limits<float>::infinity());
  Int4 best_bin{};
  for (uint32_t b = 1; b < count; ++b) {
    sum.Add(bins, b - 1);
    const Float4 cost = sum.Cost(blocks) + right_cost[b];
    const Int4 is_better = cost < best_cost;
    best_cost = is_better ? cost : best_cost;
    best_bin = is_better ? Splat<Int4>(int32_t(b)) : best_bin;
  }
  Split best;
  for (int axis = 0; axis < 3; ++axis) {
    if (best_cost[axis] < best.cost) best.cost = best_cost[axis], best.axis = axis, best.bin = best_bin[axis];
  }
  if (best.axis >= 0) {
    best.left = bins.Box(best.axis, 0, uint32_t(best.bin));
    best.right = bins.Box(best.axis, uint32_t(best.bin), count);
  }
  return best;
}

/// Records to bins, every second one to bins of its own: what was just stored to a bin is not there to be loaded yet.
inline Bins BinsOf(const Record* records, size_t n, const Binning& binning) {
  constexpr size_t kApart = 128;  // fewer are sooner done than another set of bins
  Bins bins(binning.bins);
  size_t i = 0;
  if (n >= kApart) {
    Bins others(binning.bins);
    for (; i + 1 < n; i += 2) bins.Add(records[i], binning), others.Add(records[i + 1], binning);
    bins.Merge(others, binning.bins);
  }
  for (; i < n; ++i) bins.Add(records[i], binning);
  return bins;
}

/// The bins of each block (as ForBlocks cuts) of a long range.
using BlockBins = HugeArray<Bins>;

/// Bins a range and takes the cheapest plane; `axis` is -1 if no plane separates the centroids. Fills `blocks` if the
/// range is long.
inline Split FindSplit(const Record* records, const RecordRange& range, const Binning& binning,
                       const SahCosts& costs, BlockBins& blocks) {
  if (range.size() < kParallelRange)
    return BestSplit(BinsOf(&records[range.begin], range.size(), binning), binning.bins, costs);
  blocks = BlockBins(BlocksIn(range.size()));
  ForBlocks(range.begin, range.end, [&](size_t begin, size_t end) {
    blocks[(begin - range.begin) / kParallelBlock] = BinsOf(&records[begin], end - begin, binning);
  });
  Bins all(binning.bins);
  for (size_t b = 0; b < blocks.size(); ++b) all.Merge(blocks[b], binning.bins);
  return BestSplit(all, binning.bins, costs);
}

/// Splits a range in the middle of its records, however they stand.
inline void Halve(const Record* records, const RecordRange& range, RecordRange& left, RecordRange& right) {
  left.end = right.begin = range.begin + range.size() / 2;
  for (size_t i = left.begin; i < left.end; ++i) left.Extend(records[i]);
  for (size_t i = right.begin; i < right.end; ++i) right.Extend(records[i]);
}

}  // namespace raybench
