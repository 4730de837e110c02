// Rays aimed at where float arithmetic fails: vertices, edges, silhouettes, planes, axes, far away.
//
// Each family is a function from (scene, seed, i) to ray i, so that a set of any size can be made, judged and
// forgotten piece by piece, and any ray of it made again.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "accel/host/registry.h"
#include "harness/rays/family.h"
#include "harness/truth/mesh_edges.h"
#include "tracer/rays/ray_set.h"

namespace raybench {

/// A family of rays, or why the scene has none.
struct AimedSet {
  std::string name;  ///< "aimed_edge": the label in tables and files
  /// Fills `rays` with rays first, first + 1, ... over at most `threads` threads (0: all). Empty if absent.
  std::function<void(uint64_t first, std::span<rb_ray> rays, uint32_t threads)> fill;
  std::string absent;  ///< why there are no such rays, in words
};

/// What can be asked for, in the order of the tables.
std::vector<RayFamily> AimedFamilies();

/// Every family that does not depend on a tree; `edges` are the scene's. Both must outlive the result, which
/// is planned for `count` rays of each (the camera's picture has that many pixels). Origins of the aimed ones
/// lie around the centre, within the bounds, or outside. tnear is 0, tfar infinite; directions are float
/// differences, half of them scaled off the lattice. Outlines are edges whose two triangles lie on one side of
/// the plane through edge and origin.
std::vector<AimedSet> SharedSets(const Scene& scene, std::span<const MeshEdge> edges, uint64_t count,
                                 uint64_t seed);

/// planes: aimed at the faces, edges and corners of the boxes of this very tree, across and within them; a
/// split plane is a face of the boxes on either side. Absent where the structure shows no boxes. The scene
/// must outlive the result; the tree need not.
AimedSet PlanesSet(const Scene& scene, const Tree& tree, uint64_t seed);

}  // namespace raybench
