// The recorder's example as a stranger builds it: strict C11, its own little ray caster. What it found,
// raybench finds in the files that it leaves.
#include <gmock/gmock.h>

#include <cstdio>
#include <fstream>

#include "accel/host/registry.h"
#include "tests/support/command.h"
#include "tracer/rays/ray_file.h"

namespace raybench {
namespace {

using ::testing::HasSubstr;

class HarnessRecorder : public HarnessCommand {
 protected:
  std::string In(const std::string& name) const { return (folder_ / name).string(); }
  int Shell(const std::string& command) {
    return std::system(fmt::format("cd '{}' && {} > log 2>&1", folder_.string(), command).c_str());
  }
  const std::string recorder_ = std::string(kSourceDirectory) + "/tracer/rays/recorder";
};

TEST_F(HarnessRecorder, ExampleRecordsWhatReplaysToItsOwnHits) {
  if (Shell("cc --version") != 0) GTEST_SKIP() << "no C compiler 'cc' here, so the example is not tried";
  ASSERT_EQ(Shell(fmt::format("cc -std=c11 -O2 -Wall -Wextra -Werror -pedantic '{}/example.c' -o example -lm",
                              recorder_)),
            0)
      << Read(In("log"));
  ASSERT_EQ(Shell("./example out"), 0) << Read(In("log"));
  unsigned long camera = 0, hits = 0, prims = 0, shadow = 0, blocked = 0;
  char hash[17];
  ASSERT_EQ(std::sscanf(
                Read(In("log")).c_str(),
                "scene %16s camera %lu rays, %lu hit, sum of triangles hit %lu shadow %lu rays, %lu blocked",
                hash, &camera, &hits, &prims, &shadow, &blocked),
            6)
      << Read(In("log"));
  EXPECT_GT(hits, 1000u);
  EXPECT_LT(hits, camera);
  EXPECT_EQ(shadow, hits);
  EXPECT_GT(blocked, 100u);

  const Scene scene = LoadScene(In("out.ply"));
  EXPECT_EQ(scene.hash(), hash);
  const RaySet set = ReplayedSet(ReadRayFile(In("out_camera.rays")), scene);
  EXPECT_EQ(set.invalid_rays, 0u);
  Registry registry;
  const Tree tree(ParseContestant(registry, "brute"), scene.Geometry(), DefaultBuildOptions());
  std::vector<rb_hit> answers(set.rays.size());
  rb_query query = {};
  query.struct_size = sizeof query;
  query.kind = set.query, query.n = set.rays.size();
  query.rays = set.rays.data(), query.hits = answers.data();
  tree.Query(query);
  unsigned long sum = 0;
  for (const rb_hit& hit : answers) sum += hit.prim == RAYBENCH_NONE ? 0 : hit.prim;
  EXPECT_EQ(sum, prims);

  const Outcome run = Call({"run", In("out.ply"), "--rays", In("out_camera.rays"), "--rays",
                            In("out_shadow.rays"), "--structures", "bvh_sah", "--quick", "--repetitions", "1",
                            "--threads", "1", "--no-report", "--out", In("results")});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  std::map<std::string, std::string> found;
  for (auto& row : ReadCsv(folder_ / "results" / "cases.csv")) {
    found[row["ray_set"] + " " + row["query"]] = row["rays"] + " " + row["hits"];
    EXPECT_EQ(row["order"], row["query"] == "build" ? "" : "recorded");
  }
  EXPECT_EQ(found,
            (std::map<std::string, std::string>{{"build build", " "},
                                                {"out_camera closest", fmt::format("{} {}", camera, hits)},
                                                {"out_shadow any", fmt::format("{} {}", shadow, blocked)}}));
}

TEST_F(HarnessRecorder, HeaderIsStrictCAndCpp) {
  std::ofstream(In("use.cpp"))
      << "#define RAYBENCH_RECORDER_IMPLEMENTATION\n#include \"raybench_recorder.h\"\n"
         "#include \"raybench_recorder.h\"\n";
  EXPECT_EQ(
      Shell(fmt::format("'{}' -std=c++11 -Wall -Wextra -Wconversion -Werror -pedantic -I '{}' -c use.cpp",
                        kCompilerPath, recorder_)),
      0)
      << Read(In("log"));
  if (Shell("cc --version") != 0) GTEST_SKIP() << "no C compiler 'cc' here, so C is not tried";
  EXPECT_EQ(Shell("cp use.cpp use.c"), 0);
  EXPECT_EQ(Shell(fmt::format("cc -std=c99 -Wall -Wextra -Wconversion -Werror -pedantic -I '{}' -c use.c",
                              recorder_)),
            0)
      << Read(In("log"));
}

}  // namespace
}  // namespace raybench
