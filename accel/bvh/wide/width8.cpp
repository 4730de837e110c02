#include "accel/bvh/wide/traversal.h"

namespace raybench {

std::unique_ptr<WideBvh> MakeWideBvh8(const rb_geometry& geometry, const BinaryTree& tree,
                                      const WideTopology& topology, NodeFormat format, bool needs_uv) {
  return MakeWideBvhOf<8>(geometry, tree, topology, format, needs_uv);
}

}  // namespace raybench
