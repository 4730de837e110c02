// Splitting ranges of primitives at the planes between bins of their centroids (Wald 2007); shared
// by builders.
#pragma once

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

struct Bins {
  /// A box as lo and -hi: one minimum extends it. Aligned as tasks are.
  using Corners = FloatN<8>;
  using StoredCorners __attribute__((aligned(16))) = Corners;
  StoredCorners box[3][kMaxBins];
  uint32_t count[3][kMaxBins];

  explicit Bins(uint32_t bins) {
    for (int a = 0; a < 3; ++a) {
      for (uint32_t b = 0; b < bins; ++b)
        box[a][b] = Splat<Corners>(std::numeric_limits<float>::infinity()), count[a][b] = 0;
    }
  }
  void Add(const Record* r, size_t n, const Binning& binning) {
    constexpr int32_t kSign = int32_t(0x80000000u);
    for (size_t i = 0; i < n; ++i) {
      const Int4 bin = binning.Of(r[i]);
      const Corners corners = Corners(Load<IntN<8>>(reinterpret_cast<const int32_t*>(&r[i])) ^
                                      IntN<8>{0, 0, 0, 0, kSign, kSign, kSign, kSign});
      for (int a = 0; a < 3; ++a) {
        StoredCorners& sum = box[a][bin[a]];
        sum = MinOrSecond<Corners>(corners, sum);
        ++count[a][bin[a]];
      }
    }
  }
  void Merge(const Bins& o, uint32_t bins) {
    for (int a = 0; a < 3; ++a) {
      for (uint32_t b = 0; b < bins; ++b)
        box[a][b] = MinOrSecond<Corners>(o.box[a][b], box[a][b]), count[a][b] += o.count[a][b];
    }
  }
  Box4 Box(int axis, uint32_t bin) const {
    const Corners c = box[axis][bin];
    return {__builtin_shufflevector(c, c, 0, 1, 2, 3), -__builtin_shufflevector(c, c, 4, 5, 6, 7)};
  }
};

struct Split {
  float cost = std::numeric_limits<float>::infinity();  // of both sides, times area
  int axis = -1;
  int bin = 0;  // the first bin of the right side
  Box4 left = Box4::Empty(), right = Box4::Empty();
};

/// The cheapest plane between bins. Sides without a primitive are none.
inline Split BestSplit(const Bins& bins, const Binning& binning, const SahCosts& costs) {
  Split best;
  for (int axis = 0; axis < 3; ++axis) {
    if (!binning.Usable(axis)) continue;
    float right_cost[kMaxBins];
    Box4 box = Box4::Empty();
    uint32_t count = 0;
    for (uint32_t b = binning.bins - 1; b > 0; --b) {
      box.Extend(bins.Box(axis, b)), count += bins.count[axis][b];
      right_cost[b] = count == 0 ? -1 : box.HalfArea() * costs.Blocks(count);
    }
    box = Box4::Empty(), count = 0;
    for (uint32_t b = 1; b < binning.bins; ++b) {
      box.Extend(bins.Box(axis, b - 1)), count += bins.count[axis][b - 1];
      if (count == 0 || right_cost[b] < 0) continue;
      const float cost = box.HalfArea() * costs.Blocks(count) + right_cost[b];
      if (cost < best.cost) best.cost = cost, best.axis = axis, best.bin = int32_t(b), best.left = box;
    }
  }
  if (best.axis >= 0) {
    for (uint32_t b = uint32_t(best.bin); b < binning.bins; ++b) best.right.Extend(bins.Box(best.axis, b));
  }
  return best;
}

/// Bins a range and takes the cheapest plane; `axis` is -1 if no plane separates the centroids.
inline Split FindSplit(const Record* records, const RecordRange& range, const Binning& binning,
                       const SahCosts& costs) {
  if (range.size() < kParallelRange) {
    Bins bins(binning.bins);
    bins.Add(&records[range.begin], range.size(), binning);
    return BestSplit(bins, binning, costs);
  }
  const Bins bins = ParallelReduce(
      Range<size_t>(range.begin, range.end, kParallelBlock), Bins(binning.bins),
      [&](const auto& block, Bins sum) {
        sum.Add(&records[block.begin()], block.size(), binning);
        return sum;
      },
      [&](Bins a, const Bins& b) {
        a.Merge(b, binning.bins);
        return a;
      });
  return BestSplit(bins, binning, costs);
}

/// Splits a range in the middle of its records, however they stand.
inline void Halve(const Record* records, const RecordRange& range, RecordRange& left, RecordRange& right) {
  left.end = right.begin = range.begin + range.size() / 2;
  for (size_t i = left.begin; i < left.end; ++i) left.Extend(records[i]);
  for (size_t i = right.begin; i < right.end; ++i) right.Extend(records[i]);
}

}  // namespace raybench
