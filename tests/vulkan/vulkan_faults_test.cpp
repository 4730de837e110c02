// What the commands do when a Vulkan device fails: fault_layer.cpp stands between vulkan_rt and whatever driver there is.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <map>

#include "harness/measure/build_info.h"
#include "tests/support/command.h"

namespace raybench::testing {
namespace {

using ::testing::HasSubstr;

class VulkanFaults : public HarnessCommand {
 protected:
  void SetUp() override {
    const Outcome listed = Call({"list", "structure", "vulkan_rt"});
    ASSERT_EQ(listed.exit_code, 0) << listed.err;
    if (const size_t why = listed.out.find("not here: "); why != std::string::npos)
      GTEST_SKIP() << listed.out.substr(why);
  }
  void TearDown() override {
    for (const char* name : {"VK_INSTANCE_LAYERS", "VK_ADD_LAYER_PATH", "RAYBENCH_TEST_FAULT"})
      unsetenv(name);
  }

  Outcome CallWith(const std::string& fault, const std::vector<std::string>& arguments) {
    setenv("VK_ADD_LAYER_PATH", (fs::path(kBinaryDirectory) / "tests" / "vulkan_faults").c_str(), 1);
    setenv("VK_INSTANCE_LAYERS", "VK_LAYER_RAYBENCH_faults", 1);
    setenv("RAYBENCH_TEST_FAULT", fault.c_str(), 1);
    const char* const validation = std::getenv("RAYBENCH_VULKAN_VALIDATION");
    const std::string before = validation != nullptr ? validation : "";
    unsetenv("RAYBENCH_VULKAN_VALIDATION");  // which would find fault with the limits
    Outcome outcome = Call(arguments);
    if (validation != nullptr) setenv("RAYBENCH_VULKAN_VALIDATION", before.c_str(), 1);
    return outcome;
  }

