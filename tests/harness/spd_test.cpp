// raybench spd: counts and figures beside the published ones.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include "harness/spd/figures.h"
#include "tests/support/command.h"
#include "tests/support/effort.h"
#include "tests/support/shared_data.h"

namespace raybench {
namespace {

using nlohmann::json;

/// A mirror floor at z = 0 that fills the picture, a matte ceiling at z = 7 above the camera, facing up, and
/// a light over it.
constexpr char kRoom[] =
    "v\nfrom 0 0 5\nat 0 0 0\nup 0 1 0\nangle 60\nhither 1\nresolution 512 512\n"
    "b 0 0 0\nl 0 0 10\n"
    "f 1 1 1 0.5 0.5 10 0 0\np 4\n-100 -100 0\n100 -100 0\n100 100 0\n-100 100 0\n"
    "f 1 1 1 1 0 0 0 0\np 4\n-100 -100 7\n100 -100 7\n100 100 7\n-100 100 7\n";

json Figure(const json& all, const std::string& scene, const std::string& structure,
            const std::string& figure) {
  for (const json& row : all.at("rows"))
    if (row.at("scene").get<std::string>().ends_with(scene) &&
        row.at("structure").get<std::string>().starts_with(structure) && row.at("figure") == figure)
      return row;
  ADD_FAILURE() << scene << ", " << structure << ": no " << figure;
  return {{"ours", 0}, {"published", nullptr}, {"check", nullptr}};
}

TEST_F(HarnessCommand, SpdCountsTheRaysOfARoom) {
  std::ofstream(folder_ / "room.nff") << kRoom;
  const std::string file = (folder_ / "room.nff").string(), out = (folder_ / "out.json").string(),
                    csv = (folder_ / "out.csv").string();
  for (const char* structure : {"bvh_sah(numerics=double)", "brute"}) {
    const Outcome outcome = Call({"spd", file, "--json", out, "--csv", csv, "--structure", structure});
    ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
    const json all = json::parse(Read(out));
    constexpr int kRays = 513 * 513;
    // All camera rays hit the floor. All shadow rays from there are blocked by the ceiling, which all
    // mirrored rays hit too; from there light comes in freely, as it faces the light.
    for (const auto& [figure, count] : {std::pair("primitives", 2),
                                        {"camera rays", kRays},
                                        {"camera rays hitting", kRays},
                                        {"shadow rays", 2 * kRays},
                                        {"shadow rays blocked", kRays},
                                        {"secondary rays", kRays},
                                        {"secondary rays hitting", kRays},
                                        {"all rays", 4 * kRays}}) {
      const json row = Figure(all, "room.nff", structure, figure);
      EXPECT_EQ(row.at("ours"), count) << figure;
      EXPECT_TRUE(row.at("published").is_null());
      EXPECT_TRUE(row.at("check_percent").is_null());
    }
    EXPECT_NE(outcome.out.find("1,052,676"), std::string::npos) << outcome.out;
    EXPECT_NE(outcome.out.find("no figures are published"), std::string::npos);
    EXPECT_NE(outcome.out.find("including those that miss the grid"), std::string::npos);
    const auto rows = ReadCsv(csv);
    ASSERT_EQ(rows.size(), 8u);
    EXPECT_EQ(rows[7].at("ours"), "1052676");
    EXPECT_EQ(rows[7].at("published"), "");
  }
}

TEST_F(HarnessCommand, SpdComparesAFileNamedAsAPublishedScene) {
  std::ofstream(folder_ / "tetra.nff") << kRoom;
  const std::string out = (folder_ / "out.json").string();
  const Outcome outcome = Call({"spd", (folder_ / "tetra.nff").string(), "--json", out});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const json all = json::parse(Read(out));
  const json row = Figure(all, "tetra.nff", "bvh_sah", "primitives");
  EXPECT_EQ(row.at("published"), 4096);
  EXPECT_NEAR(row.at("check_percent").get<double>(), 100 * (2 / 4096.0 - 1), 1e-9);
  // No secondary rays were found there: nothing to take percents of.
  EXPECT_EQ(Figure(all, "tetra.nff", "bvh_sah", "secondary rays").at("published"), 0);
  EXPECT_TRUE(Figure(all, "tetra.nff", "bvh_sah", "secondary rays").at("published_percent").is_null());
  // Every ray meets the box around everything, and a grid's cells hold both.
  const json cells = Figure(all, "tetra.nff", "grid", "cells per ray");
  EXPECT_GE(cells.at("ours"), 1);
  EXPECT_EQ(cells.at("published"), 15.97);
  EXPECT_NE(outcome.out.find("resolution_x=35"), std::string::npos) << outcome.out;
  EXPECT_NE(outcome.out.find("resolution_x=16"), std::string::npos) << outcome.out;
}

TEST_F(HarnessCommand, SpdRefusesWrongInput) {
  std::ofstream(folder_ / "ball.nff") << "s 0 0 0 1\n";
  const std::string ball = (folder_ / "ball.nff").string();
  struct Row {
    std::vector<std::string> arguments;
    std::string says;
  };
  for (const Row& row :
       std::vector<Row>{{{"nosuch.nff"}, "nosuch.nff"},
                        {{ball, "--structure", "nosuch"}, "unknown structure 'nosuch'"},
                        {{ball, "--json", (folder_ / "no" / "x.json").string()}, "is not a directory"},
                        {{ball, "--csv", (folder_ / "no" / "x.csv").string()}, "is not a directory"},
                        {{ball, "--threads", "0"}, "--threads"}}) {
    SCOPED_TRACE(::testing::PrintToString(row.arguments));
    std::vector<std::string> words = {"spd"};
    words.insert(words.end(), row.arguments.begin(), row.arguments.end());
    const Outcome outcome = Call(words);
    EXPECT_EQ(outcome.exit_code, 2) << outcome.err;
    EXPECT_NE(outcome.err.find(row.says), std::string::npos) << outcome.err;
    EXPECT_EQ(outcome.out, "");
  }
}

void ExpectWithin(const json& row, const char* other, double percent) {
  const double theirs = row.at(other);
  EXPECT_NEAR(row.at("ours").get<double>(), theirs, theirs * percent / 100)
      << row.at("scene") << " " << row.at("structure") << " " << row.at("figure") << " beside " << other;
}

TEST_F(HarnessCommand, SpdAgreesWithPublishedFigures) {
  std::vector<std::string> words = {"spd", "--json", (folder_ / "out.json").string()};
  // gears is the slowest by far; the counts of all are compared in tests/tracer/spd_test.cpp.
  const auto left_out = [](const auto& figures) {
    return testing::kSanitized ? figures.scene != std::string_view("tetra")
                               : figures.scene == std::string_view("gears");
  };
  for (const SpdCounts& counts : kSpdCounts) {
    if (left_out(counts)) continue;
    const fs::path file = testing::SharedData() / "spd" / (std::string(counts.scene) + ".nff");
    if (!fs::exists(file)) GTEST_SKIP() << testing::NotCompared(file);
    words.push_back(file.string());
  }
  const Outcome outcome = Call(words);
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const json all = json::parse(Read(folder_ / "out.json"));
  for (const SpdCounts& counts : kSpdCounts) {
    if (left_out(counts)) continue;
    const std::string scene = std::string(counts.scene) + ".nff";
    const auto figure = [&](const char* name) { return Figure(all, scene, "bvh_sah", name); };
    EXPECT_EQ(figure("primitives").at("ours"), figure("primitives").at("published"));
    EXPECT_EQ(figure("camera rays").at("ours"), figure("camera rays").at("published"));
    EXPECT_NEAR(figure("camera rays hitting").at("ours").get<double>(), counts.camera_hits.published, 3);
    for (const char* name :
         {"shadow rays", "shadow rays blocked", "secondary rays", "secondary rays hitting", "all rays"}) {
      const json row = figure(name);
      ExpectWithin(row, "check", 0.5);
      const double published = row.at("published"), check = row.at("check");
      if (std::abs(published - check) <= 0.002 * check) ExpectWithin(row, "published", 0.5);
    }
  }
  for (const SpdGrid& grid : kSpdGrids) {
    if (left_out(grid)) continue;
    const std::string structure = "grid(numerics=fast,resolution_x=" + std::to_string(grid.resolution[0]);
    const auto figure = [&](const char* name) {
      return Figure(all, std::string(grid.scene) + ".nff", structure, name);
    };
    // At 35 x 35 x 35 the two agree to the digit; at 16 x 16 x 16 tetra's primitives lie on cell walls.
    const bool to_the_digit = grid.resolution[0] == 35;
    for (const char* name : {"empty cells", "references"})
      ExpectWithin(figure(name), "check", to_the_digit ? 0 : 1);
    for (const char* name : {"cells per ray", "empty cells per ray", "tests per ray"}) {
      ExpectWithin(figure(name), "check", to_the_digit ? 1 : 3);
      if (to_the_digit) ExpectWithin(figure(name), "published", 1);
    }
  }
  for (const SpdOctree& octree : kSpdOctrees) {
    if (left_out(octree)) continue;
    const auto figure = [&](const char* name) {
      return Figure(all, std::string(octree.scene) + ".nff", "octree", name);
    };
    // Where primitives lie in the planes of cells, as the teapot's do, the two differ by more than 1 %.
    for (const char* name : {"interior nodes", "leaves", "empty leaves", "references"}) {
      const json row = figure(name);
      const double ours = row.at("ours"), published = row.at("published"), check = row.at("check");
      EXPECT_LE(std::min(std::abs(ours / published - 1), std::abs(ours / check - 1)), 0.01) << row;
    }
    // Published as tests per ray, but what agrees is tests per ray that hits something.
    for (const char* name : {"tests per ray that hits", "leaves per ray"})
      ExpectWithin(figure(name), "published", 10);
  }
}

}  // namespace
}  // namespace raybench
