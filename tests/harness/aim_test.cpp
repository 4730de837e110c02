// Aimed rays hit what they aim at: each family against what it promises, by geometry in double.
#include "harness/rays/aim.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "accel/host/registry.h"
#include "harness/plan/build_options.h"
#include "harness/verify/closed.h"
#include "tests/support/meshes.h"
#include "tests/support/oracle_scenes.h"

namespace raybench {
namespace {

constexpr uint64_t kRays = 512, kSeed = 7;

class HarnessAim : public ::testing::Test {
 protected:
  HarnessAim() : scene_(testing::MakeIcosphere(2)), edges_(MeshEdges(scene_)) {
    const Vec3d extent = ToDouble(scene_.bounds().hi) - ToDouble(scene_.bounds().lo);
    size_ = Length(extent);
  }

  std::vector<rb_ray> Rays(const std::string& name) const {
    for (const AimedSet& set : SharedSets(scene_, edges_, kRays, kSeed)) {
      if (set.name != name) continue;
      EXPECT_EQ(set.absent, "");
      std::vector<rb_ray> rays(kRays);
      set.fill(0, rays, 1);
      for (const rb_ray& ray : rays) EXPECT_TRUE(IsValidRay(ray));
      return rays;
    }
    ADD_FAILURE() << name;
    return {};
  }
  static Vec3d Org(const rb_ray& ray) { return ToDouble(LoadVec3(ray.org)); }
  static Vec3d Dir(const rb_ray& ray) { return ToDouble(LoadVec3(ray.dir)); }
  Vec3d Position(uint32_t vertex) const { return ToDouble(scene_.positions[vertex]); }

  /// What the roundings of origin, target, their difference and its scaling may move the ray sideways at the
  /// target: half an ulp each of what is at most twice the farther of both from zero, a few times over.
  static double Ulp(const rb_ray& ray, double reach) {
    return std::ldexp(std::max(Length(Org(ray)), reach), -22);
  }
  static double DistanceToPoint(const rb_ray& ray, Vec3d p) {
    return Length(Cross(p - Org(ray), Dir(ray))) / Length(Dir(ray));
  }
  /// Of the line and a segment that it passes at a right angle or not: least over the segment, which is a
  /// quadratic function along it.
  static double DistanceToSegment(const rb_ray& ray, Vec3d a, Vec3d b) {
    const Vec3d d = Normalize(Dir(ray)), e = b - a, r = a - Org(ray);
    const Vec3d e_side = e - d * Dot(d, e), r_side = r - d * Dot(d, r);
    const double square = Dot(e_side, e_side);
    const double s = square > 0 ? std::clamp(-Dot(e_side, r_side) / square, 0.0, 1.0) : 0;
    return Length(r_side + e_side * s);
  }
  /// Index of the nearest edge.
  size_t NearestEdge(const rb_ray& ray, double& distance) const {
    size_t nearest = 0;
    distance = std::numeric_limits<double>::infinity();
    for (size_t i = 0; i < edges_.size(); ++i) {
      const double d = DistanceToSegment(ray, Position(edges_[i].a), Position(edges_[i].b));
      if (d < distance) distance = d, nearest = i;
    }
    return nearest;
  }

