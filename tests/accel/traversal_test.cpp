// The shared ray tests and bvh_sah, against brute force bit for bit.
#include <gtest/gtest.h>

#include <cstring>
#include <set>

#include "accel/contract/structure.h"
#include "accel/ray/primitive.h"
#include "tests/support/meshes.h"

namespace raybench::testing {
namespace {

bool Same(const rb_hit& a, const rb_hit& b) { return std::memcmp(&a, &b, sizeof a) == 0; }

std::vector<Mesh> NastyMeshes() {
  const Mesh ball = Ball(3);
  return {Mesh{"empty", {}, {}},
          Mesh{"one", {{0, 0, 0}, {1, 0, 0}, {0, 1, 0.5f}}, {{0, 1, 2}}},
          ball,
          Lattice(12),
          Coincident(500),
          Needles(300),
          Moved(ball, 1, {1000, -2000, 500}, "far"),
          Moved(ball, 0x1p-30f, {0, 0, 0}, "small"),
          Moved(ball, 0x1p29f, {0, 0, 0}, "large")};
}

class BvhSah : public ::testing::TestWithParam<Mesh> {};

class BvhSahNumerics : public ::testing::TestWithParam<std::tuple<Mesh, std::string>> {};

TEST_P(BvhSahNumerics, AnswersAsBruteForceBitForBit) {
  const auto& [mesh, numerics] = GetParam();
  const Tree bvh = Build("bvh_sah(numerics=" + numerics + ")", mesh.Geometry()),
             brute = Build("brute(numerics=" + numerics + ")", mesh.Geometry());
  const auto rays = NastyRays(mesh, 400, 5);
  const auto expected = Closest(brute, rays), got = Closest(bvh, rays);
  const auto shadow = Occluded(bvh, rays);
  size_t hits = 0;
  for (size_t i = 0; i < rays.size(); ++i) {
    ASSERT_TRUE(Same(expected[i], got[i])) << "ray " << i << ": prim " << expected[i].prim << " or "
                                           << got[i].prim << ", t " << expected[i].t << " or " << got[i].t;
    ASSERT_EQ(shadow[i] != 0, expected[i].prim != RAYBENCH_NONE) << "ray " << i;
    hits += expected[i].prim != RAYBENCH_NONE;
  }
  EXPECT_TRUE(mesh.triangles.empty() || hits > rays.size() / 10) << hits << " hits";
}

INSTANTIATE_TEST_SUITE_P(Meshes, BvhSahNumerics,
                         ::testing::Combine(::testing::ValuesIn(NastyMeshes()),
                                            ::testing::Values("watertight", "double", "exact")),
                         [](const auto& i) {
                           return std::get<0>(i.param).name + "_" + std::get<1>(i.param);
                         });

TEST_P(BvhSah, ParametersDoNotChangeTheAnswer) {
  const Mesh& mesh = GetParam();
  const auto rays = NastyRays(mesh, 100, 6);
  const auto expected = Closest(Build("bvh_sah", mesh.Geometry()), rays);
  for (const char* spec : {"bvh_sah(leaf_size=1)", "bvh_sah(leaf_size=16,bins=2)",
                           "bvh_sah(traversal_cost=0,bins=64)", "bvh_sah(traversal_cost=100)"}) {
    const auto got = Closest(Build(spec, mesh.Geometry()), rays);
    for (size_t i = 0; i < rays.size(); ++i) ASSERT_TRUE(Same(expected[i], got[i])) << spec << " ray " << i;
  }
}

TEST_P(BvhSah, EveryPrimitiveStandsOnceInsideItsLeaf) {
  const Mesh& mesh = GetParam();
  const rb_geometry geometry = mesh.Geometry();
  const Tree tree = Build("bvh_sah", geometry);
  struct Seen {
    const rb_geometry& geometry;
    std::multiset<uint32_t> prims;
    uint32_t depth = 0;
  } seen{geometry, {}};
  tree.structure().visit(
      tree.get(),
      [](void* ctx, const rb_node* node) {
        Seen& s = *static_cast<Seen*>(ctx);
        s.depth = std::max(s.depth, node->depth);
        const Bounds3 box{LoadVec3(node->bounds), LoadVec3(node->bounds + 3)};
        for (uint32_t i = 0; i < node->prim_count; ++i) {
          s.prims.insert(node->prims[i]);
          EXPECT_TRUE(box.Contains(PaddedPrimBounds(s.geometry, node->prims[i])));
        }
        return 0;
      },
      &seen);
  EXPECT_EQ(seen.prims.size(), mesh.triangles.size());
  for (uint32_t i = 0; i < mesh.triangles.size(); ++i) EXPECT_EQ(seen.prims.count(i), 1u) << i;
  EXPECT_LE(seen.depth, 72u);
}

INSTANTIATE_TEST_SUITE_P(Meshes, BvhSah, ::testing::ValuesIn(NastyMeshes()),
                         [](const auto& i) { return i.param.name; });

TEST(BvhSah, LargeTreesAreTheSameAtAnyThreadCount) {
  const Mesh mesh = Ball(7);  // 131,072 triangles: binned and partitioned in parallel
  auto digest = [&](uint32_t threads) {
    std::string bytes;
    const Tree tree = Build("bvh_sah", mesh.Geometry(), threads);
    tree.structure().visit(
        tree.get(),
        [](void* ctx, const rb_node* n) {
          auto& out = *static_cast<std::string*>(ctx);
          out.append(reinterpret_cast<const char*>(n->bounds), n->bounds_count * sizeof(float));
          out.append(reinterpret_cast<const char*>(n->prims), n->prim_count * sizeof(uint32_t));
          return 0;
        },
        &bytes);
    return bytes;
  };
  const std::string one = digest(1);
  EXPECT_GT(one.size(), 1u << 19);
  EXPECT_EQ(one, digest(2));
  EXPECT_EQ(one, digest(5));
}

TEST(BvhSah, DepthAndAnswerHoldForManyCoincidentTriangles) {
  const Mesh mesh = Coincident(50000);
  const Tree tree = Build("bvh_sah", mesh.Geometry(), 2);
  const auto hits =
      Closest(tree, {{{0.6f, 0.3f, 5}, 0, {0, 0, -1}, INFINITY}, {{0.3f, 0.6f, 5}, 0, {0, 0, -1}, INFINITY}});
  EXPECT_EQ(hits[0].prim, 0u);
  EXPECT_EQ(hits[1].prim, 1u);
}

TEST(BvhSah, MemoryLimitAndCancelEndTheBuild) {
  const Mesh mesh = Ball(5);
  const Registry registry;
  rb_build_options options = DefaultBuildOptions();
  options.memory_limit = 1000;
  EXPECT_THROW(Tree(ParseContestant(registry, "bvh_sah"), mesh.Geometry(), options), BuildError);
  options.memory_limit = 0;
  const int cancel = 1;
  options.cancel = &cancel;
  EXPECT_THROW(Tree(ParseContestant(registry, "bvh_sah"), mesh.Geometry(), options), BuildError);
}

TEST(Contract, ClosestHitsCanBeWalkedInOrder) {
  const Mesh mesh = Coincident(5);
  for (const char* spec : {"brute", "bvh_sah", "bvh_sah(numerics=double)", "bvh_sah(numerics=exact)"}) {
    const Tree tree = Build(spec, mesh.Geometry());
    rb_ray ray{{0.6f, 0.3f, 5}, 0, {0, 0, -1}, INFINITY};
    std::vector<uint32_t> order;
    uint32_t after = RAYBENCH_NONE;
    for (int i = 0; i < 20; ++i) {
      rb_hit hit{};
      rb_query q{};
      q.struct_size = sizeof q, q.kind = RB_CLOSEST, q.n = 1, q.rays = &ray, q.after = &after, q.hits = &hit;
      tree.Query(q);
      if (hit.prim == RAYBENCH_NONE) break;
      order.push_back(hit.prim);
      ray.tnear = hit.t, after = hit.prim;
    }
    EXPECT_EQ(order, (std::vector<uint32_t>{0, 2, 4, 6, 8})) << spec;
  }
}

TEST(Contract, SkippedPrimitivesAndIntervalEndsCountAsSaid) {
  const Mesh mesh = Coincident(2);
  for (const char* spec : {"brute", "bvh_sah", "bvh_sah(numerics=double)", "bvh_sah(numerics=exact)"}) {
    const Tree tree = Build(spec, mesh.Geometry());
    const rb_ray ray{{0.6f, 0.3f, 5}, 0, {0, 0, -1}, INFINITY};
    const uint32_t skip = 0;
    rb_hit hit{};
    rb_query q{};
    q.struct_size = sizeof q, q.kind = RB_CLOSEST, q.n = 1, q.rays = &ray, q.skip = &skip, q.hits = &hit;
    tree.Query(q);
    EXPECT_EQ(hit.prim, 2u) << spec;
    const float t = hit.t;
    rb_ray ends = ray;
    ends.tfar = t;
    EXPECT_EQ(Closest(tree, {ends})[0].prim, 0u) << spec << ": t == tfar counts";
    ends.tfar = std::nextafter(t, 0.0f);
    EXPECT_EQ(Closest(tree, {ends})[0].prim, RAYBENCH_NONE) << spec;
    ends = ray, ends.tnear = t;
    EXPECT_EQ(Closest(tree, {ends})[0].prim, RAYBENCH_NONE) << spec << ": t == tnear does not";
    const rb_hit miss = Closest(tree, {InvalidRayStandIn()})[0];
    EXPECT_EQ(miss.prim, RAYBENCH_NONE);
    EXPECT_EQ(miss.t, InvalidRayStandIn().tfar);
  }
}

TEST(Contract, DirectionsOfAnyLengthHitTheSame) {
  const Mesh mesh = Ball(2);
  const Tree tree = Build("bvh_sah", mesh.Geometry());
  auto rays = NastyRays(mesh, 50, 9);
  const auto expected = Closest(tree, rays);
  int exact_scales = 0;
  for (int e : {-140, -100, -40, 40, 100}) {
    auto scaled = rays;
    bool exact = true;
    for (size_t i = 0; i < rays.size(); ++i) {
      for (int a = 0; a < 3; ++a) {
        scaled[i].dir[a] = std::ldexp(rays[i].dir[a], e);
        exact = exact && std::ldexp(scaled[i].dir[a], -e) == rays[i].dir[a];
      }
    }
    const auto got = Closest(tree, scaled);
    size_t differ = 0;
    for (size_t i = 0; i < rays.size(); ++i) differ += got[i].prim != expected[i].prim;
    // Below 2^-126 directions lose bits: they are other rays then.
    EXPECT_TRUE(!exact || differ == 0) << "2^" << e;
    exact_scales += exact;
  }
  EXPECT_GE(exact_scales, 3);
}

TEST(Contract, TScalesWithTheDirectionInSmallScenesToo) {
  const Mesh mesh = Moved(Ball(3), 0x1p-29f, {0, 0, 0}, "small");
  for (const char* numerics : {"watertight", "double", "exact"}) {
    const Tree tree = Build(std::string("bvh_sah(numerics=") + numerics + ")", mesh.Geometry());
    auto rays = NastyRays(mesh, 100, 10);
    const auto expected = Closest(tree, rays);
    for (int e : {-20, 20, 50, 80}) {
      auto scaled = rays;
      for (rb_ray& ray : scaled) {
        for (float& d : ray.dir) d = std::ldexp(d, e);
      }
      const auto got = Closest(tree, scaled);
      for (size_t i = 0; i < rays.size(); ++i) {
        ASSERT_EQ(got[i].prim, expected[i].prim) << numerics << " 2^" << e << " ray " << i;
        ASSERT_EQ(std::ldexp(got[i].t, e), expected[i].t) << numerics << " 2^" << e << " ray " << i;
      }
    }
  }
}

TEST(RayTriangle, RoundingToFloatIsNotOptimisedAway) {
  // CMakeLists.txt: a compiler does away with it, two at a time.
  std::vector<Vec3d> points = {{1, 2, 3}, {4, 5, 6}, {7, 8, 9}};
  const volatile double third = 1.0 / 3;
  for (Vec3d& p : points) p = ToDouble(ToFloat(p * third));
  for (Vec3d p : points) {
    for (int a = 0; a < 3; ++a) EXPECT_EQ(std::fmod(p[a], 0x1p-25), 0);
  }
}

/// Accepted triangles, of rays at the mesh; fails where so many lanes at once say otherwise than one by one.
template <int kWidth>
size_t AcceptedInLanes(const Mesh& mesh, const std::vector<rb_ray>& rays) {
  struct alignas(4 * kWidth) Block {
    float v[3][3][kWidth];
    uint32_t prim[kWidth];
  };
  size_t accepted = 0;
  auto check = [&]<class Test>() {
    for (const rb_ray& ray : rays) {
      const RayState<Test> state(RayQuery{ray});
      for (size_t t = 0; t + kWidth <= mesh.triangles.size(); t += kWidth) {
        Block block;
        for (int l = 0; l < kWidth; ++l) {
          block.prim[l] = uint32_t(t) + uint32_t(l);
          for (int c = 0; c < 3; ++c)
            for (int a = 0; a < 3; ++a) block.v[c][a][l] = mesh.Corner(t + size_t(l), c)[a];
        }
        const rb_hit miss{ray.tfar, 0, 0, RAYBENCH_NONE};
        rb_hit nearest = miss;
        unsigned takes = 0;
        for (int l = 0; l < kWidth; ++l) {
          const size_t i = t + size_t(l);
          const auto take = [&](rb_hit& best) {
            return state.Triangle(mesh.Corner(i, 0), mesh.Corner(i, 1), mesh.Corner(i, 2), uint32_t(i), best);
          };
          rb_hit alone = miss;
          if (take(alone)) ++accepted, takes |= 1u << l;
          take(nearest);
        }
        if constexpr (RayState<Test>::kInLanes) {
          rb_hit best = miss;
          EXPECT_EQ(
              state.lanes.template Take<false>(block, kAllLanes<kWidth>, state.query, state.slab, true, best),
              takes != 0);
          EXPECT_EQ(std::memcmp(&best, &nearest, sizeof best), 0);
          for (int l = 0; l < kWidth; ++l) {
            best = miss;
            EXPECT_EQ(state.lanes.template Take<true>(block, 1u << l, state.query, state.slab, true, best),
                      (takes >> l & 1u) != 0);
          }
        } else {
          const unsigned may = state.test.MayHit(Lanes<kWidth>{block.v});
          EXPECT_EQ(may & ~kAllLanes<kWidth>, 0u);
          EXPECT_EQ(takes & ~may, 0u);
        }
      }
    }
  };
  for (uint32_t numerics = 0; numerics < 4; ++numerics) WithNumerics(numerics, check);
  return accepted;
}

TEST(RayTriangle, LanesSayWhatOneByOneIsSaid) {
  const Mesh mesh = Ball(2);
  const auto rays = NastyRays(mesh, 100, 3);
  const size_t accepted = AcceptedInLanes<4>(mesh, rays);
  EXPECT_GT(accepted, rays.size());
  EXPECT_EQ(AcceptedInLanes<8>(mesh, rays), accepted);
  EXPECT_EQ(AcceptedInLanes<16>(mesh, rays), accepted);
}

TEST(RayTriangle, WatertightLeavesNoGapAtSharedEdges) {
  // Random fans around a vertex, rays at the vertex and at the spokes: each must hit at least one triangle.
  Random random(21);
  size_t fast_gaps = 0;
  for (int i = 0; i < 20000; ++i) {
    const rb_ray ray{
        {0.1f, 0.2f, 3}, 0, {random.NextFloat() - 0.5f, random.NextFloat() - 0.5f, -3}, INFINITY};
    const Vec3f tip = LoadVec3(ray.org) + LoadVec3(ray.dir);
    Vec3f rim[5];
    const float corner[5][2] = {{1, 0}, {0.3f, 0.95f}, {-0.8f, 0.6f}, {-0.8f, -0.6f}, {0.3f, -0.95f}};
    for (int k = 0; k < 5; ++k) {
      rim[k] = tip + Vec3f{corner[k][0] + 0.1f * random.NextFloat(), corner[k][1] + 0.1f * random.NextFloat(),
                           0.2f * random.NextFloat()};
    }
    const WatertightTest watertight(ray);
    const FastTest fast(ray);
    bool closed = false, fast_hit = false;
    for (int k = 0; k < 5; ++k) {
      PrimHit hit;
      closed |= watertight.Intersect(tip, rim[k], rim[(k + 1) % 5], hit);
      fast_hit |= fast.Intersect(tip, rim[k], rim[(k + 1) % 5], hit);
    }
    ASSERT_TRUE(closed) << i;
    fast_gaps += !fast_hit;
  }
  EXPECT_GT(fast_gaps, 0u) << "the rays do not aim well enough to tell the tests apart";
}

TEST(RayBounds, NestedBoxesHaveNestedIntervals) {
  Random random(5);
  for (int i = 0; i < 20000; ++i) {
    Bounds3 inner, outer;
    for (int k = 0; k < 2; ++k) inner.Extend(ToFloat(random.UnitVector()));
    outer = inner;
    outer.Extend(ToFloat(random.UnitVector()));
    rb_ray ray{{random.NextFloat() * 4 - 2, random.NextFloat() * 4 - 2, inner.hi.z},
               0,
               {random.NextFloat() - 0.5f, random.Below(2) ? 0.0f : -0.0f, random.Below(2) ? 1e-41f : -0.5f},
               INFINITY};
    const SlabRay slab(ray, Slack::kFarEnd);
    float n0, f0, n1, f1;
    slab.Interval(inner, n0, f0);
    slab.Interval(outer, n1, f1);
    ASSERT_LE(n1, n0);
    ASSERT_GE(f1, f0);
  }
}

TEST(RayBounds, RaysInAFaceOfTheBoxHitIt) {
  const Bounds3 box{{-1, -2, -3}, {1, 2, 3}}, flat{{-1, -2, 3}, {1, 2, 3}};
  for (const Bounds3& b : {box, flat}) {
    for (float zero : {0.0f, -0.0f, 1e-42f, -1e-42f}) {
      rb_ray ray{{0.25f, -5, 3}, 0, {zero, 1, zero}, INFINITY};
      float n, f;
      SlabRay(ray, Slack::kFarEnd).Interval(b, n, f);
      EXPECT_LE(n, f) << zero;
      ray.org[2] = 3.001f;  // beside the face: a miss
      SlabRay(ray, Slack::kFarEnd).Interval(b, n, f);
      EXPECT_GT(n, f) << zero;
    }
  }
}

/// Counts rays that the test accepts, and those of them that pass the triangle's box where it is not padded.
struct PaddedBoxes {
  size_t accepted = 0, outside_unpadded = 0;

