// `raybench verify --closed`: rays from inside a closed mesh, where a miss needs no oracle to be a leak.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "accel/host/registry.h"
#include "harness/truth/mesh_edges.h"
#include "harness/verify/verify.h"

namespace raybench {

/// Empty if every edge has an even number of distinct triangles, so that any point that is not on the surface
/// is inside or outside by the parity of crossings; else how many edges are open, and one of them.
std::string WhyNotClosed(const Scene& scene, std::span<const MeshEdge> edges);

/// Points inside of a closed mesh.
struct InsidePoints {
  std::vector<Vec3f> points;
  double margin = 0;  ///< no triangle is nearer to any of them
};

/// Up to `count` points, uniform among those that are inside by the exact parity of crossings along two
/// random directions (rays that touch an edge or a vertex are drawn again) and at least 2^-10 of the diagonal
/// of the bounds away from every triangle. Fewer where few of 4096 candidates qualify. Throws
/// std::logic_error if the two parities differ: the mesh is not closed.
InsidePoints FindInsidePoints(const Scene& scene, size_t count, uint64_t seed, uint32_t threads);

/// Ray i of a campaign: from one of the points at a vertex, the midpoint of an edge or a point of an edge,
/// rounded to float. Makes rays of batch `batch` (kClosedBatch rays).
void FillClosedBatch(const Scene& scene, std::span<const MeshEdge> edges, const InsidePoints& inside,
                     uint64_t seed, uint64_t batch, std::span<rb_ray> rays);
inline constexpr uint64_t kClosedBatch = 1 << 16;

/// Fires `options.closed` rays at each structure (default: EveryArithmetic() without linear ones) in each
/// scene, prints a line each, and sums up in `options.ledger`. Returns the exit code: 0; 1 if a structure
/// that claims to be watertight or exact lost a ray; 3 if a structure could not be built; 130 if interrupted:
/// rays so far are printed and recorded. Throws InputError for a mesh that is not closed or has no inside.
int RunClosed(const Registry& registry, const VerifyOptions& options);

}  // namespace raybench
