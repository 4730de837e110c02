#include "tests/plugins/saboteurs/space_tree.h"

using namespace raybench;
using namespace raybench::saboteurs;

namespace {

struct NoFault : HonestOctree {
  static constexpr const char* kName = "honest_octree";
  static constexpr const char* kDoc = "cells halved at their middle along x, y and z; no fault";
};

}  // namespace

RAYBENCH_PLUGIN(SpaceTree<NoFault>)
