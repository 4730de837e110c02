// Parameters: what users type, and what they are told when it is wrong.
#include "accel/host/parameters.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <limits>

#include "accel/contract/parameters.h"
#include "accel/host/names.h"
#include "accel/host/registry.h"

namespace raybench {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

template <class Fn>
std::string ErrorOf(Fn&& fn) {
  try {
    fn();
  } catch (const InputError& e) {
    return e.what();
  }
  return "no error";
}

struct Config {
  int64_t count;
  double factor;
  uint32_t mode, flag;
};
const char* const kModes[] = {"slow", "quick", nullptr};
const rb_param kParams[] = {
    IntParam("count", "how many", offsetof(Config, count), 1, 9, 4),
    FloatParam("factor", "how much", offsetof(Config, factor), 0, 1, 0.1),
    ChoiceParam("mode", "how", offsetof(Config, mode), kModes, 1),
    BoolParam("flag", "whether", offsetof(Config, flag), 0),
};

std::vector<std::byte> Make(std::string_view text) {
  return Configure("thing", kParams, sizeof(Config), ParseSpec(text).values);
}

TEST(Parameters, DefaultsThenValues) {
  auto bytes = Make("thing(count=7, flag=true)");
  const auto& c = *reinterpret_cast<const Config*>(bytes.data());
  EXPECT_EQ(c.count, 7);
  EXPECT_EQ(c.factor, 0.1);
  EXPECT_EQ(c.mode, 1u);
  EXPECT_EQ(c.flag, 1u);
}

TEST(Parameters, FormattingReadsBackToTheSameBits) {
  auto bytes = Make("thing(factor=0.30000000000000004,mode=slow)");
  std::string all = FormatAllParameters(kParams, bytes.data());
  EXPECT_EQ(all, "count=4,factor=0.30000000000000004,mode=slow,flag=false");
  EXPECT_EQ(Make("thing(" + all + ")"), bytes);
  EXPECT_EQ(FormatSpec("thing", kParams, bytes.data()), "thing(factor=0.30000000000000004,mode=slow)");
  EXPECT_EQ(FormatSpec("thing", kParams, Make("thing").data()), "thing");
}

TEST(Parameters, ErrorsSayWhatIsAllowed) {
  EXPECT_THAT(ErrorOf([] { Make("thing(size=3)"); }), HasSubstr("allowed: count, factor, mode, flag"));
  EXPECT_THAT(ErrorOf([] { Make("thing(count=10)"); }), HasSubstr("an integer from 1 to 9"));
  EXPECT_THAT(ErrorOf([] { Make("thing(count=2.5)"); }), HasSubstr("an integer from 1 to 9"));
  EXPECT_THAT(ErrorOf([] { Make("thing(factor=nan)"); }), HasSubstr("a number from 0 to 1"));
  EXPECT_THAT(ErrorOf([] { Make("thing(mode=best)"); }), HasSubstr("slow, quick"));
  EXPECT_THAT(ErrorOf([] { Make("thing(flag=yes)"); }), HasSubstr("false, true"));
}

TEST(Parameters, TheNearestNameIsMeant) {
  constexpr std::string_view known[] = {"bunny", "bvh_sah", "bvh_sweep", "grid", "kdop"};
  for (auto [typed, meant] : {std::pair("bunnyy", "bunny"),
                              {"buny", "bunny"},
                              {"bvh_sha", "bvh_sah"},
                              {"BUNNY", "bunny"},
                              {"gird", "grid"},
                              {"bvhswep", "bvh_sweep"}})
    EXPECT_EQ(DidYouMean(typed, known), std::string(" (did you mean ") + meant + "?)") << typed;
  for (const char* far : {"", "x", "embree", "sphereflake", "gr", "kd"})
    EXPECT_EQ(DidYouMean(far, known), "") << far;
}

TEST(Parameters, WhatIsBadlyDescribedIsNamed) {
  EXPECT_EQ(FlawOfParameters(kParams, sizeof(Config)), "");
  const auto flaw = [](size_t which, auto&& change) {
    std::vector<rb_param> params(std::begin(kParams), std::end(kParams));
    change(params[which]);
    return FlawOfParameters(params, sizeof(Config));
  };
  static const char* const none[] = {nullptr};
  static const char* const twice[] = {"a", "a", nullptr};
  static const char* const spaced[] = {"a b", nullptr};
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(flaw(0, [](rb_param& p) { p.name = nullptr; }), HasSubstr("parameter 0"));
  EXPECT_THAT(flaw(0, [](rb_param& p) { p.name = "a=b"; }), HasSubstr("parameter 0"));
  EXPECT_THAT(flaw(1, [](rb_param& p) { p.name = "count"; }), HasSubstr("'count': there are two"));
  EXPECT_THAT(flaw(0, [](rb_param& p) { p.doc = nullptr; }), HasSubstr("'count': it lacks doc"));
  EXPECT_THAT(flaw(0, [](rb_param& p) { p.type = 4; }), HasSubstr("type 4"));
  EXPECT_THAT(flaw(0, [](rb_param& p) { p.offset = 4; }), HasSubstr("aligned"));
  EXPECT_THAT(flaw(3, [](rb_param& p) { p.offset = sizeof(Config); }), HasSubstr("offset 24"));
  EXPECT_THAT(flaw(3, [](rb_param& p) { p.offset = 0xFFFFFFFC; }), HasSubstr("offset 4294967292"));
  EXPECT_THAT(flaw(3, [](rb_param& p) { p.offset = offsetof(Config, mode); }), HasSubstr("shares bytes"));
  EXPECT_THAT(flaw(0, [](rb_param& p) { p.def = 10; }), HasSubstr("'count': default 10"));
  EXPECT_THAT(flaw(0, [](rb_param& p) { p.lo = 10; }), HasSubstr("range 10 to 9"));
  EXPECT_THAT(flaw(0, [](rb_param& p) { p.def = 2.5; }), HasSubstr("64-bit"));
  EXPECT_THAT(flaw(0, [](rb_param& p) { p.hi = 1e30; }), HasSubstr("64-bit"));
  EXPECT_THAT(flaw(1, [&](rb_param& p) { p.def = nan; }), HasSubstr("'factor': default nan"));
  EXPECT_THAT(flaw(1, [&](rb_param& p) { p.hi = nan; }), HasSubstr("'factor'"));
  EXPECT_THAT(flaw(2, [](rb_param& p) { p.def = 2; }), HasSubstr("'mode': default 2 is none of its 2"));
  EXPECT_THAT(flaw(2, [](rb_param& p) { p.def = -1; }), HasSubstr("'mode': default -1"));
  EXPECT_THAT(flaw(2, [&](rb_param& p) { p.def = nan; }), HasSubstr("'mode': default nan"));
  EXPECT_THAT(flaw(3, [](rb_param& p) { p.def = 2; }), HasSubstr("'flag': default 2"));
  EXPECT_THAT(flaw(2, [](rb_param& p) { p.choices = nullptr; }), HasSubstr("lacks choices"));
  EXPECT_THAT(flaw(2, [](rb_param& p) { p.choices = none; }), HasSubstr("no choices"));
  EXPECT_THAT(flaw(2, [](rb_param& p) { p.choices = twice; }), HasSubstr("choice 1 'a'"));
  EXPECT_THAT(flaw(2, [](rb_param& p) { p.choices = spaced; }), HasSubstr("choice 0 'a b'"));
}

TEST(Parameters, MalformedTextIsRefused) {
  for (const char* text : {"", "thing(", "thing(count)", "thing(count=)", "thing(=3)", "thing(count=1,)",
                           "thing()x", "thing(count=1,count=2)", "thing(a=(b))", "(count=1)", "th ing"}) {
    std::string error = ErrorOf([&] { Make(text); });
    EXPECT_NE(error, "no error") << text;
    EXPECT_THAT(error, Not(HasSubstr("\n")));
  }
}

TEST(Parameters, ListsSplitOutsideParentheses) {
  EXPECT_THAT(SplitSpecs("a, b(x=1,y=2),c"), ElementsAre("a", "b(x=1,y=2)", "c"));
  EXPECT_NE(ErrorOf([] { SplitSpecs("a,,b"); }), "no error");
  EXPECT_THAT(SplitSpecs("a,\n\tb"), ElementsAre("a", "b"));
  EXPECT_EQ(ErrorOf([] { SplitSpecs("a\x01,b"); }),
            "'a?,b': control characters, shown as ?, are not allowed");
  EXPECT_EQ(ErrorOf([] { ParseSpec("a\nb"); }), "'a b': expected NAME or NAME(key=value,...)");
}

TEST(Registry, KnowsEveryBuiltinOnceAndFindsByName) {
  Registry registry;
  for (const rb_structure* s : registry.structures()) EXPECT_EQ(&registry.Find(s->name), s);
  for (const char* name : {"null", "brute", "bvh_sah"}) EXPECT_NO_THROW(registry.Find(name)) << name;
  EXPECT_THAT(ErrorOf([&] { registry.Find("kdtree"); }), HasSubstr("see: raybench list structures"));
  EXPECT_THAT(ErrorOf([&] { registry.Find("bvh_sha"); }), HasSubstr("'bvh_sha' (did you mean bvh_sah?)"));
  EXPECT_THAT(ErrorOf([&] { registry.LoadPlugin("no_such_plugin.so"); }), HasSubstr("no_such_plugin.so"));
  EXPECT_TRUE(std::is_sorted(
      registry.structures().begin(), registry.structures().end(),
      [](const rb_structure* x, const rb_structure* y) { return std::string_view(x->name) < y->name; }))
      << "whatever their folders: results are listed in this order";
}

TEST(Registry, ContestantsShowTheirParameters) {
  Registry registry;
  Contestant c = ParseContestant(registry, "bvh_sah(numerics=fast)");
  EXPECT_EQ(c.Spec(), "bvh_sah(numerics=fast)");
  EXPECT_THAT(c.Params(), HasSubstr("leaf_size="));
  EXPECT_EQ(ParseContestant(registry, "bvh_sah(" + c.Params() + ")").config, c.config);
}

TEST(Rays, ValidityIsWhatTheContractSays) {
  const rb_ray good{{0, 0, 0}, 0, {0, 0, 1}, 1};
  EXPECT_TRUE(IsValidRay(good));
  EXPECT_TRUE(IsValidRay(InvalidRayStandIn()));
  rb_ray bad = good;
  bad.org[1] = NAN;
  EXPECT_FALSE(IsValidRay(bad));
  bad = good, bad.dir[2] = 0;
  EXPECT_FALSE(IsValidRay(bad));
  bad = good, bad.tnear = -1;
  EXPECT_FALSE(IsValidRay(bad));
  bad = good, bad.tnear = -1e-45f;
  EXPECT_FALSE(IsValidRay(bad));
  bad = good, bad.tnear = INFINITY;
  EXPECT_FALSE(IsValidRay(bad));
  bad = good, bad.tfar = NAN;
  EXPECT_FALSE(IsValidRay(bad));
  bad = good, bad.dir[0] = INFINITY;
  EXPECT_FALSE(IsValidRay(bad));
  const float most = std::numeric_limits<float>::max();
  EXPECT_TRUE(IsValidRay({{-most, most, -0.0f}, -0.0f, {0, -1e-45f, -0.0f}, INFINITY}));
  EXPECT_TRUE(IsValidRay({{0, 0, 0}, most, {most, -most, 0}, -INFINITY}));
}

}  // namespace
}  // namespace raybench
