// The kd-tree builders: against a quadratic one, against their invariants, at their bounds.
#include <gtest/gtest.h>

#include <cstring>
#include <set>

#include "accel/kd/build.h"
#include "accel/ray/bounds.h"
#include "tests/support/meshes.h"

namespace raybench::testing {
namespace {

/// A node as the visitor shows it.
struct Shown {
  uint32_t depth;
  bool is_leaf;
  Bounds3 cell;
  std::vector<uint32_t> prims;

  friend bool operator==(const Shown& a, const Shown& b) {
    return a.depth == b.depth && a.is_leaf == b.is_leaf && a.cell.lo == b.cell.lo && a.cell.hi == b.cell.hi &&
           a.prims == b.prims;
  }
};

std::vector<Shown> NodesOf(const Tree& tree) {
  std::vector<Shown> nodes;
  tree.structure().visit(
      tree.get(),
      [](void* ctx, const rb_node* n) {
        EXPECT_EQ(n->space_partition, 1u);
        static_cast<std::vector<Shown>*>(ctx)->push_back({n->depth,
                                                          n->is_leaf != 0,
                                                          {LoadVec3(n->bounds), LoadVec3(n->bounds + 3)},
                                                          {n->prims, n->prims + n->prim_count}});
        return 0;
      },
      &nodes);
  return nodes;
}

std::vector<Shown> NodesOf(const KdTree& tree) {
  std::vector<Shown> nodes;
  tree.Visit([&](const rb_node& n) {
    nodes.push_back({n.depth,
                     n.is_leaf != 0,
                     {LoadVec3(n.bounds), LoadVec3(n.bounds + 3)},
                     {n.prims, n.prims + n.prim_count}});
    return 0;
  });
  return nodes;
}

/// Boxes on a grid, so that many faces share planes; some are flat.
Mesh Town(int n) {
  Mesh mesh{"town", {}, {}};
  Random random(8);
  for (int i = 0; i < n * n; ++i) {
    const Vec3f lo = {float(i % n), float(i / n), 0};
    const Vec3f hi = {lo.x + 0.5f, lo.y + 0.75f, float(random.Below(4))};
    const uint32_t first = uint32_t(mesh.positions.size());
    for (int c = 0; c < 8; ++c)
      mesh.positions.push_back({c & 1 ? hi.x : lo.x, c & 2 ? hi.y : lo.y, c & 4 ? hi.z : lo.z});
    for (std::array<uint32_t, 3> t : {std::array{0u, 1u, 3u}, {0, 3, 2}, {0, 1, 5}, {1, 3, 7}})
      mesh.triangles.push_back({first + t[0], first + t[1], first + t[2]});
  }
  // No triangle is degenerate: walls of height 0 go.
  std::erase_if(mesh.triangles, [&](const auto& t) {
    return mesh.positions[t[0]] == mesh.positions[t[1]] || mesh.positions[t[1]] == mesh.positions[t[2]] ||
           mesh.positions[t[0]] == mesh.positions[t[2]];
  });
  return mesh;
}

std::vector<Mesh> Meshes() {
  return {Mesh{"one", {{0, 0, 0}, {1, 0, 0}, {0, 1, 0.5f}}, {{0, 1, 2}}},
          Ball(3),
          Lattice(8),
          Town(7),
          Coincident(60),
          Needles(60),
          Moved(Ball(2), 1, {1000, -2000, 500}, "far"),
          Moved(Needles(40), 0x1p-29f, {0, 0, 0}, "small")};
}

/// The definition: every plane that bounds a primitive, each weighed by looking at all primitives.
class Quadratic {
 public:
  Quadratic(const rb_geometry& geometry, const KdOptions& options) : geometry_(geometry), options_(options) {
    Bounds3 cell;
    std::vector<KdRef> refs;
    for (uint32_t i = 0; i < PrimCount(geometry); ++i) {
      refs.push_back({options.padded ? PaddedPrimBounds(geometry, i) : PrimBounds(geometry, i), i});
      cell.Extend(refs.back().box);
    }
    if (!refs.empty()) Recurse(cell, refs, 0);
  }
  const std::vector<Shown>& nodes() const { return nodes_; }

 private:
  struct Best {
    float cost = std::numeric_limits<float>::infinity(), pos = 0;
    int axis = -1;
    bool planar_left = true;
  };

