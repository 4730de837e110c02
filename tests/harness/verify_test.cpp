// `raybench verify` as a user meets it: what it finds, what it writes, what it refuses.
#include "harness/verify/verify.h"

#include <gmock/gmock.h>

#include <chrono>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <thread>

#include "harness/plan/plan.h"
#include "harness/rays/aim.h"
#include "harness/verify/ledger.h"
#include "tests/support/command.h"
#include "tests/support/effort.h"

namespace raybench {
namespace {

using ::testing::ContainsRegex;
using ::testing::HasSubstr;
using ::testing::Not;
using Fields = std::map<std::string, std::string>;

constexpr const char* kBall = "icosphere(level=2)";
constexpr const char* kClasses[] = {
    "exact",          "tie",        "neighbour",           "leak",      "wrong",
    "wrong_marginal", "false_miss", "false_miss_marginal", "false_hit", "false_hit_marginal"};

constexpr const char* kSpheres =
    "v\nfrom 0 -8 1\nat 0 0 0\nup 0 0 1\nangle 45\nhither 0.01\nresolution 64 64\nl 4 -8 9\n"
    "f 1 0.5 0.25 1 0 0 0 1\ns 0 0 0 1\ns 1.5 0.25 0 0.75\ns -1 0.5 1 0.5\n";

class HarnessVerify : public HarnessCommand {
 protected:
  std::string In(const std::string& name) const { return (folder_ / name).string(); }
  Outcome Verify(std::vector<std::string> words) {
    words.insert(words.begin(), "verify");
    return Call(words);
  }
  static uint64_t Number(const Fields& row, const std::string& column) { return std::stoull(row.at(column)); }
};

/// Short; by hand it takes more rays, and the models that are fetched.
TEST_F(HarnessVerify, AllTakesEveryGeneratorEveryStructureAndEachOfItsNumerics) {
  setenv("RAYBENCH_CACHE", In("cache").c_str(), 1);
  std::vector<std::string> words{"--all", "--rays", "64", "--sets", "random,aimed_edge,grazing",
                                 "--out", In("out")};
  const Registry registry;
  std::set<std::string> structures;
  if (testing::kSanitized) {
    structures = {"bvh_sah", "grid", "kdtree_sah"};
    words.insert(words.end(), {"--structures", "bvh_sah,grid,kdtree_sah"});
  } else {
    for (const rb_structure* s : registry.structures()) structures.insert(s->name);
    structures.erase("null");
  }
  const Outcome outcome = Verify(words);
  unsetenv("RAYBENCH_CACHE");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.out << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("models that are not fetched are left out: sponza, dungeon, "));
  std::set<std::string> judged, scenes;
  for (const Fields& row : ReadCsv(folder_ / "out" / "verdicts.csv")) {
    judged.insert(row.at("spec").substr(0, row.at("spec").find('(')));
    scenes.insert(row.at("scene").substr(0, row.at("scene").find('(')));
  }
  EXPECT_EQ(judged, structures);
  for (const Generator* generator : Generators()) {
    EXPECT_THAT(scenes, ::testing::Contains(generator->name));
    EXPECT_THAT(outcome.out, HasSubstr(fmt::format("\n  {}(", generator->name)));
  }
  EXPECT_THAT(Verify({"--all", kBall}).err, HasSubstr("name none"));
  EXPECT_EQ(Verify({"--all", "--rays", In("no.rays")}).exit_code, 2);
  EXPECT_EQ(Verify({"--rays", "64"}).exit_code, 2);
}

/// Faces at coordinate 0 have rays with subnormal components beside them.
TEST_F(HarnessVerify, GrazingRaysOfTheStadiumKeepEveryClaim) {
  const Outcome outcome =
      Verify({"stadium(size=1000)", "--sets", "grazing", "--rays", testing::kSanitized ? "2K" : "32K",
              "--structures", "bvh_sah,kdtree_sah,grid,octree,kdop,bvh_sphere,quadtree,bvh_spatial"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.out;
}

TEST_F(HarnessVerify, WatertightHoldsOnEverySetAndFastDoesNot) {
  const Outcome outcome =
      Verify({kBall, "--rays", "512", "--structures", "bvh_sah,bvh_sah(numerics=fast)", "--out", In("out")});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("\nbvh_sah claims watertight: held\n"));
  EXPECT_THAT(outcome.out, HasSubstr("\nbvh_sah(numerics=fast) claims inexact: its errors are measured\n"));
  EXPECT_THAT(outcome.out, HasSubstr("references, depth"));
  EXPECT_THAT(outcome.out, HasSubstr("; structure: ok\n"));
  std::set<std::string> seen;
  uint64_t fast_leaks = 0;
  for (const Fields& row : ReadCsv(folder_ / "out" / "verdicts.csv")) {
    SCOPED_TRACE(row.at("spec") + " " + row.at("ray_set") + " " + row.at("query"));
    seen.insert(row.at("spec") + " " + row.at("ray_set") + " " + row.at("query"));
    uint64_t sum = 0;
    for (const char* name : kClasses) sum += Number(row, name);
    EXPECT_EQ(sum, Number(row, "rays"));
    EXPECT_EQ(Number(row, "rays"), row.at("query") == "any" ? 128u : 512u);
    EXPECT_EQ(row.at("held"), "1");
    EXPECT_EQ(row.at("scene"), kBall);
    EXPECT_GT(std::stod(row.at("leak_upper")), double(Number(row, "leak")) / double(sum));
    EXPECT_EQ(row.at("t_error_p50").empty(), row.at("query") == "any");
    if (row.at("spec") == "bvh_sah") {
      EXPECT_EQ(
          Number(row, "leak") + Number(row, "wrong") + Number(row, "false_miss") + Number(row, "false_hit"),
          0u);
    } else {
      fast_leaks += Number(row, "leak");
    }
  }
  EXPECT_EQ(seen.size(), 2 * 2 * AimedFamilies().size());
  EXPECT_GT(fast_leaks, 20u);
  const auto facts = nlohmann::json::parse(Read(folder_ / "out" / "verify.json"));
  EXPECT_EQ(facts.at("scenes").at(0).at("structures").at(0).at("structure").at("flaw"), "");
  EXPECT_EQ(facts.at("scenes").at(0).at("structures").at(0).at("structure").at("references"), 320);
  EXPECT_EQ(facts.at("seed"), 1);

  const Outcome again = Verify({kBall, "--rays", "512", "--structures", "bvh_sah,bvh_sah(numerics=fast)",
                                "--threads", "1", "--out", In("again")});
  EXPECT_EQ(Read(folder_ / "again" / "verdicts.csv"), Read(folder_ / "out" / "verdicts.csv"));
  EXPECT_EQ(Read(folder_ / "again" / "examples.json"), Read(folder_ / "out" / "examples.json"));
  const Outcome other = Verify({kBall, "--rays", "512", "--structures", "bvh_sah(numerics=fast)", "--seed",
                                "2", "--out", In("other")});
  EXPECT_NE(Read(folder_ / "other" / "examples.json"), Read(folder_ / "out" / "examples.json"));
}

TEST_F(HarnessVerify, WhatClaimsExactIsHeldToTheBit) {
  const Outcome outcome = Verify({kBall, "--rays", "256", "--any", "--structures",
                                  "bvh_sah(numerics=exact),bvh_sah", "--out", In("out")});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.out;
  const size_t answers = 2 * 256 * AimedFamilies().size();
  EXPECT_THAT(outcome.out,
              HasSubstr(fmt::format("bvh_sah(numerics=exact) claims exact: held, {0} of {0} answers are "
                                    "exact to the bit\n",
                                    answers)));
  uint64_t loose = 0;
  for (const Fields& row : ReadCsv(folder_ / "out" / "verdicts.csv")) {
    if (row.at("spec") == "bvh_sah") loose += Number(row, "rays") - Number(row, "strict");
  }
  EXPECT_GT(loose, 100u);  // watertight is not
  EXPECT_GT(nlohmann::json::parse(Read(folder_ / "out" / "verify.json")).at("scenes").at(0).at("audited"),
            100);
}

TEST_F(HarnessVerify, ExamplesReplayToTheSameVerdicts) {
  const std::string spec = "bvh_sah(numerics=fast)";
  ASSERT_EQ(Verify({kBall, "--rays", "1024", "--structures", spec, "--examples", "12", "--out", In("out")})
                .exit_code,
            0);
  const auto examples = nlohmann::json::parse(Read(folder_ / "out" / "examples.json"));
  ASSERT_EQ(examples.size(), 12u);
  std::map<std::string, uint64_t> classes;
  for (size_t i = 0; i < examples.size(); ++i) {
    const auto& e = examples[i];
    EXPECT_EQ(e.at("structure"), spec);
    ++classes[e.at("verdict")];
    if (i % 4 != 0) continue;
    const Outcome replay = Verify({kBall, "--structures", spec, "--replay", e.at("ray")});
    EXPECT_EQ(replay.exit_code, 0) << replay.err;
    const std::string verdict = e.at("verdict"), query = e.at("query");
    EXPECT_THAT(replay.out, HasSubstr(verdict + ": " + query + " hit, set replay"));
    EXPECT_THAT(replay.out, HasSubstr("ray " + e.at("ray").get<std::string>()));
    if (!e.at("truth").is_null()) {
      EXPECT_THAT(replay.out, HasSubstr(e.at("truth").at("t").get<std::string>()));
    }
  }
  EXPECT_GT(classes["leak"], 0u);
  const Outcome files = Verify({kBall, "--structures", spec, "--rays", In("out"), "--out", In("replayed")});
  EXPECT_EQ(files.exit_code, 0) << files.err;
  std::map<std::string, uint64_t> replayed;
  for (const Fields& row : ReadCsv(folder_ / "replayed" / "verdicts.csv")) {
    EXPECT_THAT(row.at("ray_set"), HasSubstr("bvh_sah_numerics_fast"));
    if (row.at("query") != "closest") continue;
    for (const char* name : kClasses)
      if (Number(row, name) > 0) replayed[name] += Number(row, name);
  }
  std::map<std::string, uint64_t> closest;
  for (const auto& e : examples)
    if (e.at("query") == "closest") ++closest[e.at("verdict")];
  EXPECT_EQ(replayed, closest);
}

TEST_F(HarnessVerify, APluginThatLosesRaysIsCaughtByRaysAndByItsTree) {
  const std::string plugin = (BuildPlugins() / "libleaky.so").string();
  struct Case {
    const char* flaw;
    const char* structure;
    bool loses_rays;
  };
  for (const Case& c :
       {Case{"none", "structure: ok", false},
        Case{"drop", "structure: BROKEN: no leaf holds primitive 160", true},
        Case{"box", "structure: BROKEN: the bounds of a leaf leave out part of primitive", true},
        Case{"gap", "structure: BROKEN: the leaves of primitive", true}}) {
    SCOPED_TRACE(c.flaw);
    const std::string spec = c.loses_rays ? fmt::format("leaky(flaw={})", c.flaw) : "leaky";
    const Outcome outcome =
        Verify({kBall, "--plugin", plugin, "--structures", spec, "--rays", "2048", "--examples", "2"});
    EXPECT_EQ(outcome.exit_code, c.loses_rays ? 1 : 0) << outcome.out << outcome.err;
    EXPECT_THAT(outcome.out, HasSubstr(c.structure));
    EXPECT_THAT(outcome.out, HasSubstr(c.loses_rays ? spec + " claims watertight: BROKEN"
                                                    : spec + " claims watertight: held"));
    EXPECT_EQ(outcome.out.find("--replay") != std::string::npos, c.loses_rays);

    const Outcome closed = Verify({kBall, "--plugin", plugin, "--structures", spec, "--closed", "20000"});
    EXPECT_EQ(closed.exit_code, c.loses_rays ? 1 : 0) << closed.out << closed.err;
    EXPECT_THAT(closed.out,
                HasSubstr(c.loses_rays ? "(BROKEN): 20000 closest-hit rays"
                                       : ": 20000 closest-hit rays, 0 misses, leak rate < 1.5e-04;"));
    if (!c.loses_rays) continue;
    // The command that an example comes with, and its verdict.
    const size_t at = closed.out.find("--replay \"");
    ASSERT_NE(at, std::string::npos);
    const std::string ray = closed.out.substr(at + 10, closed.out.find('"', at + 10) - at - 10);
    const Outcome replay = Verify({kBall, "--plugin", plugin, "--structures", spec, "--replay", ray});
    EXPECT_EQ(replay.exit_code, 1);
    EXPECT_THAT(replay.out, HasSubstr("answer: miss"));
    EXPECT_THAT(replay.out, HasSubstr("claims watertight: BROKEN"));
  }
}

TEST_F(HarnessVerify, MalformedAnswersBreakTheContractWhateverIsClaimed) {
  const std::string plugin = (BuildPlugins() / "libwrong.so").string();
  const Outcome outcome = Verify(
      {kBall, "--plugin", plugin, "--structures", "wrong_bad_ids", "--rays", "512", "--sets", "aimed_edge"});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(
      outcome.out,
      HasSubstr("contract BROKEN: ray 99 hits primitive 327 of 320 (of those from 0 on, of set aimed_edge)"));
}

TEST_F(HarnessVerify, ABrokenClaimIsWordedWithTheRayThatShowsIt) {
  const std::string plugin = (BuildPlugins() / "libwrong.so").string();
  const auto verify = [&](const std::string& name) {
    return Verify({kBall, "--plugin", plugin, "--structures", name, "--rays", "512", "--sets", "random"});
  };
  const Outcome misses = verify("wrong_misses");
  EXPECT_EQ(misses.exit_code, 1);
  EXPECT_THAT(misses.out,
              ContainsRegex("\n  claims watertight, but of 640 rays [0-9]+ false_miss; ray [0-9]+ of set "
                            "random: org \\(.*\\) dir \\(.*\\) tnear 0x0p\\+0 tfar inf is answered miss "
                            "\\(false_miss\\); true is primitive [0-9]+ at t 0x"));
}

TEST_F(HarnessVerify, SwappedUAndVBreakTheClaimOfWhatIsRightElse) {
  const std::string plugin = (BuildPlugins() / "libwrong.so").string();
  const Outcome outcome = Verify({kBall, "--plugin", plugin, "--structures", "wrong_uv,wrong_not,bvh_sah",
                                  "--rays", "512", "--sets", "random", "--out", In("out")});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.out, HasSubstr("wrong_uv claims watertight: BROKEN"));
  EXPECT_THAT(outcome.out, HasSubstr(" with u or v beyond its bound; ray "));
  EXPECT_THAT(outcome.out, HasSubstr("\n     u, v: 0x"));
  EXPECT_THAT(outcome.out, HasSubstr("wrong_not claims watertight: held"));
  for (const Fields& row : ReadCsv(folder_ / "out" / "verdicts.csv")) {
    SCOPED_TRACE(row.at("spec") + " " + row.at("query"));
    EXPECT_EQ(row.at("uv_wrong").empty(), row.at("query") == "any");
    EXPECT_EQ(row.at("uv_error_max").empty(), row.at("query") == "any");
    const bool lies = row.at("spec") == "wrong_uv" && row.at("query") == "closest";
    EXPECT_EQ(row.at("held"), lies ? "0" : "1");
    if (row.at("query") == "any") continue;
    EXPECT_EQ(Number(row, "uv_wrong") > 100, lies);
    EXPECT_EQ(std::stod(row.at("uv_error_max")) > 1, lies);
    EXPECT_GT(std::stod(row.at("uv_error_max")), 0);
  }
  const size_t at = outcome.out.find("--replay \"");
  ASSERT_NE(at, std::string::npos);
  const std::string ray = outcome.out.substr(at + 10, outcome.out.find('"', at + 10) - at - 10);
  const Outcome replay = Verify({kBall, "--plugin", plugin, "--structures", "wrong_uv", "--replay", ray});
  EXPECT_EQ(replay.exit_code, 1);
  EXPECT_THAT(replay.out, HasSubstr("u and v are off by "));
}

TEST_F(HarnessVerify, TheDefaultIsEveryStructureAtEachNumericsAndLinearOnesGetAPart) {
  const Outcome outcome = Verify({"icosphere(level=5)", "--sets", "random,planes", "--rays", "2K", "--any",
                                  "--examples", "0", "--out", In("out")});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const Registry registry;
  std::set<std::string> expected, seen;
  for (const Contestant& c : EveryArithmetic(registry, {})) expected.insert(c.Spec());
  for (const char* spec : {"brute", "brute(numerics=fast)", "bvh_sah", "bvh_sah(numerics=fast)"})
    EXPECT_TRUE(expected.contains(spec)) << spec;
  EXPECT_FALSE(expected.contains("null"));
  for (const Fields& row : ReadCsv(folder_ / "out" / "verdicts.csv")) {
    seen.insert(row.at("spec"));
    const uint64_t rays = Number(row, "rays");
    if (registry.Find(row.at("structure")).capabilities & RB_LINEAR) {
      EXPECT_EQ(rays, 1024u);
    } else {
      EXPECT_EQ(rays, 2048u);
    }
  }
  EXPECT_EQ(seen, expected);
  EXPECT_THAT(outcome.out, HasSubstr("planes: none: no visitor"));
}

TEST_F(HarnessVerify, ScenesOfProceduralPrimitivesSayWhatTheyLack) {
  std::ofstream(In("spheres.nff")) << kSpheres;
  const Outcome outcome = Verify({In("spheres.nff"), "--rays", "256", "--structures", "bvh_sah"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err << outcome.out;
  for (const char* set : {"aimed_vertex", "aimed_edge", "silhouette", "grazing"})
    EXPECT_THAT(outcome.out, HasSubstr(fmt::format("  {}: none: the scene has no triangles\n", set)));
  for (const char* set : {"random", "camera", "axis_parallel", "planes", "far"})
    EXPECT_THAT(outcome.out, HasSubstr(fmt::format("\n  {} ", set)));
  EXPECT_THAT(outcome.out, HasSubstr("claims watertight: held"));
}

TEST_F(HarnessVerify, TheLedgerAddsUpAndNeverCountsASeedTwice) {
  const std::vector<std::string> words = {
      kBall,      "--structures",   "bvh_sah,bvh_sah(numerics=fast)", "--closed", "100K",
      "--ledger", In("ledger.json")};
  const Outcome first = Verify(words);
  EXPECT_EQ(first.exit_code, 0) << first.err;
  EXPECT_THAT(first.out,
              HasSubstr("icosphere(level=2): closed, 320 triangles, 480 edges; rays from 64 points inside"));
  EXPECT_THAT(first.out, HasSubstr("102400 rays in 1 runs, 0 misses, leak rate < 2.9e-05"));
  const Outcome second = Verify(words);
  EXPECT_THAT(second.out, HasSubstr("204800 rays in 2 runs, 0 misses, leak rate < 1.5e-05"));
  // Other queries are another campaign.
  std::vector<std::string> any = words;
  any.push_back("--any");
  EXPECT_THAT(Verify(any).out, HasSubstr("102400 rays in 1 runs, 0 misses"));

  const auto ledger = nlohmann::json::parse(Read(folder_ / "ledger.json"));
  ASSERT_EQ(ledger.at("campaigns").size(), 4u);
  const auto &robust = ledger["campaigns"][0], &fast = ledger["campaigns"][1];
  EXPECT_EQ(robust.at("scene"), kBall);
  EXPECT_EQ(robust.at("structure"), "bvh_sah");
  EXPECT_THAT(robust.at("params").get<std::string>(), HasSubstr("numerics=watertight"));
  EXPECT_EQ(robust.at("version"), kVersion);
  EXPECT_EQ(robust.at("rays"), 204800);
  EXPECT_EQ(robust.at("misses"), 0);
  for (const auto& campaign : {robust, fast}) {
    ASSERT_EQ(campaign.at("runs").size(), 2u);
    EXPECT_EQ(campaign["runs"][0].at("seed"), 1);
    EXPECT_EQ(campaign["runs"][1].at("seed"), 2);
  }
  const uint64_t misses[] = {fast["runs"][0].at("misses"), fast["runs"][1].at("misses")};
  EXPECT_GT(misses[0], 100u);
  EXPECT_NE(misses[0], misses[1]);  // other rays
  EXPECT_EQ(fast.at("misses"), misses[0] + misses[1]);
  // Rays do not depend on the threads.
  std::vector<std::string> alone = {
      kBall, "--structures", "bvh_sah(numerics=fast)", "--closed", "100K", "--threads", "1"};
  EXPECT_THAT(Verify(alone).out, HasSubstr(fmt::format("102400 closest-hit rays, {} misses", misses[0])));
}

TEST_F(HarnessVerify, ALedgerThatDoesNotAddUpIsRefusedAndLeftAlone) {
  const std::string good =
      R"({"format": "raybench closed-mesh ledger 1", "campaigns": [{"scene": "x", "scene_hash": "0",
    "structure": "s", "params": "", "query": "closest", "version": "1", "commit": "c", "plugin_sha256": "",
    "rays": 30, "misses": 2, "runs": [{"seed": 1, "rays": 10, "misses": 0}, {"seed": 5, "rays": 20, "misses": 2}]}]})";
  const LedgerKey key{"0", "s", "", "closest", "1", "c", ""};
  const std::string path = In("ledger.json");
  const auto write = [&](const std::string& text) { std::ofstream(path) << text; };
  write(good);
  Ledger ledger(path);
  EXPECT_EQ(ledger.Totals(key).rays, 30u);
  EXPECT_EQ(ledger.Begin(key, "x", 1), 2u);
  EXPECT_EQ(ledger.Begin(key, "x", 5), 6u);
  ledger.Record(key, 2, 100, 1);
  EXPECT_EQ(ledger.Totals(key).rays, 130u);
  EXPECT_EQ(ledger.Totals(key).misses, 3u);
  EXPECT_EQ(ledger.Totals(key).runs, 4u);
  LedgerKey other = key;
  other.commit = "d";
  EXPECT_EQ(ledger.Totals(other).rays, 0u);
  EXPECT_THROW(ledger.Record(other, 1, 1, 0), InputError);
  EXPECT_THROW(Ledger(In("no/such/ledger.json")), InputError);

  const auto with = [&](const std::string& from, const std::string& to) {
    std::string text = good;
    text.replace(text.find(from), from.size(), to);
    return text;
  };
  for (const auto& [text, says] : std::vector<std::pair<std::string, std::string>>{
           {"", "is not a ledger of raybench"},
           {"[1, 2]", "is not a ledger of raybench"},
           {with("ledger 1", "ledger 9"), "is not a ledger of raybench"},
           {with("\"rays\": 30", "\"rays\": 31"),
            "campaign 0 has 31 rays and 2 misses, but its runs add up to 30 and 2"},
           {with("\"misses\": 2", "\"misses\": 1"), "campaign 0 has 30 rays and 1 misses"},
           {with("\"seed\": 5", "\"seed\": 1"), "campaign 0 has two runs with seed 1"},
           {with("\"misses\": 2}", "\"misses\": 21}"),
            "campaign 0 has more misses than rays in the run with seed 5"},
           {with("\"rays\": 20", "\"rays\": -20"), "campaign 0 has a run without the counts"},
           {with("\"rays\": 30", "\"rays\": \"many\""), "campaign 0 has no counts"},
           {with("\"commit\"", "\"comet\""), "campaign 0 has no text 'commit'"}}) {
    write(text);
    const Outcome outcome = Verify({kBall, "--structures", "bvh_sah", "--closed", "1K", "--ledger", path});
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_THAT(outcome.err, HasSubstr("ledger.json: " + says));
    EXPECT_EQ(outcome.out, "");
    EXPECT_EQ(Read(path), text);
  }
}

