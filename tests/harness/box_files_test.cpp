// The boxes of trees that a run leaves for the report.
#include "harness/results/box_files.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "harness/base/json.h"
#include "tests/support/tracer.h"

namespace raybench {
namespace {

namespace fs = std::filesystem;

class HarnessBoxFiles : public ::testing::Test {
 protected:
  HarnessBoxFiles() : folder_(fs::path(::testing::TempDir()) / "raybench_box_files") {
    fs::remove_all(folder_);
    for (int i = 0; i < 40; ++i) testing::AddFloor(scene_, {2.0f * float(i), 0, 0}, 0.5f);
  }
  ~HarnessBoxFiles() override { fs::remove_all(folder_); }
  Json Read() const {
    std::ifstream in(folder_ / "boxes" / "s.json");
    return Json::parse(in);
  }
  void Add(const std::string& spec, size_t most = 1000) const {
    AddBoxes(folder_ / "boxes" / "s.json", spec, testing::BuildTree(scene_, spec), most);
  }
  Scene scene_;
  fs::path folder_;
};

TEST_F(HarnessBoxFiles, HoldEveryLevelOfASmallTree) {
  Add("bvh_sah(leaf_size=1)");
  const Json tree = Read().at("trees").at(0);
  EXPECT_EQ(tree.at("spec"), "bvh_sah(leaf_size=1)");
  ASSERT_EQ(tree.at("levels").size(), tree.at("depth").get<size_t>() + 1);
  const Json root = tree.at("levels").at(0).at(0);
  EXPECT_EQ(tree.at("levels").at(0).size(), 1u);
  EXPECT_NEAR(root.at(0), -0.5, 1e-4);
  EXPECT_NEAR(root.at(3), 78.5, 1e-4);
  EXPECT_EQ(root.at(6), 0);
  size_t inner = 0, leaves = 0;
  for (const Json& level : tree.at("levels"))
    for (const Json& box : level) {
      ++(box.at(6) == 1 ? leaves : inner);
      EXPECT_GE(box.at(0), root.at(0));
      EXPECT_LE(box.at(3), root.at(3));
    }
  EXPECT_EQ(leaves, inner + 1);  // a binary tree
}

TEST_F(HarnessBoxFiles, HoldWholeLevelsAsLongAsThereIsRoom) {
  Add("bvh_sah(leaf_size=1)", 6);
  const Json tree = Read().at("trees").at(0);
  ASSERT_EQ(tree.at("levels").size(), 2u);  // 1 + 2; with 4 more there would be 7
  EXPECT_EQ(tree.at("levels").at(1).size(), 2u);
  EXPECT_GT(tree.at("depth"), 3);
}

TEST_F(HarnessBoxFiles, HoldEachStructureOnceAndNothingOfWhatIsNoBox) {
  Add("bvh_sah");
  Add("kdtree_sah");
  Add("bvh_sah");
  EXPECT_EQ(Read().at("trees").size(), 2u);
  Add("bvh_sphere");
  Add("brute");
  EXPECT_EQ(Read().at("trees").size(), 2u);
}

}  // namespace
}  // namespace raybench
