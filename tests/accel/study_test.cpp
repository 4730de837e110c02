// The study's ray-triangle and ray-box tests (ray/study.h): each finds what exact ones find where nothing is difficult,
// and fails where its authors and NUMERICS say that it does.
#include "accel/ray/study.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <set>

#include "tests/support/meshes.h"

namespace raybench::testing {
namespace {

const char* const kTests[] = {
    "moeller_trumbore", "moeller_trumbore_double", "baldwin_weber", "pluecker", "woop", "woop_double"};

bool IsMiss(const rb_hit& hit) { return hit.prim == RAYBENCH_NONE; }

std::vector<rb_ray> RandomRays(int count, uint64_t seed) {
  Random random(seed);
  std::vector<rb_ray> rays;
  for (int i = 0; i < count; ++i) {
    const Vec3f from = ToFloat(random.UnitVector() * (2 * random.NextDouble())),
                to = ToFloat(random.UnitVector() * random.NextDouble()), d = to - from;
    rays.push_back({{from.x, from.y, from.z}, 0, {d.x, d.y, d.z}, INFINITY});
  }
  return rays;
}

/// From inside a closed mesh about the origin at its vertices and at the middles of its edges, rounded to float.
std::vector<rb_ray> AimedFromInside(const Mesh& mesh, int count, uint64_t seed) {
  Random random(seed);
  std::vector<rb_ray> rays;
  for (int i = 0; i < count; ++i) {
    const size_t t = random.Below(mesh.triangles.size());
    const int k = int(random.Below(3));
    const Vec3f a = mesh.Corner(t, k), b = mesh.Corner(t, (k + 1) % 3), to = i % 2 == 0 ? a : (a + b) * 0.5f,
                from = ToFloat(random.UnitVector() * (0.3 * random.NextDouble())), d = to - from;
    rays.push_back({{from.x, from.y, from.z}, 0, {d.x, d.y, d.z}, INFINITY});
  }
  return rays;
}

size_t Misses(const std::string& spec, const Mesh& mesh, const std::vector<rb_ray>& rays) {
  const auto hits = Closest(Build(spec, mesh.Geometry()), rays);
  return size_t(std::count_if(hits.begin(), hits.end(), IsMiss));
}

/// Answers that say hit or miss where `expected` says the other, or t that differs by more than `ulps` of t or, if that is
/// more, of the direction's length, which is about the scene's.
size_t Differences(const std::vector<rb_hit>& got, const std::vector<rb_hit>& expected, float ulps) {
  size_t n = 0;
  for (size_t i = 0; i < got.size(); ++i)
    n += IsMiss(got[i]) != IsMiss(expected[i]) ||
         (!IsMiss(got[i]) &&
          std::fabs(got[i].t - expected[i].t) > ulps * 0x1p-23f * std::max(expected[i].t, 1.0f));
  return n;
}

TEST(Study, FindsWhatExactTestsFindOnRandomRays) {
  const Mesh mesh = Ball(3);
  const auto rays = RandomRays(500, 1);
  const auto expected = Closest(Build("brute(numerics=exact)", mesh.Geometry()), rays);
  EXPECT_GT(std::count_if(expected.begin(), expected.end(), [](const rb_hit& h) { return !IsMiss(h); }), 200);
  for (const char* structure : {"brute", "bvh_sah", "kdtree_sah"})
    for (const char* test : kTests)
      for (const char* fma : {"false", "true"}) {
        const std::string spec = std::string(structure) + "(triangle=" + test + ",fma=" + fma + ")";
        const Tree tree = Build(spec, mesh.Geometry());
        EXPECT_EQ(tree.Claims(), uint32_t(RB_CLAIM_INEXACT)) << spec;
        const auto got = Closest(tree, rays);
        EXPECT_EQ(Differences(got, expected, 1000), 0u) << spec;
        const auto any = Occluded(tree, rays);
        for (size_t i = 0; i < rays.size(); ++i) ASSERT_EQ(any[i] == 0, IsMiss(got[i])) << spec << " " << i;
        for (size_t i = 0; i < rays.size(); ++i) {
          if (IsMiss(got[i])) continue;
          EXPECT_NEAR(got[i].u, expected[i].u, 1e-3) << spec << " " << i;
          EXPECT_NEAR(got[i].v, expected[i].v, 1e-3) << spec << " " << i;
        }
      }
}

TEST(Study, DoubleGivesTWithinAnUlp) {
  const Mesh mesh = Ball(3);
  const auto rays = RandomRays(500, 2);
  const auto expected = Closest(Build("brute(numerics=exact)", mesh.Geometry()), rays);
  for (const char* test : {"moeller_trumbore_double", "woop_double"})
    EXPECT_EQ(Differences(Closest(Build(std::string("brute(triangle=") + test + ")", mesh.Geometry()), rays),
                          expected, 1),
              0u)
        << test;
}

TEST(Study, LeaksAsPublished) {
  const Mesh mesh = Ball(4);
  const auto rays = AimedFromInside(mesh, 10000, 3);
  std::map<std::string, size_t> leaks;
  for (const char* test : kTests) {
    leaks[test] = Misses(std::string("bvh_sah(triangle=") + test + ")", mesh, rays);
    leaks[std::string(test) + " fma"] =
        Misses(std::string("bvh_sah(triangle=") + test + ",fma=true)", mesh, rays);
  }
  for (const auto& [test, n] : leaks) RecordProperty(test, int(n));
  // Watertight: none. Signs that agree at edges: vertices alone. Double: what no float can tell. Float: percents.
  EXPECT_EQ(leaks["woop"], 0u);
  EXPECT_EQ(leaks["woop_double"], 0u);
  for (const char* few : {"pluecker", "moeller_trumbore_double"}) {
    EXPECT_GT(leaks[few], 0u) << few;
    EXPECT_LT(leaks[few], rays.size() / 200) << few;
  }
  for (const char* many : {"moeller_trumbore", "baldwin_weber"})
    EXPECT_GT(leaks[many], rays.size() / 50) << many;
  for (const char* test : {"moeller_trumbore", "baldwin_weber", "pluecker", "woop"})
    EXPECT_GT(leaks[test + std::string(" fma")], leaks[test])
        << test << ": products of an edge are rounded differently";
}

TEST(Study, ExactIsExactWhereTraversalIsMadeForIt) {
  for (const Mesh& mesh : {Ball(3), Lattice(8), Needles(100)}) {
    const auto rays = NastyRays(mesh, 100, 4);
    const auto expected = Closest(Build("brute(numerics=exact)", mesh.Geometry()), rays);
    for (const char* structure : {"brute", "bvh_sah", "kdtree_sah"}) {
      const Tree tree = Build(std::string(structure) + "(numerics=exact,triangle=exact)", mesh.Geometry());
      EXPECT_EQ(tree.Claims(), uint32_t(RB_CLAIM_EXACT));
      const auto got = Closest(tree, rays);
      for (size_t i = 0; i < rays.size(); ++i)
        ASSERT_EQ(std::memcmp(&got[i], &expected[i], sizeof got[i]), 0)
            << structure << " " << mesh.name << " " << i;
    }
  }
  for (const char* spec : {"bvh_sah(numerics=exact,triangle=woop_double)", "bvh_sah(triangle=exact)",
                           "bvh_sah(numerics=exact,triangle=exact,slab=padded)",
                           "kdtree_sah(numerics=exact,planes=padded)", "bvh_sah(slab=padded)"})
    EXPECT_EQ(Build(spec, Ball(1).Geometry()).Claims(), uint32_t(RB_CLAIM_INEXACT)) << spec;
}

/// A flat lattice, and rays across it that meet boxes in their planes, edges and corners: 0 components at first.
struct Slabs {
  struct Rays : std::vector<rb_ray> {
    std::vector<rb_hit> expected;
  };
  Mesh mesh = Lattice(12);
  Rays along, oblique;

