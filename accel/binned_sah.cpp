#include "accel/binned_sah.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <utility>
#include <vector>

#include "accel/ray_bounds.h"
#include "accel/simd.h"
#include "accel/structure.h"

namespace raybench {
namespace {

constexpr uint32_t kMaxBins = 64;
constexpr size_t kParallelRange = size_t{1}
                                  << 16;  // ranges from here on are binned and partitioned in parallel
constexpr size_t kParallelBlock = size_t{1} << 13;
constexpr size_t kTaskRange = size_t{1} << 11;  // subtrees from here on are tasks

struct Box4 {
  Float4 lo, hi;

  static Box4 Empty() {
    constexpr float kInf = std::numeric_limits<float>::infinity();
    return {Splat4(kInf), Splat4(-kInf)};
  }
  void Extend(Float4 p) { lo = MinOrSecond(p, lo), hi = MaxOrSecond(p, hi); }
  void Extend(const Box4& b) { lo = MinOrSecond(b.lo, lo), hi = MaxOrSecond(b.hi, hi); }
  float HalfArea() const {
    const Float4 e = hi - lo;
    return e[0] * e[1] + e[1] * e[2] + e[2] * e[0];
  }
};

/// A primitive's bounds; the id rides in the fourth lane of lo, where arithmetic ignores it.
struct alignas(16) Record {
  Float4 lo, hi;

  Float4 Centroid2() const { return lo + hi; }
  uint32_t id() const {
    uint32_t bits;
    std::memcpy(&bits, reinterpret_cast<const char*>(&lo) + 12, sizeof bits);
    return bits;
  }
};

struct Range {
  size_t begin, end;
  Box4 box = Box4::Empty(), centroids = Box4::Empty();

  size_t size() const { return end - begin; }
  void Extend(const Record& r) { box.Extend({r.lo, r.hi}), centroids.Extend(r.Centroid2()); }
  void Extend(const Range& r) { box.Extend(r.box), centroids.Extend(r.centroids); }
};

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
  Box4 box[3][kMaxBins];
  uint32_t count[3][kMaxBins];

  explicit Bins(uint32_t bins) {
    for (int a = 0; a < 3; ++a) {
      for (uint32_t b = 0; b < bins; ++b) box[a][b] = Box4::Empty(), count[a][b] = 0;
    }
  }
  void Add(const Record* r, size_t n, const Binning& binning) {
    for (size_t i = 0; i < n; ++i) {
      const Int4 bin = binning.Of(r[i]);
      const Box4 b{r[i].lo, r[i].hi};
      for (int a = 0; a < 3; ++a) box[a][bin[a]].Extend(b), ++count[a][bin[a]];
    }
  }
  void Merge(const Bins& o, uint32_t bins) {
    for (int a = 0; a < 3; ++a) {
      for (uint32_t b = 0; b < bins; ++b) box[a][b].Extend(o.box[a][b]), count[a][b] += o.count[a][b];
    }
  }
};

struct Split {
  float cost = std::numeric_limits<float>::infinity();  // of both sides, times area
  int axis = -1;
  int bin = 0;  // the first bin of the right side
  Box4 left = Box4::Empty(), right = Box4::Empty();
};

class Builder {
 public:
  Builder(const rb_geometry& geometry, const BinnedSahOptions& options, const volatile int* cancel)
      : options_(options), cancel_(cancel), records_(PrimCount(geometry)) {
    if (records_.size() >= kParallelRange) scratch_ = HugeArray<Record>(records_.size());
    tree_.nodes = HugeArray<BuildNode>(2 * records_.size());
    Recurse(MakeRecords(geometry), 0, 0);
    tree_.order = HugeArray<uint32_t>(records_.size());
    ForBlocks(0, records_.size(), [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) tree_.order[i] = records_[i].id();
    });
  }
  BinaryTree Take() { return std::move(tree_); }

 private:
  /// fn(begin, end) over blocks of kParallelBlock entries, in parallel.
  template <class Fn>
  static void ForBlocks(size_t begin, size_t end, Fn&& fn) {
    const size_t blocks = (end - begin + kParallelBlock - 1) / kParallelBlock;
    tbb::parallel_for(size_t{0}, blocks, [&](size_t b) {
      const size_t first = begin + b * kParallelBlock;
      fn(first, std::min(first + kParallelBlock, end));
    });
  }