  const Scene scene_;
  const std::vector<MeshEdge> edges_;
  double size_;
};

TEST_F(HarnessAim, AnyPartOfASetIsThatPartAtAnyNumberOfThreads) {
  for (const AimedSet& set : SharedSets(scene_, edges_, kRays, kSeed)) {
    SCOPED_TRACE(set.name);
    std::vector<rb_ray> whole(kRays), part(100);
    set.fill(0, whole, 1);
    set.fill(200, part, 2);
    EXPECT_EQ(std::memcmp(part.data(), whole.data() + 200, part.size() * sizeof(rb_ray)), 0);
    EXPECT_NE(std::memcmp(part.data(), whole.data(), part.size() * sizeof(rb_ray)), 0);
  }
}

TEST_F(HarnessAim, VertexRaysPassAVertexAndEdgeRaysAnEdgeWithinAnUlp) {
  for (const rb_ray& ray : Rays("aimed_vertex")) {
    double least = std::numeric_limits<double>::infinity();
    for (uint32_t v = 0; v < scene_.positions.size(); ++v)
      least = std::min(least, DistanceToPoint(ray, Position(v)));
    EXPECT_LE(least, Ulp(ray, 1));
  }
  size_t off_the_vertices = 0;
  for (const rb_ray& ray : Rays("aimed_edge")) {
    double least;
    const MeshEdge& edge = edges_[NearestEdge(ray, least)];
    EXPECT_LE(least, Ulp(ray, 1));
    off_the_vertices +=
        DistanceToPoint(ray, Position(edge.a)) > 0.01 && DistanceToPoint(ray, Position(edge.b)) > 0.01;
  }
  EXPECT_GT(off_the_vertices, kRays / 2);
}

TEST_F(HarnessAim, SilhouetteRaysPassAnOutlineSeenFromOutside) {
  size_t beside = 0;
  for (const rb_ray& ray : Rays("silhouette")) {
    EXPECT_GT(Length(Org(ray)), 1.0);
    double least;
    const MeshEdge& edge = edges_[NearestEdge(ray, least)];
    EXPECT_LE(least, 8 * Ulp(ray, 1));
    // Both triangles lie on one side of the plane through the edge and the origin.
    const Vec3d a = Position(edge.a), n = Cross(a - Org(ray), Position(edge.b) - Org(ray));
    double side[2];
    for (int i = 0; i < 2; ++i) {
      side[i] = 0;
      for (uint32_t v : scene_.triangles[edge.triangles[i]])
        if (std::fabs(Dot(n, Position(v) - a)) > std::fabs(side[i])) side[i] = Dot(n, Position(v) - a);
    }
    EXPECT_GT(side[0] * side[1], 0);
    beside += least > 0.75 * Ulp(ray, 1);
  }
  EXPECT_GT(beside, kRays / 4);  // more than rounding explains
}

TEST_F(HarnessAim, AxisParallelRaysHaveZerosOfBothSignsAndLieInFaces) {
  size_t one = 0, two = 0, positive = 0, negative = 0, lo_face = 0, hi_face = 0;
  for (const rb_ray& ray : Rays("axis_parallel")) {
    int zeros = 0;
    for (int k = 0; k < 3; ++k) {
      if (ray.dir[k] != 0) continue;
      ++zeros;
      (std::signbit(ray.dir[k]) ? negative : positive) += 1;
      lo_face += ray.org[k] == scene_.bounds().lo[k];
      hi_face += ray.org[k] == scene_.bounds().hi[k];
    }
    ASSERT_TRUE(zeros == 1 || zeros == 2);
    (zeros == 1 ? one : two) += 1;
  }
  for (size_t n : {one, two, positive, negative, lo_face, hi_face}) EXPECT_GT(n, kRays / 10);
}

TEST_F(HarnessAim, GrazingRaysLieNearlyInATrianglesPlane) {
  for (const rb_ray& ray : Rays("grazing")) {
    bool found = false;
    for (const auto& t : scene_.triangles) {
      const Vec3d a = Position(t[0]), n = Normalize(Cross(Position(t[1]) - a, Position(t[2]) - a));
      found = found || (std::fabs(Dot(n, Normalize(Dir(ray)))) < 1e-3 &&
                        std::fabs(Dot(n, Org(ray) - a)) < 8 * Ulp(ray, 1));
    }
    EXPECT_TRUE(found);
  }
}

TEST_F(HarnessAim, FarRaysComeFromAThousandToAMillionSizesAwayAndReachTheScene) {
  double nearest = 1e30, farthest = 0;
  for (const rb_ray& ray : Rays("far")) {
    const double distance = Length(Org(ray)) / size_;
    nearest = std::min(nearest, distance), farthest = std::max(farthest, distance);
    EXPECT_LE(DistanceToPoint(ray, {0, 0, 0}), 1 + Ulp(ray, 0));
  }
  EXPECT_GT(nearest, 0.99e3);
  EXPECT_LT(nearest, 1e4);
  EXPECT_GT(farthest, 1e5);
  EXPECT_LT(farthest, 1.01e6);
}

TEST_F(HarnessAim, PlanesAreThoseOfTheTree) {
  const Registry registry;
  const Tree tree(ParseContestant(registry, "bvh_sah"), scene_.Geometry(), BuildOptions(1, 1));
  std::vector<Bounds3> boxes;
  tree.structure().visit(
      tree.get(),
      [](void* to, const rb_node* node) {
        static_cast<std::vector<Bounds3>*>(to)->push_back(
            {LoadVec3(node->bounds), LoadVec3(node->bounds + 3)});
        return 0;
      },
      &boxes);
  const AimedSet set = PlanesSet(scene_, tree, kSeed);
  ASSERT_EQ(set.absent, "");
  std::vector<rb_ray> rays(kRays);
  set.fill(0, rays, 1);
  size_t in_a_face = 0, at_an_edge = 0;
  for (const rb_ray& ray : rays) {
    bool near = false;
    for (int k = 0; k < 3; ++k) {
      if (ray.dir[k] != 0) continue;
      // A ray that stays at one coordinate stays in a face, exactly.
      const bool face = std::any_of(boxes.begin(), boxes.end(), [&](const Bounds3& b) {
        return ray.org[k] == b.lo[k] || ray.org[k] == b.hi[k];
      });
      in_a_face += face;
    }
    for (const Bounds3& b : boxes) {
      for (int axis = 0; axis < 3; ++axis) {
        for (int corner = 0; corner < 4; ++corner) {
          Vec3f from = b.lo, to = b.lo;
          const int u = (axis + 1) % 3, v = (axis + 2) % 3;
          from[u] = to[u] = corner & 1 ? b.hi[u] : b.lo[u];
          from[v] = to[v] = corner & 2 ? b.hi[v] : b.lo[v];
          to[axis] = b.hi[axis];
          near = near || DistanceToSegment(ray, ToDouble(from), ToDouble(to)) <= Ulp(ray, 1);
        }
      }
    }
    at_an_edge += near;
  }
  EXPECT_GT(in_a_face, kRays / 3);
  EXPECT_GT(at_an_edge, kRays / 2);  // faces are a third
  const Tree embree(ParseContestant(registry, "brute"), scene_.Geometry(), BuildOptions(1, 1));
  EXPECT_EQ(PlanesSet(scene_, embree, kSeed).absent, "no visitor");
}

TEST(HarnessAimSets, WithoutTrianglesOrInnerEdgesTheySayWhatIsAbsent) {
  const Scene soup = testing::MakeScene({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}});
  const std::vector<MeshEdge> edges = MeshEdges(soup);
  EXPECT_EQ(edges.size(), 3u);
  size_t present = 0;
  for (const AimedSet& set : SharedSets(soup, edges, 64, 1)) {
    const bool needs_edges = set.name == "aimed_edge" || set.name == "silhouette";
    EXPECT_EQ(set.absent, needs_edges ? "no edge belongs to two triangles" : "");
    EXPECT_EQ(bool(set.fill), !needs_edges);
    present += set.absent.empty();
  }
  EXPECT_EQ(present, AimedFamilies().size() - 3);  // planes is the tree's
  EXPECT_THROW(CheckFamilyNames("--sets", {"random", "sideways"}, AimedFamilies()), InputError);
  EXPECT_NO_THROW(CheckFamilyNames("--sets", {"random", "planes"}, AimedFamilies()));
}

TEST(HarnessMeshEdges, CountDistinctTrianglesByPosition) {
  // Each face of the box has vertices of its own, and the whole is there twice.
  const Scene box = testing::MakeLatticeBox(2, {0, 0, 0}, 1, 2);
  const std::vector<MeshEdge> edges = MeshEdges(box);
  EXPECT_EQ(edges.size(), 72u);  // 48 triangles
  for (const MeshEdge& edge : edges) {
    EXPECT_EQ(edge.count, 2u);
    EXPECT_NE(edge.triangles[0], edge.triangles[1]);
    EXPECT_LT(edge.triangles[0], 48u);
  }
  EXPECT_EQ(WhyNotClosed(box, edges), "");
}

TEST(HarnessClosed, AnOpenMeshIsToldByItsEdges) {
  const Scene whole = testing::MakeIcosphere(0);
  Scene open = testing::MakeScene(whole.positions, {whole.triangles.begin() + 1, whole.triangles.end()});
  const std::string why = WhyNotClosed(open, MeshEdges(open));
  EXPECT_TRUE(why.starts_with("3 of 30 edges have an odd number of triangles; one of them runs from ("))
      << why;
}

TEST(HarnessClosed, PointsInsideAreBetweenTwoSpheresAndClearOfBoth) {
  const Scene outer = testing::MakeIcosphere(2);
  std::vector<Vec3f> positions = outer.positions;
  auto triangles = outer.triangles;
  for (Vec3f p : outer.positions) positions.push_back(p * 0.5f);
  for (auto [a, b, c] : outer.triangles) {
    const uint32_t n = uint32_t(outer.positions.size());
    triangles.push_back({a + n, b + n, c + n});
  }
  const Scene hollow = testing::MakeScene(positions, triangles);
  const InsidePoints inside = FindInsidePoints(hollow, 40, 3, 2);
  EXPECT_EQ(inside.points.size(), 40u);
  EXPECT_NEAR(inside.margin, std::sqrt(12.0) / 1024, 1e-4);
  for (Vec3f p : inside.points) {
    // A flat face of the icosphere is nearer to the centre than its corners.
    EXPECT_GT(Length(ToDouble(p)), 0.47);
    EXPECT_LT(Length(ToDouble(p)), 1 - inside.margin);
  }
  EXPECT_EQ(FindInsidePoints(hollow, 40, 3, 1).points, inside.points);

  std::vector<rb_ray> rays(256), again(256);
  const std::vector<MeshEdge> edges = MeshEdges(hollow);
  FillClosedBatch(hollow, edges, inside, 3, 5, rays);
  FillClosedBatch(hollow, edges, inside, 3, 5, again);
  EXPECT_EQ(std::memcmp(rays.data(), again.data(), rays.size() * sizeof(rb_ray)), 0);
  FillClosedBatch(hollow, edges, inside, 3, 6, again);
  EXPECT_NE(std::memcmp(rays.data(), again.data(), rays.size() * sizeof(rb_ray)), 0);
  for (const rb_ray& ray : rays) {
    double least = std::numeric_limits<double>::infinity();
    for (const MeshEdge& edge : edges) {
      const Vec3d a = ToDouble(positions[edge.a]), e = ToDouble(positions[edge.b]) - a,
                  target = ToDouble(LoadVec3(ray.org)) + ToDouble(LoadVec3(ray.dir));
      const double s = std::clamp(Dot(target - a, e) / Dot(e, e), 0.0, 1.0);
      least = std::min(least, Length(target - a - e * s));
    }
    EXPECT_LT(least, 0x1p-22);
  }
}

}  // namespace
}  // namespace raybench