  Best Find(const Bounds3& cell, const std::vector<KdRef>& refs) const {
    Best best;
    for (int axis = 0; axis < 3; ++axis) {
      const KdAxisCost cost(options_.costs, cell, axis);
      std::set<float> planes;
      for (const KdRef& r : refs) planes.insert({r.box.lo[axis], r.box.hi[axis]});
      for (const float pos : planes) {
        if (pos <= cell.lo[axis] || pos >= cell.hi[axis]) continue;
        uint32_t left = 0, right = 0, planar = 0;
        for (const KdRef& r : refs) {
          left += r.box.lo[axis]<pos, right += r.box.hi[axis]> pos;
          planar += r.box.lo[axis] == pos && r.box.hi[axis] == pos;
        }
        for (bool planar_left : {true, false}) {
          const float c =
              cost(pos, left + (planar_left ? planar : 0), right + (planar_left ? 0 : planar)).cost;
          if (c < best.cost) best = {c, pos, axis, planar_left};
        }
      }
    }
    return best;
  }

  void Recurse(const Bounds3& cell, const std::vector<KdRef>& refs, uint32_t depth) {
    nodes_.push_back({depth, true, cell, {}});
    const Best best = Find(cell, refs);
    const uint32_t n = uint32_t(refs.size());
    if (n <= options_.leaf_size || depth >= options_.max_depth ||
        !(best.cost < KdLeafCost(options_.costs, cell, n))) {
      for (const KdRef& r : refs) nodes_.back().prims.push_back(r.prim);
      return;
    }
    nodes_.back().is_leaf = false;
    Bounds3 left = cell, right = cell;
    left.hi[best.axis] = right.lo[best.axis] = best.pos;
    std::vector<KdRef> lefts, rights;
    for (const KdRef& r : refs) {
      const float lo = r.box.lo[best.axis], hi = r.box.hi[best.axis];
      if (lo == best.pos && hi == best.pos) {
        (best.planar_left ? lefts : rights).push_back(r);
      } else if (hi <= best.pos) {
        lefts.push_back(r);
      } else if (lo >= best.pos) {
        rights.push_back(r);
      } else {
        const KdParts parts = SplitRef(geometry_, r, best.axis, left, right, options_.clip, options_.padded);
        if (!parts.left.Empty()) lefts.push_back({parts.left, r.prim});
        if (!parts.right.Empty()) rights.push_back({parts.right, r.prim});
      }
    }
    Recurse(left, lefts, depth + 1);
    Recurse(right, rights, depth + 1);
  }

