// Inputs that public reports are about, each with the answer that is right. The same kinds of input are made
// by tests/datasets/text_forms_test.cpp, tests/truth/limits_test.cpp and below, and tested without the
// folder, too.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "harness/plan/plan.h"
#include "harness/truth/oracle.h"
#include "harness/verify/verify.h"
#include "tests/support/command.h"
#include "tests/support/rays.h"
#include "tests/support/shared_data.h"
#include "tracer/rays/ray_file.h"

namespace raybench {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr float kNever = std::numeric_limits<float>::infinity();
const char kUnitSquare[] = "v -1 -1 0\nv -1 1 0\nv 1 1 0\nv 1 -1 0\nf 1 2 3\nf 3 4 1\n";

class HarnessReports : public HarnessCommand {
 protected:
  Outcome Verify(std::vector<std::string> words) {
    words.insert(words.begin(), "verify");
    return Call(std::move(words));
  }
  std::string Write(const std::string& name, const std::string& text) {
    const fs::path path = folder_ / name;
    fs::create_directories(path.parent_path());
    std::ofstream(path, std::ios::binary) << text;
    return path.string();
  }
  /// A .rays file for a scene.
  std::string WriteRays(const std::string& name, const Scene& scene, std::vector<rb_ray> rays) {
    RaySet set{
        .kind = "camera", .order = "recorded", .query = RB_CLOSEST, .rays = std::move(rays), .hash = {}};
    WriteRayFile(folder_ / name, set, scene, "test");
    return (folder_ / name).string();
  }
};

class HarnessReportsOfOthers : public HarnessReports {
 protected:
  void SetUp() override {
    if (!fs::is_directory(data_)) GTEST_SKIP() << testing::NotCompared(data_);
  }
  std::string In(const std::string& file) const { return (data_ / file).string(); }
  /// The ray file as it replays in the scene, and what is true of it.
  RaySet Replay(const std::string& file, const Scene& scene) const {
    return ReplayedSet(ReadRayFile(In(file)), scene);
  }
  static std::vector<Truth> TruthOf(const Scene& scene, const RaySet& set) {
    const auto oracle = MakeOracle(scene);
    std::vector<Truth> truth = oracle->Ask(set.rays, 1);
    oracle->Audit(set.rays, truth, 1, set.rays.size());  // throws where the two disagree
    return truth;
  }
  const fs::path data_ = testing::SharedData() / "reports";
};

// ---- the inputs of the folder

TEST_F(HarnessReportsOfOthers, TinyCube) {
  const Scene scene = LoadScene(In("08-tiny-cube/mesh.obj"));
  const std::vector<Truth> truth = TruthOf(scene, Replay("08-tiny-cube/rays.rays", scene));
  const double half = 14411519 / 288230376151711744.0;
  const double t[] = {half,
                      half,
                      288230376137300225.0 / 288230376151711744.0,
                      864691128440723713.0 / 864691128455135232.0,
                      273818849 / 28823038.0,
                      0.5};
  const std::vector<uint32_t> tied[] = {{8, 9}, {0, 1, 2, 9}, {8, 9}, {0}, {0, 1}, {2, 9}};
  const Feature feature[] = {Feature::kEdge,     Feature::kVertex, Feature::kEdge,
                             Feature::kInterior, Feature::kEdge,   Feature::kEdge};
  ASSERT_EQ(truth.size(), 6u);
  for (size_t i = 0; i < 6; ++i) {
    EXPECT_TRUE(truth[i].hit);
    EXPECT_NEAR(truth[i].t, t[i], std::abs(t[i]) * 0x1p-52) << i;
    EXPECT_EQ(truth[i].tied, tied[i]) << i;
    EXPECT_EQ(truth[i].feature, feature[i]) << i;
  }
  const Outcome outcome = Verify({In("08-tiny-cube/mesh.obj"), "--rays", In("08-tiny-cube/rays.rays")});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.out << outcome.err;
  // A line of rays.txt, as a bug report has it.
  const Outcome replay = Verify({In("08-tiny-cube/mesh.obj"), "--structures", "bvh_sah", "--replay",
                                 "0,0,9.99999972e-10,0,0,0,-1.00000001e-10,inf"});
  EXPECT_EQ(replay.exit_code, 0) << replay.err;
  EXPECT_THAT(replay.out,
              AllOf(HasSubstr("org 0 0 1e-09, dir 0 0 -1e-10"), HasSubstr("primitives 0, 1, edge"),
                    HasSubstr("oz = "), HasSubstr("times the size in the file")));
}

TEST_F(HarnessReportsOfOthers, RaysInFacesOfBoxes) {
  const Scene scene = LoadScene(In("13-rays-in-faces-of-boxes/mesh.obj"));
  const std::vector<Truth> truth = TruthOf(scene, Replay("13-rays-in-faces-of-boxes/rays.rays", scene));
  size_t hits = 0;
  for (const Truth& t : truth) hits += t.hit;
  EXPECT_EQ(truth.size(), 125u);
  EXPECT_EQ(hits, 116u);
  const Outcome outcome =
      Verify({In("13-rays-in-faces-of-boxes/mesh.obj"), "--rays", In("13-rays-in-faces-of-boxes/rays.rays"),
              "--any", "--out", (folder_ / "out").string()});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.out << outcome.err;
  for (const auto& row : ReadCsv(folder_ / "out" / "verdicts.csv")) {
    if (row.at("t_error_max").empty() || row.at("held") != "true" || row.at("structure") == "null") continue;
    EXPECT_LT(std::stod(row.at("t_error_max")), 100) << row.at("spec");
  }
}

TEST_F(HarnessReportsOfOthers, TextForms) {
  const std::string folder = "23-25-27-text-forms/";
  for (const char* file : {"cr_only.obj", "one_line.stl"})
    EXPECT_EQ(LoadScene(In(folder + file)).triangles.size(), 1u) << file;
  EXPECT_EQ(LoadScene(In(folder + "end_loop_with_blank.stl")).triangles.size(), 2u);
  for (const char* file : {"cr_binary.ply", "lfcr_binary.ply"}) {
    const Scene scene = LoadScene(In(folder + file));
    EXPECT_EQ(scene.triangles.size(), 4u) << file;
    EXPECT_EQ(scene.bounds().hi, (Vec3f{1, 1, 1})) << file;
  }
  try {
    LoadScene(In(folder + "nan_unused.obj"));
    ADD_FAILURE();
  } catch (const InputError& e) {
    EXPECT_THAT(e.what(), AllOf(HasSubstr("line 3: vertex 2"), HasSubstr("--drop-bad")));
  }
}

TEST_F(HarnessReportsOfOthers, RaysAsOtherProgramsHandThemOver) {
  const std::string folder = "30-recorded-rays-odd/";
  const Scene square = LoadScene(In(folder + "mesh.obj")), large = LoadScene(In(folder + "square_1e9.obj"));
  struct Expected {
    const char* file;
    uint64_t invalid;       ///< rays that are counted and become misses
    std::vector<double> t;  ///< of each ray; -1: a miss
  };
  for (const Expected& e :
       {Expected{"inactive_embree.rays", 1, {-1, 1}},
        Expected{"occluded_marker_tfar_minus_inf.rays", 0, {-1, 1}},
        Expected{"zero_dir_nan.rays", 5, {-1, -1, -1, -1, -1}},
        Expected{"negative_tnear.rays", 2, {-1, -1, 1}}, Expected{"tfar_flt_max.rays", 0, {1, 1}},
        Expected{"tfar_below_tnear.rays", 0, {-1, -1, 1}},
        Expected{"origin_on_surface_tnear_0.rays", 0, {-1, -1, -1}},
        Expected{"tiny_huge_dir.rays", 0, {1e38, -1, 1 / 3e38, 1}}}) {
    SCOPED_TRACE(e.file);
    const RaySet set = Replay(folder + e.file, square);
    EXPECT_EQ(set.invalid_rays, e.invalid);
    const std::vector<Truth> truth = TruthOf(square, set);
    ASSERT_EQ(truth.size(), e.t.size());
    for (size_t i = 0; i < truth.size(); ++i) {
      EXPECT_EQ(truth[i].hit, e.t[i] >= 0) << i;
      if (truth[i].hit) {
        EXPECT_NEAR(truth[i].t / e.t[i], 1, 1e-6) << i;
      }
    }
    const Outcome outcome = Verify({In(folder + "mesh.obj"), "--rays", In(folder + e.file)});
    EXPECT_EQ(outcome.exit_code, 0) << outcome.out << outcome.err;
    if (e.invalid > 0) {
      EXPECT_THAT(outcome.out,
                  HasSubstr(fmt::format("{} of {} rays are invalid", set.invalid_rays, set.rays.size())));
    }
  }
  const RaySet far = Replay(folder + "square_1e9_dir_1e-30.rays", large);
  for (const Truth& truth : TruthOf(large, far)) EXPECT_FALSE(truth.hit && !std::isfinite(truth.t_rounded));
  const Outcome outcome =
      Verify({In(folder + "square_1e9.obj"), "--rays", In(folder + "square_1e9_dir_1e-30.rays")});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.out << outcome.err;
  const Outcome wrong = Verify({In(folder + "mesh.obj"), "--rays", In(folder + "wrong_hash.rays")});
  EXPECT_EQ(wrong.exit_code, 2);
  EXPECT_THAT(wrong.err, HasSubstr("was recorded in"));
}

TEST_F(HarnessReportsOfOthers, StatementsOfObj) {
  const auto notes = [&](const std::string& file) { return LoadScene(In("32-obj-free-form/" + file)); };
  EXPECT_EQ(notes("curve_between.obj").triangles.size(), 2u);
  EXPECT_THAT(notes("curve_between.obj").stats.notes, ElementsAre(HasSubstr("curv")));
  EXPECT_EQ(notes("points_lines.obj").triangles.size(), 2u);
  EXPECT_THAT(notes("points_lines.obj").stats.notes, ElementsAre("left out: l, p"));
  EXPECT_EQ(notes("vp_lod_call.obj").triangles.size(), 1u);
  EXPECT_THAT(notes("vp_lod_call.obj").stats.notes, ElementsAre(HasSubstr("call")));
  try {
    notes("surf_only.obj");
    ADD_FAILURE();
  } catch (const InputError& e) {
    EXPECT_THAT(e.what(), AllOf(HasSubstr("no faces"), HasSubstr("surf")));
  }
}

TEST_F(HarnessReportsOfOthers, Names) {
  for (const char* name : {"bunny(1).obj", "model (1).obj", "terrain(size=100).obj"})
    EXPECT_GT(LoadScene(In(std::string("33-file-names/") + name)).triangles.size(), 0u);
}

TEST_F(HarnessReportsOfOthers, SceneHashes) {
  const std::string folder = "34-scene-hash/";
  for (const char* stem : {"collinear", "deg_last", "point_index", "repeat_index", "unused"})
    for (const char* ending : {".obj", ".ply", ".off"}) {
      const Scene scene = LoadScene(In(folder + stem + ending));
      EXPECT_EQ(ReadRayFileHeader(In(folder + stem + ".rays")).scene_hash, scene.hash()) << stem << ending;
      EXPECT_EQ(scene.triangles.size(), 1u);
    }
  for (const char* name : {"uv.obj", "uvt.obj"})
    EXPECT_EQ(ReadRayFileHeader(In(folder + "uv.rays")).scene_hash, LoadScene(In(folder + name)).hash())
        << name;
  // RAYS.md: the vertices of the file, three a facet.
  const std::string stl = LoadScene(In(folder + "s.stl")).hash();
  EXPECT_EQ(ReadRayFileHeader(In(folder + "s_unwelded.rays")).scene_hash, stl);
  EXPECT_NE(ReadRayFileHeader(In(folder + "s_welded.rays")).scene_hash, stl);
}

TEST_F(HarnessReportsOfOthers, ByteOrderMarks) {
  const std::string folder = "35-bom/";
  for (const char* file : {"bom.obj", "bom.off", "bom.ply", "bom.stl"}) {
    const Scene scene = LoadScene(In(folder + file));
    EXPECT_EQ(scene.triangles.size(), 1u) << file;
    EXPECT_EQ(scene.bounds().lo, (Vec3f{0, 0, 0})) << file;
    EXPECT_EQ(scene.bounds().hi, (Vec3f{1, 1, 0})) << file;
  }
  EXPECT_EQ(LoadScene(In(folder + "bom.nff")).spheres.size(), 1u);
  for (const char* file : {"bom_shift.obj", "bom_shift_without_bom.obj", "bom_negative.obj"}) {
    const Scene scene = LoadScene(In(folder + file));
    EXPECT_EQ(scene.triangles.size(), 2u) << file;
    EXPECT_EQ(scene.bounds().lo, (Vec3f{0, 0, 0})) << file;
    EXPECT_EQ(scene.bounds().hi, (Vec3f{2, 2, 0})) << file;
  }
  for (const char* file : {"bom_mtllib.obj", "nobom_mtllib.obj", "bommtl.obj", "nobommtl.obj"}) {
    const Scene scene = LoadScene(In(folder + file));
    EXPECT_EQ(scene.materials.at(scene.MaterialOf(0)).diffuse, (Vec3f{1, 0, 0})) << file;
  }
  try {
    LoadScene(In(folder + "bom.gltf"));
    ADD_FAILURE();
  } catch (const InputError& e) {
    EXPECT_THAT(e.what(), HasSubstr("has no triangles in its default scene"));
  }
}

TEST_F(HarnessReportsOfOthers, FacesAtZero) {
  for (const char* file : {"cube01.obj", "cubeshift.obj", "one.obj"}) {
    const Outcome outcome = Verify({In(std::string("36-faces-at-zero/") + file), "--rays", "8K"});
    EXPECT_EQ(outcome.exit_code, 0) << file << outcome.out << outcome.err;
    EXPECT_THAT(outcome.out, Not(HasSubstr("BROKEN")));
  }
}

// ---- the same kinds, made here

TEST_F(HarnessReports, ScenesOfOneNameKeepTheirExamples) {
  const std::string a = Write("a/mesh.obj", kUnitSquare),
                    b = Write("b/mesh.obj", std::string(kUnitSquare) + "v 0 0 1\nf 1 2 5\n");
  const Outcome outcome =
      Verify({a, b, "--structures", "cgal_aabb,embree,embree(robust=true)", "--rays", "4K", "--sets",
              "aimed_edge,aimed_vertex", "--out", (folder_ / "out").string()});
  ASSERT_NE(outcome.exit_code, 2) << outcome.err;
  // Every example stands in the file that it names, and no file is named by two scenes.
  std::map<std::string, std::string> scene_of;
  std::map<std::string, size_t> count;
  for (const auto& example : nlohmann::json::parse(Read(folder_ / "out" / "examples.json"))) {
    const std::string file = example.at("file");
    ++count[file];
    const std::string scene = example.at("scene");
    EXPECT_EQ(scene_of.try_emplace(file, scene).first->second, scene);
  }
  for (const auto& [file, n] : count) EXPECT_EQ(ReadRayFileHeader(folder_ / "out" / file).count, n) << file;
}

TEST_F(HarnessReports, NumbersOfPrimitivesAreExplained) {
  const std::string mesh = Write("repeat.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 1 2\nf 1 2 3\n");
  const std::string left_out = "1 degenerate or bad triangles are left out";
  EXPECT_THAT(Verify({mesh, "--structures", "brute", "--rays", "64"}).out, HasSubstr(left_out));
  EXPECT_THAT(Verify({Write("whole.obj", kUnitSquare), "--structures", "brute", "--rays", "64"}).out,
              Not(HasSubstr("left out")));
}

TEST_F(HarnessReports, ALedgerMayHaveAByteOrderMark) {
  const std::string ledger = (folder_ / "ledger.json").string();
  const std::vector<std::string> words = {"icosphere(level=1)", "--structures", "bvh_sah", "--closed", "1K",
                                          "--ledger",           ledger};
  ASSERT_EQ(Verify(words).exit_code, 0);
  Write("ledger.json", "\xEF\xBB\xBF" + Read(ledger));
  const Outcome again = Verify(words);
  EXPECT_EQ(again.exit_code, 0) << again.err;
  EXPECT_EQ(nlohmann::json::parse(Read(ledger)).at("campaigns").at(0).at("runs").size(), 2u);
}

TEST_F(HarnessReports, RecordedRaysAreNotReplacedByThoseOfAnotherScene) {
  const std::string a = Write("a/mesh.obj", kUnitSquare),
                    b = Write("b/mesh.obj", std::string(kUnitSquare) + "v 0 0 1\nf 1 2 5\n"),
                    out = (folder_ / "rays").string();
  const auto record = [&](const std::string& scene) {
    return Call({"rays", "record", scene, "--sets", "random", "--rays", "64", "-o", out});
  };
  ASSERT_EQ(record(a).exit_code, 0);
  const std::string before = Read(folder_ / "rays" / "random.rays");
  EXPECT_EQ(record(a).exit_code, 0);
  const Outcome other = record(b);
  EXPECT_EQ(other.exit_code, 2);
  EXPECT_THAT(other.err, HasSubstr("holds rays of another scene"));
  EXPECT_EQ(Read(folder_ / "rays" / "random.rays"), before);
}

TEST(HarnessReportsNames, AreGivenOnce) {
  DistinctNames distinct;
  EXPECT_EQ(distinct("a"), "a");
  EXPECT_EQ(distinct("a_2"), "a_2");
  EXPECT_EQ(distinct("a"), "a_3");
  EXPECT_EQ(distinct("a_2"), "a_2_2");
  EXPECT_EQ(distinct("b"), "b");
}

TEST_F(HarnessReports, ReplayTakesCoordinatesOfTheFile) {
  const std::string cube = Write("tiny.obj", "v 0 0 0\nv 1e-20 0 0\nv 0 1e-20 0\nf 1 2 3\n");
  const Outcome outcome =
      Verify({cube, "--structures", "bvh_sah", "--replay", "1e-21,1e-21,1e-20,0,0,0,-1e-20,inf"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("org 1e-21 1e-21 1e-20, dir 0 0 -1e-20, t in (0, inf]"),
                                 HasSubstr("truth: t = 1 "), HasSubstr("rounded to the nearest float: ox = "),
                                 HasSubstr("at 2^")));
  // What is printed is taken again, and needs no rounding.
  const size_t at = outcome.out.find("\nray ") + 5;
  const std::string ray = outcome.out.substr(at, outcome.out.find('\n', at) - at);
  const Outcome again = Verify({cube, "--structures", "bvh_sah", "--replay", ray});
  EXPECT_EQ(again.exit_code, 0) << again.err;
  EXPECT_THAT(again.out, AllOf(HasSubstr("ray " + ray), Not(HasSubstr("nearest float"))));
  const std::string huge = Write("huge.obj", "v 0 0 0\nv 1e38 0 0\nv 0 1e38 0\nf 1 2 3\n");
  EXPECT_THAT(Verify({huge, "--structures", "bvh_sah", "--replay", "1e37,1e37,1e38,0,0,0,-1e38,inf"}).out,
              HasSubstr("truth: t = 1 "));
  EXPECT_THAT(Verify({huge, "--structures", "bvh_sah", "--replay", "0,0,1e39,0,0,0,1,inf"}).err,
              HasSubstr("oz = 1e+39 is beyond float"));
}

TEST(HarnessReportsRay, TextReadsBackAtEveryScale) {
  const rb_ray ray{{0.1f, -0.0f, 0x1p-149f}, 0.3f, {-1e30f, 1.0f / 3, 0}, kNever};
  for (const int exponent : {0, 33, -33, 126, -126, 148}) {
    const auto [back, rounded] = ParseRay(FormatRay(ray, exponent), exponent);
    EXPECT_EQ(std::memcmp(&back, &ray, sizeof ray), 0) << exponent;
    EXPECT_EQ(rounded, "");
  }
  const auto [near, said] = ParseRay("0.1,1,0x1p-1,0,0.3,0,0,1e10", 0);
  EXPECT_EQ(near.org[0], 0.1f);
  EXPECT_EQ(near.dir[0], 0.3f);
  EXPECT_EQ(said, "rounded to the nearest float: ox = 0x1.99999ap-4 (0.1), dx = 0x1.333334p-2 (0.3)");
}

TEST_F(HarnessReports, NoErrorOfTInAPlane) {
  const std::string mesh = Write("square.obj", kUnitSquare);
  const Scene scene = LoadScene(mesh);
  const std::string rays = WriteRays("plane.rays", scene,
                                     {{{-3, 0, 0}, 0, {1, 0, 0}, kNever},
                                      {{-1, 0, 0}, 0, {1, 0.25f, 0}, kNever},
                                      {{-1, -1, 0}, 0, {0, 1, 0}, kNever}});
  const Outcome outcome = Verify({mesh, "--rays", rays, "--out", (folder_ / "out").string()});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.out << outcome.err;
  for (const auto& row : ReadCsv(folder_ / "out" / "verdicts.csv"))
    if (row.at("query") == "closest") {
      EXPECT_EQ(row.at("t_error_max"), "") << row.at("spec");
    }
}

TEST_F(HarnessReports, OpenEndAndFacesAtZeroForEveryStructure) {
  std::string cube =
      "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\nf 1 4 3 2\nf 5 6 7 8\n"
      "f 1 2 6 5\nf 3 4 8 7\nf 2 3 7 6\nf 1 5 8 4\n";
  const std::string mesh = Write("cube.obj", cube);
  const Scene scene = LoadScene(mesh);
  const float d = 0x1p-149f;
  // From the face, from a float beside it, and with t == tnear at the near face; then the far one is
  // the answer.
  const std::string rays = WriteRays("ends.rays", scene,
                                     {{{.3f, .4f, 0}, 0, {0, 0, 1}, kNever},
                                      {{.3f, .4f, 0}, 0, {0, 0, -1}, kNever},
                                      {{.3f, .4f, -1}, 1, {0, 0, 1}, kNever},
                                      {{.3f, .4f, -1}, 2, {0, 0, 1}, kNever},
                                      {{.3f, .4f, -1}, 1, {0, 0, 1}, 2},
                                      {{.3f, .4f, -1}, 0, {0, 0, 1}, 1},
                                      {{.3f, .4f, d}, 0, {1, .1f, -d}, kNever},
                                      {{.3f, .4f, 3 * d}, 0, {1, 0, -2 * d}, kNever},
                                      {{.3f, .4f, -d}, 0, {1, 0, d}, kNever},
                                      {{.3f, .4f, 5 * d}, 0, {.1f, .1f, -7 * d}, kNever},
                                      {{.3f, .4f, -0x1p-120f}, 0, {0, 0, 0x1p-30f}, kNever}});
  const Outcome outcome = Verify({mesh, "--rays", rays, "--any", "--structures", "all"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.out << outcome.err;
  EXPECT_THAT(outcome.out, Not(HasSubstr("BROKEN")));
}

}  // namespace
}  // namespace raybench