  Slabs() {
    Random random(5);
    for (int i = 0; i < 1500; ++i) {
      const float x = float(int(random.Below(13)) - 6), y = float(int(random.Below(13)) - 6);
      along.push_back(
          {{x, y, 3}, 0, {random.Below(2) ? 0.0f : -0.0f, random.Below(2) ? 0.0f : -0.0f, -1}, INFINITY});
      const Vec3f from = ToFloat(random.UnitVector() * 9.0) + Vec3f{0, 0, 10}, d = Vec3f{x, y, 0} - from;
      oblique.push_back({{from.x, from.y, from.z}, 0, {d.x, d.y, d.z}, INFINITY});
    }
    const Tree exact = Build("brute(numerics=exact)", mesh.Geometry());
    for (Rays* rays : {&along, &oblique}) rays->expected = Closest(exact, *rays);
  }
  /// Hits that the exact test finds alone and behind these boxes does not.
  size_t Lost(const std::string& spec, const Rays& rays) const {
    const auto got = Closest(Build(spec, mesh.Geometry()), rays);
    size_t lost = 0;
    for (size_t i = 0; i < rays.size(); ++i) lost += !IsMiss(rays.expected[i]) && IsMiss(got[i]);
    return lost;
  }
};

TEST(Study, NaiveSlabsLoseRaysInBoxFacesAndPaddingFindsEdges) {
  const Slabs s;
  const auto spec = [](const char* slab) {
    return std::string("bvh_sah(leaf_size=1,numerics=exact,triangle=exact,slab=") + slab + ")";
  };
  EXPECT_GT(s.Lost(spec("naive"), s.along), s.along.size() / 100);
  EXPECT_EQ(s.Lost(spec("nan_safe"), s.along), 0u);
  EXPECT_EQ(s.Lost(spec("padded"), s.along), 0u);
  EXPECT_GT(s.Lost(spec("naive"), s.oblique), 0u);
  EXPECT_GT(s.Lost(spec("nan_safe"), s.oblique), 0u);
  EXPECT_EQ(s.Lost(spec("padded"), s.oblique), 0u);
}

TEST(Study, TextbookPlanesLoseRaysThatPaddedOnesFind) {
  const Slabs s;
  const auto spec = [](const char* planes) {
    return std::string("kdtree_sah(numerics=exact,triangle=exact,planes=") + planes + ")";
  };
  EXPECT_GT(s.Lost(spec("textbook"), s.oblique), 0u);
  EXPECT_EQ(s.Lost(spec("padded"), s.oblique), 0u);
}

TEST(Study, ToleranceBoundsTAndFindsTheSameRays) {
  const Mesh mesh = Needles(400);
  const auto rays = RandomRays(2000, 8);
  const auto expected = Closest(Build("bvh_sah", mesh.Geometry()), rays);
  size_t farther = 0;
  for (const char* spec : {"bvh_sah(t_tolerance=0.1)", "bvh_sah(t_tolerance=0.1,triangle=woop)"}) {
    const Tree tree = Build(spec, mesh.Geometry());
    EXPECT_EQ(tree.Claims(), uint32_t(RB_CLAIM_INEXACT));
    const auto got = Closest(tree, rays);
    for (size_t i = 0; i < rays.size(); ++i) {
      ASSERT_EQ(IsMiss(got[i]), IsMiss(expected[i])) << spec << " " << i;
      if (IsMiss(got[i])) continue;
      ASSERT_LE(got[i].t, 1.1f * (1 + 0x1p-20f) * expected[i].t) << spec << " " << i;
      farther += got[i].t > expected[i].t * (1 + 0x1p-20f);
    }
  }
  EXPECT_GT(farther, 0u);
}

TEST(Study, ToleranceLeavesWalksInOrder) {
  const Mesh mesh = Ball(3);
  const Tree tree = Build("bvh_sah(t_tolerance=1)", mesh.Geometry());
  const uint32_t after = 0;  // behind t = 0
  for (rb_ray ray : RandomRays(100, 9)) {
    rb_hit hit{};
    rb_query q{};
    q.struct_size = sizeof q, q.kind = RB_CLOSEST, q.n = 1, q.rays = &ray, q.after = &after, q.hits = &hit;
    tree.Query(q);
    EXPECT_EQ(hit.prim, Closest(Build("brute", mesh.Geometry()), {ray})[0].prim);
  }
}

TEST(Study, BoxesStandInForWhatTheyHold) {
  const Mesh mesh = Ball(3);
  std::vector<rb_ray> rays;
  for (rb_ray ray : RandomRays(600, 10)) {
    const Vec3f to = LoadVec3(ray.org) + LoadVec3(ray.dir), from = Normalize(LoadVec3(ray.org)) * 3.0f,
                d = to - from;
    rays.push_back({{from.x, from.y, from.z}, 0, {d.x, d.y, d.z}, INFINITY});  // from outside of all boxes
  }
  const auto expected = Closest(Build("bvh_sah", mesh.Geometry()), rays);
  const auto answers = [&](int depth) {
    const Tree tree = Build("bvh_sah(leaf_size=1,max_depth=" + std::to_string(depth) + ")", mesh.Geometry());
    EXPECT_EQ(tree.Claims(), uint32_t(RB_CLAIM_INEXACT));
    const auto got = Closest(tree, rays);
    const auto any = Occluded(tree, rays);
    for (size_t i = 0; i < rays.size(); ++i) EXPECT_EQ(any[i] != 0, !IsMiss(got[i])) << depth << " " << i;
    return got;
  };
  // Boxes hide what they hold, and lie the less before it the smaller they are.
  double before = INFINITY;
  for (int depth : {1, 4, 7}) {
    const auto got = answers(depth);
    std::set<uint32_t> named;
    double ahead = 0;
    for (size_t i = 0; i < rays.size(); ++i) {
      if (!IsMiss(got[i])) named.insert(got[i].prim);
      if (IsMiss(expected[i])) continue;
      ASSERT_FALSE(IsMiss(got[i])) << depth << " " << i;
      ASSERT_LE(got[i].t, expected[i].t * (1 + 0x1p-18f)) << depth << " " << i;
      ahead += expected[i].t - got[i].t;
    }
    EXPECT_LE(named.size(), size_t{1} << depth);
    EXPECT_LT(ahead, before) << depth;
    EXPECT_GT(ahead, 0) << depth;
    before = ahead;
  }
  // Deeper than the tree there is nothing to stand for.
  const auto all = answers(100);
  for (size_t i = 0; i < rays.size(); ++i)
    ASSERT_EQ(std::memcmp(&all[i], &expected[i], sizeof all[i]), 0) << i;
}

TEST(Study, BoxesAreLeftByRaysThatStartInside) {
  const Mesh mesh = Ball(3);
  const Tree tree = Build("bvh_sah(max_depth=1)", mesh.Geometry());
  Bounds3 box = BoundsOf(mesh);
  const rb_ray along{{0.2f, 0.1f, 0.3f}, 0, {1, 0, 0}, INFINITY};
  const rb_hit hit = Closest(tree, {along})[0];
  ASSERT_FALSE(IsMiss(hit));
  EXPECT_LE(hit.t, (box.hi.x - 0.2f) * 1.0001f);
  rb_ray shorter = along;
  shorter.tfar = hit.t * 0.5f;
  EXPECT_TRUE(IsMiss(Closest(tree, {shorter})[0])) << "the end of a ray is no face";
}

/// The same tree under every rule: what differs is the test.
TEST(Study, RulesShareTheTree) {
  const Mesh mesh = Ball(3);
  const auto bytes = [&](const std::string& spec) {
    std::string all;
    const Tree tree = Build(spec, mesh.Geometry());
    tree.structure().visit(
        tree.get(),
        [](void* ctx, const rb_node* n) {
          static_cast<std::string*>(ctx)->append(reinterpret_cast<const char*>(n->bounds),
                                                 n->bounds_count * sizeof(float));
          return 0;
        },
        &all);
    return all;
  };
  const std::string naive = bytes("bvh_sah(slab=naive)");
  EXPECT_EQ(naive, bytes("bvh_sah(slab=nan_safe)"));
  EXPECT_EQ(naive, bytes("bvh_sah(slab=padded)"));
  EXPECT_NE(naive, bytes("bvh_sah"));
  EXPECT_EQ(bytes("bvh_sah"), bytes("bvh_sah(triangle=pluecker)"));
  EXPECT_EQ(bytes("kdtree_sah(planes=textbook)"), bytes("kdtree_sah(planes=padded)"));
}

TEST(Study, MapsAreCountedAndKeepTheMemoryLimit) {
  const Mesh mesh = Ball(4);
  for (const char* structure : {"brute", "bvh_sah", "kdtree_sah"}) {
    const auto bytes = [&](const std::string& parameters) {
      const Tree tree = Build(structure + parameters, mesh.Geometry());
      uint64_t nodes, prims;
      int needs;
      tree.structure().memory(tree.get(), &nodes, &prims, &needs);
      return nodes + prims;
    };
    const uint64_t without = bytes("(triangle=woop)"), with = bytes("(triangle=baldwin_weber)");
    EXPECT_GE(with, without + 40 * mesh.triangles.size()) << structure;
    rb_build_options options = DefaultBuildOptions();
    options.memory_limit = (with + without) / 2;
    EXPECT_THROW(Tree(ParseContestant(Registry(), std::string(structure) + "(triangle=baldwin_weber)"),
                      mesh.Geometry(), options),
                 BuildError)
        << structure;
  }
}

TEST(Study, ProceduralPrimitivesAreHitAsEver) {
  const Mesh mesh = Ball(2);
  const Balls balls(50, 6);
  const auto rays = RandomRays(500, 7);
  for (const char* structure : {"brute", "bvh_sah", "kdtree_sah"})
    for (const char* test : {"exact", "baldwin_weber", "woop"}) {
      const std::string name = structure;
      const auto expected = Closest(Build(name + "(numerics=exact)", balls.Geometry(mesh)), rays);
      const auto got = Closest(Build(name + "(triangle=" + test + ")", balls.Geometry(mesh)), rays);
      EXPECT_EQ(Differences(got, expected, 1000), 0u) << name << " " << test;
    }
}

TEST(Study, SaysWhatItDoesNotHaveBeforeAnythingIsBuilt) {
  const Registry registry;
  const auto refusal = [&](const std::string& spec) -> std::string {
    try {
      ParseContestant(registry, spec);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  using ::testing::HasSubstr;
  EXPECT_EQ(refusal("bvh_sah(fma=true)"), "");
  EXPECT_THAT(refusal("bvh_sah(numerics=exact,fma=true)"), HasSubstr("numerics=exact has no fused form"));
  EXPECT_EQ(refusal("bvh_sah(numerics=exact,fma=true,triangle=woop)"), "");
  EXPECT_THAT(refusal("kdtree_sah(numerics=exact,fma=true)"), HasSubstr("numerics=exact has no fused form"));
  EXPECT_THAT(refusal("brute(triangle=exact,fma=true)"), HasSubstr("triangle=exact has no fused form"));
  EXPECT_THAT(refusal("grid(resolution_x=4096,resolution_y=4096,resolution_z=256)"),
              HasSubstr("4294967296 cells are too many"));
  EXPECT_EQ(refusal("grid(resolution_x=4096,resolution_y=4096,resolution_z=255)"), "");
  EXPECT_THAT(refusal("brute(slab=naive)"), HasSubstr("brute has no parameter 'slab'"));
  EXPECT_THAT(refusal("kdtree_sah(slab=naive)"), HasSubstr("kdtree_sah has no parameter 'slab'"));
  EXPECT_THAT(refusal("grid(triangle=woop)"), HasSubstr("grid has no parameter 'triangle'"));
  EXPECT_THAT(refusal("bvh_sah(triangle=plucker)"), HasSubstr("did you mean pluecker?"));
}

}  // namespace
}  // namespace raybench::testing
