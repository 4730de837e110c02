// Suites: grids, defaults, errors that name file, line and key.
#include "harness/plan/suite.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "accel/base/error.h"
#include "harness/plan/plan.h"

namespace raybench {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

Suite Parse(const std::string& text) {
  static const Registry registry;
  return ParseSuite(registry, text, "s.toml", "s");
}

std::string ErrorOf(const std::string& text) {
  try {
    Parse(text);
  } catch (const InputError& error) {
    EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
    return error.what();
  }
  return "accepted";
}

TEST(SweepsSuite, GridsAreMultipliedOutTheFirstKeySlowest) {
  const Suite suite = Parse(R"toml(
scenes = ["bunny", { name = "terrain", size = [1000, 2000], relief = 0.5 }]
structures = [
  "null",
  { name = "bvh_sah", leaf_size = [1, 2], bins = [8, 32] },
]
)toml");
  EXPECT_THAT(suite.scenes,
              ElementsAre("bunny", "terrain(size=1000,relief=0.5)", "terrain(size=2000,relief=0.5)"));
  EXPECT_THAT(suite.structures,
              ElementsAre("null", "bvh_sah(bins=8,leaf_size=1)", "bvh_sah(bins=32,leaf_size=1)",
                          "bvh_sah(bins=8,leaf_size=2)", "bvh_sah(bins=32,leaf_size=2)"));
  EXPECT_EQ(suite.rays, uint64_t{1} << 17) << "as in the suite default";
}

TEST(SweepsSuite, NumericsMultiplyWhatHasThemAndSaysNoneAndTheSameStandsOnce) {
  const Suite suite = Parse(R"toml(
scenes = ["bunny"]
structures = ["null", "grid", "bvh_sah(numerics=exact)", "bvh_sah", "bvh_sah(leaf_size=16)"]
numerics = ["fast", "watertight"]
)toml");
  EXPECT_THAT(suite.structures, ElementsAre("null", "grid(numerics=fast)", "grid", "bvh_sah(numerics=exact)",
                                            "bvh_sah(numerics=fast)", "bvh_sah"));
}

TEST(SweepsSuite, AFaultIsOneLineWithFileLineAndKey) {
  const std::string ok = "scenes = [\"bunny\"]\n";
  EXPECT_THAT(ErrorOf(ok + "rayz = 5"),
              HasSubstr("s.toml:2: rayz: unknown key (did you mean rays?); allowed: doc, "));
  EXPECT_THAT(ErrorOf("rays = 128"), HasSubstr("scenes: missing; allowed: a list"));
  EXPECT_THAT(ErrorOf(ok + "rays = \"many\""),
              HasSubstr("s.toml:2: rays: allowed: a whole number from 64 to"));
  EXPECT_THAT(ErrorOf(ok + "rays = -5"), HasSubstr("s.toml:2: rays: allowed:"));
  EXPECT_THAT(ErrorOf(ok + "\nsample_seconds = 0"), HasSubstr("s.toml:3: sample_seconds: allowed: a number"));
  EXPECT_THAT(ErrorOf(ok + "shuffled = 1"), HasSubstr("s.toml:2: shuffled: allowed: true or false"));
  EXPECT_THAT(ErrorOf("scenes = [\"bunny\",\n \"nosuch\"]"),
              HasSubstr("s.toml:2: scenes[1]: unknown scene 'nosuch'"));
  EXPECT_THAT(ErrorOf("scenes = [\"bunny\",\n \"bunny\"]"),
              HasSubstr("s.toml:2: scenes[1]: 'bunny' is given twice"));
  EXPECT_THAT(ErrorOf("scenes = [{name = \"icosphere\", level = [99]}]"),
              HasSubstr("s.toml:1: scenes[0]: icosphere: level=99 is not allowed; allowed: an integer from"));
  EXPECT_THAT(ErrorOf(ok + "structures = [\"bvh_sah(leaf_size=99)\"]"),
              HasSubstr("s.toml:2: structures[0]: bvh_sah: leaf_size=99 is not allowed"));
  EXPECT_THAT(ErrorOf(ok + "structures = [{leaf_size = 4}]"),
              HasSubstr("s.toml:2: structures[0].name: missing"));
  EXPECT_THAT(ErrorOf(ok + "structures = [\"all\", \"null\"]"),
              HasSubstr("s.toml:2: structures[0]: 'all' stands alone"));
  EXPECT_THAT(ErrorOf(ok + "structures = [\"bvh_sah\"]\nnumerics = [\"sloppy\"]"),
              HasSubstr("s.toml:2: structures[0]: "));
  EXPECT_THAT(ErrorOf(ok + "rays = "), HasSubstr("s.toml:2: not TOML: "));
}

TEST(SweepsSuite, ShippedOnesCanAllBeReadAndDefaultSaysTheDefaults) {
  const Registry registry;
  std::vector<std::string> names;
  for (const SuiteText& shipped : ShippedSuites()) {
    const Suite suite = ReadSuite(registry, shipped.name);
    names.push_back(suite.name);
    EXPECT_FALSE(suite.doc.empty()) << suite.name;
    EXPECT_FALSE(ChooseContestants(registry, suite.structures).empty()) << suite.name;
  }
  EXPECT_THAT(names, ElementsAre("default", "full", "paper", "quick", "scaling"));
  const Suite quick = ReadSuite(registry, "quick"), whole = ReadSuite(registry, "default");
  EXPECT_THAT(whole.scenes, ElementsAre("engine", "sphereflake", "stadium"));
  EXPECT_TRUE(whole.structures.empty());
  EXPECT_EQ(quick.scenes, whole.scenes);
  EXPECT_EQ(quick.rays, 8192u);
  EXPECT_NE(quick.hash, whole.hash);
  EXPECT_THROW(ReadSuite(registry, "quik"), InputError);
  EXPECT_THROW(ReadSuite(registry, "nosuch.toml"), InputError);
}

TEST(SweepsShard, ShardsOwnEveryPairOnceInStretchesOfOneLength) {
  RunOptions options;
  for (uint32_t shards : {1u, 3u, 4u, 50u}) {
    options.shards = shards;
    std::vector<int> owned(shards);
    for (size_t scene = 0; scene < 3; ++scene)
      for (size_t structure = 0; structure < 11; ++structure) {
        int owners = 0;
        for (options.shard = 1; options.shard <= shards; ++options.shard)
          if (Owns(options, scene, 3, structure, 11)) ++owners, ++owned[options.shard - 1];
        EXPECT_EQ(owners, 1);
      }
    const auto [least, most] = std::minmax_element(owned.begin(), owned.end());
    EXPECT_LE(*most - *least, 1) << shards;
  }
}

}  // namespace
}  // namespace raybench
