// Vectors of every width, lane by lane against one number at a time.
#include "accel/base/simd.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include "accel/base/random.h"

namespace raybench::testing {
namespace {

template <class Width>
class Simd : public ::testing::Test {
 public:
  static constexpr int kWidth = Width::value;
  using F = FloatN<kWidth>;

  /// fn(a, b) over vectors of numbers of every kind, each beside each.
  template <class Fn>
  static void ForPairs(const Fn& fn) {
    const float inf = std::numeric_limits<float>::infinity(), nan = std::numeric_limits<float>::quiet_NaN();
    const std::vector<float> kinds = {0.0f, -0.0f,     1,   -1,   0x1p-149f, -0x1p-149f,
                                      1.5f, -0x1p127f, inf, -inf, nan};
    Random random(7);
    auto any = [&] {
      F v;
      for (int i = 0; i < kWidth; ++i) v[i] = kinds[random.Below(kinds.size())];
      return v;
    };
    for (int i = 0; i < 2000; ++i) fn(any(), any());
  }
};

template <int kWidth>
using Width = std::integral_constant<int, kWidth>;
using Widths = ::testing::Types<Width<4>, Width<8>, Width<16>>;

struct WidthName {
  template <class W>
  static std::string GetName(int) {
    return std::to_string(W::value);
  }
};
TYPED_TEST_SUITE(Simd, Widths, WidthName);

uint32_t Bits(float x) { return std::bit_cast<uint32_t>(x); }

TYPED_TEST(Simd, MaximumAndMinimumTakeTheSecondOfWhatCannotBeCompared) {
  TestFixture::ForPairs([](auto a, auto b) {
    const auto most = MaxOrSecond(a, b), least = MinOrSecond(a, b);
    for (int i = 0; i < TestFixture::kWidth; ++i) {
      ASSERT_EQ(Bits(most[i]), Bits(a[i] > b[i] ? a[i] : b[i])) << a[i] << " " << b[i];
      ASSERT_EQ(Bits(least[i]), Bits(a[i] < b[i] ? a[i] : b[i])) << a[i] << " " << b[i];
    }
  });
}

TYPED_TEST(Simd, LoadSplatAndAbsKeepEveryBit) {
  TestFixture::ForPairs([](auto a, auto) {
    using F = typename TestFixture::F;
    float stored[TestFixture::kWidth + 1];
    std::memcpy(stored + 1, &a, sizeof a);
    const F loaded = Load<F>(stored + 1), first = Splat<F>(a[0]), positive = Abs(a);
    for (int i = 0; i < TestFixture::kWidth; ++i) {
      ASSERT_EQ(Bits(loaded[i]), Bits(a[i]));
      ASSERT_EQ(Bits(first[i]), Bits(a[0]));
      ASSERT_EQ(Bits(positive[i]), Bits(std::fabs(a[i])));
    }
  });
}

TYPED_TEST(Simd, MaskTellsWhichLanesAreTrue) {
  TestFixture::ForPairs([](auto a, auto b) {
    unsigned below = 0, equal = 0;
    for (int i = 0; i < TestFixture::kWidth; ++i)
      below |= unsigned(a[i] < b[i]) << i, equal |= unsigned(a[i] == a[i]) << i;
    ASSERT_EQ(Mask(a < b), below);
    ASSERT_EQ(Mask(a == a), equal);
    ASSERT_EQ(Mask((a < b) & (a == a)), below & equal);
  });
  const typename TestFixture::F zero{};
  EXPECT_EQ(Mask(zero == zero), kAllLanes<TestFixture::kWidth>);
  EXPECT_EQ(Mask(zero != zero), 0u);
}

TYPED_TEST(Simd, LaneXorPermutes) {
  const auto v = Iota<typename TestFixture::F>();
  for (int signs = 0; signs < TestFixture::kWidth; ++signs) {
    const auto permuted = LaneXor<TestFixture::kWidth>(signs)(v);
    for (int i = 0; i < TestFixture::kWidth; ++i)
      ASSERT_EQ(permuted[i], float(i ^ signs)) << signs << " lane " << i;
  }
}

}  // namespace
}  // namespace raybench::testing
