// Heat maps as files: what the Python part reads, and what `raybench render --heat` leaves.
#include "harness/render/heat.h"

#include <OpenImageIO/imageio.h>
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <numeric>

#include "accel/host/registry.h"
#include "harness/results/heat_files.h"
#include "tests/support/command.h"
#include "tracer/heat_map.h"

namespace raybench {
namespace {

class HarnessHeat : public HarnessCommand {
 protected:
  /// Exit code of `raybench render icosphere(level=2) ARGUMENTS`, its output in out() and err().
  int Render(const std::string& arguments, const std::string& environment = "") {
    const std::string command = fmt::format("{} '{}/raybench' render 'icosphere(level=2)' {} > '{}' 2> '{}'",
                                            environment, kBinaryDirectory, arguments,
                                            (folder_ / "stdout").string(), (folder_ / "stderr").string());
    const int status = std::system(command.c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  std::string out() const { return Read(folder_ / "stdout"); }
  std::string err() const { return Read(folder_ / "stderr"); }
  std::string Path(const char* name) const { return (folder_ / name).string(); }

  static long Lines(const std::string& text) { return std::count(text.begin(), text.end(), '\n'); }

  static HeatMap Numbered(uint32_t width, uint32_t height, uint32_t factor) {
    HeatMap map{width, height, std::vector<uint32_t>(width * height), std::vector<uint32_t>(width * height)};
    for (uint32_t i = 0; i < width * height; ++i) map.steps[i] = i, map.prims[i] = i * factor;
    return map;
  }
};

TEST_F(HarnessHeat, MapsAreNpyFilesInTheNarrowestType) {
  HeatFiles files(folder_ / "heat", "scene", "picture.png");
  files.Add("a", Numbered(3, 5, 1000));
  files.AddNotCounted("b", "cannot count");
  files.Add("c", Numbered(3, 5, 100000));
  EXPECT_TRUE(files.Has("a") && files.Has("b") && files.Has("c"));
  EXPECT_FALSE(files.Has("d"));
  const Json content = Json::parse(Read(folder_ / "heat" / "heat.json"));
  EXPECT_EQ(content["scene"], "scene");
  EXPECT_EQ(content["picture"], "picture.png");
  ASSERT_EQ(content["maps"].size(), 3u);
  EXPECT_EQ(content["maps"][1]["why_not"], "cannot count");

  const auto check = [&](const Json& name, const std::string& type, size_t size, uint32_t factor) {
    const std::string bytes = Read(folder_ / "heat" / name.get<std::string>());
    ASSERT_GE(bytes.size(), 64u);
    EXPECT_EQ(bytes.substr(0, 8), std::string("\x93NUMPY\x01\0", 8));
    const size_t header = uint8_t(bytes[8]) + 256 * size_t(uint8_t(bytes[9]));
    EXPECT_EQ((10 + header) % 64, 0u);
    EXPECT_EQ(bytes[10 + header - 1], '\n');
    EXPECT_TRUE(bytes.substr(10, header)
                    .starts_with("{'descr': '" + type + "', 'fortran_order': False, 'shape': (5, 3), }"))
        << bytes.substr(10, header);
    ASSERT_EQ(bytes.size(), 10 + header + 15 * size);
    for (uint32_t i = 0; i < 15; ++i) {
      uint32_t value = 0;
      for (size_t b = 0; b < size; ++b)
        value |= uint32_t(uint8_t(bytes[10 + header + i * size + b])) << (8 * b);
      EXPECT_EQ(value, i * factor);
    }
  };
  check(content["maps"][0]["steps"], "|u1", 1, 1);
  check(content["maps"][0]["prims"], "<u2", 2, 1000);
  check(content["maps"][2]["prims"], "<u4", 4, 100000);

  // A folder is gone on with.
  HeatFiles again(folder_ / "heat", "scene", "picture.png");
  EXPECT_TRUE(again.Has("c"));
  again.Add("d", Numbered(3, 5, 2));
  check(Json::parse(Read(folder_ / "heat" / "heat.json"))["maps"][3]["prims"], "|u1", 1, 2);
  check(content["maps"][2]["prims"], "<u4", 4, 100000);  // and what was there is untouched
  std::ofstream(folder_ / "heat" / "heat.json") << "{";
  EXPECT_THROW(HeatFiles(folder_ / "heat", "scene", "picture.png"), InputError);
}

TEST_F(HarnessHeat, DefaultsCountAndNamedOnesAreTaken) {
  const Registry registry;
  const std::vector<Contestant> chosen = HeatContestants(registry, {});
  ASSERT_GE(chosen.size(), 2u);
  for (const Contestant& c : chosen) {
    EXPECT_NE(c.structure->query_counted, nullptr) << c.Spec();
    EXPECT_STRNE(c.structure->name, "null");
    EXPECT_STRNE(c.structure->name, "brute");
  }
  EXPECT_EQ(HeatContestants(registry, {"brute"}).size(), 1u);
}

TEST_F(HarnessHeat, TheExrHoldsTheCountsOfTheCameraRays) {
  ASSERT_EQ(Render(fmt::format("--heat both --structures 'brute,bvh_sah(leaf_size=2)' --size 60x40 -o '{}'",
                               Path("a.exr"))),
            0)
      << err();
  const Registry registry;
  const Scene scene = LoadScene("icosphere(level=2)", LoadOptions());
  const auto input = OIIO::ImageInput::open(Path("a.exr"));
  ASSERT_TRUE(input);
  EXPECT_EQ(input->spec().nchannels, 7);  // the picture's three and four maps
  for (const char* spec : {"brute", "bvh_sah(leaf_size=2)"}) {
    const Tree tree(ParseContestant(registry, spec), scene.Geometry(), DefaultBuildOptions());
    const HeatMap map = CountPerPixel(scene, tree, {.width = 60, .height = 40});
    for (const char* kind : {".steps", ".prims"}) {
      const int index = input->spec().channelindex(std::string(spec) + kind);
      ASSERT_GE(index, 0) << spec << kind;
      std::vector<float> read(60 * 40);
      ASSERT_TRUE(input->read_image(0, 0, index, index + 1, OIIO::TypeDesc::FLOAT, read.data()));
      const std::vector<uint32_t>& counts = std::strcmp(kind, ".steps") == 0 ? map.steps : map.prims;
      EXPECT_EQ(read, std::vector<float>(counts.begin(), counts.end())) << spec << kind;
      const HeatSummary summary = Summarize(counts);
      EXPECT_EQ(std::accumulate(read.begin(), read.end(), 0.0), double(summary.sum));
      // The printed figures are these.
      EXPECT_NE(out().find(fmt::format("mean {:.2f}, max {}", double(summary.sum) / 2400, summary.max)),
                std::string::npos)
          << out();
    }
  }
  ASSERT_EQ(Render(fmt::format("--heat prims --structures bvh_sah --size 8x8 -o '{}'", Path("b.exr"))), 0);
  EXPECT_EQ(OIIO::ImageInput::open(Path("b.exr"))->spec().nchannels, 4);
}

TEST_F(HarnessHeat, WhatCannotCountIsSaidAndLeftOut) {
  const Registry registry;
  std::string silent;
  for (const rb_structure* structure : registry.structures())
    if (structure->query_counted == nullptr) silent = structure->name;
  if (silent.empty()) GTEST_SKIP() << "every structure of this build can count";
  const std::string arguments =
      fmt::format("--heat both --size 8x8 -o '{}' --structures {}", Path("a.exr"), silent);
  ASSERT_EQ(Render(arguments + ",bvh_sah"), 0) << err();
  EXPECT_NE(out().find(silent + ": not counted (cannot count)"), std::string::npos) << out();
  EXPECT_EQ(OIIO::ImageInput::open(Path("a.exr"))->spec().nchannels, 5);
  fs::remove(Path("a.exr"));
  EXPECT_EQ(Render(arguments), 2);
  EXPECT_NE(err().find(silent + " cannot count"), std::string::npos) << err();
  EXPECT_FALSE(fs::exists(Path("a.exr")));
}

TEST_F(HarnessHeat, WithoutPythonASheetIsRefusedAndAnExrIsNot) {
  const std::string none = "RAYBENCH_PYTHON=/nonexistent/python";
  EXPECT_EQ(Render(fmt::format("--heat both --size 8x8 -o '{}'", Path("a.png")), none), 2);
  EXPECT_NE(err().find("RAYBENCH_PYTHON"), std::string::npos) << err();
  EXPECT_NE(err().find(".exr"), std::string::npos) << err();
  EXPECT_EQ(Lines(err()), 1) << err();
  EXPECT_FALSE(fs::exists(Path("a.png")));
  EXPECT_EQ(Render(fmt::format("--heat both --size 8x8 -o '{}'", Path("a.exr")), none), 0) << err();
}

TEST_F(HarnessHeat, WrongArgumentsAreOneLineAndExitCode2) {
  struct Row {
    const char *arguments, *says;
  };
  for (const Row& row : {Row{"--heat colour -o @a.exr", "--heat"},
                         {"--heat -o @a.exr", "--heat"},
                         {"--heat both -o @a.jpg", "allowed: .png, .exr"},
                         {"--heat both -o @no/such/a.png", "not a directory"},
                         {"--heat both --structures nosuch -o @a.exr", "unknown structure 'nosuch'"},
                         {"--heat both --structures brute,brute -o @a.exr", "given twice"},
                         {"--heat both --structure brute -o @a.exr", "--structure"},
                         {"--structures brute -o @a.exr", "--heat"},
                         {"--heat-scale log -o @a.exr", "--heat"},
                         {"--heat both --heat-scale cubic -o @a.exr", "--heat-scale"}}) {
    std::string arguments = row.arguments;
    arguments.replace(arguments.find('@'), 1, folder_.string() + "/");
    EXPECT_EQ(Render(arguments), 2) << row.arguments;
    EXPECT_EQ(out(), "");
    EXPECT_TRUE(err().starts_with("raybench: ")) << err();
    EXPECT_EQ(Lines(err()), 1) << err();
    EXPECT_NE(err().find(row.says), std::string::npos) << err();
    EXPECT_FALSE(fs::exists(Path("a.exr")) || fs::exists(Path("a.jpg")));
  }
}

}  // namespace
}  // namespace raybench
