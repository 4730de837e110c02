// A hierarchy of any bound over the topology of the binned SAH builder.
#pragma once

#include "accel/base/parallel.h"
#include "accel/bvh/binned_sah.h"
#include "accel/bvh/bound_tree.h"

namespace raybench {

/// Throws std::runtime_error: over the memory limit, cancelled.
template <class Bound>
BoundTree<Bound> BuildBinnedBoundTree(const rb_geometry& geometry, const rb_build_options& options,
                                      uint32_t leaf_size, bool padded) {
  const uint64_t prims = PrimCount(geometry);
  BoundTree<Bound> tree;
  if (prims == 0) return tree;
  RequireWithinLimit(BinnedSahPeakBytes(prims), options);
  Arena arena(options.threads);
  arena.Run([&] {
    const BinnedSahOptions build{.costs = {.leaf_size = leaf_size}, .padded = padded};
    tree =
        BoundTree<Bound>(geometry, BuildBinnedSah(geometry, build, options.cancel), padded, options.cancel);
  });
  const MemoryUse use = tree.Memory();
  RequireWithinLimit(use.nodes + use.prims, options);
  return tree;
}

}  // namespace raybench
