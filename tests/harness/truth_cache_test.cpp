// Truth kept on disk: it saves the asking, and nothing that happens to its files changes a result.
#include "harness/judge/truth_cache.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>

#include "accel/base/random.h"
#include "harness/measure/build_info.h"
#include "tests/support/command.h"
#include "tests/support/files.h"

namespace raybench {
namespace {

/// Counts what the oracle is asked.
class CountingOracle final : public Oracle {
 public:
  explicit CountingOracle(const Scene& scene) : oracle_(MakeOracle(scene)) {}
  std::vector<Truth> Ask(std::span<const rb_ray> rays, uint32_t threads) const override {
    asked += rays.size();
    return oracle_->Ask(rays, threads);
  }
  bool IsStrict(const rb_ray& r, const Truth& t, const rb_hit& h) const override {
    return oracle_->IsStrict(r, t, h);
  }
  Verdict Judge(const rb_ray& r, const Truth& t, const rb_hit& h) const override {
    return oracle_->Judge(r, t, h);
  }
  Verdict JudgeAny(const rb_ray& r, const Truth& t, bool o) const override {
    return oracle_->JudgeAny(r, t, o);
  }
  UvTruth Uv(const rb_ray& r, const rb_hit& h) const override { return oracle_->Uv(r, h); }
  std::string Name() const override { return oracle_->Name(); }
  bool Exact() const override { return oracle_->Exact(); }

  mutable uint64_t asked = 0;

 private:
  std::unique_ptr<Oracle> oracle_;
};

class HarnessTruthCache : public HarnessCommand {
 protected:
  void SetUp() override {
    setenv("RAYBENCH_CACHE", (folder_ / "cache").c_str(), 1);
    setenv("RAYBENCH_TRUTH_CACHE", "on", 1);
    // Ties, edges, misses, planes: every field of a truth differs somewhere.
    scene_ = LoadScene("icosphere(level=1)");
    scene_.spheres = {{{0, 0, 0}, 0.5f}, {{0, 0, 0}, 0.5f}, {{0, 0, 0}, 0.75f}};
    scene_.Finish();
    Random random(5);
    for (int i = 0; i < 200; ++i) {
      const Vec3f org = ToFloat(random.UnitVector() * 2.0), at = scene_.positions[random.Below(12)];
      const Vec3f dir = i % 3 == 0 ? at - org : i % 3 == 1 ? ToFloat(random.UnitVector()) : -org;
      rays_.push_back({{org.x, org.y, org.z}, 0, {dir.x, dir.y, dir.z}, i % 2 ? 1.5f : 1e30f});
    }
    oracle_.emplace(scene_);
    expected_ = MakeOracle(scene_)->Ask(rays_, 1);
  }
  void TearDown() override { unsetenv("RAYBENCH_CACHE"); }

  /// Asks and compares; returns how many rays the oracle was asked about.
  uint64_t Ask() {
    oracle_->asked = 0, said_.clear();
    const auto truth = CachedTruth(*oracle_, scene_, rays_, 1,
                                   {[](double) {}, [&](const std::string& line) { said_.push_back(line); }});
    EXPECT_EQ(truth.size(), expected_.size());
    for (size_t i = 0; i < truth.size(); ++i) {
      const Truth &a = truth[i], &b = expected_[i];
      EXPECT_TRUE(a.hit == b.hit && a.coplanar == b.coplanar && a.t == b.t && a.t_rounded == b.t_rounded &&
                  a.first == b.first && a.tied == b.tied && (!a.hit || a.feature == b.feature))
          << i;
    }
    return oracle_->asked;
  }
  std::vector<fs::path> Files() const {
    std::vector<fs::path> files;
    std::error_code error;
    for (const auto& entry : fs::directory_iterator(folder_ / "cache" / "truth", error))
      files.push_back(entry);
    return files;
  }
  static void Overwrite(const fs::path& path, const std::string& text) {
    std::ofstream(path, std::ios::binary) << text;
  }

