// Bad files and bad rays through the command: one line and exit code 2 with nothing written, or,
// where it is asked for, a run that goes on and says how much it left out. Every fault of every
// format: tests/datasets/bad_input_test.cpp.
#include <gmock/gmock.h>

#include <cstring>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>

#include "accel/base/hash.h"
#include "accel/contract/raybench.h"
#include "tests/support/command.h"

namespace raybench {
namespace {

using ::testing::HasSubstr;

class HarnessBadInput : public HarnessCommand {
 protected:
  std::string Write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name, std::ios::binary) << text;
    return (folder_ / name).string();
  }
  std::string In(const std::string& name) const { return (folder_ / name).string(); }

  /// Everything below the folder but what the test itself notes down.
  std::set<std::string> Files() const {
    std::set<std::string> files;
    for (const auto& entry : fs::recursive_directory_iterator(folder_))
      if (const std::string name = entry.path().filename(); name != "stdout" && name != "stderr")
        files.insert(entry.path());
    return files;
  }
};

TEST_F(HarnessBadInput, BadFilesAreOneLineInEveryCommandAndNothingIsWritten) {
  const std::string corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
  const std::string header =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
      "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
  struct Bad {
    std::string file, says;
    bool is_scene = false;  // `list scene` has nothing against it
  };
  const std::vector<Bad> all = {
      {Write("index.obj", corners + "f 1 2 4\n"), "line 4: face 0 refers to vertex 4; allowed are 1 to 3"},
      {Write("nan.off", "OFF\n3 1 0\n0 0 0\n1 nan 0\n0 1 0\n3 0 1 2\n"), "must be finite"},
      {Write("overflow.nff", "p 3\n0 0 0\n1e39 0 0\n0 1 0\n"), "line 3: the x of the corner is not finite"},
      {Write("cut.ply", header + "0 0 0\n1 0 0\n0 1 0\n"), "ends early"},
      {Write("infinite.stl",
             "solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 -inf 0\nendloop\n"
             "endfacet\nendsolid\n"),
       "must be finite"},
      {Write("cut.glb", std::string("glTF\2\0\0\0", 8)), "cut.glb: "},
      {Write("broken.gltf", "{\"asset\": {"), "broken.gltf: "},
      {Write("empty.obj", ""), "is empty"},
      {Write("no_faces.obj", corners), "no faces"},
      {Write("far_apart.obj", "v 1e38 0 0\nv 0 1 0\nv 0 0 1e-20\nf 1 2 3\n"), "too small beside"},
      {Write("lines.obj", corners + "f 1 1 2\nf 1 2 2\n"), "no primitives", true},
      {In("not_there.obj"), "no such file"},
  };
  const std::set<std::string> before = Files();
  for (const Bad& bad : all) {
    for (std::vector<std::string> command :
         {std::vector<std::string>{"run", bad.file, "--out", In("out"), "--no-report"},
          {"run", "subdivide(" + bad.file + ")", "--out", In("out"), "--no-report"},
          {"render", bad.file, "-o", In("out.png"), "--size", "8x8"},
          {"render", bad.file, "-o", In("out.png"), "--size", "8x8", "--heat", "steps"},
          {"rays", "record", bad.file, "-o", In("rays")},
          {"list", "scene", bad.file}}) {
      if (bad.is_scene && command[0] == "list") continue;
      SCOPED_TRACE(::testing::PrintToString(command));
      const Outcome outcome = Call(command);
      EXPECT_EQ(outcome.exit_code, 2);
      EXPECT_EQ(outcome.out, "");
      EXPECT_TRUE(outcome.err.starts_with("raybench: ")) << outcome.err;
      EXPECT_EQ(outcome.err.find('\n'), outcome.err.size() - 1) << outcome.err;
      EXPECT_THAT(outcome.err, HasSubstr(fs::path(bad.file).filename().string()));
      EXPECT_THAT(outcome.err, HasSubstr(bad.says));
      EXPECT_EQ(Files(), before);
    }
  }
}

