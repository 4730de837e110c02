// Space partitions (grids, octree, quadtree) against brute force, bit for bit, where walls and rounding hurt
// most: rays at edges and vertices; along axes with +-0; geometry on a lattice, so that it lies on walls and
// split planes; far origins; flat boxes. RAYBENCH_TEST_RAYS sets the rays of a workload (default 600).
#include <gtest/gtest.h>

#include <cstdlib>
#include <cstring>

#include "accel/contract/structure.h"
#include "tests/support/effort.h"
#include "tests/support/meshes.h"

namespace raybench::testing {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

size_t RayCount() {
  const char* count = std::getenv("RAYBENCH_TEST_RAYS");
  return count != nullptr ? size_t(std::atoll(count)) : Effort(600);
}

/// Many flat boxes, some of them without any thickness, and steps between them: a plane of squares at a
/// few heights.
Mesh Flat(int n) {
  Mesh mesh{"flat", {}, {}};
  for (int y = 0; y < n; ++y) {
    for (int x = 0; x < n; ++x) {
      const auto first = uint32_t(mesh.positions.size());
      const float z = (x + y) % 3 == 0 ? 0.0f : (x * y) % 5 == 0 ? 0x1p-20f : 0.125f;
      for (int k = 0; k < 4; ++k) mesh.positions.push_back({float(x + (k & 1)), float(y + (k >> 1)), z});
      mesh.triangles.push_back({first, first + 1, first + 3});
      mesh.triangles.push_back({first, first + 3, first + 2});
    }
  }
  return mesh;
}

/// The lattice of 16 cells: triangles on the walls of grids whose resolution divides it.
Mesh Cubes() {
  Mesh mesh{"cubes", {}, {}};
  Random random(3);
  for (int i = 0; i < 150; ++i) {
    const auto first = uint32_t(mesh.positions.size());
    const int axis = int(random.Below(3));
    Vec3f at{float(random.Below(16)), float(random.Below(16)), float(random.Below(16))};
    const float size = float(1 + random.Below(3));
    for (int k = 0; k < 4; ++k) {
      Vec3f p = at;
      p[(axis + 1) % 3] += (k & 1) != 0 ? size : 0, p[(axis + 2) % 3] += (k >> 1) != 0 ? size : 0;
      mesh.positions.push_back(p);
    }
    mesh.triangles.push_back({first, first + 1, first + 3});
    mesh.triangles.push_back({first, first + 3, first + 2});
  }
  return mesh;
}

rb_ray Ray(Vec3f from, Vec3f d) { return {{from.x, from.y, from.z}, 0, {d.x, d.y, d.z}, kInfinity}; }

struct Workload {
  Mesh mesh;
  std::vector<rb_ray> rays;
};

Workload EdgesAndVertices() {
  Workload w{Ball(3), {}};
  for (const rb_ray& ray : NastyRays(w.mesh, int(RayCount() / 6), 1)) w.rays.push_back(ray);
  return w;
}

/// Along an axis or in a plane of two, from and to lattice points and beside them by an ulp.
Workload AlongAxes() {
  Workload w{Cubes(), {}};
  Random random(2);
  while (w.rays.size() < RayCount()) {
    Vec3f from, d;
    const int axis = int(random.Below(3));
    for (int a = 0; a < 3; ++a) {
      from[a] = float(random.Below(33)) * 0.5f;
      if (random.Below(4) == 0)
        from[a] = std::nextafter(from[a], random.Below(2) != 0 ? kInfinity : -kInfinity);
      d[a] = random.Below(2) != 0 ? 0.0f : -0.0f;
    }
    d[axis] = random.Below(2) != 0 ? 1.0f : -1.0f;
    if (random.Below(2) != 0) d[(axis + 1) % 3] = random.Below(2) != 0 ? 1.0f : -0.3f;
    if (random.Below(5) == 0) d[(axis + 2) % 3] = random.Below(2) != 0 ? 1e-41f : -1e-30f;
    if (random.Below(2) != 0) from[axis] -= d[axis] * 20;
    w.rays.push_back(Ray(from, d));
  }
  return w;
}

/// From anywhere through lattice points and along diagonals: walls of two and three axes at the same time.
Workload OnWalls() {
  Workload w{Cubes(), {}};
  Random random(3);
  auto lattice = [&] { return float(random.Below(17)); };
  while (w.rays.size() < RayCount()) {
    const Vec3f to{lattice(), lattice(), lattice()};
    Vec3f from{lattice(), lattice(), lattice()};
    if (random.Below(2) != 0) from = to + ToFloat(random.UnitVector() * (30 * random.NextDouble()));
    if (random.Below(3) == 0)
      from = to - Vec3f{1, random.Below(2) != 0 ? 1.0f : -1.0f, 1} * float(random.Below(40));
    if (!(from == to)) w.rays.push_back(Ray(from, to - from));
  }
  return w;
}

Workload FarOrigins() {
  Workload w{Ball(3), {}};
  Random random(4);
  while (w.rays.size() < RayCount()) {
    const double distance = std::ldexp(1.0, int(random.Below(22)));  // up to 1e6 sizes
    const Vec3f from = ToFloat(random.UnitVector() * distance);
    const size_t t = random.Below(w.mesh.triangles.size());
    const Vec3f to =
        random.Below(2) != 0 ? w.mesh.Corner(t, 0) : (w.mesh.Corner(t, 0) + w.mesh.Corner(t, 1)) * 0.5f;
    w.rays.push_back(Ray(from, to - from));
  }
  return w;
}

Workload FlatBoxes() {
  Workload w{Flat(12), {}};
  Random random(5);
  while (w.rays.size() < RayCount()) {
    const Vec3f to{float(random.Below(25)) * 0.5f, float(random.Below(25)) * 0.5f,
                   random.Below(2) != 0 ? 0.0f : 0.125f};
    Vec3f from = to + ToFloat(random.UnitVector() * (20 * random.NextDouble()));
    if (random.Below(3) == 0) from.z = to.z;
    if (random.Below(3) == 0) from.z = to.z + 0x1p-19f;
    if (!(from == to)) w.rays.push_back(Ray(from, to - from));
  }
  return w;
}

struct Case {
  const char* name;
  Workload (*make)();
};

class SpacePartition : public ::testing::TestWithParam<std::tuple<Case, std::string>> {};

TEST_P(SpacePartition, AnswersAsBruteForceBitForBit) {
  const auto& [workload, numerics] = GetParam();
  const auto [mesh, rays] = workload.make();
  const auto expected = Closest(Build("brute(numerics=" + numerics + ")", mesh.Geometry()), rays);
  size_t hits = 0;
  for (const rb_hit& hit : expected) hits += hit.prim != RAYBENCH_NONE;
  EXPECT_GT(hits, rays.size() / 20);
  for (const char* spec :
       {"grid", "grid(resolution_x=16,resolution_y=16,resolution_z=16", "grid(density=30,mailbox=true",
        "grid(rule=regular,insertion=exact,density=10", "grid_recursive(leaf_size=1,levels=3,density=1",
        "grid_recursive(leaf_size=2,levels=4,density=1,insertion=exact,mailbox=true", "octree(leaf_size=1",
        "quadtree", "quadtree(axis=x,leaf_size=1", "quadtree(insertion=exact,growth=5,depth=5,leaf_size=2",
        "octree(growth=9,depth=7,leaf_size=2,insertion=exact"}) {
    // Where triangles themselves decide, not their bounds, t computed in float may lie in another cell.
    if (numerics == "watertight" && std::strstr(spec, "exact") != nullptr) continue;
    const std::string name =
        std::string(spec) + (std::strchr(spec, '(') != nullptr ? "," : "(") + "numerics=" + numerics + ")";
    const Tree tree = Build(name, mesh.Geometry());
    const auto got = Closest(tree, rays);
    const auto occluded = Occluded(tree, rays);
    for (size_t i = 0; i < rays.size(); ++i) {
      ASSERT_EQ(std::memcmp(&expected[i], &got[i], sizeof(rb_hit)), 0)
          << name << ", ray " << i << ": prim " << expected[i].prim << " or " << got[i].prim << ", t "
          << expected[i].t << " or " << got[i].t;
      ASSERT_EQ(occluded[i] != 0, expected[i].prim != RAYBENCH_NONE) << name << ", ray " << i;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    Workloads, SpacePartition,
    ::testing::Combine(::testing::Values(Case{"edges", EdgesAndVertices}, Case{"axes", AlongAxes},
                                         Case{"walls", OnWalls}, Case{"far", FarOrigins},
                                         Case{"flat", FlatBoxes}),
                       ::testing::Values("watertight", "double", "exact")),
    [](const auto& i) { return std::string(std::get<0>(i.param).name) + "_" + std::get<1>(i.param); });

class SpacePartitionBuild : public ::testing::TestWithParam<std::string> {};

TEST_P(SpacePartitionBuild, MakesTheSameTreeAtAnyThreadCount) {
  const Mesh mesh = Ball(6);  // 32,768 triangles: counted, filled and divided in parallel
  auto digest = [&](uint32_t threads) {
    std::string bytes;
    const Tree tree = Build(GetParam(), mesh.Geometry(), threads);
    tree.structure().visit(
        tree.get(),
        [](void* ctx, const rb_node* n) {
          auto& out = *static_cast<std::string*>(ctx);
          out.append(reinterpret_cast<const char*>(n->bounds), n->bounds_count * sizeof(float));
          if (n->prim_count > 0)
            out.append(reinterpret_cast<const char*>(n->prims), n->prim_count * sizeof(uint32_t));
          return 0;
        },
        &bytes);
    return bytes;
  };
  const std::string one = digest(1);
  EXPECT_GT(one.size(), 1u << 18);
  EXPECT_EQ(one, digest(2));
  EXPECT_EQ(one, digest(5));
}

TEST_P(SpacePartitionBuild, CoversEveryPrimitiveByItsLeaves) {
  for (const Mesh& mesh :
       {Ball(3), Cubes(), Flat(8), Needles(200), Moved(Ball(3), 1, {1e6f, 1e6f, -1e6f}, "far")}) {
    for (const char* numerics : {"watertight", "fast"}) {
      const rb_geometry geometry = mesh.Geometry();
      const Tree tree = Build(GetParam() + "(numerics=" + numerics + ")", geometry);
      std::vector<Bounds3> covered(mesh.triangles.size());
      tree.structure().visit(
          tree.get(),
          [](void* ctx, const rb_node* n) {
            EXPECT_EQ(n->space_partition, 1u);
            for (uint32_t i = 0; i < n->prim_count; ++i)
              (*static_cast<std::vector<Bounds3>*>(ctx))[n->prims[i]].Extend(
                  Bounds3{LoadVec3(n->bounds), LoadVec3(n->bounds + 3)});
            return 0;
          },
          &covered);
      for (uint32_t i = 0; i < covered.size(); ++i)
        EXPECT_TRUE(covered[i].Contains(PrimBounds(geometry, i))) << mesh.name << " " << numerics << " " << i;
    }
  }
}

/// References of all leaves per primitive, and the deepest level.
std::pair<double, uint32_t> ReferencesAndDepth(const Tree& tree, size_t prims) {
  std::pair<double, uint32_t> result{0, 0};
  tree.structure().visit(
      tree.get(),
      [](void* ctx, const rb_node* n) {
        auto& r = *static_cast<std::pair<double, uint32_t>*>(ctx);
        r.first += n->prim_count, r.second = std::max(r.second, n->depth);
        return 0;
      },
      &result);
  result.first /= double(prims);
  return result;
}

TEST_P(SpacePartitionBuild, IsBoundedWhateverLiesAcrossWhat) {
  // The same large triangles, the same needles, and few others among them that make dividing look worthwhile.
  Mesh needles{"needles", {{0, 0, 0}, {1, 1, 1}, {1, 1, 1.0001f}}, {}};
  for (int i = 0; i < 20000; ++i) needles.triangles.push_back({0, 1, 2});
  Mesh mixed = Coincident(10000);
  const Mesh ball = Moved(Ball(2), 0.01f, {0.3f, 0.3f, 0.2f}, "ball");
  for (auto t : ball.triangles) {
    for (uint32_t& v : t) v += uint32_t(mixed.positions.size());
    mixed.triangles.push_back(t);
  }
  mixed.positions.insert(mixed.positions.end(), ball.positions.begin(), ball.positions.end());
  for (const Mesh& mesh : {Coincident(10000), needles, mixed}) {
    const auto [references, depth] =
        ReferencesAndDepth(Build(GetParam(), mesh.Geometry(), 2), mesh.triangles.size());
    EXPECT_GE(references, 1);
    EXPECT_LE(references, 16) << mesh.name;
    EXPECT_LE(depth, 24u);
  }
}

TEST_P(SpacePartitionBuild, EndsAtTheMemoryLimitAndWhenCancelled) {
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

INSTANTIATE_TEST_SUITE_P(Every, SpacePartitionBuild,
                         ::testing::Values("grid", "grid_recursive", "octree", "quadtree"),
                         [](const auto& i) { return i.param; });

TEST(Grid, RulesGiveTheResolutionsThatTheySay) {
  Mesh mesh{"box", {}, {}};
  Random random(8);
  for (uint32_t i = 0; i < 1000; ++i) {  // small triangles in a box of 4 x 2 x 1
    const Vec3f at = i == 0   ? Vec3f{0, 0, 0}
                     : i == 1 ? Vec3f{4, 2, 1}
                              : Vec3f{4 * random.NextFloat(), 2 * random.NextFloat(), random.NextFloat()};
    for (Vec3f p : {at, at + Vec3f{1e-4f, 0, 0}, at + Vec3f{0, 1e-4f, 1e-4f}}) mesh.positions.push_back(p);
    mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  auto cells = [&](const std::string& spec) {
    const Tree tree = Build(spec, mesh.Geometry());
    int64_t n = -1;  // the root is no cell
    tree.structure().visit(
        tree.get(),
        [](void* ctx, const rb_node*) {
          ++*static_cast<int64_t*>(ctx);
          return 0;
        },
        &n);
    return n;
  };
  EXPECT_EQ(cells("grid(rule=regular,density=1)"), 10 * 10 * 10);
  EXPECT_EQ(cells("grid(rule=woo,density=8)"), 20 * 10 * 5);
  EXPECT_EQ(cells("grid(rule=heterogeneous,density=1)"), 20 * 10 * 5);
  EXPECT_EQ(cells("grid(resolution_x=3,resolution_y=5,resolution_z=7)"), 3 * 5 * 7);
}

}  // namespace
}  // namespace raybench::testing
