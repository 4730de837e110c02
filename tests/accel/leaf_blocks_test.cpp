// Leaf blocks of every width, against the primitives one by one.
#include "accel/ray/leaf_blocks.h"

#include <gtest/gtest.h>

#include <cstring>
#include <numeric>

#include "accel/contract/counting.h"
#include "tests/support/meshes.h"

namespace raybench::testing {
namespace {

/// A mesh with balls or without, its primitives strewn over leaves of 1 to 40.
struct Leaves {
  Mesh mesh = Needles(300);
  Balls balls{100, 4};
  rb_geometry geometry;
  std::vector<std::vector<uint32_t>> prims;

  explicit Leaves(bool with_balls) : geometry(with_balls ? balls.Geometry(mesh) : mesh.Geometry()) {
    Random random(3);
    for (size_t i = 0; i < 60; ++i) {
      std::vector<uint32_t>& leaf = prims.emplace_back(1 + random.Below(40));
      for (uint32_t& prim : leaf) prim = uint32_t(random.Below(PrimCount(geometry)));
    }
  }
};

template <uint32_t kWidth>
struct Blocks {
  LeafBlocks<kWidth> blocks;
  std::vector<size_t> first;

  explicit Blocks(const Leaves& leaves) {
    size_t end = 0;
    for (const auto& leaf : leaves.prims)
      first.push_back(end), end += LeafBlocks<kWidth>::BlocksOf(leaf.size());
    blocks = LeafBlocks<kWidth>(leaves.geometry, end);
    blocks.Fill(0, first.size(),
                [&](size_t i) { return std::pair(first[i], std::span<const uint32_t>(leaves.prims[i])); });
  }
};

template <class Width>
class LeafBlocksOf : public ::testing::Test {};

template <uint32_t kWidth>
using Width = std::integral_constant<uint32_t, kWidth>;
using Widths = ::testing::Types<Width<4>, Width<8>, Width<16>>;

struct WidthName {
  template <class W>
  static std::string GetName(int) {
    return std::to_string(W::value);
  }
};
TYPED_TEST_SUITE(LeafBlocksOf, Widths, WidthName);

TYPED_TEST(LeafBlocksOf, HoldTheirPrimitives) {
  constexpr uint32_t kWidth = TypeParam::value;
  const Leaves leaves(true);
  const Blocks<kWidth> b(leaves);
  size_t blocks = 0;
  for (size_t i = 0; i < leaves.prims.size(); ++i) {
    std::vector<uint32_t> held;
    b.blocks.Append(b.first[i], uint32_t(leaves.prims[i].size()), held);
    EXPECT_EQ(held, leaves.prims[i]);
    blocks += (leaves.prims[i].size() + kWidth - 1) / kWidth;
  }
  EXPECT_EQ(b.blocks.bytes(), blocks * 40 * kWidth);
}

/// Calls check.operator()<kProcedural, Test>(leaves).
template <class Check>
void WithEveryTest(const Check& check) {
  for (const bool with_balls : {false, true}) {
    const Leaves leaves(with_balls);
    for (uint32_t numerics = 0; numerics < 4; ++numerics) {
      WithNumerics(numerics, [&]<class Test>() {
        with_balls ? check.template operator()<true, Test>(leaves)
                   : check.template operator()<false, Test>(leaves);
      });
    }
  }
}

TYPED_TEST(LeafBlocksOf, AnswerAsTheirPrimitivesOneByOne) {
  WithEveryTest([]<bool kProcedural, class Test>(const Leaves& leaves) {
    static constexpr uint32_t kWidth = TypeParam::value;
    const Blocks<kWidth> b(leaves);
    size_t hits = 0;
    for (const rb_ray& r : NastyRays(leaves.mesh, 40, 6)) {
      const RayState<Test> ray(RayQuery{r});
      for (size_t i = 0; i < leaves.prims.size(); ++i) {
        const auto& prims = leaves.prims[i];
        const uint32_t count = uint32_t(prims.size());
        const rb_hit miss{r.tfar, 0, 0, RAYBENCH_NONE};
        rb_hit expected = miss, got = miss, any = miss, boxed = miss;
        for (const uint32_t prim : prims) ray.Primitive(leaves.geometry, prim, expected);
        const bool hit = expected.prim != RAYBENCH_NONE;
        Counting counter;
        NoCounting no_counting;
        Mailbox mailbox;
        auto same = [&](bool changed, const rb_hit& other) {
          ASSERT_EQ(changed, hit);
          ASSERT_EQ(std::memcmp(&other, &expected, sizeof expected), 0) << kWidth << " lanes, leaf " << i;
        };
        same(b.blocks.template Intersect<kProcedural, false>(b.first[i], count, ray, got, counter,
                                                             NoMailbox()),
             got);
        ASSERT_EQ(counter.counts().prims, count);
        ASSERT_EQ(counter.counts().bytes, LeafBlocks<kWidth>::BlocksOf(count) * 40 * kWidth);
        same(b.blocks.template Intersect<kProcedural, false>(b.first[i], count, ray, boxed, no_counting,
                                                             mailbox),
             boxed);
        ASSERT_EQ((b.blocks.template Intersect<kProcedural, true>(b.first[i], count, ray, any, no_counting,
                                                                  NoMailbox())),
                  hit);
        hits += hit;
      }
    }
    EXPECT_GT(hits, 100u);
  });
}

TYPED_TEST(LeafBlocksOf, TestNothingTwiceThatAMailboxRemembers) {
  constexpr uint32_t kWidth = TypeParam::value;
  const Mesh mesh = Ball(1);
  const rb_geometry geometry = mesh.Geometry();
  std::vector<uint32_t> prims(mesh.triangles.size());
  std::iota(prims.begin(), prims.end(), 0u);
  ASSERT_EQ(prims.size(), 32u);  // as many as a mailbox has places
  LeafBlocks<kWidth> blocks(geometry, LeafBlocks<kWidth>::BlocksOf(prims.size()));
  blocks.Fill(0, prims);
  const RayState<WatertightTest> ray(RayQuery{{{0, 0, 0}, 0, {1, 0.3f, 0.2f}, INFINITY}});
  rb_hit best{INFINITY, 0, 0, RAYBENCH_NONE};
  Mailbox mailbox;
  Counting counter;
  EXPECT_TRUE((blocks.template Intersect<false, false>(0, 32, ray, best, counter, mailbox)));
  EXPECT_EQ(counter.counts().prims, 32u);
  EXPECT_FALSE((blocks.template Intersect<false, false>(0, 32, ray, best, counter, mailbox)));
  EXPECT_EQ(counter.counts().prims, 32u);
}

}  // namespace
}  // namespace raybench::testing
