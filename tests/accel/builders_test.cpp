// What builders of BVHs share: bins, Morton order, nodes in depth-first order.
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>
#include <vector>

#include "accel/base/random.h"
#include "accel/bvh/binned_sah.h"
#include "accel/bvh/binning.h"
#include "accel/bvh/linear.h"
#include "accel/bvh/morton.h"
#include "accel/bvh/spatial_sah.h"
#include "accel/bvh/sweep_sah.h"
#include "tests/support/meshes.h"

namespace raybench::testing {
namespace {

/// Small boxes in the cube from 0 to `size`; on a coarse grid where many things are equal.
HugeArray<Record> RandomRecords(size_t n, float size, bool on_grid, uint64_t seed) {
  Random random(seed);
  const auto number = [&] { return on_grid ? float(random.Below(6)) : random.NextFloat(); };
  HugeArray<Record> records(n);
  for (size_t i = 0; i < n; ++i) {
    const Float4 lo = Float4{number(), number(), number(), 0} * size;
    records[i].lo = lo, records[i].hi = lo + Float4{number(), number(), number(), 0} * (size * 0.0625f);
    records[i].SetId(uint32_t(i));
  }
  return records;
}

RecordRange RangeOf(const HugeArray<Record>& records) {
  RecordRange range{0, records.size()};
  for (size_t i = 0; i < records.size(); ++i) range.Extend(records[i]);
  return range;
}

/// Weighs each plane by itself.
Split SlowSplit(const HugeArray<Record>& records, const Binning& binning, const SahCosts& costs) {
  Split best;
  for (int axis = 0; axis < 3; ++axis) {
    for (int bin = 1; bin < int(binning.bins); ++bin) {
      Box4 boxes[2] = {Box4::Empty(), Box4::Empty()};
      size_t counts[2] = {0, 0};
      for (size_t i = 0; i < records.size(); ++i) {
        const int side = binning.Of(records[i])[axis] >= bin;
        boxes[side].Extend({records[i].lo, records[i].hi});
        ++counts[side];
      }
      if (counts[0] == 0 || counts[1] == 0) continue;
      const float cost =
          boxes[0].HalfArea() * costs.Blocks(counts[0]) + boxes[1].HalfArea() * costs.Blocks(counts[1]);
      if (cost < best.cost) best = {cost, axis, bin, boxes[0], boxes[1]};
    }
  }
  return best;
}

bool SameBox(const Box4& a, const Box4& b) { return (Mask((a.lo == b.lo) & (a.hi == b.hi)) & 7u) == 7u; }

TEST(Binning, TakesTheFirstOfTheCheapestPlanes) {
  for (const size_t n : {2, 9, 40, 127, 128, 301}) {
    for (const bool on_grid : {false, true}) {
      const HugeArray<Record> records = RandomRecords(n, 10, on_grid, n);
      const RecordRange range = RangeOf(records);
      for (const uint32_t block : {8u, 4u, 3u}) {
        const SahCosts costs{block, block, 1.5f};
        const Binning binning(range.centroids, uint32_t(std::min<size_t>(32, 4 + n / 4)));
        BlockBins blocks;
        const Split fast = FindSplit(&records[0], range, binning, costs, blocks),
                    slow = SlowSplit(records, binning, costs);
        ASSERT_EQ(fast.axis, slow.axis) << n;
        EXPECT_EQ(fast.cost, slow.cost);
        EXPECT_EQ(fast.bin, slow.bin);
        EXPECT_TRUE(SameBox(fast.left, slow.left) && SameBox(fast.right, slow.right));
      }
    }
  }
}

TEST(Binning, BlocksOfLongRangesAddUp) {
  const HugeArray<Record> records = RandomRecords(kParallelRange + 5, 1, false, 3);
  const RecordRange range = RangeOf(records);
  const Binning binning(range.centroids, 32);
  BlockBins blocks;
  const Split split = FindSplit(&records[0], range, binning, {8, 8, 1.5f}, blocks);
  ASSERT_GE(split.axis, 0);
  ASSERT_EQ(blocks.size(), kParallelRange / kParallelBlock + 1);
  for (size_t b = 0; b < blocks.size(); ++b) {
    int32_t counts[32] = {};
    for (size_t i = b * kParallelBlock; i < std::min((b + 1) * kParallelBlock, records.size()); ++i)
      ++counts[binning.Of(records[i])[split.axis]];
    for (uint32_t bin = 0; bin < 32; ++bin)
      ASSERT_EQ(blocks[b].Count(split.axis, bin), counts[bin]) << b << " " << bin;
  }
}

TEST(Binning, WhatHasNoPlaneHasNoSplit) {
  HugeArray<Record> records = RandomRecords(50, 1, false, 1);
  for (size_t i = 1; i < records.size(); ++i) records[i].lo = records[0].lo, records[i].hi = records[0].hi;
  const RecordRange range = RangeOf(records);
  BlockBins blocks;
  EXPECT_EQ(FindSplit(&records[0], range, Binning(range.centroids, 16), {8, 8, 1.5f}, blocks).axis, -1);
}

/// The rule: the highest bit in which codes differ.
size_t SlowCut(const std::vector<uint64_t>& codes, size_t begin, size_t end) {
  const uint64_t changes = codes[begin] ^ codes[end - 1];
  if (changes == 0) return begin;
  size_t cut = begin;
  while ((codes[cut] & std::bit_floor(changes)) == 0) ++cut;
  return cut;
}

TEST(MortonOrder, SortsByCodeThenByNumber) {
  struct Case {
    size_t n;
    float size;
    bool on_grid;
  };
  // A far one leaves few cells, or a single one, to all others.
  for (const auto& [n, size, on_grid] :
       {Case{5000, 100, false}, Case{5000, 100, true}, Case{5000, 0.01f, false}, Case{40, 1e-6f, false},
        Case{1, 1, false}}) {
    HugeArray<Record> records = RandomRecords(n, size, on_grid, n);
    records[n - 1].lo = records[n - 1].hi = Splat<Float4>(1000);
    records[n - 1].SetId(uint32_t(n - 1));
    const Box4 centroids = RangeOf(records).centroids;
    const MortonOrder order(records, centroids);
    const MortonGrid grid(centroids);
    std::vector<uint32_t> prims(n);
    std::iota(prims.begin(), prims.end(), 0u);
    std::sort(prims.begin(), prims.end(), [&](uint32_t a, uint32_t b) {
      const uint64_t code_a = grid.Code(records[a]), code_b = grid.Code(records[b]);
      return code_a != code_b ? code_a < code_b : a < b;
    });
    std::vector<uint64_t> codes;
    for (size_t i = 0; i < n; ++i) {
      ASSERT_EQ(order.prim(i), prims[i]) << size << " " << i;
      codes.push_back(grid.Code(records[prims[i]]));
    }
    Random random(1);
    for (int k = 0; k < 1000 && n > 1; ++k) {
      size_t begin = random.Below(n),
             end = begin + 1 + random.Below(std::min(n - begin, size_t{1} << (k % 12)));
      ASSERT_EQ(order.Cut(begin, end), SlowCut(codes, begin, end)) << size << " " << begin << " " << end;
    }
  }
}

TEST(MortonOrder, CodesInterleaveTheBitsOfCells) {
  HugeArray<Record> records(3);
  records[0].lo = records[0].hi = Float4{0, 0, 0, 0};
  records[1].lo = records[1].hi = Float4{0x1p20f, 0x1p20f, 0x1p20f, 0};
  records[2].lo = records[2].hi = Float4{0x0.8p0f, 3, 0x1p19f, 0};
  const MortonGrid grid(RangeOf(records).centroids);
  EXPECT_EQ(grid.Code(records[0]), 0u);
  EXPECT_EQ(grid.Code(records[1]), (uint64_t{1} << kMortonBits) - 1);
  EXPECT_EQ(grid.Code(records[2]), 1u << 2 | 1u << 4 | 1u << 7 | uint64_t{1} << 60);
}

TEST(Builders, NodesStandInDepthFirstOrderWithoutGaps) {
  const Mesh mesh = Ball(5);  // tasks are joined
  const rb_geometry geometry = mesh.Geometry();
  const SahCosts costs{4, 4, 1.0f};
  const BinaryTree trees[] = {
      BuildBinnedSah(geometry, {16, costs, true}, nullptr), BuildSweepSah(geometry, costs, true, nullptr),
      BuildSpatialSah(geometry, {16, 1, costs, true}, nullptr), BuildLinear(geometry, costs, true, nullptr)};
  for (const BinaryTree& tree : trees) {
    uint32_t next = 0;
    std::vector<uint32_t> stack{0};
    while (!stack.empty()) {
      ASSERT_EQ(stack.back(), next++);
      const BuildNode& node = tree.nodes[stack.back()];
      stack.pop_back();
      if (node.count == 0) stack.push_back(node.right), stack.push_back(next);
    }
    EXPECT_EQ(next, tree.nodes.size());
  }
}

}  // namespace
}  // namespace raybench::testing
