// The fuzzer: what it makes, finds, shrinks and replays; and our own structures before it.
#include "harness/fuzz/fuzz.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <set>

#include "accel/contract/valid_ray.h"
#include "datasets/scene/text.h"
#include "harness/base/json.h"
#include "harness/fuzz/isolate.h"
#include "harness/fuzz/lattice.h"
#include "harness/fuzz/report.h"
#include "harness/fuzz/shrink.h"
#include "harness/truth/oracle.h"
#include "tests/support/datasets.h"
#include "tests/support/effort.h"
#include "tests/support/files.h"
#include "tests/support/source_directory.h"

namespace raybench::fuzz {
namespace {
namespace fs = std::filesystem;
using raybench::testing::Effort;

constexpr const char* kTwoTriangles =
    "raybench-case 1\n"
    "# a comment\n"
    "structure bvh_sah(leaf_size=2)\n"
    "mode chaotic\n"
    "check closest\n"
    "seed 7\n"
    "vertex 0 0 0\n"
    "vertex 1e-45 -0 0.1\n"
    "vertex 0 1 0\n"
    "vertex 3.4028235e+38 1 0\n"
    "triangle 0 1 2\n"
    "triangle 2 1 3\n"
    "sphere 1 2 3 -0.5\n"
    "cone 0 0 0 1  0 0 1 0.5\n"
    "polygon 0 1 2 3\n"
    "ray 0 0 -1 0  1e-40 -0 1 inf\n";

TEST(FuzzCase, IsReadBackToTheBit) {
  const Case c = ParseCase(kTwoTriangles, "text");
  EXPECT_EQ(c.structure, "bvh_sah(leaf_size=2)");
  EXPECT_EQ(c.check, "closest");
  EXPECT_EQ(c.seed, 7u);
  EXPECT_EQ(c.primitives(), 5u);
  EXPECT_TRUE(std::signbit(c.positions[1].y));
  EXPECT_EQ(c.positions[1].x, 0x1p-149f);
  const Case again = ParseCase(Format(c, "two\nlines"), "again");
  EXPECT_EQ(Format(again), Format(c));
  EXPECT_EQ(std::memcmp(again.rays.data(), c.rays.data(), sizeof(rb_ray)), 0);
}

TEST(FuzzCase, WrongTextIsOneLineThatNamesThePlace) {
  const std::pair<std::string, const char*> rows[] = {
      {"", "'raybench-case 1' is missing"},
      {"raybench-case 2\n", "line 1: a case begins with 'raybench-case 1'"},
      {"raybench-case 1\nvertex 0 0 0\n", "a line 'structure NAME' is missing"},
      {"raybench-case 1\nstructure null\nvertex 0 0\n", "line 3: '' stands where a finite number is needed"},
      {"raybench-case 1\nstructure null\nvertex 0 0 inf\n", "line 3: 'inf' stands where a finite number"},
      {"raybench-case 1\nstructure null\ntriangle 0 1 2\n", "triangle 0 refers to vertex 0, but there are 0"},
      {"raybench-case 1\nstructure null\nray 0 0 0 0 0 0 0 1\n", "line 3: the ray is not valid"},
      {"raybench-case 1\nstructure null\nray 0 0 0 0 0 0 1 nan\n", "'nan' stands where a number is needed"},
      {"raybench-case 1\nstructure null\nsphere 0 0 0 1 2\n", "line 3: more words than 'sphere' takes"},
      {"raybench-case 1\nstructure null\npolygon\n", "line 3: a polygon needs 3 corners"},
      {"raybench-case 1\nstructure null\nmode odd\n", "line 3: the mode is exact or chaotic"},
      {"raybench-case 1\nstructure null\ncube 1\n", "line 3: 'cube' is unknown; allowed: structure, mode"},
  };
  for (const auto& [text, says] : rows) {
    try {
      ParseCase(text, "file.case");
      ADD_FAILURE() << text;
    } catch (const InputError& error) {
      EXPECT_TRUE(std::string(error.what()).starts_with("file.case: ")) << error.what();
      EXPECT_NE(std::string(error.what()).find(says), std::string::npos) << error.what();
    }
  }
}

TEST(FuzzGenerate, MakesTheSameCasesAgainAndSoundOnes) {
  size_t triangles = 0, others = 0, rays = 0;
  std::set<std::string> different;
  for (uint64_t i = 0; i < 300; ++i) {
    const Case c = GenerateCase(Mode::kBoth, 5, i);
    EXPECT_EQ(Format(c), Format(GenerateCase(Mode::kBoth, 5, i)));
    EXPECT_NO_THROW(SceneOf(c)) << i;
    for (const rb_ray& ray : c.rays) EXPECT_TRUE(IsValidRay(ray));
    triangles += c.triangles.size(), others += c.primitives() - c.triangles.size(), rays += c.rays.size();
    different.insert(Format(c));
  }
  EXPECT_EQ(different.size(), 300u);
  EXPECT_GT(triangles, 5000u);
  EXPECT_GT(others, 100u);
  EXPECT_GT(rays, 10000u);
}

TEST(FuzzLattice, AgreesWithTheOracle) {
  size_t hits = 0, misses = 0;
  for (uint64_t i = 0; i < 600; ++i) {
    const Case c = GenerateCase(Mode::kExact, 9, i);
    ASSERT_TRUE(c.exact);
    const Scene scene = SceneOf(c);
    const auto oracle = MakeBoxOracle(scene);
    for (rb_ray ray : c.rays) {
      ray.tnear = 0, ray.tfar = std::numeric_limits<float>::infinity();
      const auto expected = LatticeHits(c, ray);
      if (!expected) continue;
      const Truth truth = oracle->Ask({&ray, 1}, 1)[0];
      ASSERT_EQ(truth.hit, !expected->empty());
      (truth.hit ? hits : misses) += 1;
      if (!truth.hit) continue;
      EXPECT_EQ(truth.tied.front(), expected->front().prim);
      EXPECT_NEAR(truth.t, expected->front().t(), 1e-12 * truth.t);
    }
  }
  EXPECT_GT(hits, 300u);
  EXPECT_GT(misses, 300u);
}

TEST(FuzzShrink, LeavesWhatFails) {
  Case big;
  for (uint64_t i = 0; big.triangles.size() < 20; ++i) big = GenerateCase(Mode::kChaotic, 3, i);
  big.structure = "null";
  const Vec3f kept = big.positions[big.triangles[3][1]];
  // Fails as long as a triangle has this corner and some ray goes down.
  const auto fails = [&](const Case& c) {
    bool has_corner = false, goes_down = false;
    for (const auto& t : c.triangles)
      for (uint32_t v : t) has_corner |= c.positions[v] == kept;
    for (const rb_ray& r : c.rays) goes_down |= r.dir[2] < 0;
    return has_corner && goes_down;
  };
  ASSERT_TRUE(fails(big));
  const Shrunk shrunk = Shrink(big, fails, [] { return false; });
  EXPECT_TRUE(fails(shrunk.smallest));
  EXPECT_EQ(shrunk.smallest.primitives(), 1u);
  EXPECT_EQ(shrunk.smallest.rays.size(), 1u);
  EXPECT_EQ(shrunk.smallest.rays[0].tfar, std::numeric_limits<float>::infinity());
}

// ---- our own ----

TEST(Fuzz, OurStructuresKeepEveryPromiseInAFewCases) {
  const Registry registry;
  FuzzOptions options;
  options.seconds = 0, options.cases = Effort(1200), options.seed = 20261128, options.quiet = true;
  const FuzzResult result = Fuzz(registry, options);
  for (const FoundFault& fault : result.faults)
    ADD_FAILURE() << fault.structure << ": " << fault.check << ": " << fault.text << "\n"
                  << Format(fault.smallest);
  EXPECT_EQ(result.structures.size(), registry.structures().size());
  uint64_t cases = 0;
  for (const FuzzedStructure& s : result.structures) cases += s.cases;
  EXPECT_EQ(cases, options.cases);
}

TEST(Fuzz, ACleanCampaignHasAReportWhereAFolderIsAskedFor) {
  const ScratchDirectory scratch;
  FuzzOptions options;
  options.structures = {"null"}, options.cases = 3, options.seconds = 0, options.quiet = true;
  options.out = (scratch.path() / "clean").string();
  EXPECT_EQ(RunFuzz(Registry(), options), 0);
  const Json report = Json::parse(Read(scratch.path() / "clean" / "fuzz.json"));
  EXPECT_TRUE(report.at("findings").empty());
  EXPECT_EQ(report.at("structures").at(0).at("cases"), 3);
}

TEST(FuzzExamine, AsksOnlyForWhatAStructureCanDo) {
  const Registry registry;
  Case c = GenerateCase(Mode::kExact, 1, 0);
  const auto looked_at = [&](const char* structure) {
    c.structure = structure;
    // In a child: it starts threads, and who has threads cannot fork.
    std::string names;
    RunIsolated(
        {}, [&] { return fmt::format("{}", fmt::join(Examine(registry, c).looked_at, "\n")); }, names);
    std::set<std::string> set;
    Lines lines(names);
    for (std::string_view line; lines.Next(line);) set.emplace(line);
    return set;
  };
  const std::set<std::string> all = looked_at("bvh_sah");
  for (const char* check : {"after", "skip", "counted", "rebuilt", "closest", "brute"})
    EXPECT_TRUE(all.contains(check)) << check;
  // It claims nothing.
  EXPECT_FALSE(looked_at("null").contains("closest"));
  for (const rb_structure* s : registry.structures()) {
    EXPECT_EQ(looked_at(s->name).contains("after"), (s->capabilities & RB_CAN_AFTER) != 0) << s->name;
    EXPECT_EQ(looked_at(s->name).contains("counted"), (s->capabilities & RB_CAN_COUNT) != 0) << s->name;
  }
}

TEST(Fuzz, WhatOnceFailedIsMended) {
  const Registry registry;
  size_t files = 0;
  for (const auto& entry : fs::directory_iterator(fs::path(kTestedSource) / "tests/fuzz/cases")) {
    Case c = ReadCase(entry.path());
    const std::string name = c.structure.substr(0, c.structure.find('('));
    if (std::ranges::none_of(registry.structures(), [&](const rb_structure* s) { return s->name == name; }))
      continue;  // a build without this library
    ++files;
    for (const bool all : {false, true}) {
      if (all) c.check.clear();
      for (const Finding& f : ExamineIsolated(registry, c))
        ADD_FAILURE() << entry.path() << ": " << f.check << ": " << f.text;
    }
  }
  EXPECT_GE(files, 10u);
}

}  // namespace
}  // namespace raybench::fuzz
