#include "accel/bvh/wide/traversal.h"

namespace raybench {

std::unique_ptr<WideBvh> MakeWideBvh16(const rb_geometry& geometry, const BinaryTree& tree,
                                       const WideTopology& topology, const WideOptions& options) {
  return MakeWideBvhOf<16>(geometry, tree, topology, options);
}

}  // namespace raybench
