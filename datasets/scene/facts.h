// What one wants to know of a scene before measuring on it, and loading does not tell.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "datasets/scene/scene.h"

namespace raybench {

/// Quantiles of a figure over all triangles; all 0 where there is no triangle.
struct Spread {
  double percent1 = 0, median = 0, percent99 = 0;
};

struct SceneFacts {
  /// Procedural primitives by kind ("spheres"), those that there are.
  std::vector<std::pair<std::string, uint64_t>> procedural;
  uint64_t distinct_positions = 0;  ///< of the vertices that triangles use
  // Edges between triangles, vertices of equal coordinates taken as one. A surface with neither is closed.
  uint64_t boundary_edges = 0;      ///< of one triangle only
  uint64_t non_manifold_edges = 0;  ///< of three or more triangles
  Spread area;                      ///< in units of the scene as it is measured (after rescaling), squared
  Spread aspect;                    ///< longest edge over the height on it; 1.15 for an equilateral triangle
  Spread extent;                    ///< longest side of a triangle's box
  /// The shortest positive edge or radius, in ulp of the largest coordinate (2^-23 of the power of two below
  /// it): how much of float's precision the scene takes. 0: nothing to measure.
  double smallest_feature_ulp = 0;
  uint64_t bytes = 0;  ///< BytesOf()

  /// How uneven the sizes of triangles are: 99th over 1st percentile of `extent`; 0 without triangles.
  double size_spread() const { return extent.percent1 > 0 ? extent.percent99 / extent.percent1 : 0; }

  bool closed() const { return boundary_edges == 0 && non_manifold_edges == 0; }
};

/// What the scene holds: geometry, attributes, materials, pictures.
uint64_t BytesOf(const Scene& scene);

/// Takes time and memory of the order of loading; same answer at any thread count.
SceneFacts Examine(const Scene& scene);

}  // namespace raybench
