#include "accel/bvh/wide/compact_leaves.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "accel/base/parallel.h"
#include "accel/ray/bounds.h"

namespace raybench {
namespace {

float StepOf(uint8_t exponent) {
  const uint32_t bits = uint32_t{exponent} << 23;
  float step;
  std::memcpy(&step, &bits, sizeof step);
  return step;
}

/// The number of the grid's point nearest to x whose place is a float.
double PointNear(float x, uint8_t exponent) {
  const double step = StepOf(exponent), k = std::nearbyint(x / step);
  return std::fabs(k * step) <= std::numeric_limits<float>::max() ? k : k - std::copysign(1.0, k);
}

/// A grid that a leaf's vertices fit: offsets from 0 to `most` an axis, points of 24 bits.
GridSteps StepsFor(const Bounds3& vertices, int most, const GridSteps& least) {
  GridSteps steps;
  for (int a = 0; a < 3; ++a) {
    const float lo = vertices.lo[a], hi = vertices.hi[a];
    const auto fits = [&](int e) {
      const double from = PointNear(lo, uint8_t(e)), to = PointNear(hi, uint8_t(e));
      return to - from <= most && std::max(std::fabs(from), std::fabs(to)) <= 0x1p24;
    };
    const double finest =
        std::max((double(hi) - lo) / (most + 1), std::max(std::fabs(lo), std::fabs(hi)) * 0x1p-25);
    int e = std::max({std::ilogb(std::max(finest, 0x1p-126)) + 127, int(least.exponent[a]), 1});
    while (e < 254 && !fits(e)) ++e;  // the largest one fits all that is finite
    steps.exponent[a] = uint8_t(e);
  }
  return steps;
}

int MostOffset(Leaves leaves) {
  return leaves == Leaves::kQuantized8 || leaves == Leaves::kSnapped8 ? 255 : 65535;
}

Bounds3 VertexBounds(const rb_geometry& geometry, std::span<const uint32_t> prims) {
  Bounds3 box;
  for (const uint32_t prim : prims)
    for (int c = 0; c < 3; ++c) box.Extend(Vertex(geometry, prim, c));
  return box;
}

/// The box of the triangles, padded, as a leaf with these steps will hold them.
Bounds3 SnappedBounds(const rb_geometry& geometry, std::span<const uint32_t> prims, const GridSteps& steps) {
  Bounds3 box;
  for (const uint32_t prim : prims) {
    Vec3f p[3];
    for (int c = 0; c < 3; ++c)
      for (int a = 0; a < 3; ++a)
        p[c][a] =
            float(PointNear(Vertex(geometry, prim, c)[a], steps.exponent[a]) * StepOf(steps.exponent[a]));
    box.Extend(PaddedBounds(p[0], p[1], p[2]));
  }
  return box;
}

void Extend(BuildNode& node, const Bounds3& box) {
  for (int a = 0; a < 3; ++a)
    node.lo[a] = std::min(node.lo[a], box.lo[a]), node.hi[a] = std::max(node.hi[a], box.hi[a]);
}

/// Elements 0 and 1 of each four of a, between those of b; then 2 and 3.
template <int kLanes>
FloatN<kLanes> Low(FloatN<kLanes> a, FloatN<kLanes> b) {
  if constexpr (kLanes == 4) return __builtin_shufflevector(a, b, 0, 4, 1, 5);
  if constexpr (kLanes == 8) return __builtin_shufflevector(a, b, 0, 8, 1, 9, 4, 12, 5, 13);
}
template <int kLanes>
FloatN<kLanes> High(FloatN<kLanes> a, FloatN<kLanes> b) {
  if constexpr (kLanes == 4) return __builtin_shufflevector(a, b, 2, 6, 3, 7);
  if constexpr (kLanes == 8) return __builtin_shufflevector(a, b, 2, 10, 3, 11, 6, 14, 7, 15);
}

template <int kLanes>
struct IndexedLeaf {
  uint32_t prim[kLanes];

  static void Encode(const rb_geometry& /*geometry*/, const GridSteps& /*steps*/,
                     std::span<const uint32_t> prims, void* leaf) {
    auto& out = *static_cast<IndexedLeaf*>(leaf);
    for (size_t i = 0; i < kLanes; ++i) out.prim[i] = prims[std::min(i, prims.size() - 1)];
  }
  static void Decode(const rb_geometry& geometry, const void* leaf, typename LeafBlocks<kLanes>::Block& out) {
    // Rows are written whole: read whole, what was just written in parts waits for the memory.
    using F = FloatN<kLanes>;
    const auto& in = *static_cast<const IndexedLeaf*>(leaf);
    std::memcpy(out.prim, in.prim, sizeof out.prim);
    const uint32_t* corners[kLanes];
    static constexpr uint32_t kNoTriangle[3] = {};
    for (int i = 0; i < kLanes; ++i)
      corners[i] = in.prim[i] < geometry.triangle_count ? geometry.triangles[in.prim[i]] : kNoTriangle;
    for (int c = 0; c < 3; ++c) {
      const auto of = [&](int k) {  // triangle k, and k + 4
        const Float4 a = Load<Float4>(geometry.positions[corners[k][c]]);
        if constexpr (kLanes == 4) {
          return a;
        } else {
          const Float4 b = Load<Float4>(geometry.positions[corners[k + 4][c]]);
          return F(__builtin_shufflevector(a, b, 0, 1, 2, 3, 4, 5, 6, 7));
        }
      };
      const F p0 = of(0), p1 = of(1), p2 = of(2), p3 = of(3);
      const F xy02 = Low<kLanes>(p0, p2), xy13 = Low<kLanes>(p1, p3), z02 = High<kLanes>(p0, p2),
              z13 = High<kLanes>(p1, p3);
      const F rows[3] = {Low<kLanes>(xy02, xy13), High<kLanes>(xy02, xy13), Low<kLanes>(z02, z13)};
      for (int a = 0; a < 3; ++a) std::memcpy(out.v[c][a], &rows[a], sizeof rows[a]);
    }
  }
};

template <int kLanes, class Offset>
struct QuantizedLeaf {
  uint32_t prim[kLanes];
  float origin[3];
  uint8_t exponent[4];     // of the steps; the last one is 0
  Offset q[3][3][kLanes];  // corner, axis

