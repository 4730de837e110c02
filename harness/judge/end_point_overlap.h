// End-point overlap: what SAH cost does not see.
#pragma once

#include <cstdint>
#include <optional>

#include "accel/host/registry.h"

namespace raybench {

/// EPO of Aila, Karras and Laine 2013 ("On quality metrics of bounding volume hierarchies"): the expected
/// cost of the nodes that a random point of the surface lies in without belonging to them. A sum over nodes
/// of cost x area of the triangles' parts that lie in the node's box but in none of its leaves / area of all
/// triangles, the cost being 1 for an inner node and the number of primitives for a leaf, as in
/// TreeStatistics::sah_cost. Estimated from `samples` triangles, evenly spaced strata with one seeded pick
/// each; all of them if there are no more. Absent when the structure shows no nodes or other shapes than
/// boxes, or there are procedural primitives or no triangles.
std::optional<double> EndPointOverlap(const Tree& tree, const rb_geometry& geometry, uint64_t samples,
                                      uint64_t seed);

}  // namespace raybench