  Range MakeRecords(const rb_geometry& geometry) {
    return tbb::parallel_reduce(
        tbb::blocked_range<size_t>(0, records_.size(), kParallelBlock), Range{0, records_.size()},
        [&](const auto& block, Range sum) {
          for (size_t i = block.begin(); i < block.end(); ++i) {
            const uint32_t id = uint32_t(i);
            const Bounds3 b = options_.padded ? PaddedPrimBounds(geometry, id) : PrimBounds(geometry, id);
            Record& record = records_[i];
            record.lo = Float4{b.lo.x, b.lo.y, b.lo.z, 0}, record.hi = Float4{b.hi.x, b.hi.y, b.hi.z, 0};
            sum.Extend(record);
            std::memcpy(reinterpret_cast<char*>(&record.lo) + 12, &id, sizeof id);
          }
          return sum;
        },
        [](Range a, const Range& b) {
          a.Extend(b);
          return a;
        });
  }

  void Recurse(const Range& range, uint32_t slot, uint32_t depth) {
    const size_t n = range.size();
    if (n >= kTaskRange && cancel_ != nullptr && *cancel_ != 0) throw std::runtime_error("cancelled");
    BuildNode& node = tree_.nodes[slot];
    for (int a = 0; a < 3; ++a) node.lo[a] = range.box.lo[a], node.hi[a] = range.box.hi[a];

    const Binning binning(range.centroids, std::min(options_.bins, uint32_t(4 + n / 4)));
    Split split;
    if (n > 1 && depth < kSahDepth) split = FindSplit(range, binning);
    const float area = range.box.HalfArea();
    const bool splitting_pays = split.cost + options_.traversal_cost * area < Blocks(uint32_t(n)) * area;
    if (n == 1 || (n <= options_.leaf_size && !splitting_pays)) {
      node.right = 0, node.first = uint32_t(range.begin), node.count = uint32_t(n);
      return;
    }

    Range left{range.begin, range.begin}, right{range.end, range.end};
    if (split.axis < 0) {
      Halve(range, left, right);
    } else if (n >= kParallelRange) {
      PartitionInParallel(range, binning, split, left, right);
    } else {
      Partition(range, binning, split, left, right);
    }
    node.right = slot + 2 * uint32_t(left.size()), node.first = 0, node.count = 0;
    auto go_left = [&] { Recurse(left, slot + 1, depth + 1); };
    auto go_right = [&] { Recurse(right, node.right, depth + 1); };
    if (n >= kTaskRange) {
      tbb::parallel_invoke(go_left, go_right);
    } else {
      go_left(), go_right();
    }
  }

  float Blocks(uint32_t n) const { return float((n + options_.block_size - 1) / options_.block_size); }

  Split FindSplit(const Range& range, const Binning& binning) {
    if (range.size() < kParallelRange) {
      Bins bins(binning.bins);
      bins.Add(&records_[range.begin], range.size(), binning);
      return Best(bins, binning);
    }
    const Bins bins = tbb::parallel_reduce(
        tbb::blocked_range<size_t>(range.begin, range.end, kParallelBlock), Bins(binning.bins),
        [&](const auto& block, Bins sum) {
          sum.Add(&records_[block.begin()], block.size(), binning);
          return sum;
        },
        [&](Bins a, const Bins& b) {
          a.Merge(b, binning.bins);
          return a;
        });
    return Best(bins, binning);
  }

  Split Best(const Bins& bins, const Binning& binning) const {
    Split best;
    for (int axis = 0; axis < 3; ++axis) {
      if (!binning.Usable(axis)) continue;
      float right_cost[kMaxBins];
      Box4 box = Box4::Empty();
      uint32_t count = 0;
      for (uint32_t b = binning.bins - 1; b > 0; --b) {
        box.Extend(bins.box[axis][b]), count += bins.count[axis][b];
        right_cost[b] = count == 0 ? -1 : box.HalfArea() * Blocks(count);
      }
      box = Box4::Empty(), count = 0;
      for (uint32_t b = 1; b < binning.bins; ++b) {
        box.Extend(bins.box[axis][b - 1]), count += bins.count[axis][b - 1];
        if (count == 0 || right_cost[b] < 0) continue;
        const float cost = box.HalfArea() * Blocks(count) + right_cost[b];
        if (cost < best.cost) best.cost = cost, best.axis = axis, best.bin = int32_t(b), best.left = box;
      }
    }
    if (best.axis >= 0) {
      for (uint32_t b = uint32_t(best.bin); b < binning.bins; ++b) best.right.Extend(bins.box[best.axis][b]);
    }
    return best;
  }