  static void Encode(const rb_geometry& geometry, const GridSteps& least, std::span<const uint32_t> prims,
                     void* leaf) {
    auto& out = *static_cast<QuantizedLeaf*>(leaf);
    const Bounds3 box = VertexBounds(geometry, prims);
    const GridSteps steps = StepsFor(box, std::numeric_limits<Offset>::max(), least);
    for (size_t i = 0; i < kLanes; ++i) out.prim[i] = prims[std::min(i, prims.size() - 1)];
    out.exponent[3] = 0;
    for (int a = 0; a < 3; ++a) {
      const uint8_t e = out.exponent[a] = steps.exponent[a];
      const double from = PointNear(box.lo[a], e);
      out.origin[a] = float(from * StepOf(e));
      for (int c = 0; c < 3; ++c)
        for (size_t i = 0; i < kLanes; ++i)
          out.q[c][a][i] = Offset(PointNear(Vertex(geometry, out.prim[i], c)[a], e) - from);
    }
  }
  static void Decode(const rb_geometry& /*geometry*/, const void* leaf,
                     typename LeafBlocks<kLanes>::Block& out) {
    using F = FloatN<kLanes>;
    const auto& in = *static_cast<const QuantizedLeaf*>(leaf);
    std::memcpy(out.prim, in.prim, sizeof out.prim);
    for (int a = 0; a < 3; ++a) {
      const F origin = Splat<F>(in.origin[a]), step = Splat<F>(StepOf(in.exponent[a]));
      for (int c = 0; c < 3; ++c) {
        const F v = MultiplyAdd<kLanes>(FloatsOf<kLanes>(in.q[c][a]), step, origin);
        std::memcpy(out.v[c][a], &v, sizeof v);
      }
    }
  }
};

}  // namespace

GridSteps ChooseGrids(const rb_geometry& geometry, const WideTopology& topology, Leaves leaves,
                      BinaryTree& tree) {
  const int most = MostOffset(leaves);
  const auto prims_of = [&](const WideTopology::Child& leaf) {
    return std::span<const uint32_t>(&tree.order[leaf.first], leaf.count);
  };
  const auto each_leaf = [&](const Range<size_t>& range, const auto& visit) {
    for (size_t i = range.begin(); i < range.end(); ++i)
      if (topology.children[i].count > 0) visit(topology.children[i]);
  };
  const Range<size_t> all(0, topology.children.size(), 256);
  GridSteps least;
  if (leaves == Leaves::kSnapped16 || leaves == Leaves::kSnapped8) {
    const auto larger = [](GridSteps a, const GridSteps& b) {
      for (int i = 0; i < 3; ++i) a.exponent[i] = std::max(a.exponent[i], b.exponent[i]);
      return a;
    };
    // What fits a step fits twice that.
    least = ParallelReduce(
        all, least,
        [&](const Range<size_t>& range, GridSteps steps) {
          each_leaf(range, [&](const WideTopology::Child& leaf) {
            steps = larger(steps, StepsFor(VertexBounds(geometry, prims_of(leaf)), most, {}));
          });
          return steps;
        },
        larger);
  }
  ParallelFor(all, [&](const Range<size_t>& range) {
    each_leaf(range, [&](const WideTopology::Child& leaf) {
      const GridSteps steps = StepsFor(VertexBounds(geometry, prims_of(leaf)), most, least);
      Extend(tree.nodes[leaf.slot], SnappedBounds(geometry, prims_of(leaf), steps));
    });
  });
  // Children's boxes are complete before their parents': nodes are in depth-first order.
  std::vector<uint32_t> slot(topology.nodes());
  if (!slot.empty()) slot[0] = 0;
  for (const WideTopology::Child& child : topology.children)
    if (child.count == 0) slot[child.first] = child.slot;
  for (uint32_t i = topology.nodes(); i-- > 0;) {
    for (const WideTopology::Child& child : topology.ChildrenOf(i)) {
      const BuildNode& box = tree.nodes[child.slot];
      Extend(tree.nodes[slot[i]], {LoadVec3(box.lo), LoadVec3(box.hi)});
    }
  }
  return least;
}

template <int kLanes>
const LeafCodec<kLanes>* LeafCodec<kLanes>::Of(Leaves leaves) {
  using Indexed = IndexedLeaf<kLanes>;
  using Offsets16 = QuantizedLeaf<kLanes, uint16_t>;
  using Offsets8 = QuantizedLeaf<kLanes, uint8_t>;
  static constexpr LeafCodec kIndexed{sizeof(Indexed), 3 * (sizeof(uint32_t) + sizeof(Vec3f)),
                                      &Indexed::Encode, &Indexed::Decode},
      kOffsets16{sizeof(Offsets16), 0, &Offsets16::Encode, &Offsets16::Decode},
      kOffsets8{sizeof(Offsets8), 0, &Offsets8::Encode, &Offsets8::Decode};
  if (leaves == Leaves::kCopied) return nullptr;
  if (leaves == Leaves::kIndexed) return &kIndexed;
  return MostOffset(leaves) == 255 ? &kOffsets8 : &kOffsets16;
}

template struct LeafCodec<4>;
template struct LeafCodec<8>;

}  // namespace raybench
