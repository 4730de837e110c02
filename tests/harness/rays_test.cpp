// `raybench rays` and `raybench run --rays FILE`: what is recorded replays to the same cases and hits, and
// what does not belong is refused before anything is written.
#include <gmock/gmock.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <set>

#include "datasets/models/fetch.h"
#include "tests/support/command.h"

namespace raybench {
namespace {

using ::testing::HasSubstr;
using Fields = std::map<std::string, std::string>;

class HarnessRays : public HarnessCommand {
 protected:
  std::string In(const std::string& name) const { return (folder_ / name).string(); }

  Outcome Record(const std::string& scene, const std::string& out, std::vector<std::string> more = {}) {
    std::vector<std::string> words = {"rays", "record",  scene, "-o",     In(out), "--rays",
                                      "256",  "--depth", "1",   "--seed", "3"};
    words.insert(words.end(), more.begin(), more.end());
    return Call(words);
  }
  Outcome Run(std::vector<std::string> scenes_and_rays, const std::string& out) {
    std::vector<std::string> words = {"run",
                                      "--quick",
                                      "--repetitions",
                                      "1",
                                      "--verify-rays",
                                      "64",
                                      "--depth",
                                      "1",
                                      "--seed",
                                      "3",
                                      "--no-report",
                                      "--threads",
                                      "1",
                                      "--structures",
                                      "bvh_sah,null",
                                      "--out",
                                      In(out)};
    words.insert(words.begin() + 1, scenes_and_rays.begin(), scenes_and_rays.end());
    return Call(words);
  }
  /// Without times and places in the plan.
  std::set<Fields> Cases(const std::string& out) {
    std::set<Fields> rows;
    for (Fields row : ReadCsv(folder_ / out / "cases.csv")) {
      EraseVarying(row);
      rows.insert(row);
    }
    return rows;
  }
};

TEST_F(HarnessRays, ReplayingIsTheSameCasesWithTheSameHits) {
  // Rescaled inside; the rays in the file are not.
  std::ofstream(In("huge.off")) << "OFF\n4 4 0\n0 0 0\n1e20 0 0\n0 1e20 0\n0 0 1e20\n"
                                   "3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n";
  size_t number = 0;
  for (const std::string& scene : {std::string("icosphere(level=1)"), In("huge.off")}) {
    const std::string n = std::to_string(number++);
    const Outcome recorded = Record(scene, "rays" + n, {"--shuffled"});
    ASSERT_EQ(recorded.exit_code, 0) << recorded.err;
    ASSERT_EQ(Run({scene, "--rays", "256", "--shuffled"}, "captured" + n).exit_code, 0);
    const Outcome replay = Run({scene, "--rays", In("rays" + n)}, "replayed" + n);
    ASSERT_EQ(replay.exit_code, 0) << replay.err;
    const std::set<Fields> captured = Cases("captured" + n), replayed = Cases("replayed" + n);
    EXPECT_EQ(captured, replayed);
    std::set<std::string> sets;
    uint64_t hits = 0;
    for (const Fields& row : replayed) {
      EXPECT_EQ(row.at("status"), "timed");
      if (row.at("query") == "build") continue;
      sets.insert(row.at("ray_set") + " " + row.at("order") + " " + row.at("query"));
      hits += std::stoull(row.at("hits"));
    }
    EXPECT_GT(hits, 100u);
    EXPECT_TRUE(sets.contains("camera traced closest"));
    EXPECT_TRUE(sets.contains("camera shuffled closest"));
    EXPECT_TRUE(sets.contains("shadow.0 traced any"));
    EXPECT_TRUE(sets.contains("ambient_occlusion traced any"));

    const auto scene_facts =
        nlohmann::json::parse(Read(folder_ / ("replayed" + n) / "run.json"))["scenes"][0];
    EXPECT_TRUE(scene_facts.at("image").is_null());
    EXPECT_FALSE(fs::exists(folder_ / ("replayed" + n) / "images" / "huge.png"));
    for (const auto& set : scene_facts.at("ray_sets")) {
      const std::string file = set.at("file");
      EXPECT_EQ(set.at("file_sha256"), Sha256OfFile(file));
      EXPECT_THAT(set.at("file_software").get<std::string>(), HasSubstr("raybench"));
    }
  }
}

TEST_F(HarnessRays, FilesGoToTheScenesTheyBelongTo) {
  const std::string a = "icosphere(level=1)", b = "icosphere(level=2)";
  ASSERT_EQ(Record(a, "a", {"--sets", "camera,shadow"}).exit_code, 0);
  ASSERT_EQ(Record(b, "b", {"--sets", "random"}).exit_code, 0);
  const Outcome outcome =
      Run({b, a, "--rays", In("b/random.rays"), "--rays", In("a"), "--rays", "100", "--shuffled"}, "out");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  std::set<std::string> sets;
  for (const Fields& row : Cases("out")) {
    if (row.at("query") == "build") continue;
    EXPECT_EQ(row.at("rays"), "100");
    sets.insert(row.at("scene") + " " + row.at("ray_set") + " " + row.at("order"));
  }
  EXPECT_EQ(sets,
            (std::set<std::string>{a + " camera traced", a + " camera shuffled", a + " shadow.0 traced",
                                   a + " shadow.0 shuffled", b + " random traced", b + " random shuffled"}));
}

TEST_F(HarnessRays, WhatDoesNotBelongIsRefusedBeforeAnythingIsWritten) {
  const std::string ball = "icosphere(level=1)";
  ASSERT_EQ(Record(ball, "a", {"--sets", "camera"}).exit_code, 0);
  const std::string good = Read(In("a/camera.rays"));
  std::ofstream(In("cut.rays"), std::ios::binary) << good.substr(0, good.size() - 1);
  std::ofstream(In("flipped.rays"), std::ios::binary) << good.substr(0, 999) << '\x55' << good.substr(1000);
  fs::create_directories(In("twice"));
  fs::create_directories(In("none"));
  fs::copy_file(In("a/camera.rays"), In("twice/camera.rays"));
  struct Wrong {
    std::vector<std::string> arguments;
    std::string says;
  };
  for (const Wrong& wrong : std::vector<Wrong>{
           {{ball, "--rays", In("cut.rays")},
            "cut.rays: is truncated: 256 rays take 8448 bytes, it has 8447"},
           {{ball, "--rays", In("flipped.rays")}, "flipped.rays: is damaged"},
           {{"icosphere(level=2)", "--rays", In("a")},
            "camera.rays: was recorded in 'icosphere(level=1)' (hash "},
           {{ball, "icosphere(level=2)", "--rays", In("a")}, "scene 'icosphere(level=2)' (hash "},
           {{ball, "--rays", In("a"), "--rays", In("twice")}, "would both be ray set 'camera'"},
           {{ball, "--rays", In("none")}, "none: has no .rays files"},
           {{ball, "--rays", In("nosuch.rays")},
            "nosuch.rays: neither a number of rays (such as 64K or 1M) nor a .rays file"},
           {{ball, "--rays", In("a"), "--sets", "camera"}, "--sets names captured ray sets"},
           {{"--rays", In("a")}, "name the scene"},
           {{ball, "--sets", "camera,lens"}, "unknown ray set 'lens'; allowed are camera, shadow.N, "},
           {{ball, "--sets", "camera.1"}, "unknown ray set 'camera.1'"},
           {{ball, "--sets", "shadow.x"}, "unknown ray set 'shadow.x'"},
       }) {
    SCOPED_TRACE(::testing::PrintToString(wrong.arguments));
    const Outcome outcome = Run(wrong.arguments, "out");
    EXPECT_EQ(outcome.exit_code, 2) << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr(wrong.says));
    EXPECT_TRUE(outcome.err.ends_with("\n") && outcome.err.rfind("raybench: ") != std::string::npos);
    EXPECT_FALSE(fs::exists(In("out")));
  }
  for (const Wrong& wrong : std::vector<Wrong>{
           {{"rays"}, "add record or info"},
           {{"rays", "info"}, "files"},
           {{"rays", "info", In("flipped.rays")}, "flipped.rays: is damaged"},
           {{"rays", "info", In("none")}, "none: has no .rays files"},
           {{"rays", "record", "nosuch", "-o", In("new")}, "nosuch"},
           {{"rays", "record", ball, "-o", In("new"), "--sets", "refraction"}, "has no rays of the sets"},
           {{"rays", "record", ball, "-o", In("new"), "--rays", "3"}, "--rays"},
           {{"rays", "record", ball}, "--out"},
           {{"rays", "record", ball, "-o", In("cut.rays"), "--sets", "random"}, "cut.rays: cannot be made"},
       }) {
    SCOPED_TRACE(::testing::PrintToString(wrong.arguments));
    const Outcome outcome = Call(wrong.arguments);
    EXPECT_EQ(outcome.exit_code, 2) << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr(wrong.says));
    EXPECT_FALSE(fs::exists(In("new")));
  }
}

TEST_F(HarnessRays, InfoShowsTheHeaderAndWhatTheRaysAreLike) {
  ASSERT_EQ(Record("icosphere(level=1)", "a", {"--sets", "camera,ambient_occlusion"}).exit_code, 0);
  const Outcome outcome = Call({"rays", "info", In("a")});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  for (const char* text :
       {"a/camera.rays\n", "a/ambient_occlusion.rays\n", "(icosphere(level=1))", "ambient_occlusion, depth 1",
        "256", "(verified)", "tfar finite      256 (100.00 %)", "tfar finite      0 (0.00 %)"})
    EXPECT_THAT(outcome.out, HasSubstr(text));
}

}  // namespace
}  // namespace raybench
