// Access to the Embree scene behind a built `embree` tree: for measuring what the contract costs over it.
#pragma once

#if RAYBENCH_EMBREE_MAJOR >= 4
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include "accel/contract/raybench.h"

namespace raybench {

/// `tree` must have been built by the structure `embree`. The scene lives as long as the tree.
RTCScene EmbreeSceneOf(const rb_tree* tree);

}  // namespace raybench
