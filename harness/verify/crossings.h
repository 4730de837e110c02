// `raybench verify --crossings`: is a point inside of a closed mesh? By counting what its line crosses, as
// voxelisers and radiation transport do. CROSSINGS.md has the rule that is never wrong, and its proof.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "accel/host/registry.h"
#include "harness/truth/inside.h"
#include "harness/truth/mesh_edges.h"
#include "harness/verify/verify.h"

namespace raybench {

/// A point that lies on no triangle, and the line by which it is asked about.
struct CrossingPoint {
  Vec3f at;
  uint8_t axis = 0;       ///< the line runs along it,
  bool backward = false;  ///< towards lower coordinates
  bool inside = false;    ///< the truth
};

/// All coordinates of points are multiples of this; those of vertices should be, too. Their differences then
/// are exact in double: it is 2^-51 of a power of two above all coordinates of points and vertices.
double LatticeStep(const Scene& scene);
/// Whether all vertices are such multiples.
bool IsOnLattice(const Scene& scene);

/// Fills in batch `batch` (kCrossingBatch points), one half uniform in the bounds and a little around, the
/// other where counting is hard: lines through vertices and along edges and faces; points within ulps of
/// vertices and triangles. All are on the lattice; one on the surface is drawn again. Returns how many were.
uint64_t FillCrossingBatch(const Scene& scene, std::span<const MeshEdge> edges, const InsideTruth& truth,
                           uint64_t seed, uint64_t batch, std::span<CrossingPoint> points);
inline constexpr uint64_t kCrossingBatch = 1 << 12;

/// The ray along the point's line from before the scene, at -2^52 steps of the lattice; tilted by an amount
/// that is smaller than anything on the lattice, or straight. `t` becomes the point's.
rb_ray CountingRay(const CrossingPoint& point, double step, bool tilted, double& t);
/// Whether the line crosses the triangle behind t, if it is moved by (e, e^2, e^3) with e > 0 smaller than
/// anything else. It must not meet the triangle at t.
bool CrossesBehind(const exact::Line& line, const exact::Corners& p, double t);

/// Counts `options.crossings` points with each structure (default: EveryArithmetic() without linear ones)
/// in each scene, by the rule and by the usual ways, and prints a table per scene. Returns the exit code:
/// 0; 1 if a structure that claims to be watertight or exact is wrong by the rule; 3 if a structure could
/// not be built; if interrupted, counts so far are printed and written. Throws InputError for a mesh
/// that is not closed.
int RunCrossings(const Registry& registry, const VerifyOptions& options);

}  // namespace raybench
