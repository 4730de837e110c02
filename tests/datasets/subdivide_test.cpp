// The modifier subdivide: counts, the surfaces that it keeps, what follows the faces, what it refuses.

#include <gmock/gmock.h>

#include "accel/base/parallel.h"
#include "datasets/scene/facts.h"
#include "datasets/scene/weld.h"
#include "tests/support/datasets.h"

namespace raybench {
namespace {

using ::testing::HasSubstr;

constexpr const char* kSchemes[] = {"loop", "midpoint", "sqrt3", "butterfly"};

std::string Subdivide(const std::string& scene, const std::string& scheme, int levels) {
  return "subdivide(" + scene + ",levels=" + std::to_string(levels) + ",scheme=" + scheme + ")";
}

/// Two faces with materials of their own, a shared edge, and a third face apart.
std::string Obj(const ScratchDirectory& files) {
  files.Write("m.mtl", "newmtl red\nKd 1 0 0\nnewmtl blue\nKd 0 0 1\n");
  return files.Write("m.obj",
                     "mtllib m.mtl\nv 0 0 0\nv 4 0 0\nv 4 4 1\nv 0 4 0\nv 9 0 0\nv 13 0 0\nv 9 4 0\n"
                     "usemtl red\nf 1 2 3 4\nusemtl blue\nf 5 6 7\n");
}

TEST(SubdivideTest, Counts) {
  for (const char* scheme : kSchemes)
    for (const char* name : {"icosphere(level=1)", "terrain(size=200)", "fibres(size=500,shape=tube)"}) {
      const size_t start = LoadScene(name).triangles.size();
      size_t count = start;
      for (int levels = 0; levels <= 3; ++levels, count *= std::string(scheme) == "sqrt3" ? 3 : 4) {
        const Scene scene = LoadScene(Subdivide(name, scheme, levels));
        EXPECT_EQ(scene.triangles.size(), count) << scheme << " " << name << " " << levels;
        EXPECT_EQ(scene.stats.degenerate_triangles, 0u);
      }
    }
}

TEST(SubdivideTest, ClosedStaysClosed) {
  for (const char* scheme : kSchemes)
    for (const char* name :
         {"icosphere(level=0)", "menger(depth=1)", "terrain_box(n=5)", "shells(size=300)"}) {
      const Scene scene = LoadScene(Subdivide(name, scheme, 2));
      EXPECT_TRUE(Examine(scene).closed()) << scheme << " " << name;
    }
}

TEST(SubdivideTest, MidpointKeepsTheSurface) {
  const Scene before = LoadScene("soup(size=40)"),
              after = LoadScene(Subdivide("soup(size=40)", "midpoint", 3));
  ASSERT_EQ(after.triangles.size(), 64 * before.triangles.size());
  std::vector<double> area(before.triangles.size());
  for (size_t i = 0; i < after.triangles.size(); ++i) {
    const size_t parent = after.triangle_face[i];
    ASSERT_EQ(parent, i / 64) << "children follow each other in the order of their parents";
    const auto [a, b, c] = CornersOf(before, parent);
    const Vec3d origin = ToDouble(a), u = ToDouble(b) - origin, v = ToDouble(c) - origin,
                normal = Cross(u, v);
    for (Vec3f corner : CornersOf(after, i)) {
      // Corners lie at multiples of 1/8 along both sides, up to rounding.
      const Vec3d p = ToDouble(corner) - origin;
      const double s = Dot(Cross(p, v), normal) / Dot(normal, normal),
                   t = Dot(Cross(u, p), normal) / Dot(normal, normal);
      ASSERT_NEAR(8 * s, std::round(8 * s), 1e-3);
      ASSERT_NEAR(8 * t, std::round(8 * t), 1e-3);
      ASSERT_GE(std::min(s, t), -1e-4);
      ASSERT_LE(s + t, 1 + 1e-4);
      ASSERT_NEAR(Dot(p, normal) / Length(normal), 0, 1e-7);
    }
    const auto [d, e, f] = CornersOf(after, i);
    area[parent] +=
        Dot(Cross(ToDouble(e) - ToDouble(d), ToDouble(f) - ToDouble(d)), normal) / Dot(normal, normal);
  }
  for (double part : area) EXPECT_NEAR(part, 1, 1e-3);
}

TEST(SubdivideTest, LoopAndSqrt3SmoothAndButterflyKeepsVertices) {
  const Scene coarse = LoadScene("icosphere(level=0)");
  for (const char* scheme : {"loop", "sqrt3", "butterfly"}) {
    const Scene fine = LoadScene(Subdivide("icosphere(level=0)", scheme, 4));
    double least = 2, most = 0;
    for (Vec3f p : fine.positions) {
      const double r = Length(ToDouble(p));
      least = std::min(least, r), most = std::max(most, r);
    }
    EXPECT_LT(most / least, 1.12) << scheme;  // the icosahedron itself: 1.26
    size_t kept = 0;
    for (Vec3f p : coarse.positions)
      kept += size_t(std::count(fine.positions.begin(), fine.positions.end(), p));
    EXPECT_EQ(kept, std::string(scheme) == "butterfly" ? 12u : 0u);
  }
}

TEST(SubdivideTest, MaterialsAndFacesFollow) {
  const ScratchDirectory files;
  const std::string path = Obj(files);
  const Scene before = LoadScene(path);
  for (const char* scheme : kSchemes) {
    const Scene scene = LoadScene(Subdivide(path, scheme, 2));
    const size_t growth = std::string(scheme) == "sqrt3" ? 9 : 16;
    ASSERT_EQ(scene.triangles.size(), 3 * growth);
    for (size_t i = 0; i < scene.triangles.size(); ++i) {
      EXPECT_EQ(scene.triangle_face[i], before.triangle_face[i / growth]);
      EXPECT_EQ(scene.triangle_material[i], before.triangle_material[i / growth]);
      EXPECT_EQ(CornersOf(scene, i)[0].x > 8, scene.triangle_face[i] == 1);
    }
    EXPECT_EQ(scene.stats.faces, 2u);
    EXPECT_EQ(scene.name, std::string(scheme) == "loop"
                              ? "subdivide(m.obj,levels=2)"
                              : "subdivide(m.obj,levels=2,scheme=" + std::string(scheme) + ")");
    EXPECT_THAT(scene.provenance.source, HasSubstr(") of "));
    EXPECT_EQ(scene.provenance.sha256, before.provenance.sha256);
  }
}

TEST(SubdivideTest, NestsAndSpellsCanonically) {
  const Scene nested =
      LoadScene("subdivide( subdivide( icosphere( level=0 ) , levels=1 ) ,scheme=loop, levels=2)");
  EXPECT_EQ(nested.name, "subdivide(subdivide(icosphere(level=0)),levels=2)");
  const Scene once = LoadScene("subdivide(icosphere(level=0),levels=3)");
  ASSERT_EQ(nested.triangles.size(), once.triangles.size());
  EXPECT_EQ(LoadScene(nested.name).hash(), nested.hash());
  EXPECT_EQ(nested.cameras.size(), 1u);
  EXPECT_TRUE(nested.automatic_camera);
}

TEST(SubdivideTest, SeamsAreWeldedUnlessToldOtherwise) {
  // A tetrahedron whose faces share nothing, as STL has it.
  const ScratchDirectory files;
  std::string text = "OFF\n12 4 0\n";
  const char* const points[] = {"0 0 0\n", "1 0 0\n", "0 1 0\n", "0 0 1\n"};
  for (const auto& face : {std::array{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}})
    for (int v : face) text += points[v];
  for (int i = 0; i < 4; ++i)
    text += "3 " + std::to_string(3 * i) + " " + std::to_string(3 * i + 1) + " " + std::to_string(3 * i + 2) +
            "\n";
  const std::string path = files.Write("t.off", text);
  const Scene welded = LoadScene("subdivide(" + path + ",levels=2)");
  EXPECT_EQ(welded.positions.size(), 34u);  // 4, 10, 34
  EXPECT_TRUE(Examine(welded).closed());
  const Scene apart = LoadScene("subdivide(" + path + ",levels=2,weld=false)");
  EXPECT_FALSE(Examine(apart).closed());
  EXPECT_EQ(WeldVertices(std::vector<Vec3f>{{0, 1, 2}, {-0.0f, 1, 2}, {0, 1, 3}, {0, 1, 2}}),
            (std::vector<uint32_t>{0, 0, 2, 0}));
}

TEST(SubdivideTest, RefusesWhatHalfEdgesCannotHold) {
  const ScratchDirectory files;
  const std::string book = files.Write(
      "book.obj",
      "v 0 0 0\nv 0 0 1\nv 1 0 0\nv -1 0 0\nv 0 1 0\nf 1 2 3\nf 2 1 4\nf 1 2 5\n");  // three pages
  const std::string error = LoadError("subdivide(" + book + ")");
  EXPECT_THAT(error, HasSubstr("1 of 3 faces"));
  EXPECT_THAT(error, HasSubstr("face 2 is the first"));
  EXPECT_THAT(error, HasSubstr("--drop-bad"));
  LoadOptions drop;
  drop.drop_bad = true;
  const Scene scene = LoadScene("subdivide(" + book + ")", drop);
  EXPECT_EQ(scene.triangles.size(), 8u);
  EXPECT_EQ(scene.stats.dropped_triangles, 1u);

  EXPECT_THAT(LoadError("subdivide(sphereflake(depth=1,tessellation=0))"), HasSubstr("10 of its primitives"));
  EXPECT_THAT(LoadError("subdivide(icosphere,levels=15)"), HasSubstr("at most 715827882"));
  EXPECT_THAT(LoadError("subdivide(icosphere,levels=16)"), HasSubstr("from 0 to 15"));
  EXPECT_THAT(LoadError("subdivide(icosphere,depth=1)"), HasSubstr("levels, scheme, weld"));
  EXPECT_THAT(LoadError("subdivide(icosphere,scheme=round)"), HasSubstr("loop, midpoint, sqrt3, butterfly"));
  EXPECT_THAT(LoadError("subdivide(subdivid)"),
              HasSubstr("unknown scene 'subdivid' (did you mean subdivide?)"));
  for (const char* broken :
       {"subdivide", "subdivide()", "subdivide(,levels=1)", "subdivide(icosphere", "subdivide( )"})
    EXPECT_THAT(LoadError(broken), HasSubstr("write subdivide(SCENE)")) << broken;
  EXPECT_THAT(LoadError("subdivide(icosphere,)"), HasSubstr("last comma"));
  // A triangle's two sides: closed, with vertices of two neighbours.
  const std::string coin = files.Write("coin.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 3 2\n");
  for (const char* scheme : {"sqrt3", "butterfly"})
    EXPECT_THAT(LoadError(Subdivide(coin, scheme, 2)),
                HasSubstr("3 vertices inside the surface have only two"));
  for (const char* scheme : {"loop", "midpoint"})
    EXPECT_EQ(LoadScene(Subdivide(coin, scheme, 2)).stats.faces, 2u);
}

TEST(SubdivideTest, PiecesThatTouchInAVertex) {
  const ScratchDirectory files;
  const std::string bow = files.Write(
      "bow.obj",
      "v 0 0 0\nv 1 0 0\nv 1 1 0\nv -1 0 0\nv -1 -1 0\nv 0 2 1\nv -1 2 1\nf 1 2 3\nf 1 4 5\nf 1 6 7\n");
  for (const char* scheme : kSchemes) {
    const Scene scene = LoadScene(Subdivide(bow, scheme, 3));
    EXPECT_EQ(scene.triangles.size(), std::string(scheme) == "sqrt3" ? 81u : 192u);
  }
}

TEST(SubdivideTest, ManyNeighboursAndEmptyScenes) {
  const ScratchDirectory files;
  std::string cone = "v 0 0 1\n";
  for (int i = 0; i < 400; ++i) {  // around a square, 100 a side
    const int side = i / 100, k = i % 100;
    const int x = side == 0 ? k : side == 1 ? 100 : side == 2 ? 100 - k : 0;
    const int y = side == 0 ? 0 : side == 1 ? k : side == 2 ? 100 : 100 - k;
    cone += "v " + std::to_string(x - 50) + " " + std::to_string(y - 50) + " 0\n";
  }
  for (int i = 0; i < 400; ++i)
    cone += "f 1 " + std::to_string(2 + i) + " " + std::to_string(2 + (i + 1) % 400) + "\n";
  const std::string path = files.Write("cone.obj", cone);
  for (const char* scheme : kSchemes) {
    const Scene scene = LoadScene(Subdivide(path, scheme, 1));
    EXPECT_EQ(scene.triangles.size(), std::string(scheme) == "sqrt3" ? 1200u : 1600u);
    EXPECT_LE(scene.bounds().hi.x, 50.1f);  // the butterfly overshoots a little
  }
  const std::string lone = files.Write("lone.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n");
  EXPECT_EQ(LoadScene("subdivide(" + lone + ",levels=3)").triangles.size(), 0u);
}

TEST(SubdivideTest, SameOnEveryMachine) {
  const std::pair<const char*, const char*> known[] = {{"loop", "2bcdbf198dcd4c39"},
                                                       {"midpoint", "5499a836b00c9f7c"},
                                                       {"sqrt3", "74e1a4522459fbcb"},
                                                       {"butterfly", "2dba0fd77ea0dc75"}};
  for (const auto& [scheme, hash] : known) {
    const std::string name = Subdivide("stadium(size=500)", scheme, 2);
    EXPECT_EQ(LoadScene(name).hash(), hash) << scheme;
    const ThreadLimit one(1);
    EXPECT_EQ(LoadScene(name).hash(), hash) << scheme;
  }
}

TEST(SubdivideTest, LeavesOutTexturesAndWhatGlowsByThem) {
  ScratchDirectory files;
  files.Write("p.png", "\x89PNG not decoded");
  files.Write("m.mtl", "newmtl a\nmap_Kd p.png\nKe 1 1 1\nmap_Ke p.png\nnewmtl b\nKe 2 2 2\n");
  const std::string path = files.Write(
      "m.obj",
      "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl a\nf 1/1 2/2 3/3\nusemtl b\n");
  EXPECT_EQ(LoadScene(path).uvs.size(), 3u);
  const Scene scene = LoadScene("subdivide(" + path + ")");
  EXPECT_TRUE(scene.uvs.empty() && scene.textures.empty());
  ASSERT_EQ(scene.materials.size(), 3u);
  EXPECT_EQ(scene.materials[1].base_color_texture, -1);
  EXPECT_EQ(scene.materials[1].emission_texture, -1);
  EXPECT_EQ(scene.materials[1].emission, (Vec3f{0, 0, 0}));
  EXPECT_EQ(scene.materials[2].emission, (Vec3f{2, 2, 2}));
}

TEST(SceneFactsTest, BytesAreOfAllThatTheSceneHolds) {
  Scene scene = LoadScene("icosphere(level=0)");
  const uint64_t before = Examine(scene).bytes;
  scene.lights.reserve(scene.lights.capacity() + 1000);
  scene.cameras.reserve(scene.cameras.capacity() + 1000);
  scene.textures.reserve(1000);
  EXPECT_GE(Examine(scene).bytes, before + 1000 * (sizeof(Light) + sizeof(Camera) + sizeof(Texture)));
}

TEST(SceneFactsTest, CountsEdgesAndMeasuresTriangles) {
  const ScratchDirectory files;
  const Scene scene = LoadScene(files.Write(
      "f.obj",
      "v 0 0 0\nv 0 0 1\nv 1 0 0\nv -1 0 0\nv 0 10 0\nv 0 0 0\nv 7 7 7\nf 1 2 3\nf 2 6 4\nf 1 2 5\n"));
  const SceneFacts facts = Examine(scene);
  EXPECT_EQ(facts.distinct_positions, 5u);
  EXPECT_EQ(facts.boundary_edges, 6u);
  EXPECT_EQ(facts.non_manifold_edges, 1u);
  EXPECT_FALSE(facts.closed());
  EXPECT_NEAR(facts.area.median, 0.5, 1e-9);
  EXPECT_NEAR(facts.aspect.median, 2, 1e-9);
  EXPECT_GT(facts.bytes, scene.triangles.size() * 20 + scene.positions.size() * 12);
  const SceneFacts balls = Examine(LoadScene("sphereflake(depth=1,tessellation=0)"));
  ASSERT_EQ(balls.procedural.size(), 1u);
  EXPECT_EQ(balls.procedural[0], (std::pair<std::string, uint64_t>{"spheres", 10}));
}

}  // namespace
}  // namespace raybench