TEST_F(HarnessBadInput, DropBadGoesOnAndCounts) {
  const std::string file = Write(
      "bad.off", "OFF\n5 4 0\n0 0 0\n1 0 0\n0 1 0\nnan 0 0\n0 0 1\n3 0 1 2\n3 0 1 3\n3 0 2 5\n3 1 1 2\n");
  std::vector<std::string> command = TinyRun("out", {"--structures", "bvh_sah", "--drop-bad"});
  command[1] = file;
  const Outcome outcome = Call(command);
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const auto scene = nlohmann::json::parse(Read(folder_ / "out" / "run.json")).at("scenes").at(0);
  EXPECT_EQ(scene.at("triangles"), 1);
  EXPECT_EQ(scene.at("dropped_triangles"), 2);
  EXPECT_EQ(scene.at("degenerate_triangles"), 1);
  // Nothing left is as good as nothing there.
  command[1] = Write("all_bad.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 inf 0\n3 0 1 2\n");
  *(std::find(command.begin(), command.end(), "--out") + 1) = In("none");
  const Outcome none = Call(command);
  EXPECT_EQ(none.exit_code, 2);
  EXPECT_THAT(none.err, HasSubstr("no primitives"));
  EXPECT_FALSE(fs::exists(In("none")));
}

TEST_F(HarnessBadInput, InvalidRaysOfAFileAreCountedAndMiss) {
  const std::string ball = "icosphere(level=1)";
  ASSERT_EQ(Call({"rays", "record", ball, "-o", In("a"), "--sets", "camera", "--rays", "256"}).exit_code, 0);
  std::string bytes = Read(In("a/camera.rays"));
  constexpr size_t kHeader = 256, kInvalid = 5;
  const auto ray = [&](size_t i) {
    rb_ray r;
    std::memcpy(&r, bytes.data() + kHeader + i * sizeof r, sizeof r);
    return r;
  };
  const auto put = [&](size_t at, const auto& value) {
    std::memcpy(bytes.data() + at, &value, sizeof value);
  };
  for (size_t i = 0; i < kInvalid; ++i) {
    rb_ray r = ray(i);
    const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
    if (i == 0) r.org[1] = nan;
    if (i == 1) r.dir[2] = -inf;
    if (i == 2) r.dir[0] = r.dir[1] = r.dir[2] = 0;
    if (i == 3) r.tnear = nan;
    if (i == 4) r.tfar = nan;
    put(kHeader + i * sizeof r, r);
  }
  // Checksums of the rays, then of the header.
  Hash64 of_rays, of_header;
  of_rays.Add(bytes.data() + kHeader, bytes.size() - kHeader);
  put(40, of_rays.value());
  of_header.Add(bytes.data(), 248);
  put(248, of_header.value());
  Write("bad.rays", bytes);
  const Outcome info = Call({"rays", "info", In("bad.rays")});
  EXPECT_THAT(info.out, HasSubstr("invalid          5 (")) << info.err;

  const auto run = [&](const std::string& rays, const std::string& out) {
    const Outcome outcome =
        Call({"run", ball, "--quick", "--repetitions", "1", "--no-report", "--threads", "1", "--structures",
              "brute,bvh_sah,embree,null", "--rays", In(rays), "--out", In(out)});
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    const auto facts =
        nlohmann::json::parse(Read(folder_ / out / "run.json")).at("scenes").at(0).at("ray_sets");
    std::map<std::string, std::string> hits;
    for (const auto& row : ReadCsv(folder_ / out / "cases.csv")) {
      EXPECT_EQ(row.at("status"), "timed");
      if (row.at("query") != "build") hits[row.at("structure")] = row.at("hits");
    }
    return std::pair(facts.at(0).at("invalid_rays").get<size_t>(), hits);
  };
  // The same rays without those five.
  const auto [invalid, hits] = run("bad.rays", "bad");
  EXPECT_EQ(invalid, kInvalid);
  EXPECT_EQ(hits.at("null"), "0");
  EXPECT_EQ(hits.at("bvh_sah"), hits.at("brute"));
  EXPECT_EQ(run("a/camera.rays", "good").first, 0u);
  EXPECT_EQ(hits.size(), 4u);
}

}  // namespace
}  // namespace raybench
