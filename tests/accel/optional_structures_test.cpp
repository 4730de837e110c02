// Structures of raybench that are not here: who asks for one learns why, and what it takes.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "accel/host/builtin.h"
#include "accel/host/registry.h"

namespace raybench::testing {
namespace {

using ::testing::HasSubstr;

class OptionalStructuresTest : public ::testing::Test {
 protected:
  OptionalStructuresTest()
      : folder_(std::filesystem::path(::testing::TempDir()) /
                ("raybench_optional_" + std::to_string(getpid()))) {
    std::filesystem::create_directories(folder_);
    registry_.SetOnRequest(folder_.string());
  }
  ~OptionalStructuresTest() override { std::filesystem::remove_all(folder_); }

  std::string WhyNot(const std::string& name) const {
    try {
      registry_.Find(name);
    } catch (const InputError& error) {
      return error.what();
    }
    return {};
  }

  std::filesystem::path folder_;
  Registry registry_;
};

TEST_F(OptionalStructuresTest, SayWhatTheyTake) {
  const std::map<std::string, std::string> absent = registry_.Absent();
  ASSERT_TRUE(absent.contains("vulkan_rt"));
  EXPECT_EQ(absent.size(), OptionalStructures().size());
  for (const OptionalStructure& s : OptionalStructures()) {
    const std::string why = WhyNot(s.name);
    EXPECT_THAT(why, HasSubstr("structure '" + std::string(s.name) + "' is not here: "));
    EXPECT_THAT(why, HasSubstr(s.is_built ? (folder_ / s.name).string() + ".so is missing"
                                          : std::string("this build is without it")));
    EXPECT_THAT(why, HasSubstr("it takes the package"));
    EXPECT_EQ(why.find('\n'), std::string::npos);
  }
  EXPECT_THAT(WhyNot("vulkan_rt"), HasSubstr("libvulkan-dev and glslang-tools"));
  EXPECT_THAT(WhyNot("vulkan_rtx"), HasSubstr("unknown structure 'vulkan_rtx'"));
}

TEST_F(OptionalStructuresTest, SayThatTheirLibraryDoesNotLoad) {
  const std::filesystem::path file = folder_ / "vulkan_rt.so";
  std::ofstream(file) << "no library";
  EXPECT_FALSE(registry_.Absent().contains("vulkan_rt"));
  const std::string why = WhyNot("vulkan_rt");
  EXPECT_THAT(why, HasSubstr("plugin " + file.string() + ": "));
  EXPECT_EQ(why.find('\n'), std::string::npos);
}

}  // namespace
}  // namespace raybench::testing
