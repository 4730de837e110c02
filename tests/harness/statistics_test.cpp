// Figures of trees and samples against values worked out by hand.
#include "harness/measure/statistics.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <random>
#include <vector>

#include "accel/base/random.h"
#include "harness/judge/bound_tightness.h"
#include "harness/judge/cover.h"
#include "harness/judge/end_point_overlap.h"
#include "harness/judge/tree_statistics.h"
#include "harness/plan/plan.h"
#include "harness/verify/report.h"
#include "tests/support/meshes.h"

namespace raybench {
namespace {

TEST(TreeFigures, AVisitorThatShowsNothingIsAFlawUnlessThereIsNothing) {
  static rb_structure silent{};
  silent.name = "silent";
  silent.build = [](const rb_geometry*, const rb_build_options*, const void*, rb_tree** tree, char*, size_t) {
    *tree = reinterpret_cast<rb_tree*>(&silent);
    return 0;
  };
  silent.destroy = [](rb_tree*) {};
  silent.visit = [](const rb_tree*, int (*)(void*, const rb_node*), void*) { return 0; };
  const float positions[4][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  const uint32_t triangles[1][3] = {{0, 1, 2}};
  rb_geometry geometry{};
  geometry.struct_size = sizeof geometry;
  geometry.positions = positions, geometry.vertex_count = 3, geometry.triangles = triangles;
  geometry.triangle_count = 1;
  const Contestant contestant{&silent, {}};
  EXPECT_EQ(ReadTree(Tree(contestant, geometry, DefaultBuildOptions()), geometry)->flaw,
            "the visit shows no node, but there are 1 primitives");
  geometry.triangle_count = 0;
  EXPECT_EQ(ReadTree(Tree(contestant, geometry, DefaultBuildOptions()), geometry)->flaw, "");
}

TEST(HarnessMedian, IntervalIsThatOfTheBinomialTable) {
  // n: ranks (from 1) of the narrowest symmetric interval of at least 95 %, from a binomial table.
  struct Row {
    size_t n, lo, hi;
    double coverage;
  };
  for (Row row : {Row{6, 1, 6, 1 - 2.0 / 64},
                  {7, 1, 7, 1 - 2.0 / 128},
                  {8, 1, 8, 1 - 2.0 / 256},
                  {9, 2, 8, 1 - 20.0 / 512},
                  {10, 2, 9, 1 - 22.0 / 1024},
                  {15, 4, 12, 1 - 2 * 576.0 / 32768},
                  {20, 6, 15, 0.95861053}}) {
    std::vector<double> values(row.n);
    for (size_t i = 0; i < row.n; ++i) values[i] = double(i + 1);
    std::shuffle(values.begin(), values.end(), std::mt19937(7));
    const MedianInterval m = MedianOf(values);
    SCOPED_TRACE(row.n);
    EXPECT_DOUBLE_EQ(m.median, 0.5 * double(row.n + 1));
    ASSERT_TRUE(m.lo && m.hi);
    EXPECT_EQ(*m.lo, double(row.lo));
    EXPECT_EQ(*m.hi, double(row.hi));
    EXPECT_NEAR(m.coverage, row.coverage, 1e-7);
  }
}

TEST(HarnessMedian, FiveSamplesHaveNoInterval) {
  const std::vector<double> values = {5, 1, 4, 2, 3};
  const MedianInterval m = MedianOf(values);
  EXPECT_EQ(m.median, 3);
  EXPECT_FALSE(m.lo);
  EXPECT_FALSE(m.hi);
  EXPECT_EQ(MedianOf(std::vector<double>{2.5}).median, 2.5);
}

/// A structure whose tree is written down by hand.
struct HandTree {
  std::vector<rb_node> nodes;
  rb_structure table = {};
  HandTree() {
    table.name = "hand";
    table.destroy = [](rb_tree*) {};
    table.build = [](const rb_geometry*, const rb_build_options*, const void* config, rb_tree** tree, char*,
                     size_t) {
      std::memcpy(tree, config, sizeof *tree);
      return 0;
    };
    table.config_size = sizeof(void*);
    table.visit = [](const rb_tree* tree, int (*node)(void*, const rb_node*), void* context) {
      for (const rb_node& n : reinterpret_cast<const HandTree*>(tree)->nodes) {
        if (int stop = node(context, &n)) return stop;
      }
      return 0;
    };
  }
  Tree Build(const rb_geometry& geometry) {
    HandTree* self = this;
    Contestant contestant{&table, std::vector<std::byte>(sizeof self)};
    std::memcpy(contestant.config.data(), &self, sizeof self);
    return Tree(contestant, geometry, DefaultBuildOptions());
  }
  std::optional<TreeStatistics> Read(const rb_geometry& geometry) {
    return ReadTree(Build(geometry), geometry);
  }
};

/// Two triangles: one in x = 0..1, the other in x = 2..3; both of y, z in 0..1.
testing::Mesh TwoTriangles() {
  return {"two", {{0, 0, 0}, {1, 1, 0}, {0, 0, 1}, {2, 0, 0}, {3, 1, 0}, {2, 0, 1}}, {{0, 1, 2}, {3, 4, 5}}};
}

TEST(HarnessTreeStatistics, CountsDepthReferencesAndSahCostOfAHandMadeTree) {
  const testing::Mesh mesh = TwoTriangles();
  const float root[] = {0, 0, 0, 3, 1, 1}, left[] = {0, 0, 0, 1, 1, 1}, right[] = {2, 0, 0, 3, 1, 1};
  const uint32_t prims[] = {0, 1};
  HandTree hand;
  hand.nodes = {{0, 0, 0, RB_SHAPE_BOX, root, 6, 0, nullptr},
                {1, 1, 0, RB_SHAPE_BOX, left, 6, 1, prims},
                {1, 0, 0, RB_SHAPE_BOX, right, 6, 0, nullptr},
                {2, 1, 0, RB_SHAPE_BOX, right, 6, 1, prims + 1},
                {2, 1, 0, RB_SHAPE_BOX, right, 6, 0, nullptr}};
  const auto s = hand.Read(mesh.Geometry());
  ASSERT_TRUE(s);
  EXPECT_EQ(s->inner_nodes, 2u);
  EXPECT_EQ(s->leaf_nodes, 3u);
  EXPECT_EQ(s->empty_leaf_nodes, 1u);
  EXPECT_EQ(s->references, 2u);
  EXPECT_EQ(s->depth, 2u);
  // Half areas: root 3+1+3 = 7, the others 3. 1 (root) + 3/7 (left leaf, one primitive) + 3/7 (inner) +
  // 3/7 (leaf).
  ASSERT_TRUE(s->sah_cost);
  EXPECT_NEAR(*s->sah_cost, 1 + 9.0 / 7, 1e-12);
  EXPECT_EQ(s->flaw, "");
}

TEST(HarnessTreeStatistics, NamesAPrimitiveThatALeafLeavesOutOrThatNoLeafHolds) {
  const testing::Mesh mesh = TwoTriangles();
  const float all[] = {0, 0, 0, 3, 1, 1}, small[] = {0, 0, 0, 2.5f, 1, 1};
  const uint32_t prims[] = {0, 1};
  HandTree hand;
  hand.nodes = {{0, 1, 0, RB_SHAPE_BOX, small, 6, 2, prims}};
  EXPECT_EQ(hand.Read(mesh.Geometry())->flaw, "the bounds of a leaf leave out part of primitive 1");
  hand.nodes = {{0, 1, 0, RB_SHAPE_BOX, all, 6, 1, prims}};
  EXPECT_EQ(hand.Read(mesh.Geometry())->flaw, "no leaf holds primitive 1");
  const uint32_t wrong[] = {0, 1, 2};
  hand.nodes = {{0, 1, 0, RB_SHAPE_BOX, all, 6, 3, wrong}};
  EXPECT_EQ(hand.Read(mesh.Geometry())->flaw, "a leaf refers to primitive 2, but there are 2");
}

TEST(HarnessTreeStatistics, LeavesOfASpacePartitionMayShareAPrimitive) {
  const testing::Mesh mesh = TwoTriangles();
  const float all[] = {0, 0, 0, 3, 1, 1}, left[] = {0, 0, 0, 2.5f, 1, 1}, right[] = {2.5f, 0, 0, 3, 1, 1};
  const uint32_t prims[] = {0, 1};
  HandTree hand;
  hand.nodes = {{0, 0, 1, RB_SHAPE_BOX, all, 6, 0, nullptr},
                {1, 1, 1, RB_SHAPE_BOX, left, 6, 2, prims},
                {1, 1, 1, RB_SHAPE_BOX, right, 6, 1, prims + 1}};
  EXPECT_EQ(hand.Read(mesh.Geometry())->flaw, "");
  // The box around both leaves would still hold the triangle.
  const float narrow[] = {std::nextafter(2.5f, 3.0f), 0, 0, 3, 1, 1};
  hand.nodes[2].bounds = narrow;
  EXPECT_EQ(hand.Read(mesh.Geometry())->flaw, "the leaves of primitive 1 leave out part of it");
  hand.nodes[2].bounds = right;
  hand.nodes[2].prims = prims;
  EXPECT_EQ(hand.Read(mesh.Geometry())->flaw, "the leaves of primitive 1 leave out part of it");
}

TEST(HarnessTreeStatistics, NodesAreInPreOrderAndInsideTheirParents) {
  const testing::Mesh mesh = TwoTriangles();
  const float all[] = {0, 0, 0, 3, 1, 1}, larger[] = {0, 0, 0, 3, 1, 1.5f};
  const uint32_t prims[] = {0, 1};
  const rb_node inner{0, 0, 0, RB_SHAPE_BOX, all, 6, 0, nullptr},
      leaf{1, 1, 0, RB_SHAPE_BOX, all, 6, 2, prims};
  const auto at = [](rb_node node, uint32_t depth) {
    node.depth = depth;
    return node;
  };
  HandTree hand;
  const auto flaw = [&](std::vector<rb_node> nodes) {
    hand.nodes = std::move(nodes);
    return hand.Read(mesh.Geometry())->flaw;
  };
  EXPECT_EQ(flaw({inner, leaf, leaf}), "");
  EXPECT_EQ(flaw({inner, at(inner, 1), at(leaf, 2), leaf}), "");
  EXPECT_EQ(flaw({leaf}), "node 0 of the visit is the first, but its depth is not 0");
  EXPECT_EQ(flaw({inner, leaf, at(leaf, 0)}), "node 2 of the visit is a second root");
  EXPECT_EQ(flaw({inner, at(leaf, 2)}), "node 1 of the visit is deeper than a child of the one before it");
  EXPECT_EQ(flaw({inner, leaf, at(leaf, 2)}),
            "node 2 of the visit is deeper than a child of the one before it");
  EXPECT_EQ(flaw({inner, at(inner, 1), leaf}), "node 1 of the visit is an inner node without children");
  EXPECT_EQ(flaw({inner, leaf, at(inner, 1)}), "node 2 of the visit is an inner node without children");
  rb_node wide = leaf;
  wide.bounds = larger;
  EXPECT_EQ(flaw({inner, leaf, wide}), "the box of node 2 of the visit is not inside its parent's");
}

TEST(HarnessTreeStatistics, SpheresAndKDopsHoldTheirTrianglesBelowToo) {
  const testing::Mesh mesh = TwoTriangles();
  const uint32_t prims[] = {0, 1};
  // Around the middle of both triangles, x in 0..3, y and z in 0..1; the farthest corner is sqrt(2.75) away.
  float sphere[] = {1.5f, 0.5f, 0.5f, 1.6584f};
  // x, y, z, x+y+z, x-y+z, x+y-z, x-y-z: the greatest of x+y+z is that of (3, 1, 0).
  float kdop[] = {0, 0, 0, 0, -1, -1, -1, 3, 1, 1, 4, 3, 4, 2};
  const float all[] = {0, 0, 0, 3, 1, 1};
  HandTree hand;
  const auto flaw = [&](const rb_node& above, const rb_node& leaf) {
    hand.nodes = {above, leaf};
    return hand.Read(mesh.Geometry())->flaw;
  };
  const rb_node inner_sphere{0, 0, 0, RB_SHAPE_SPHERE, sphere, 4, 0, nullptr},
      leaf_sphere{1, 1, 0, RB_SHAPE_SPHERE, sphere, 4, 2, prims},
      inner_kdop{0, 0, 0, RB_SHAPE_KDOP, kdop, 14, 0, nullptr},
      leaf_kdop{1, 1, 0, RB_SHAPE_KDOP, kdop, 14, 2, prims},
      leaf_box{1, 1, 0, RB_SHAPE_BOX, all, 6, 2, prims};
  EXPECT_EQ(flaw(inner_sphere, leaf_sphere), "");
  EXPECT_EQ(flaw(inner_sphere, leaf_box), "");
  EXPECT_EQ(flaw(inner_kdop, leaf_kdop), "");
  EXPECT_EQ(hand.Read(mesh.Geometry())->unchecked_nodes, 0u);
  EXPECT_FALSE(hand.Read(mesh.Geometry())->sah_cost);
  const std::string lost = "the bounds of a leaf or of a node above it leave out part of primitive ";
  sphere[3] = 1.6582f;
  EXPECT_EQ(flaw(inner_sphere, leaf_box), lost + "0");
  EXPECT_EQ(flaw(inner_kdop, leaf_sphere), lost + "0");
  kdop[7 + 3] = std::nextafter(4.0f, 0.0f);
  EXPECT_EQ(flaw(inner_kdop, leaf_box), lost + "1");
  rb_node unknown = leaf_kdop;
  unknown.bounds_count = 12;
  unknown.depth = 0;
  hand.nodes = {unknown};
  EXPECT_EQ(hand.Read(mesh.Geometry())->flaw, "");
  EXPECT_EQ(hand.Read(mesh.Geometry())->unchecked_nodes, 1u);
}

// Found by the fuzzer: the recursion was as deep as boxes stand about a triangle that passes most of them by.
TEST(HarnessCover, ManyCellsAboutADiagonalTriangle) {
  const Vec3f p0{0, 0, 0}, p1{4000, 5, 0}, p2{4000, 5, 10};
  std::vector<Bounds3> cells;
  for (int z = 0; z < 10; ++z)
    for (int y = 0; y < 5; ++y)
      for (int x = 0; x < 4000; ++x)
        cells.push_back({{float(x), float(y), float(z)}, {float(x + 1), float(y + 1), float(z + 1)}});
  EXPECT_TRUE(BoxesCover(cells, p0, p1, p2));
  cells.erase(cells.begin() + 2000 + 4000 * 2);  // x 2000, y 2, z 0: the triangle's plane crosses it
  EXPECT_FALSE(BoxesCover(cells, p0, p1, p2));
}

TEST(HarnessCover, BoxesCoverATriangleWhateverTheirOrder) {
  const Vec3f p0{0.125f, 0.25f, 0.5f}, p1{7.5f, 1.25f, 3.25f}, p2{2.25f, 7.75f, 6.5f};
  // Cells of a grid of 8 x 8 x 8; those that the triangle does not reach are not needed, each other one is.
  std::vector<Bounds3> cells;
  for (int x = 0; x < 8; ++x)
    for (int y = 0; y < 8; ++y)
      for (int z = 0; z < 8; ++z)
        cells.push_back({{float(x), float(y), float(z)}, {float(x + 1), float(y + 1), float(z + 1)}});
  std::shuffle(cells.begin(), cells.end(), std::mt19937(5));
  EXPECT_TRUE(BoxesCover(cells, p0, p1, p2));
  std::vector<Bounds3> needed;
  for (size_t i = 0; i < cells.size(); ++i) {
    std::vector<Bounds3> others = cells;
    others.erase(others.begin() + ptrdiff_t(i));
    if (!BoxesCover(others, p0, p1, p2)) needed.push_back(cells[i]);
  }
  EXPECT_GT(needed.size(), 60u);
  EXPECT_LT(needed.size(), 160u);
  EXPECT_TRUE(BoxesCover(needed, p0, p1, p2));
  // Points of the triangle are in the cells that are needed.
  Random random(3);
  for (int i = 0; i < 2000; ++i) {
    double u = random.NextDouble(), v = random.NextDouble();
    if (u + v > 1) u = 1 - u, v = 1 - v;
    const Vec3d p = ToDouble(p0) * (1 - u - v) + ToDouble(p1) * u + ToDouble(p2) * v;
    EXPECT_TRUE(std::any_of(needed.begin(), needed.end(), [&](const Bounds3& b) {
      return p.x >= b.lo.x && p.x <= b.hi.x && p.y >= b.lo.y && p.y <= b.hi.y && p.z >= b.lo.z &&
             p.z <= b.hi.z;
    }));
  }
  // A gap of one ulp anywhere between the cells is seen.
  for (Bounds3& b : needed) b.hi.x = std::nextafter(b.hi.x, 0.0f);
  EXPECT_FALSE(BoxesCover(needed, p0, p1, p2));
  EXPECT_FALSE(BoxesCover({}, p0, p1, p2));
  // In the plane of a face, on either side.
  const std::vector<Bounds3> one = {{{0, 0, 0}, {1, 1, 1}}};
  EXPECT_TRUE(BoxesCover(one, {0, 0, 1}, {1, 0, 1}, {0, 1, 1}));
  EXPECT_FALSE(BoxesCover(one, {0, 0, 1}, {1, 0, 1}, {0, 1, std::nextafter(1.0f, 2.0f)}));
}

TEST(HarnessUpperRate, IsThatOfClopperAndPearson) {
  EXPECT_NEAR(UpperRate(0, 1), 0.95, 1e-12);
  EXPECT_NEAR(UpperRate(0, 100), 1 - std::pow(0.05, 0.01), 1e-12);
  EXPECT_NEAR(UpperRate(0, 100'000'000) * 1e8, 2.9957, 1e-4);  // the rule of three
  // Quantiles of the beta distribution from a table: 95 % of Beta(k + 1, n - k).
  EXPECT_NEAR(UpperRate(1, 10), 0.394163, 1e-6);
  EXPECT_NEAR(UpperRate(5, 100), 0.102253, 1e-5);
  EXPECT_NEAR(UpperRate(1, 1'000'000) * 1e6, 4.7438, 1e-3);  // Poisson: 95 % of chi-squared(4) / 2
  EXPECT_NEAR(UpperRate(100'000, 1'000'000), 0.1 + 1.6449 * std::sqrt(0.09e-6), 2e-6);
  EXPECT_EQ(UpperRate(7, 7), 1);
  EXPECT_EQ(UpperRate(0, 0), 1);
  for (uint64_t k = 1; k < 50; ++k) EXPECT_GT(UpperRate(k, 50), UpperRate(k - 1, 50));
}

TEST(HarnessErrorHistogram, PercentilesAreAtMostASixtyFourthTooLarge) {
  Random random(9);
  ErrorHistogram whole, half;
  std::vector<double> errors;
  EXPECT_EQ(whole.Percentile(50), 0);
  for (int i = 0; i < 10000; ++i) {
    const double error = i % 10 == 0 ? 0 : std::ldexp(random.NextDouble(), int(random.Below(40)) - 20);
    errors.push_back(error);
    (i % 2 ? whole : half).Add(error);
  }
  whole.Add(half);
  std::sort(errors.begin(), errors.end());
  for (uint64_t percent : {5, 50, 90, 99}) {
    const double exact = errors[errors.size() * percent / 100 - 1], got = whole.Percentile(percent);
    EXPECT_GE(got, exact);
    EXPECT_LE(got, exact * (1 + 1.0 / 64) * (1 + 1e-6));
  }
  EXPECT_EQ(whole.Max(), errors.back());
  EXPECT_EQ(whole.Percentile(100), errors.back());
}

TEST(HarnessTreeStatistics, EveryBuiltInTreeEnclosesItsPrimitives) {
  const Registry registry;
  const testing::Mesh ball = testing::Ball(3);
  for (const rb_structure* structure : registry.structures()) {
    const Tree tree(ParseContestant(registry, structure->name), ball.Geometry(), DefaultBuildOptions());
    const auto statistics = ReadTree(tree, ball.Geometry());
    SCOPED_TRACE(structure->name);
    EXPECT_EQ(statistics.has_value(), structure->visit != nullptr);
    if (statistics && statistics->leaf_nodes > 0) {
      EXPECT_EQ(statistics->flaw, "");
      EXPECT_GE(statistics->references, ball.triangles.size());
    }
  }
}

TEST(HarnessEndPointOverlap, CountsTheAreaOfStrangersInEachNode) {
  const testing::Mesh mesh = TwoTriangles();
  const float root[] = {0, 0, 0, 3, 1, 1}, left[] = {0, 0, 0, 1, 1, 1}, right[] = {2, 0, 0, 3, 1, 1},
              wide[] = {0, 0, 0, 3, 1, 0.5f};
  const uint32_t prims[] = {0, 1};
  HandTree hand;
  hand.nodes = {{0, 0, 0, RB_SHAPE_BOX, root, 6, 0, nullptr},
                {1, 1, 0, RB_SHAPE_BOX, left, 6, 1, prims},
                {1, 1, 0, RB_SHAPE_BOX, right, 6, 1, prims + 1}};
  EXPECT_EQ(EndPointOverlap(hand.Build(mesh.Geometry()), mesh.Geometry(), 100, 1), 0.0);
  // Both triangles have the same area; of the second, 1 - 1/2^2 of it lies below z = 0.5, in the first one's
  // leaf. Below an inner node of the same box that counts twice.
  hand.nodes[1].bounds = wide;
  const auto once = EndPointOverlap(hand.Build(mesh.Geometry()), mesh.Geometry(), 100, 1);
  ASSERT_TRUE(once);
  EXPECT_NEAR(*once, 0.75 / 2, 1e-12);
  hand.nodes.insert(hand.nodes.begin() + 1, {1, 0, 0, RB_SHAPE_BOX, wide, 6, 0, nullptr});
  hand.nodes[2].depth = 2;
  EXPECT_NEAR(*EndPointOverlap(hand.Build(mesh.Geometry()), mesh.Geometry(), 100, 1), 2 * 0.75 / 2, 1e-12);
  // A leaf of two primitives costs two, and both belong to it.
  hand.nodes[2].prim_count = 2;
  EXPECT_EQ(*EndPointOverlap(hand.Build(mesh.Geometry()), mesh.Geometry(), 100, 1), 0);
}

TEST(HarnessEndPointOverlap, MillionsOfChildrenArePassedOverTogether) {
  // A row of leaves along x, as a grid has: the second triangle stands alone in the last, and one stranger's leaf, in
  // the middle of a run, reaches it.
  const testing::Mesh mesh = TwoTriangles();
  constexpr int kLeaves = 3000;
  std::vector<std::array<float, 6>> boxes(kLeaves);
  const float root[] = {-kLeaves, 0, 0, 3, 1, 1};
  const uint32_t prims[] = {0, 1};
  HandTree hand;
  hand.nodes = {{0, 0, 0, RB_SHAPE_BOX, root, 6, 0, nullptr}};
  for (int i = 0; i < kLeaves; ++i) {
    boxes[i] = {float(i - kLeaves), 0, 0, float(i - kLeaves + 1), 1, 1};
    if (i == 1500) boxes[i] = {0, 0, 0, 3, 1, 0.5f};
    if (i == kLeaves - 1) boxes[i] = {2, 0, 0, 3, 1, 1};
    const uint32_t count = i == 1500 || i == kLeaves - 1;
    hand.nodes.push_back({1, 1, 0, RB_SHAPE_BOX, boxes[i].data(), 6, count, i == 1500 ? prims : prims + 1});
  }
  EXPECT_NEAR(*EndPointOverlap(hand.Build(mesh.Geometry()), mesh.Geometry(), 100, 1), 0.75 / 2, 1e-12);
}

TEST(HarnessBoundTightness, IsTheRatioOfAreasForOneTriangle) {
  // For convex bodies the share of random lines is the ratio of surfaces (Cauchy); a triangle has two sides.
  testing::Mesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  mesh.triangles = {{0, 1, 2}};
  const float box[] = {0, 0, -1, 1, 1, 1}, ball[] = {0, 0, 0, 1}, half[] = {0, 0, 0, 0.5f, 1, 1};
  float kdop[14] = {0, 0, -1, -9, -9, -9, -9, 1, 1, 1, 9, 9, 9, 9};
  const uint32_t prim = 0;
  HandTree hand;
  const auto tightness = [&](uint32_t shape, const float* bounds, uint32_t count) {
    hand.nodes = {{0, 1, 1, shape, bounds, count, 1, &prim}};
    return BoundTightness(hand.Build(mesh.Geometry()), mesh.Geometry(), 1 << 16, 1).value();
  };
  const double error = 3 * 0.5 / std::sqrt(65536 / 3.0);
  EXPECT_NEAR(tightness(RB_SHAPE_BOX, box, 6), 1.0 / 10, error);
  EXPECT_NEAR(tightness(RB_SHAPE_SPHERE, ball, 4), 1 / (4 * M_PI), error);
  EXPECT_NEAR(tightness(RB_SHAPE_KDOP, kdop, 14), 1.0 / 10, error);
  // Cut at x + y + z <= 1, beyond which the triangle does not reach, the k-DOP loses surface.
  kdop[10] = 1;
  EXPECT_GT(tightness(RB_SHAPE_KDOP, kdop, 14), 1.15 / 10);
  // Only what is hit within the bounds counts: three quarters of the triangle lie at x <= 0.5.
  EXPECT_NEAR(tightness(RB_SHAPE_BOX, half, 6), 0.75 / 4, error);
  // An empty leaf has nothing to hit and is not asked; two leaves count by how often lines meet them.
  hand.nodes = {{0, 0, 1, RB_SHAPE_BOX, box, 6, 0, nullptr},
                {1, 1, 1, RB_SHAPE_BOX, box, 6, 0, nullptr},
                {1, 1, 1, RB_SHAPE_BOX, box, 6, 1, &prim}};
  EXPECT_NEAR(*BoundTightness(hand.Build(mesh.Geometry()), mesh.Geometry(), 1 << 16, 1), 1.0 / 10, error);
  hand.nodes = {{0, 1, 1, RB_SHAPE_BOX, box, 6, 0, nullptr}};
  EXPECT_FALSE(BoundTightness(hand.Build(mesh.Geometry()), mesh.Geometry(), 100, 1));
}

TEST(HarnessTreeStatistics, LeafDepthIsWeightedByArea) {
  const testing::Mesh mesh = TwoTriangles();
  const float root[] = {0, 0, 0, 3, 1, 1}, left[] = {0, 0, 0, 1, 1, 1}, right[] = {1, 0, 0, 3, 1, 1},
              near[] = {1, 0, 0, 2, 1, 1}, far[] = {2, 0, 0, 3, 1, 1};
  const uint32_t prims[] = {0, 1};
  HandTree hand;
  hand.nodes = {{0, 0, 1, RB_SHAPE_BOX, root, 6, 0, nullptr},
                {1, 1, 1, RB_SHAPE_BOX, left, 6, 1, prims},
                {1, 0, 1, RB_SHAPE_BOX, right, 6, 0, nullptr},
                {2, 1, 1, RB_SHAPE_BOX, near, 6, 0, nullptr},
                {2, 1, 1, RB_SHAPE_BOX, far, 6, 1, prims + 1}};
  const auto statistics = ReadTree(hand.Build(mesh.Geometry()), mesh.Geometry());
  ASSERT_TRUE(statistics && statistics->leaf_depth);
  EXPECT_NEAR(*statistics->leaf_depth, (6 * 1 + 6 * 2 + 6 * 2) / 18.0, 1e-6);
}

TEST(HarnessPlan, PicksAreDistinctAscendingSeededAndAllOfASmallSet) {
  EXPECT_EQ(PickSample(5, 100, 1, "x"), (std::vector<uint32_t>{0, 1, 2, 3, 4}));
  const std::vector<uint32_t> picks = PickSample(1000, 37, 1, "x");
  EXPECT_EQ(picks.size(), 37u);
  EXPECT_TRUE(std::is_sorted(picks.begin(), picks.end()));
  EXPECT_EQ(std::adjacent_find(picks.begin(), picks.end()), picks.end());
  EXPECT_LT(picks.back(), 1000u);
  EXPECT_EQ(picks, PickSample(1000, 37, 1, "x"));
  EXPECT_NE(picks, PickSample(1000, 37, 2, "x"));
  EXPECT_NE(picks, PickSample(1000, 37, 1, "y"));
}

}  // namespace
}  // namespace raybench
