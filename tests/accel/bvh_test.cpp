// The binary BVHs: what their trees are made of, and that no hit is lost where traversal is easiest to break.
// RAYBENCH_TEST_RAYS raises the number of rays of each workload.
#include <gtest/gtest.h>

#include <cstdlib>
#include <cstring>
#include <set>

#include "accel/bvh/linked_tree.h"
#include "accel/ray/bounds.h"
#include "tests/support/effort.h"
#include "tests/support/meshes.h"

namespace raybench::testing {
namespace {

const std::string kBuilders[] = {"bvh_median",
                                 "bvh_median(axis=cyclic)",
                                 "bvh_sah",
                                 "bvh_sweep",
                                 "bvh_morton",
                                 "bvh_ploc",
                                 "bvh_spatial",
                                 "bvh_morton(reinsertion=2)",
                                 "bvh_spatial(reinsertion=1)",
                                 "bvh_wide",
                                 "bvh_wide(width=8,builder=sweep,reinsertion=1)",
                                 "bvh_wide(width=4,builder=spatial)",
                                 "bvh_wide(width=16,nodes=quantized16,leaves=indexed,builder=morton)",
                                 "bvh_wide(width=8,nodes=quantized8,leaves=indexed,builder=spatial)",
                                 "bvh_wide(width=4,nodes=quantized8,leaf_size=2)"};

std::string NameOf(std::string spec) {
  for (char& c : spec) {
    if (std::isalnum(static_cast<unsigned char>(c)) == 0) c = '_';
  }
  return spec;
}

/// "a" or "a(b=1)" with one more parameter.
std::string With(const std::string& spec, const std::string& parameter) {
  return spec.back() == ')' ? spec.substr(0, spec.size() - 1) + "," + parameter + ")"
                            : spec + "(" + parameter + ")";
}

Mesh Joined(std::initializer_list<Mesh> meshes, const std::string& name) {
  Mesh all{name, {}, {}};
  for (const Mesh& mesh : meshes) {
    const uint32_t first = uint32_t(all.positions.size());
    all.positions.insert(all.positions.end(), mesh.positions.begin(), mesh.positions.end());
    for (auto [a, b, c] : mesh.triangles) all.triangles.push_back({first + a, first + b, first + c});
  }
  return all;
}

/// Axes moved on by `by`: x becomes the axis `by`.
Mesh Turned(Mesh mesh, int by, Vec3f offset) {
  for (Vec3f& p : mesh.positions) p = Vec3f{p[(3 - by) % 3], p[(4 - by) % 3], p[(5 - by) % 3]} + offset;
  return mesh;
}

struct Workload {
  std::string name;
  Mesh mesh;
  std::vector<rb_ray> rays;
};

/// The five workloads over which textbook traversal loses 4 to 97 % of the hits.
std::vector<Workload> Workloads(int count) {
  const float inf = std::numeric_limits<float>::infinity();
  const Mesh ball = Ball(3);
  // Three crossing lattices: all boxes, planes and vertices on integers.
  const Mesh lattice =
      Joined({Lattice(8), Turned(Lattice(8), 1, {1, 0, 0}), Turned(Lattice(8), 2, {0, 2, 0})}, "lattice");
  Random random(91);
  auto ray = [&](Vec3f from, Vec3f d) { return rb_ray{{from.x, from.y, from.z}, 0, {d.x, d.y, d.z}, inf}; };
  auto zero = [&] { return random.Below(2) ? 0.0f : -0.0f; };
  auto on_feature = [&](const Mesh& mesh) {
    const size_t t = random.Below(mesh.triangles.size());
    const int k = int(random.Below(3));
    const Vec3f a = mesh.Corner(t, k), b = mesh.Corner(t, (k + 1) % 3);
    return random.Below(2) ? a : a + (b - a) * random.NextFloat();
  };
  auto aimed = [&](Vec3f from, Vec3f at) { return ray(from, at - from); };
  std::vector<Workload> all = {
      {"aimed", ball, {}},
      {"axis_parallel", Joined({ball, lattice}, ""), {}},
      {"split_planes", lattice, {}},
      {"far_origin", ball, {}},
      {"flat_boxes", Joined({Lattice(12), Turned(Lattice(6), 1, {6, 0, 0})}, ""), {}}};
  for (int i = 0; i < count; ++i) {
    all[0].rays.push_back(aimed(ToFloat(random.UnitVector() * (3 * random.NextDouble())), on_feature(ball)));

    const int axis = int(random.Below(3));
    Vec3f at = on_feature(all[1].mesh);
    Vec3f d{zero(), zero(), zero()};
    d[axis] = random.Below(2) ? 1.0f : -1.0f;
    at[axis] = random.Below(4) ? -8 * d[axis] : at[axis];
    all[1].rays.push_back(ray(at, d));

    // From lattice point to lattice point, some along the planes.
    auto point = [&] {
      return Vec3f{float(random.Below(9)) - 4, float(random.Below(9)) - 4, float(random.Below(9)) - 4};
    };
    const Vec3f from = point();
    Vec3f step = point();
    if (random.Below(2)) step[int(random.Below(3))] = zero();
    if (step == Vec3f{0, 0, 0}) step.x = 1;
    all[2].rays.push_back(ray(from - step * float(random.Below(3)), step));

    const double distance = 2 * std::ldexp(1.0, int(random.Below(21)));
    all[3].rays.push_back(aimed(ToFloat(random.UnitVector() * distance), on_feature(ball)));

    // Within the flat boxes' planes, onto them, and at grazing angles.
    Vec3f start = on_feature(all[4].mesh) + ToFloat(random.UnitVector() * random.NextDouble()),
          to = on_feature(all[4].mesh);
    if (random.Below(3) == 0) start.z = 0;
    if (random.Below(3) == 0) start.z = std::ldexp(1.0f, -int(random.Below(30)));
    if (to == start) to.x += 1;
    all[4].rays.push_back(aimed(start, to));
  }
  return all;
}

class Bvh : public ::testing::TestWithParam<std::string> {};

/// What brute force answers, asked once for all builders.
const std::vector<rb_hit>& Expected(const Workload& w, const char* numerics) {
  static std::map<std::string, std::vector<rb_hit>> answers;
  auto [it, is_new] = answers.try_emplace(w.name + numerics);
  if (is_new) it->second = Closest(Build(With("brute", numerics), w.mesh.Geometry()), w.rays);
  return it->second;
}

TEST_P(Bvh, LosesNoHitWhereTraversalIsEasiestToBreak) {
  const char* const asked = std::getenv("RAYBENCH_TEST_RAYS");
  static const auto workloads = Workloads(asked != nullptr ? std::atoi(asked) : int(Effort(1000)));
  for (const char* numerics : {"numerics=watertight", "numerics=double", "numerics=exact"}) {
    for (const Workload& w : workloads) {
      const Tree tree = Build(With(GetParam(), numerics), w.mesh.Geometry());
      const auto& expected = Expected(w, numerics);
      const auto got = Closest(tree, w.rays);
      const auto shadow = Occluded(tree, w.rays);
      size_t hits = 0, differ = 0, shadows = 0;
      for (size_t i = 0; i < w.rays.size(); ++i) {
        differ += std::memcmp(&expected[i], &got[i], sizeof(rb_hit)) != 0;
        shadows += (shadow[i] != 0) != (expected[i].prim != RAYBENCH_NONE);
        hits += expected[i].prim != RAYBENCH_NONE;
      }
      EXPECT_EQ(differ, 0u) << w.name << ", " << numerics;
      EXPECT_EQ(shadows, 0u) << w.name << ", " << numerics;
      EXPECT_GT(hits, w.rays.size() / 10) << w.name;
    }
  }
}

/// What a visitor sees of a tree.
struct Seen {
  std::string bytes;              // all of it
  std::multiset<uint32_t> prims;  // in all leaves
  std::map<uint32_t, Bounds3> covered;
  uint32_t depth = 0;
  bool space_partition = false, all_inside = true, repeats = false;
  const rb_geometry* geometry = nullptr;
};

Seen Visit(const Tree& tree, const rb_geometry& geometry) {
  Seen seen;
  seen.geometry = &geometry;
  tree.structure().visit(
      tree.get(),
      [](void* ctx, const rb_node* node) {
        Seen& s = *static_cast<Seen*>(ctx);
        s.bytes.append(reinterpret_cast<const char*>(node->bounds), node->bounds_count * sizeof(float));
        s.bytes.append(reinterpret_cast<const char*>(node->prims), node->prim_count * sizeof(uint32_t));
        s.depth = std::max(s.depth, node->depth);
        s.space_partition |= node->space_partition != 0;
        const Bounds3 box{LoadVec3(node->bounds), LoadVec3(node->bounds + 3)};
        for (uint32_t i = 0; i < node->prim_count; ++i) {
          const uint32_t prim = node->prims[i];
          s.prims.insert(prim);
          s.covered[prim].Extend(box);
          s.all_inside &= box.Contains(PaddedPrimBounds(*s.geometry, prim));
          s.repeats |= std::count(node->prims, node->prims + node->prim_count, prim) > 1;
        }
        return 0;
      },
      &seen);
  return seen;
}

TEST_P(Bvh, LeavesHoldEveryPrimitive) {
  for (const Mesh& mesh :
       {Mesh{"one", {{0, 0, 0}, {1, 0, 0}, {0, 1, 0.5f}}, {{0, 1, 2}}}, Ball(3), Lattice(12), Coincident(500),
        Needles(2000), Moved(Ball(3), 1, {1000, -2000, 500}, "far"),
        Moved(Needles(300), 0x1p-30f, {0, 0, 0}, "small"),
        Moved(Needles(300), 0x1p27f, {0, 0, 0}, "large")}) {
    const rb_geometry geometry = mesh.Geometry();
    const Seen seen = Visit(Build(GetParam(), geometry), geometry);
    const bool spatial = GetParam().find("spatial") != std::string::npos;
    EXPECT_EQ(seen.space_partition, spatial);
    EXPECT_FALSE(seen.repeats) << mesh.name;
    EXPECT_LT(seen.depth, kMaxTreeDepth);
    EXPECT_EQ(seen.covered.size(), mesh.triangles.size()) << mesh.name;
    for (const auto& [prim, box] : seen.covered)
      ASSERT_TRUE(box.Contains(PaddedPrimBounds(geometry, prim))) << mesh.name << " " << prim;
    if (spatial) {
      EXPECT_LE(seen.prims.size(), 2 * mesh.triangles.size());
      EXPECT_TRUE(mesh.name != "needles" || seen.prims.size() > mesh.triangles.size() * 11 / 10);
    } else {
      EXPECT_EQ(seen.prims.size(), mesh.triangles.size()) << mesh.name;
      EXPECT_TRUE(seen.all_inside) << mesh.name;
    }
  }
}

TEST_P(Bvh, LargeTreesAreTheSameAtAnyThreadCount) {
  const Mesh mesh = Ball(7);  // 131,072 triangles: large ranges are worked on in parallel
  const rb_geometry geometry = mesh.Geometry();
  const std::string one = Visit(Build(GetParam(), geometry, 1), geometry).bytes;
  EXPECT_GT(one.size(), 1u << 19);
  EXPECT_EQ(one, Visit(Build(GetParam(), geometry, 3), geometry).bytes);
}

TEST_P(Bvh, DepthAndAnswerHoldForManyCoincidentTriangles) {
  const Mesh mesh = Coincident(50000);
  const rb_geometry geometry = mesh.Geometry();
  const Tree tree = Build(GetParam(), geometry);
  const auto hits =
      Closest(tree, {{{0.6f, 0.3f, 5}, 0, {0, 0, -1}, INFINITY}, {{0.3f, 0.6f, 5}, 0, {0, 0, -1}, INFINITY}});
  EXPECT_EQ(hits[0].prim, 0u);
  EXPECT_EQ(hits[1].prim, 1u);
  EXPECT_LE(Visit(tree, geometry).depth, 60u);
}

TEST_P(Bvh, MemoryLimitAndCancelEndTheBuild) {
  const Mesh mesh = Ball(5);
  const Registry registry;
  rb_build_options options = DefaultBuildOptions();
  options.memory_limit = 1000;
  EXPECT_THROW(Tree(ParseContestant(registry, GetParam()), mesh.Geometry(), options), BuildError);
  options.memory_limit = 0;
  const int cancel = 1;
  options.cancel = &cancel;
  EXPECT_THROW(Tree(ParseContestant(registry, GetParam()), mesh.Geometry(), options), BuildError);
}

INSTANTIATE_TEST_SUITE_P(Builders, Bvh, ::testing::ValuesIn(kBuilders),
                         [](const auto& i) { return NameOf(i.param); });

/// Sum of the areas of all nodes over the root's: what reinsertion makes smaller.
double Areas(const Tree& tree) {
  struct {
    double root = 0, all = 0;
  } sum;
  tree.structure().visit(
      tree.get(),
      [](void* ctx, const rb_node* node) {
        auto& s = *static_cast<decltype(sum)*>(ctx);
        const double area = Bounds3{LoadVec3(node->bounds), LoadVec3(node->bounds + 3)}.HalfArea();
        if (s.root == 0) s.root = area;
        s.all += area;
        return 0;
      },
      &sum);
  return sum.all / sum.root;
}

TEST(Reinsertion, EachPassMakesBoxesSmaller) {
  for (const Mesh& mesh : {Ball(5), Needles(3000)}) {
    double before = INFINITY;
    for (const char* passes : {"reinsertion=0", "reinsertion=1", "reinsertion=4"}) {
      const double areas =
          Areas(Build(With("bvh_median(leaf_size=1,traversal_cost=0)", passes), mesh.Geometry()));
      EXPECT_LT(areas, before * 0.98) << mesh.name << ", " << passes;
      before = areas;
    }
  }
}

TEST(LinkedTree, ChainsComeOutNoDeeperThanTheTraversalStack) {
  // Each inner node has one leaf and the rest of the chain.
  constexpr uint32_t kLeaves = 5000;
  LinkedTree tree;
  tree.nodes = HugeArray<LinkedNode>(2 * kLeaves), tree.counts = HugeArray<uint32_t>(2 * kLeaves);
  tree.order = HugeArray<uint32_t>(kLeaves);
  tree.size = 2 * kLeaves - 1;
  for (uint32_t i = 0; i < kLeaves; ++i) {
    const float x = float(i);
    const Box4 leaf{Float4{x, 0, 0, 0}, Float4{x + 1, 1, 1, 0}};
    tree.order[i] = i;
    tree.nodes[i].SetBox(leaf), tree.nodes[i].left = i, tree.nodes[i].right = LinkedNode::kLeaf;
    tree.counts[i] = 1;
    if (i == 0) continue;
    const uint32_t id = kLeaves + i - 1;
    Box4 box = leaf;
    box.Extend({Float4{0, 0, 0, 0}, Float4{x, 1, 1, 0}});
    tree.nodes[id].SetBox(box);
    tree.nodes[id].left = i == 1 ? 0 : id - 1, tree.nodes[id].right = i;
    tree.counts[id] = i + 1;
  }
  tree.root = 2 * kLeaves - 2;
  const BinaryTree flat = Flatten(tree, {.leaf_size = 1});
  std::vector<std::pair<uint32_t, uint32_t>> stack{{0, 0}};
  uint32_t depth = 0, leaves = 0;
  while (!stack.empty()) {
    const auto [slot, level] = stack.back();
    stack.pop_back();
    const BuildNode& node = flat.nodes[slot];
    depth = std::max(depth, level);
    if (node.count > 0) {
      const float x = float(flat.order[node.first]);
      EXPECT_TRUE(node.lo[0] == x && node.hi[0] == x + 1);
      ++leaves;
      continue;
    }
    for (uint32_t child : {slot + 1, node.right}) {
      EXPECT_LE(node.lo[0], flat.nodes[child].lo[0]);
      EXPECT_GE(node.hi[0], flat.nodes[child].hi[0]);
      stack.push_back({child, level + 1});
    }
  }
  EXPECT_EQ(leaves, kLeaves);
  EXPECT_LT(depth, kMaxTreeDepth);
  EXPECT_GT(depth, kDecideDepth);
}

TEST(BvhPloc, ChainsOfNearestNeighboursTakeFewRounds) {
  // Gaps grow along a row: everyone's best partner is the one before. One merge a round would take minutes.
  Mesh mesh{"row", {}, {}};
  for (uint32_t i = 0; i < 200000; ++i) {
    const float x = float(i) * float(i) * 0x1p-10f;
    for (Vec3f p : {Vec3f{x, 0, 0}, Vec3f{x, 1, 0}, Vec3f{x, 0, 1}}) mesh.positions.push_back(p);
    mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  const rb_geometry geometry = mesh.Geometry();
  const Seen seen = Visit(Build("bvh_ploc", geometry), geometry);
  EXPECT_EQ(seen.prims.size(), mesh.triangles.size());
  EXPECT_LT(seen.depth, kMaxTreeDepth);
}

}  // namespace
}  // namespace raybench::testing
