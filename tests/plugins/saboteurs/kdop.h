// A tree of 14-DOPs, halved as the BVH is.
#pragma once

#include "accel/bvh/bounds/kdop.h"
#include "tests/plugins/saboteurs/bvh.h"

namespace raybench::saboteurs {

struct Kdop : KdopBound<14> {
  static Kdop Around(const rb_geometry& g, const uint32_t* prims, size_t count) {
    return {KdopBound<14>::Around(g, prims, count, true)};
  }
};

struct HonestKdop : HonestBvh {
  using Bound = Kdop;
};

}  // namespace raybench::saboteurs