  void Aim(const Vec3f (&p)[3], Vec3f org, Vec3f target) {
    const Vec3f d = target - org;
    if (d == Vec3f{0, 0, 0}) return;
    const rb_ray ray{{org.x, org.y, org.z}, 0, {d.x, d.y, d.z}, INFINITY};
    PrimHit hit;
    if (!WatertightTest(ray).Intersect(p[0], p[1], p[2], hit)) return;
    ++accepted;
    float n, f;
    SlabRay(ray, Slack::kFarEnd).Interval(PaddedBounds(p[0], p[1], p[2]), n, f);
    ASSERT_LE(n, f) << accepted;
    SlabRay(ray, Slack::kFarEnd).Interval({Min(Min(p[0], p[1]), p[2]), Max(Max(p[0], p[1]), p[2])}, n, f);
    outside_unpadded += n > f;
  }
};

TEST(RayBounds, AcceptedHitsLieInThePaddedBoxOfLongTrianglesToo) {
  // Needles along an axis, up to 1e4 times longer than the way from the origin to the hit, and rays that pass
  // their edge at about the distance by which the vertices' rounding moves it.
  Random random(31);
  PaddedBoxes boxes;
  for (int i = 0; i < 200000; ++i) {
    const int axis = int(random.Below(3));
    const float length = std::ldexp(1.0f, int(random.Below(15)));
    const Vec3f at = ToFloat(random.UnitVector() * 3.0);
    Vec3f p[3] = {at, at, at + ToFloat(random.UnitVector()) * (length * 0x1p-20f)};
    p[0][axis] -= length * random.NextFloat();
    p[1][axis] += length * random.NextFloat();
    const Vec3f target = at + ToFloat(random.UnitVector()) * (length * 0x1p-23f);
    const Vec3f org = target + ToFloat(random.UnitVector() * random.NextDouble());
    ASSERT_NO_FATAL_FAILURE(boxes.Aim(p, org, target)) << i;
  }
  EXPECT_GT(boxes.accepted, 10000u);
  EXPECT_GT(boxes.outside_unpadded, 0u) << "the triangles are not long enough to need the padding";
}

TEST(RayBounds, AcceptedHitsLieInThePaddedBoxOfFlatAndOfFarTriangles) {
  // Edges in a face of the box, and rays that begin near them and pass them at about the distance by which the shear
  // moves them. Flat triangles at 0 have nothing but the padding; far from 0, rounding eats it.
  for (const bool is_flat : {true, false}) {
    for (const float far : {0.0f, 1.0f, 8.0f}) {
      Random random(32);
      const auto sign = [&] { return random.Below(2) != 0 ? 1.0f : -1.0f; };
      const auto some = [&](double length) {
        return ToFloat(random.UnitVector() * (length * random.NextDouble()));
      };
      PaddedBoxes boxes;
      for (int i = 0; i < 300000; ++i) {
        const int axis = int(random.Below(3)), next = (axis + 1) % 3, last = (axis + 2) % 3;
        Vec3f p[3];
        p[0] = p[1] = p[2] = ToFloat(random.UnitVector() * double(far));
        p[1][next] += sign() * random.NextFloat(), p[2][last] += sign() * random.NextFloat();
        if (!is_flat) p[1][axis] += sign() * random.NextFloat();
        const size_t corner = random.Below(3);
        const double along = random.Below(3) != 0 ? random.NextDouble() : double(random.Below(2));
        const Vec3f target =
            ToFloat(ToDouble(p[corner]) * along + ToDouble(p[(corner + 1) % 3]) * (1 - along)) +
            some(0x1p-21);
        const Vec3f org = target + some(std::ldexp(2.0, -int(random.Below(24))));
        ASSERT_NO_FATAL_FAILURE(boxes.Aim(p, org, target)) << i;
      }
      EXPECT_GT(boxes.accepted, 50000u);
      EXPECT_GT(boxes.outside_unpadded, 0u) << is_flat << " " << far << ": nothing needs the padding";
    }
  }
}

}  // namespace
}  // namespace raybench::testing