  std::string In(const std::string& name) const { return (folder_ / name).string(); }
};

/// Rows of a run by status: those of the host's structure are all timed, those of the device say `why`.
struct RowCounts {
  size_t timed = 0, skipped = 0;
};
std::map<std::string, RowCounts> CountRows(const fs::path& run, const std::string& why) {
  std::map<std::string, RowCounts> counts;
  for (const auto& row : ReadCsv(run / "cases.csv")) {
    RowCounts& of_spec = counts[row.at("spec")];
    if (row.at("status") == "timed") {
      ++of_spec.timed;
      EXPECT_EQ(row.at("note"), "");
      continue;
    }
    ++of_spec.skipped;
    EXPECT_EQ(row.at("status"), "skipped");
    EXPECT_THAT(row.at("note"), HasSubstr(why));
    EXPECT_EQ(row.at("median_ns"), "");
  }
  return counts;
}

/// Lost while the first tree is judged, and while both are timed.
TEST_F(VulkanFaults, ARunKeepsTheRowsOfOthersWhenADeviceIsLost) {
  const std::string query = "vulkan_rt", pipeline = "vulkan_rt(path=pipeline)";
  for (const auto& [submission, second_lives] : {std::pair(12, true), {300, false}}) {
    SCOPED_TRACE(submission);
    const std::string out = fmt::format("run{}", submission);
    const Outcome ran = CallWith(fmt::format("lost={}", submission),
                                 TinyRun(out, {"--structures", query + "," + pipeline + ",bvh_sah"}));
    EXPECT_EQ(ran.exit_code, 0) << ran.err;
    EXPECT_THAT(ran.err, HasSubstr("is skipped: vulkan_rt: "));
    std::map<std::string, RowCounts> rows = CountRows(folder_ / out, "the device is lost");
    EXPECT_GT(rows["bvh_sah"].timed, 3u);
    EXPECT_EQ(rows["bvh_sah"].skipped, 0u);
    EXPECT_EQ(rows[query].timed, 0u);
    EXPECT_EQ(rows[query].skipped, rows["bvh_sah"].timed);
    // Of a lost device another one is made for the next tree; who had a tree on it has lost that.
    EXPECT_EQ(rows[pipeline].timed, second_lives ? rows["bvh_sah"].timed : 0);
    EXPECT_EQ(rows[pipeline].skipped, second_lives ? 0 : rows["bvh_sah"].timed);
  }
}

TEST_F(VulkanFaults, AVerificationTellsNoVerdictOfALostDevice) {
  const Outcome verified = CallWith("lost=8", {"verify", "icosphere(level=1)", "--structures",
                                               "vulkan_rt,bvh_sah", "--rays", "1K", "--out", In("verified")});
  EXPECT_EQ(verified.exit_code, 3) << verified.err;
  EXPECT_THAT(verified.out, HasSubstr("vulkan_rt: not verified: vulkan_rt: tracing: the device is lost"));
  size_t others = 0;
  for (const auto& row : ReadCsv(folder_ / "verified" / "verdicts.csv")) {
    EXPECT_EQ(row.at("structure"), "bvh_sah");
    ++others;
  }
  EXPECT_GT(others, 3u);
}

TEST_F(VulkanFaults, NoPictureIsHalfWritten) {
  const std::string out = In("out.png"), scene = "sphereflake(depth=1)";
  for (const auto& [fault, says] :
       {std::pair("lost=12", "the device is lost"), {"memory=4", "MiB on the device: out of device memory"}})
    for (const char* waves : {"device", "host"}) {
      SCOPED_TRACE(fmt::format("{}, waves on the {}", fault, waves));
      const Outcome drawn = CallWith(fault, {"render", scene, "-o", out, "--size", "16x16", "--waves", waves,
                                             "--structure", "vulkan_rt", "--json", In("out.json")});
      EXPECT_NE(drawn.exit_code, 0);
      EXPECT_THAT(drawn.err, HasSubstr("raybench: vulkan_rt: "));
      EXPECT_THAT(drawn.err, HasSubstr(says));
      EXPECT_EQ(std::count(drawn.err.begin(), drawn.err.end(), '\n'), 1) << drawn.err;
      for (const auto& entry : fs::directory_iterator(folder_))
        EXPECT_THAT(entry.path().filename().string(), ::testing::AnyOf("stdout", "stderr"));
    }
}

TEST_F(VulkanFaults, ARunSkipsWhatTheDeviceHasNoMemoryFor) {
  const Outcome ran = CallWith("memory=4", TinyRun("run", {"--structures", "vulkan_rt,bvh_sah"}));
  EXPECT_EQ(ran.exit_code, 0) << ran.err;
  std::map<std::string, RowCounts> rows = CountRows(folder_ / "run", "out of device memory");
  EXPECT_GT(rows["bvh_sah"].timed, 3u);
  EXPECT_EQ(rows["vulkan_rt"].skipped, rows["bvh_sah"].timed);
}

/// The device's limits decide into how many bottom levels the primitives go, and whether they go at all.
TEST_F(VulkanFaults, PrimitivesAreSplitAsTheDeviceWants) {
  const std::string specs = "vulkan_rt(opaque=false),vulkan_rt(path=pipeline,opaque=false)";
  const auto verify = [&](const std::string& fault, const std::string& out) {
    return CallWith(
        fault, {"verify", "icosphere(level=2)", "--structures", specs, "--rays", "2K", "--out", In(out)});
  };
  const Outcome whole = verify("none", "whole"), split = verify("limits=50,7", "split");  // 320 triangles
  EXPECT_EQ(whole.exit_code, 0) << whole.err;
  EXPECT_EQ(split.exit_code, 0) << split.err << split.out;
  const auto verdicts = [&](const std::string& out) { return Read(folder_ / out / "verdicts.csv"); };
  EXPECT_EQ(verdicts("whole"), verdicts("split"));

  const Outcome refused = verify("limits=50,6", "refused");
  EXPECT_EQ(refused.exit_code, 3);
  EXPECT_THAT(refused.out,
              HasSubstr("not verified: vulkan_rt(opaque=false): 320 primitives; the device takes "
                        "at most 50 in each of 6 instances"));
}

/// A program that was copied without its plugins, and one beside which lies something else.
TEST_F(HarnessCommand, AMissingPluginIsToldAsSuch) {
  const fs::path program = folder_ / "raybench";
  fs::copy_file(fs::path(kBinaryDirectory) / "raybench", program);
  const auto call = [&](const std::string& arguments) {
    const int status = std::system(
        fmt::format("'{0}' {1} >'{2}' 2>&1", program.string(), arguments, (folder_ / "said").string())
            .c_str());
    return std::pair(WEXITSTATUS(status), Read(folder_ / "said"));
  };
  const std::string run = fmt::format("run 'icosphere(level=1)' --structures vulkan_rt --out '{}'",
                                      (folder_ / "run").string()),
                    file = (folder_ / "plugins" / "vulkan_rt.so").string();
  const auto [missing, missing_says] = call(run);
  EXPECT_EQ(missing, 2);
  EXPECT_EQ(
      missing_says,
      fmt::format("raybench: structure 'vulkan_rt' is not here: its library {} is missing; it takes the "
                  "packages libvulkan-dev and glslang-tools and CMake's RAYBENCH_WITH_VULKAN=ON\n",
                  file));
  const auto [listed, list_says] = call("list structures");
  EXPECT_EQ(listed, 0);
  EXPECT_THAT(list_says, HasSubstr("\nvulkan_rt "));
  EXPECT_THAT(list_says, HasSubstr("not here: its library"));
  fs::create_directory(folder_ / "plugins");
  std::ofstream(file) << "no library";
  const auto [broken, broken_says] = call(run);
  EXPECT_EQ(broken, 2);
  EXPECT_THAT(broken_says, HasSubstr("raybench: plugin " + file + ": "));
  EXPECT_EQ(std::count(broken_says.begin(), broken_says.end(), '\n'), 1) << broken_says;
  EXPECT_FALSE(fs::exists(folder_ / "run"));
}

}  // namespace
}  // namespace raybench::testing
