// What the suites make scenes and rays of.
#pragma once

#include <cmath>
#include <initializer_list>

#include "datasets/generators/generators.h"
#include "harness/extremes/suite.h"

namespace raybench::extremes {

/// Points at these magnitudes; claims must hold up to `valid_to`.
std::vector<Point> Along(std::initializer_list<double> magnitudes,
                         double valid_to = std::numeric_limits<double>::infinity());
/// 10^first, ..., 10^last.
std::vector<Point> Decades(int first, int last, double valid_to = std::numeric_limits<double>::infinity());
/// Each point once for each variant.
std::vector<Point> Times(const std::vector<Point>& points, std::initializer_list<const char*> variants);

/// Closed ball of radius 1 and 20 n^2 triangles, turned off the axes.
Mesh Ball(uint32_t n, uint64_t seed);
/// The surface of a box, each face cut in n x n cells of two triangles; vertices are shared.
Mesh Box(Vec3d lo, Vec3d hi, uint32_t n);

/// The mesh as a scene; each position is rounded to float once. Throws InputError as Scene::Finish() does.
Scene ToScene(const Mesh& mesh, const Suite& suite, const Point& point);

/// From org towards target with a direction of length 1, rounded: off any lattice.
rb_ray Towards(Vec3f org, Vec3f target);
rb_ray MakeRay(Vec3f org, Vec3f dir);

/// A vertex (odd i) or the rounded midpoint of an edge of a random triangle.
Vec3f EdgeTarget(const Scene& scene, uint64_t i, Random& random);
/// Uniform in the unit ball.
Vec3d InBall(Random& random);

/// `count` valid rays; make(i, random) is called again until it gives one.
template <class Make>
std::vector<rb_ray> MakeRays(uint64_t count, uint64_t seed, const Make& make) {
  std::vector<rb_ray> rays;
  rays.reserve(count);
  for (uint64_t i = 0; i < count; ++i) {
    Random random(seed, i);
    rb_ray ray = make(i, random);
    while (!IsValidRay(ray)) ray = make(i, random);
    rays.push_back(ray);
  }
  return rays;
}

/// The answer names none of the nearest primitives, nor the one that the contract's order puts first among
/// those whose t rounds to the same float; or it differs about hit or miss.
bool OtherPrimitive(const Truth& truth, const rb_hit& hit);
/// The answer differs about hit or miss, whatever excuse there is.
bool HitOrMissDiffers(const Truth& truth, const rb_hit& hit);

}  // namespace raybench::extremes