  void Halve(const Range& range, Range& left, Range& right) {
    left.end = right.begin = range.begin + range.size() / 2;
    for (size_t i = left.begin; i < left.end; ++i) left.Extend(records_[i]);
    for (size_t i = right.begin; i < right.end; ++i) right.Extend(records_[i]);
  }

  /// Both sides' centroids, collected without a branch: which side a record goes to is anybody's guess.
  class Sides {
   public:
    Sides(const Binning& binning, const Split& split)
        : axis_(split.axis), bin_(split.bin), origin_(binning.origin[axis_]), scale_(binning.scale[axis_]) {}

    bool Add(const Record& r) {
      const Float4 c = r.Centroid2();
      const bool is_left = int32_t((c[axis_] - origin_) * scale_) < bin_;  // as Binning::Of
      const int32_t lanes = -int32_t(is_left);
      const Int4 mask{lanes, lanes, lanes, lanes};
      const Box4 none = Box4::Empty();
      left_.lo = MinOrSecond(mask ? c : none.lo, left_.lo),
      left_.hi = MaxOrSecond(mask ? c : none.hi, left_.hi);
      right_.lo = MinOrSecond(mask ? none.lo : c, right_.lo),
      right_.hi = MaxOrSecond(mask ? none.hi : c, right_.hi);
      return is_left;
    }
    bool IsLeft(const Record& r) const { return int32_t((r.Centroid2()[axis_] - origin_) * scale_) < bin_; }
    void Into(Range& left, Range& right) const {
      left.centroids.Extend(left_), right.centroids.Extend(right_);
    }

   private:
    int axis_, bin_;
    float origin_, scale_;
    Box4 left_ = Box4::Empty(), right_ = Box4::Empty();
  };

  void Partition(const Range& range, const Binning& binning, const Split& split, Range& left, Range& right) {
    Sides sides(binning, split);
    size_t l = range.begin;
    for (size_t i = range.begin; i < range.end; ++i) {
      const Record r = records_[i];
      records_[i] = records_[l];
      records_[l] = r;
      l += sides.Add(r);
    }
    left.end = right.begin = l;
    left.box = split.left, right.box = split.right;
    sides.Into(left, right);
  }

  /// Stable: each block counts its left side, then all blocks move their records to where they belong.
  void PartitionInParallel(const Range& range, const Binning& binning, const Split& split, Range& left,
                           Range& right) {
    const Sides empty(binning, split);
    std::vector<Sides> sides((range.size() + kParallelBlock - 1) / kParallelBlock, empty);
    std::vector<size_t> starts(sides.size());  // how many go left: in the block, then before it
    ForBlocks(range.begin, range.end, [&](size_t begin, size_t end) {
      const size_t block = (begin - range.begin) / kParallelBlock;
      Sides own = empty;
      size_t lefts = 0;
      for (size_t i = begin; i < end; ++i) lefts += own.Add(records_[i]);
      sides[block] = own, starts[block] = lefts;
    });
    size_t lefts = 0;
    for (size_t block = 0; block < sides.size(); ++block) {
      lefts += std::exchange(starts[block], lefts);
      sides[block].Into(left, right);
    }
    left.end = right.begin = range.begin + lefts;
    left.box = split.left, right.box = split.right;
    ForBlocks(range.begin, range.end, [&](size_t begin, size_t end) {
      size_t l = range.begin + starts[(begin - range.begin) / kParallelBlock];
      size_t r = right.begin + (begin - l);
      for (size_t i = begin; i < end; ++i) {
        const bool is_left = empty.IsLeft(records_[i]);
        scratch_[is_left ? l : r] = records_[i];
        l += is_left, r += !is_left;
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
