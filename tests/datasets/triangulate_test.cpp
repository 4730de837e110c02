// Polygons into triangles.

#include "datasets/readers/triangulate.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "accel/base/random.h"
#include "tests/support/effort.h"

namespace raybench {
namespace {

using Triangles = std::vector<std::array<uint32_t, 3>>;

/// Polygons of the tests have integer corners in the plane z = 0, so everything here is exact.
int64_t Area2(Vec3f a, Vec3f b, Vec3f c) {
  return int64_t(b.x - a.x) * int64_t(c.y - a.y) - int64_t(b.y - a.y) * int64_t(c.x - a.x);
}

int64_t Area2(const std::vector<Vec3f>& outline) {
  int64_t area = 0;
  for (size_t i = 0; i < outline.size(); ++i)
    area += Area2({0, 0, 0}, outline[i], outline[(i + 1) % outline.size()]);
  return area;
}

/// Crossings of a ray to the right: odd inside. It starts where no edge between lattice points goes.
bool IsInside(const std::vector<Vec3f>& outline, int x, int y) {
  bool inside = false;
  for (size_t i = 0; i < outline.size(); ++i) {
    const Vec3f a = outline[i], b = outline[(i + 1) % outline.size()];
    const double px = x + 0.41421356, py = y + 0.73205081;
    if ((a.y > py) == (b.y > py)) continue;
    if (a.x + (py - a.y) / (double(b.y) - a.y) * (double(b.x) - a.x) > px) inside = !inside;
  }
  return inside;
}

/// Each point of a lattice lies in as many triangles as it should; the triangles turn as the polygon does.
void ExpectCovers(const std::vector<Vec3f>& outline, const Triangles& triangles, const std::string& what) {
  ASSERT_EQ(triangles.size(), outline.size() - 2) << what;
  const int64_t area = Area2(outline);
  int64_t sum = 0;
  Vec3f lo = outline[0], hi = lo;
  for (Vec3f p : outline) lo = Min(lo, p), hi = Max(hi, p);
  for (const std::array<uint32_t, 3>& t : triangles) {
    const int64_t part = Area2(outline[t[0]], outline[t[1]], outline[t[2]]);
    EXPECT_GE(area < 0 ? -part : part, 0) << what;
    sum += part;
  }
  EXPECT_EQ(sum, area) << what;
  for (int y = int(lo.y) - 1; y <= int(hi.y); ++y)
    for (int x = int(lo.x) - 1; x <= int(hi.x); ++x) {
      int covered = 0;
      for (const std::array<uint32_t, 3>& t : triangles)
        covered += IsInside({outline[t[0]], outline[t[1]], outline[t[2]]}, x, y);
      ASSERT_EQ(covered, IsInside(outline, x, y)) << what << ": (" << x << ", " << y << ")";
    }
}

void ExpectTriangulates(const std::vector<Vec3f>& outline, const std::string& what) {
  Triangles triangles;
  for (bool reversed : {false, true})
    for (size_t turn = 0; turn < outline.size(); ++turn) {
      std::vector<Vec3f> turned = outline;
      std::rotate(turned.begin(), turned.begin() + long(turn), turned.end());
      if (reversed) std::reverse(turned.begin(), turned.end());
      EXPECT_TRUE(Triangulate(turned, triangles)) << what;
      ExpectCovers(turned, triangles, what);
    }
}

TEST(TriangulateTest, ConvexPolygonsAreFans) {
  const std::vector<Vec3f> hexagon = {{2, 0, 0}, {6, 0, 0}, {8, 3, 0}, {6, 6, 0}, {2, 6, 0}, {0, 3, 0}};
  Triangles triangles;
  for (float z : {0.0f, 1.0f}) {  // the second one is not flat
    std::vector<Vec3f> outline = hexagon;
    outline[2].z = z;
    EXPECT_TRUE(Triangulate(outline, triangles));
    EXPECT_EQ(triangles, (Triangles{{0, 1, 2}, {0, 2, 3}, {0, 3, 4}, {0, 4, 5}}));
  }
  ExpectTriangulates(hexagon, "hexagon");
  EXPECT_TRUE(Triangulate(std::vector<Vec3f>{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, triangles));
  EXPECT_EQ(triangles, (Triangles{{0, 1, 2}}));
}

TEST(TriangulateTest, NonConvexPolygons) {
  ExpectTriangulates({{0, 0, 0}, {10, 0, 0}, {2, 2, 0}, {0, 10, 0}}, "arrow");
  ExpectTriangulates({{0, 0, 0}, {9, 0, 0}, {9, 9, 0}, {6, 9, 0}, {6, 3, 0}, {3, 3, 0}, {3, 9, 0}, {0, 9, 0}},
                     "U");
  ExpectTriangulates(
      {{0, 0, 0}, {3, 0, 0}, {6, 0, 0}, {9, 0, 0}, {9, 5, 0}, {6, 5, 0}, {6, 9, 0}, {0, 9, 0}, {0, 5, 0}},
      "L with corners along its edges");
  std::vector<Vec3f> comb;
  for (int i = 0; i < 12; ++i) comb.push_back({float(i), i % 2 ? 1.0f : 9.0f, 0});
  comb.push_back({11, 0, 0}), comb.push_back({0, 0, 0});
  ExpectTriangulates(comb, "comb");
}

TEST(TriangulateTest, HolesJoinedByAnEdge) {
  // Out to the hole, round it, and back the same way.
  ExpectTriangulates({{0, 0, 0},
                      {12, 0, 0},
                      {12, 12, 0},
                      {0, 12, 0},
                      {0, 0, 0},
                      {4, 4, 0},
                      {4, 8, 0},
                      {8, 8, 0},
                      {8, 4, 0},
                      {4, 4, 0}},
                     "frame");
  ExpectTriangulates({{0, 0, 0},
                      {20, 0, 0},
                      {20, 12, 0},
                      {0, 12, 0},
                      {0, 0, 0},
                      {3, 3, 0},
                      {3, 8, 0},
                      {7, 8, 0},
                      {7, 3, 0},
                      {12, 3, 0},
                      {12, 8, 0},
                      {16, 8, 0},
                      {16, 3, 0},
                      {12, 3, 0},
                      {7, 3, 0},
                      {3, 3, 0}},
                     "two holes in a row");
}

TEST(TriangulateTest, AnyPlane) {
  // The U, turned into the other planes and slanted.
  const std::vector<Vec3f> u = {{0, 0, 0}, {9, 0, 0}, {9, 9, 0}, {6, 9, 0},
                                {6, 3, 0}, {3, 3, 0}, {3, 9, 0}, {0, 9, 0}};
  Triangles flat, turned;
  ASSERT_TRUE(Triangulate(u, flat));
  for (int k = 1; k < 3; ++k) {
    std::vector<Vec3f> outline;
    for (Vec3f p : u) outline.push_back(k == 1 ? Vec3f{0.5f * p.x, p.x, p.y} : Vec3f{p.y, 0.25f * p.y, p.x});
    EXPECT_TRUE(Triangulate(outline, turned));
    EXPECT_EQ(turned, flat);
  }
}

TEST(TriangulateTest, WhatCannotBeCutIsAFan) {
  Triangles triangles;
  const Triangles fan = {{0, 1, 2}, {0, 2, 3}};
  EXPECT_FALSE(Triangulate(std::vector<Vec3f>{{0, 0, 0}, {4, 0, 0}, {0, 3, 0}, {4, 4, 0}}, triangles));
  EXPECT_EQ(triangles, fan);
  EXPECT_FALSE(Triangulate(std::vector<Vec3f>{{0, 0, 0}, {4, 0, 0}, {0, 3, 0}, {5, 6, 0}}, triangles));
  EXPECT_EQ(triangles, fan);
  const float nan = std::numeric_limits<float>::quiet_NaN();
  EXPECT_FALSE(Triangulate(std::vector<Vec3f>{{0, 0, 0}, {4, nan, 0}, {0, 3, 0}, {4, 4, 0}}, triangles));
  EXPECT_EQ(triangles, fan);
  // On one line, or in one point: nothing to cover, nothing wrong.
  EXPECT_TRUE(Triangulate(std::vector<Vec3f>{{0, 0, 0}, {4, 4, 4}, {1, 1, 1}, {2, 2, 2}}, triangles));
  EXPECT_EQ(triangles, fan);
}

TEST(TriangulateTest, StarsAndSpiralsOfEveryKind) {
  // A polygon whose corners go round the origin does not cross itself. Directions on a square, so that many
  // corners are collinear.
  for (uint64_t seed = 0; seed < testing::Effort(300); ++seed) {
    Random random(seed);
    std::vector<Vec3f> outline;
    const int side = 2 + int(random.Below(4));
    for (int edge = 0; edge < 4; ++edge)
      for (int i = -side; i < side; ++i) {
        if (random.Below(3) == 0 && i != 0 && i != -side) continue;
        const float length = float(1 + random.Below(8));
        Vec3f p{float(side) * length, float(i) * length, 0};
        for (int k = 0; k < edge; ++k) p = {-p.y, p.x, 0};
        outline.push_back(p);
      }
    Triangles triangles;
    std::rotate(outline.begin(), outline.begin() + long(random.Below(outline.size())), outline.end());
    EXPECT_TRUE(Triangulate(outline, triangles)) << seed;
    ExpectCovers(outline, triangles, "star " + std::to_string(seed));
  }
}

TEST(TriangulateTest, LargePolygonsTakeBoundedTime) {
  // A comb of 5000 teeth, then one whose outline crosses itself at random.
  std::vector<Vec3f> outline;
  for (int i = 0; i < 10000; ++i) outline.push_back({float(i), i % 2 ? 1.0f : 9.0f, 0});
  outline.push_back({9999, 0, 0}), outline.push_back({0, 0, 0});
  Triangles triangles;
  ASSERT_TRUE(Triangulate(outline, triangles));
  int64_t sum = 0;
  for (const std::array<uint32_t, 3>& t : triangles) {
    const int64_t part = Area2(outline[t[0]], outline[t[1]], outline[t[2]]);
    EXPECT_LE(part, 0);
    sum += part;
  }
  EXPECT_EQ(sum, Area2(outline));
  Random random(5);
  outline.resize(300000);
  for (Vec3f& p : outline) p = {float(random.Below(1000)), float(random.Below(1000)), 0};
  EXPECT_FALSE(Triangulate(outline, triangles));
  EXPECT_EQ(triangles.size(), outline.size() - 2);
}

}  // namespace
}  // namespace raybench