TEST_F(HarnessVerify, CtrlCKeepsWhatWasFired) {
  // On a slow machine nothing is fired, or judged, after a second yet.
  const fs::path ledger = folder_ / "ledger.json";
  uint64_t rays = 0;
  for (int seconds = 1; seconds <= 64 && rays == 0; seconds *= 4) {
    fs::remove(ledger);
    const pid_t pid =
        Start({"verify", kBall, "--structures", "bvh_sah", "--closed", "1000G", "--ledger", ledger.string()});
    // The run is entered before it begins.
    for (int i = 0; i < 600 && !fs::exists(ledger); ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    std::this_thread::sleep_for(std::chrono::seconds(seconds));
    kill(pid, SIGINT);
    const Outcome outcome = Finish(pid);
    EXPECT_EQ(outcome.exit_code, 130) << outcome.err;
    rays = nlohmann::json::parse(Read(ledger)).at("campaigns").at(0).at("rays");
    EXPECT_THAT(outcome.out,
                HasSubstr(fmt::format("bvh_sah, claims watertight: {} closest-hit rays, 0 misses", rays)));
  }
  EXPECT_GT(rays, 0u);
  EXPECT_EQ(rays % 65536, 0u);

  // Verdicts too: what was judged is shown.
  std::vector<Fields> rows;
  for (int seconds = 1; seconds <= 64 && (rows.empty() || Number(rows[0], "rays") == 0); seconds *= 4) {
    fs::remove_all(folder_ / "out");
    const pid_t judging =
        Start({"verify", kBall, "--structures", "bvh_sah", "--rays", "100M", "--out", In("out")});
    for (int i = 0; i < 600 && !fs::exists(folder_ / "out"); ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    std::this_thread::sleep_for(std::chrono::seconds(seconds));
    kill(judging, SIGINT);
    const Outcome judged = Finish(judging);
    EXPECT_EQ(judged.exit_code, 130) << judged.err;
    EXPECT_THAT(judged.out, HasSubstr("claims watertight: held"));
    rows = ReadCsv(folder_ / "out" / "verdicts.csv");
    ASSERT_FALSE(rows.empty());
  }
  EXPECT_GT(Number(rows[0], "rays"), 0u);
  EXPECT_EQ(nlohmann::json::parse(Read(folder_ / "out" / "verify.json")).at("interrupted"), true);
}

TEST_F(HarnessVerify, WrongInputIsOneLineAndNothingIsWritten) {
  std::ofstream(In("spheres.nff")) << kSpheres;
  std::ofstream(In("open.off")) << "OFF\n4 3 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n";
  fs::create_directories(In("full"));
  std::ofstream(In("full/verdicts.csv")) << "x\n";
  const std::string out = In("out"), ray = "0,0,0,0,1,0,0,inf";
  for (const auto& [words, says] : std::vector<std::pair<std::vector<std::string>, std::string>>{
           {{}, "name a scene"},
           {{"nosuch"}, "nosuch"},
           {{kBall, kBall}, "is given twice"},
           {{kBall, "--structures", "nosuch"}, "unknown structure 'nosuch'"},
           {{kBall, "--structures", "bvh_sah,bvh_sah"}, "is given twice"},
           {{kBall, "--sets", "sideways"},
            "unknown ray set 'sideways'; allowed are random, camera, aimed_vertex, "},
           {{kBall, "--rays", "12"}, "between 64 and 2^28"},
           {{kBall, "--rays", In("nosuch.rays")}, "neither a number of rays"},
           {{kBall, "--rays", In("full"), "--sets", "random"}, "--sets"},
           {{kBall, "--threads", "0"}, "--threads"},
           {{kBall, "--out", In("full")}, "holds the results of another verification"},
           {{kBall, "--ledger", In("l.json")}, "--closed"},
           {{kBall, "--closed", "0"}, "--closed"},
           {{kBall, "--closed", "1K", "--sets", "random"}, "--sets"},
           {{kBall, "--closed", "1K", "--rays", "64"}, "--rays"},
           {{kBall, "--closed", "1K", "--out", out}, "--out"},
           {{kBall, "--closed", "1K", "--ledger", In("no/l.json")}, "is not a readable folder"},
           {{In("open.off"), "--closed", "1K", "--ledger", In("l.json")},
            "is not closed: 3 of 6 edges have an odd number of triangles; one of them runs from (1, 0, 0) to "
            "(0, 1, 0) and has 1, of which triangle 0 is the first"},
           {{In("spheres.nff"), "--closed", "1K"}, "has no triangles"},
           {{kBall, "--replay", ray, "--rays", "64"}, "--replay"},
           {{kBall, "icosphere(level=1)", "--replay", ray}, "--replay: name one scene"},
           {{kBall, "--replay", "0,0,0,0,1,0,inf"},
            "--replay: write ox,oy,oz,tnear,dx,dy,dz,tfar; dz is not a number"},
           {{kBall, "--replay", "0,0,0,0,1,0,0,inf,2"}, "tfar is not a number there"},
           {{kBall, "--replay", "1e39,0,0,0,1,0,0,inf"}, "ox = 1e+39 is beyond float"},
           {{kBall, "--replay", "0,0,0,0,0,0,0,inf"}, "the direction not 0"},
           {{kBall, "--replay", "0,0,0,-1,1,0,0,inf"}, "tnear at least 0"}}) {
    SCOPED_TRACE(::testing::PrintToString(words));
    const Outcome outcome = Verify(words);
    EXPECT_EQ(outcome.exit_code, 2) << outcome.err;
    EXPECT_EQ(outcome.out, "");
    EXPECT_THAT(outcome.err, HasSubstr(says));
    EXPECT_FALSE(fs::exists(out));
    EXPECT_FALSE(fs::exists(In("l.json")));
  }
}

TEST(HarnessVerifyRay, TextReadsBackToTheSameBits) {
  const rb_ray ray{
      {0.1f, -0.0f, 0x1p-149f}, 0.3f, {-1e30f, 1.0f / 3, 0}, std::numeric_limits<float>::infinity()};
  const rb_ray back = ParseRay(FormatRay(ray, 0), 0).ray;
  EXPECT_EQ(std::memcmp(&back, &ray, sizeof ray), 0);
}

TEST_F(HarnessVerify, HelpSaysHowToReadTheClasses) {
  const Outcome help = Verify({"--help"});
  EXPECT_EQ(help.exit_code, 0);
  for (const char* word :
       {"--structures", "--rays", "--sets", "--any", "--seed", "--threads", "--examples", "--out", "--replay",
        "--closed", "--ledger", "--crossings", "--drop-bad", "Examples:", "Exit codes:"})
    EXPECT_THAT(help.out, HasSubstr(word));
  for (const RayFamily& family : AimedFamilies()) {
    EXPECT_THAT(help.out, HasSubstr(family.name));
    EXPECT_THAT(help.out, HasSubstr(family.doc));
  }
  for (const char* name :
       {"exact", "tie", "neighbour", "leak", "wrong", "false miss", "false hit", "marginal"})
    EXPECT_THAT(help.out, HasSubstr(name));
  EXPECT_THAT(Call({"--help"}).out, HasSubstr("raybench verify"));
}

}  // namespace
}  // namespace raybench