  rb_geometry geometry_;
  KdOptions options_;
  std::vector<Shown> nodes_;
};

TEST(KdBuild, SweepMakesTheTreeOfTheQuadraticBuilder) {
  size_t inner = 0;
  for (const Mesh& mesh : Meshes()) {
    for (const bool clip : {true, false}) {
      for (const bool padded : {true, false}) {
        for (const uint32_t block : {1u, 4u}) {
          KdOptions options;
          options.clip = clip, options.padded = padded;
          options.costs = {.traversal = 0.4f, .intersection = 1, .empty_bonus = 0.2f, .block = block};
          options.max_depth = 20, options.duplication = 1e6;
          const auto expected = Quadratic(mesh.Geometry(), options).nodes();
          const auto got = NodesOf(BuildKdTree(mesh.Geometry(), options, 0, nullptr));
          for (size_t i = 0; i < std::min(got.size(), expected.size()); ++i) {
            ASSERT_TRUE(got[i] == expected[i]) << mesh.name << " node " << i << " clip " << clip << " padded "
                                               << padded << " block " << block;
          }
          ASSERT_EQ(got.size(), expected.size()) << mesh.name;
          inner += got.size() / 2;
        }
      }
    }
  }
  EXPECT_GT(inner, 5000u);
}

const std::vector<std::string> kSpecs = {"kdtree_sah",
                                         "kdtree_sah(builder=binned,bins=8)",
                                         "kdtree_sah(axis=cyclic)",
                                         "kdtree_sah(axis=largest,traversal_cost=0,leaf_size=0)",
                                         "kdtree_sah(clip=false,empty_bonus=1)",
                                         "kdtree_sah(max_depth=3)",
                                         "kdtree_sah(duplication=0)",
                                         "kdtree_spatial_median(leaf_size=1)",
                                         "kdtree_spatial_median(axis=cyclic,clip=false)",
                                         "kdtree_object_median(leaf_size=2)",
                                         "kdtree_object_median(axis=cyclic,clip=false)",
                                         "kdtree_sah(numerics=fast)",
                                         "kdtree_object_median(numerics=fast,leaf_size=1)"};

class KdSpecs : public ::testing::TestWithParam<std::tuple<std::string, Mesh>> {};

/// The invariant that conservative traversal rests on: a ray that is accepted passes a point of the triangle
/// by up to 1.5 u (e + E) (ray/bounds.h), and wherever it passes, the leaf there holds the triangle.
TEST_P(KdSpecs, LeavesHoldWhatRaysMayHitInThem) {
  const auto& [spec, mesh] = GetParam();
  const auto nodes = NodesOf(Build(spec, mesh.Geometry()));
  const bool padded = spec.find("fast") == std::string::npos;
  Random random(3);
  size_t checked = 0;
  for (uint32_t prim = 0; prim < mesh.triangles.size(); ++prim) {
    const Vec3d p[3] = {ToDouble(mesh.Corner(prim, 0)), ToDouble(mesh.Corner(prim, 1)),
                        ToDouble(mesh.Corner(prim, 2))};
    Bounds3 box;
    for (int k = 0; k < 3; ++k) box.Extend(mesh.Corner(prim, k));
    const Vec3f e = box.Extent();
    const float most = std::max({e.x, e.y, e.z});
    for (int i = 0; i < 12; ++i) {
      // Corners, points of edges, points within; each moved as far as it may be.
      double a = random.NextDouble(), b = random.NextDouble() * (1 - a);
      if (i < 3) a = i == 0, b = i == 1;
      if (i >= 3 && i < 6) b = 0;
      Vec3d q = p[0] * a + p[1] * b + p[2] * (1 - a - b);
      if (!padded && i >= 3) continue;  // then rounding of q alone may leave the leaf
      for (int axis = 0; axis < 3; ++axis) {
        const double reach = padded ? 1.5 * 0x1p-24 * (double(e[axis]) + double(most)) : 0;
        q[axis] += reach * (double(random.Below(3)) - 1);
      }
      size_t homes = 0;
      for (const Shown& node : nodes) {
        if (!node.is_leaf) continue;
        bool inside = true;
        for (int axis = 0; axis < 3; ++axis)
          inside = inside && node.cell.lo[axis] <= q[axis] && q[axis] <= node.cell.hi[axis];
        homes += inside && std::binary_search(node.prims.begin(), node.prims.end(), prim);
      }
      EXPECT_GT(homes, 0u) << "primitive " << prim << ", point " << i;
      ++checked;
    }
  }
  EXPECT_EQ(checked, mesh.triangles.size() * (padded ? 12 : 3));
}

TEST_P(KdSpecs, LeavesPartitionTheRootAndStayWithinTheirBounds) {
  const auto& [spec, mesh] = GetParam();
  const Tree tree = Build(spec, mesh.Geometry());
  const auto nodes = NodesOf(tree);
  double volume = 0;
  size_t references = 0;
  for (const Shown& node : nodes) {
    EXPECT_LT(node.depth, KdTree::kMaxDepth);
    EXPECT_TRUE(nodes[0].cell.Contains(node.cell));
    if (!node.is_leaf) continue;
    const Vec3d e = ToDouble(node.cell.hi) - ToDouble(node.cell.lo);
    volume += e.x * e.y * e.z;
    references += node.prims.size();
    EXPECT_TRUE(std::is_sorted(node.prims.begin(), node.prims.end()));
  }
  const Vec3d e = ToDouble(nodes[0].cell.hi) - ToDouble(nodes[0].cell.lo);
  EXPECT_NEAR(volume, e.x * e.y * e.z, 1e-9 * volume);
  const double duplication = spec.find("duplication=0") != std::string::npos ? 0 : 8;
  EXPECT_LE(double(references), (1 + duplication) * double(mesh.triangles.size()));
  if (spec.find("max_depth=3") != std::string::npos) {
    for (const Shown& node : nodes) EXPECT_LE(node.depth, 3u);
  }
}

INSTANTIATE_TEST_SUITE_P(Every, KdSpecs,
                         ::testing::Combine(::testing::ValuesIn(kSpecs), ::testing::ValuesIn(Meshes())),
                         [](const auto& i) {
                           std::string name = std::get<0>(i.param) + "_" + std::get<1>(i.param).name;
                           for (char& c : name) {
                             if (std::isalnum(static_cast<unsigned char>(c)) == 0) c = '_';
                           }
                           return name;
                         });

/// Expected cost of a random line in the units of kdtree_sah's defaults: a node costs as much as a block.
double SahCost(const std::vector<Shown>& nodes) {
  double sum = 0;
  for (const Shown& n : nodes) sum += n.cell.HalfArea() * double(n.is_leaf ? (n.prims.size() + 3) / 4 : 1);
  return sum / nodes[0].cell.HalfArea();
}

TEST(KdBuild, SahCostsLessThanMediansDo) {
  for (const Mesh& mesh : {Ball(4), Town(12), Needles(500), Lattice(30)}) {
    // What bounds the duplicates would decide among needles.
    auto cost = [&](const std::string& name) {
      return SahCost(NodesOf(Build(name + "(duplication=50)", mesh.Geometry())));
    };
    const double sweep = cost("kdtree_sah");
    EXPECT_LT(sweep, cost("kdtree_spatial_median")) << mesh.name;
    EXPECT_LT(sweep, cost("kdtree_object_median")) << mesh.name;
  }
}

TEST(KdBuild, LargeTreesAreTheSameAtAnyThreadCount) {
  const Mesh mesh = Ball(6);  // 32,768 triangles: several tasks
  for (const char* spec : {"kdtree_sah", "kdtree_sah(builder=binned)", "kdtree_object_median"}) {
    const auto one = NodesOf(Build(spec, mesh.Geometry(), 1));
    EXPECT_GT(one.size(), 1000u);
    EXPECT_TRUE(one == NodesOf(Build(spec, mesh.Geometry(), 3))) << spec;
  }
}

TEST(KdBuild, ManyCoincidentTrianglesStayWithinBounds) {
  const Mesh mesh = Coincident(20000);
  for (const char* spec : {"kdtree_sah", "kdtree_sah(builder=binned)", "kdtree_spatial_median(leaf_size=1)",
                           "kdtree_object_median(leaf_size=1)"}) {
    const Tree tree = Build(spec, mesh.Geometry(), 2);
    size_t references = 0;
    for (const Shown& node : NodesOf(tree)) references += node.prims.size();
    EXPECT_GE(references, mesh.triangles.size());
    EXPECT_LE(references, 9 * mesh.triangles.size());
    const auto hits = Closest(
        tree, {{{0.6f, 0.3f, 5}, 0, {0, 0, -1}, INFINITY}, {{0.3f, 0.6f, 5}, 0, {0, 0, -1}, INFINITY}});
    EXPECT_EQ(hits[0].prim, 0u) << spec;
    EXPECT_EQ(hits[1].prim, 1u) << spec;
  }
}

TEST(KdBuild, MemoryLimitAndCancelEndTheBuild) {
  const Mesh mesh = Ball(5);
  const Registry registry;
  for (const char* spec : {"kdtree_sah", "kdtree_sah(builder=binned)", "kdtree_spatial_median"}) {
    // From what holds nothing to what holds the events but not the tree.
    for (uint64_t limit : {uint64_t{1000}, uint64_t{1} << 19, uint64_t{1} << 20}) {
      rb_build_options options = DefaultBuildOptions();
      options.memory_limit = limit;
      EXPECT_THROW(Tree(ParseContestant(registry, spec), mesh.Geometry(), options), BuildError) << limit;
    }
    rb_build_options options = DefaultBuildOptions();
    options.memory_limit = uint64_t{64} << 20;
    EXPECT_NO_THROW(Tree(ParseContestant(registry, spec), mesh.Geometry(), options));
    const int cancel = 1;
    options.cancel = &cancel;
    EXPECT_THROW(Tree(ParseContestant(registry, spec), mesh.Geometry(), options), BuildError);
  }
}

TEST(KdTree, AnswersAsBruteForceAmongProceduralPrimitives) {
  Mesh mesh = Needles(40);
  const Balls balls(60, 2);
  const rb_geometry geometry = balls.Geometry(mesh);
  const auto rays = NastyRays(mesh, 400, 1);
  for (const char* numerics : {"watertight", "double", "exact"}) {
    const std::string choice = std::string("(numerics=") + numerics + ")";
    const auto expected = Closest(Build("brute" + choice, geometry), rays);
    size_t on_balls = 0;
    for (const rb_hit& hit : expected)
      on_balls += hit.prim != RAYBENCH_NONE && hit.prim >= mesh.triangles.size();
    EXPECT_GT(on_balls, rays.size() / 10);
    for (const char* name : {"kdtree_sah", "kdtree_spatial_median", "kdtree_object_median"}) {
      const auto got = Closest(Build(name + choice, geometry), rays);
      for (size_t i = 0; i < rays.size(); ++i)
        ASSERT_EQ(std::memcmp(&got[i], &expected[i], sizeof got[i]), 0) << name << choice << " ray " << i;
    }
  }
}

}  // namespace
}  // namespace raybench::testing