  Scene scene_;
  std::vector<rb_ray> rays_;
  std::optional<CountingOracle> oracle_;
  std::vector<Truth> expected_;
  std::vector<std::string> said_;
};

TEST(TruthSources, HoldWhateverTheOracleIncludes) {
  std::set<std::string> sources;
  std::istringstream lines(Read(std::filesystem::path(kBinaryDirectory) / "harness" / "truth_sources.txt"));
  for (std::string line; std::getline(lines, line);) sources.insert(line);
  for (const char* needed :
       {"accel/ray/exact.h", "accel/base/vec3.h", "datasets/scene/orientation.h",
        "datasets/scene/orientation.cpp", "datasets/scene/procedural.cpp", "harness/truth/box_tree.cpp",
        "harness/truth/exact.cpp", "harness/truth/margins.cpp", "harness/truth/cgal.cpp",
        "harness/truth/surd.cpp", "harness/truth/verdict.cpp"})
    EXPECT_TRUE(sources.contains(needed)) << needed;
  // Closed: what one of them includes is among them.
  for (const std::string& source : sources) {
    std::istringstream text(Read(std::filesystem::path(kSourceDirectory) / source));
    for (std::string line; std::getline(text, line);) {
      if (!line.starts_with("#include \"")) continue;
      EXPECT_TRUE(sources.contains(line.substr(10, line.find('"', 10) - 10))) << source << ": " << line;
    }
  }
}

TEST_F(HarnessTruthCache, AsksOnce) {
  EXPECT_EQ(Ask(), rays_.size());
  EXPECT_EQ(Ask(), 0u);
  ASSERT_EQ(Files().size(), 1u);
  // Other rays and another state of the scene are other files.
  rays_[0].tfar = 1.25f;
  expected_ = MakeOracle(scene_)->Ask(rays_, 1);
  EXPECT_EQ(Ask(), rays_.size());
  scene_.stats.dropped_triangles = 1;
  EXPECT_EQ(Ask(), rays_.size());
  EXPECT_EQ(Files().size(), 3u);
  EXPECT_TRUE(said_.empty());
}

TEST_F(HarnessTruthCache, BrokenFilesAreWrittenAnew) {
  Ask();
  const fs::path file = Files().at(0);
  const std::string whole = Read(file);
  const auto expect_anew = [&](const std::string& text, const std::string& what) {
    Overwrite(file, text);
    EXPECT_EQ(Ask(), rays_.size()) << what;
    EXPECT_EQ(said_.size(), 1u) << what;
    EXPECT_EQ(Read(file), whole) << what;
    EXPECT_EQ(Ask(), 0u) << what;
  };
  for (size_t at = 0; at < whole.size(); at += 97) {
    std::string text = whole;
    text[at] = char(text[at] ^ 1 << at % 8);
    expect_anew(text, "flipped byte " + std::to_string(at));
  }
  for (size_t size : {size_t{0}, size_t{5}, size_t{30}, whole.size() / 2, whole.size() - 1})
    expect_anew(whole.substr(0, size), "cut to " + std::to_string(size));
  expect_anew(whole + '\0', "too long");
}

TEST_F(HarnessTruthCache, ForeignFilesAreNotTrusted) {
  Ask();
  const fs::path file = Files().at(0);
  scene_.stats.dropped_triangles = 1;
  Ask();
  ASSERT_EQ(Files().size(), 2u);
  const fs::path other = Files()[0] == file ? Files()[1] : Files()[0];
  fs::copy_file(file, other, fs::copy_options::overwrite_existing);
  EXPECT_EQ(Ask(), rays_.size());
  ASSERT_EQ(said_.size(), 1u);
  EXPECT_NE(said_[0].find("tells of something else"), std::string::npos) << said_[0];
  EXPECT_EQ(Ask(), 0u);
}

TEST_F(HarnessTruthCache, CanBeOff) {
  setenv("RAYBENCH_TRUTH_CACHE", "off", 1);
  EXPECT_EQ(Ask(), rays_.size());
  EXPECT_EQ(Ask(), rays_.size());
  EXPECT_TRUE(Files().empty());
  setenv("RAYBENCH_TRUTH_CACHE", "never", 1);
  EXPECT_THROW(Ask(), InputError);
}

TEST_F(HarnessTruthCache, GoesOnWhereNothingCanBeWritten) {
  Overwrite(folder_ / "cache", "a file");
  EXPECT_EQ(Ask(), rays_.size());
  EXPECT_EQ(said_.size(), 1u);
  EXPECT_EQ(Ask(), rays_.size());
  EXPECT_TRUE(said_.empty()) << "said once";
}

TEST_F(HarnessTruthCache, IsBounded) {
  const fs::path folder = folder_ / "cache" / "truth";
  fs::create_directories(folder);
  const auto now = fs::file_time_type::clock::now();
  for (int i = 0; i < 3; ++i) {  // without content, they take no space
    const fs::path path = folder / std::to_string(i);
    Overwrite(path, "");
    fs::resize_file(path, 500 << 20);
    fs::last_write_time(path, now - std::chrono::hours(i == 1 ? 9 : i + 1));
  }
  Ask();
  EXPECT_TRUE(fs::exists(folder / "0"));
  EXPECT_FALSE(fs::exists(folder / "1")) << "the one used longest ago";
  EXPECT_TRUE(fs::exists(folder / "2"));
  EXPECT_EQ(Files().size(), 3u);
  EXPECT_EQ(Ask(), 0u);
}

TEST_F(HarnessTruthCache, ChangesNoResult) {
  const auto run = [&](const std::string& out) {
    const Outcome outcome = Call(TinyRun(out, {"--structures", "bvh_sah"}));
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    auto rows = ReadCsv(folder_ / out / "cases.csv");
    for (auto& row : rows) EraseVarying(row);
    return std::pair(rows, outcome.err);
  };
  const auto [first, first_log] = run("first");
  ASSERT_FALSE(first.empty());
  const std::vector<fs::path> files = Files();
  ASSERT_FALSE(files.empty());
  const auto written = fs::last_write_time(files[0]);
  const auto [second, second_log] = run("second");
  EXPECT_EQ(first, second);
  EXPECT_EQ(Files().size(), files.size()) << "nothing new was asked";
  for (const fs::path& file : files) {
    std::string text = Read(file);
    text[text.size() / 2] ^= 4;
    Overwrite(file, text);
  }
  const auto [third, third_log] = run("third");
  EXPECT_EQ(first, third);
  EXPECT_NE(third_log.find("written again"), std::string::npos) << third_log;
  EXPECT_EQ(second_log.find("written again"), std::string::npos) << second_log;
  EXPECT_GE(fs::last_write_time(files[0]), written);
}

}  // namespace
}  // namespace raybench
