// What `raybench render` takes about sampling and shading, and what is said about a scene's needs.
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "accel/host/registry.h"
#include "harness/cli/picture_options.h"
#include "tests/support/command.h"

namespace raybench {
namespace {

constexpr const char* kSmallBall = "icosphere(level=1)";

TEST_F(HarnessCommand, RenderRefusesPictureOptionsThatMeanNothing) {
  const std::string out = (folder_ / "out.png").string();
  std::ofstream(folder_ / "empty.hdr");
  struct Row {
    std::vector<std::string> arguments;
    std::string says;
  };
  for (const Row& row : std::vector<Row>{
           {{"--samples", "0"}, "--samples"},
           {{"--samples", "65"}, "--samples"},
           {{"--samples", "2", "--pattern", "center"},
            "allowed with more are uniform, jittered, low-discrepancy"},
           {{"--samples", "2", "--pattern", "corners"}, "--pattern corners"},
           {{"--pattern", "spiral"}, "--pattern spiral: allowed are center, corners, uniform, jittered, low"},
           {{"--pattern", "corners", "--filter", "tent"}, "--filter"},
           {{"--filter", "sinc"}, "--filter sinc: allowed are box, tent, gaussian, mitchell"},
           {{"--adaptive", "2"}, "--adaptive"},
           {{"--adaptive", "0.1"}, "--adaptive: needs --samples of at least 2"},
           {{"--sampling-seed", "-x"}, "--sampling-seed"},
           {{"--rules", "cricket"}, "--rules cricket: allowed are whitted, spd"},
           {{"--rules", "spd", "--fresnel", "on"}, "--fresnel: --rules spd"},
           {{"--rules", "spd", "--min-contribution", "0.1"}, "--min-contribution: --rules spd"},
           {{"--rules", "spd", "--self-intersection", "none"}, "--self-intersection: --rules spd"},
           {{"--self-intersection", "pray"},
            "allowed are error-bound, none, tnear, normal-offset, integer-offset, skip"},
           {{"--self-intersection-size", "0.1"}, "only --self-intersection tnear and normal-offset"},
           {{"--self-intersection", "tnear", "--self-intersection-size", "-1"}, "a number from 0 to"},
           {{"--self-intersection", "skip", "--structure", "embree"}, "'embree' cannot skip a primitive"},
           {{"--fresnel", "maybe"}, "--fresnel maybe: allowed are material, on, off"},
           {{"--min-contribution", "-1"}, "--min-contribution"},
           {{"--background", "1,2"}, "--background 1,2: write R,G,B"},
           {{"--background", "1,2,3,4"}, "write R,G,B"},
           {{"--background", "1,2,-3"}, "write R,G,B"},
           {{"--background", "red"}, "write R,G,B"},
           {{"--background", "1,1,1", "--environment", "x.hdr"}, "not both"},
           {{"--environment", "x.gif"}, "allowed are files ending in .exr, .hdr, .png, .jpg, .jpeg"},
           {{"--environment", (folder_ / "none.exr").string()}, "none.exr: no such file"},
           {{"--environment", (folder_ / "empty.hdr").string()}, "empty.hdr"},
           {{"--heat", "steps", "--samples", "2"}, "--samples"},
       }) {
    if (row.says.find("embree") != std::string::npos) {
      const Registry registry;
      bool there = false;
      for (const rb_structure* s : registry.structures()) there |= std::string_view(s->name) == "embree";
      if (!there) continue;  // a build without Embree
    }
    SCOPED_TRACE(::testing::PrintToString(row.arguments));
    std::vector<std::string> words = {"render", kSmallBall, "-o", out, "--size", "8x8"};
    words.insert(words.end(), row.arguments.begin(), row.arguments.end());
    const Outcome outcome = Call(words);
    EXPECT_EQ(outcome.exit_code, 2) << outcome.err;
    EXPECT_NE(outcome.err.find(row.says), std::string::npos) << outcome.err;
    EXPECT_TRUE(outcome.err.starts_with("raybench: ")) << outcome.err;
    EXPECT_FALSE(fs::exists(out));
  }
}

TEST_F(HarnessCommand, RenderTakesEveryPictureOption) {
  const std::string out = (folder_ / "out.png").string();
  for (const std::vector<std::string>& more : std::vector<std::vector<std::string>>{
           {"--samples", "2"},
           {"--samples", "3", "--pattern", "low-discrepancy", "--filter", "mitchell", "--sampling-seed", "7"},
           {"--samples", "4", "--pattern", "uniform", "--filter", "gaussian", "--adaptive", "0.1"},
           {"--pattern", "corners"},
           {"--pattern", "center", "--filter", "tent"},
           {"--rules", "spd"},
           {"--rules", "whitted", "--fresnel", "on", "--min-contribution", "0.01"},
           {"--self-intersection", "skip"},
           {"--self-intersection", "normal-offset", "--self-intersection-size", "0.001"},
           {"--needs", "all"},
           {"--background", "0.1,0.2,3"}}) {
    SCOPED_TRACE(::testing::PrintToString(more));
    std::vector<std::string> words = {"render", kSmallBall, "-o", out, "--size", "16x16"};
    words.insert(words.end(), more.begin(), more.end());
    const Outcome outcome = Call(words);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    EXPECT_TRUE(Read(out).starts_with("\x89PNG"));
    fs::remove(out);
  }
  const Outcome help = Call({"render", "--help"});
  for (const char* option : {"--samples", "--pattern", "--filter", "--adaptive", "--sampling-seed",
                             "--self-intersection", "--self-intersection-size", "--fresnel",
                             "--min-contribution", "--environment", "--background", "--rules", "--needs"})
    EXPECT_NE(help.out.find(option), std::string::npos) << option;
}

TEST_F(HarnessCommand, NeedsAllMakesTheSamePictureOfMoreMemory) {
  const fs::path file = folder_ / "square.obj";
  {
    std::ofstream out(file);  // coordinates that no material reads
    for (int i = 1; i <= 50000; ++i) out << "v " << i << " 0 1\nvt 0.5 0.5\n";
    out << "v 0 0 0\nv 2000 4000 0\nvt 0 0\nvt 1 1\n";
    for (int i = 1; i <= 50000; ++i) out << "f " << i << '/' << i << " 50001/50001 50002/50002\n";
  }
  std::vector<std::string> pictures;
  std::vector<double> megabytes;
  for (const char* needs : {"scene", "all"}) {
    const fs::path picture = folder_ / "out.png";
    const Outcome outcome =
        Call({"render", file.string(), "-o", picture.string(), "--size", "32x32", "--needs", needs});
    ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
    pictures.push_back(Read(picture));
    const size_t at = outcome.out.find("scene: ");
    ASSERT_NE(at, std::string::npos) << outcome.out;
    megabytes.push_back(std::stod(outcome.out.substr(at + 7)));
  }
  EXPECT_EQ(pictures[0], pictures[1]);
  EXPECT_GT(megabytes[1], megabytes[0]);
}

TEST_F(HarnessCommand, WithoutTheLibraryOfPicturesRenderSaysSoAndTheRestWorks) {
  const fs::path alone = folder_ / "bin" / "raybench", err = folder_ / "err", picture = folder_ / "a.png";
  fs::create_directory(alone.parent_path());
  fs::copy(fs::path(kBinaryDirectory) / "raybench", alone);
  const auto call = [&](const std::string& words) {
    const int status =
        std::system(fmt::format("'{}' {} > /dev/null 2> '{}'", alone.string(), words, err.string()).c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  };
  EXPECT_EQ(call("list scenes"), 0) << Read(err);
  EXPECT_EQ(call(fmt::format("render {} -o '{}'", "'icosphere(level=1)'", picture.string())), 2);
  EXPECT_NE(Read(err).find("pictures need libraybench_images.so, which is not there"), std::string::npos);
  EXPECT_FALSE(fs::exists(picture));
}

TEST(PictureOptions, BecomeTraceOptions) {
  PictureOptions options;
  TraceOptions trace;
  SetTraceOptions(options, trace);
  EXPECT_EQ(trace.sampling.pattern, SamplePattern::kCenter);
  EXPECT_EQ(trace.sampling.grid, 1u);
  EXPECT_EQ(trace.rules, TraceRules::kWhitted);
  EXPECT_EQ(trace.self_intersection, SelfIntersection::kErrorBound);
  EXPECT_EQ(trace.fresnel, FresnelMode::kMaterial);
  EXPECT_EQ(trace.min_contribution, 0);

  options.samples = 4, options.filter = "gaussian", options.adaptive = 0.25f, options.sampling_seed = 9;
  options.self_intersection = "tnear", options.self_intersection_size = 0.5f;
  options.fresnel = "off", options.min_contribution = 0.125f;
  SetTraceOptions(options, trace);
  EXPECT_EQ(trace.sampling.pattern, SamplePattern::kJittered) << "more samples than one are jittered";
  EXPECT_EQ(trace.sampling.grid, 4u);
  EXPECT_EQ(trace.sampling.filter, ReconstructionFilter::kGaussian);
  EXPECT_EQ(trace.sampling.adaptive_contrast, 0.25f);
  EXPECT_EQ(trace.sampling.seed, 9u);
  EXPECT_EQ(trace.self_intersection, SelfIntersection::kFixedTnear);
  EXPECT_EQ(trace.self_intersection_size, 0.5f);
  EXPECT_EQ(trace.fresnel, FresnelMode::kOff);
  EXPECT_EQ(trace.min_contribution, 0.125f);
}

TEST_F(HarnessCommand, AnEnvironmentBecomesATextureOfTheScene) {
  std::ofstream(folder_ / "sky.JPG") << "jpeg";
  Scene scene = LoadScene(kSmallBall);
  PictureOptions options;
  options.background = "0.5,0,2e1";
  SetBackground(options, scene);
  EXPECT_EQ(scene.background, (Vec3f{0.5f, 0, 20}));
  EXPECT_EQ(scene.environment, -1);
  options = {};
  options.environment = (folder_ / "sky.JPG").string();
  SetBackground(options, scene);
  ASSERT_EQ(scene.environment, 0);
  EXPECT_EQ(*scene.textures[0].bytes, "jpeg");
  EXPECT_EQ(scene.textures[0].mime_type, "image/jpeg");
  EXPECT_EQ(scene.textures[0].source, (folder_ / "sky.JPG").string());
}

TEST(PictureOptions, TellTheStructureWhatItMustDo) {
  const Registry registry;
  const rb_structure& structure = *ParseContestant(registry, "bvh_sah").structure;
  Scene scene = LoadScene(kSmallBall);
  TraceOptions trace;
  EXPECT_EQ(BuildNeedsOf(scene, trace, structure), uint64_t(RB_NEED_UV | RB_NEED_ANY));
  trace.self_intersection = SelfIntersection::kSkip;
  EXPECT_EQ(BuildNeedsOf(scene, trace, structure), uint64_t(RB_NEED_UV | RB_NEED_ANY | RB_NEED_SKIP));
  trace = {};
  scene.materials[0].transmit = {1, 1, 1};
  EXPECT_EQ(BuildNeedsOf(scene, trace, structure), uint64_t(RB_NEED_UV | RB_NEED_AFTER));
  trace.rules = TraceRules::kSpd;  // glass blocks light there
  EXPECT_EQ(BuildNeedsOf(scene, trace, structure), uint64_t(RB_NEED_UV | RB_NEED_ANY));
}

TEST_F(HarnessCommand, ListSceneSaysWhatItNeedsAndWhy) {
  // Flat patches whose normals say nothing new; a glass ball.
  std::ofstream(folder_ / "glass.nff") << "f 1 1 1 0.5 0 0 0.5 1.5\ns 0 0 0 1\n"
                                          "f 1 1 1 1 0 0 0 0\npp 3 0 0 0 0 0 1 1 0 0 0 0 1 0 1 0 0 0 1\n";
  const std::string file = (folder_ / "glass.nff").string();
  const Outcome text = Call({"list", "scene", file});
  EXPECT_EQ(text.exit_code, 0) << text.err;
  for (const char* line : {"refraction_rays  yes  1 of 2 materials in use transmits",
                           "textures         no   there are no texture coordinates", "smallest feature",
                           "triangle sizes", "left out what nothing reads"})
    EXPECT_NE(text.out.find(line), std::string::npos) << line << " is not in\n" << text.out;
  const Outcome json = Call({"list", "scene", file, "--json"});
  const auto scene = nlohmann::json::parse(json.out);
  EXPECT_EQ(scene["needs"]["transmittance"]["needed"], true);
  EXPECT_EQ(scene["needs"]["smooth_normals"]["needed"], false);
  EXPECT_NE(scene["needs"]["smooth_normals"]["why"], "");
  EXPECT_EQ(scene["needs"]["closed"], false);
  EXPECT_GT(scene["needs"]["smallest_feature_ulp"], 0);
  EXPECT_EQ(scene["needs"]["size_spread"], 1);
  EXPECT_EQ(scene["saved_bytes"], 36);
  EXPECT_EQ(scene["shading_normals"], false);
}

TEST_F(HarnessCommand, RunJsonSaysWhatEachSceneNeeds) {
  ASSERT_EQ(Call(TinyRun("out", {"--structures", "null"})).exit_code, 0);
  const auto run = nlohmann::json::parse(Read(folder_ / "out" / "run.json"));
  const auto& needs = run.at("scenes").at(0).at("needs");
  EXPECT_EQ(needs.at("shadow_rays").at("needed"), true);
  EXPECT_EQ(needs.at("transmittance").at("needed"), false);
  EXPECT_NE(needs.at("transmittance").at("why"), "");
  EXPECT_EQ(needs.at("closed"), true);
  EXPECT_EQ(run.at("scenes").at(0).at("saved_bytes"), 0);
}

}  // namespace
}  // namespace raybench
