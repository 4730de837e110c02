// The nodes of wide trees: the boxes of kWidth children, and where these stand.
//
// Boxes are full floats or, an axis at a time, small integers on a grid that the node brings along (Ylitie, Karras,
// Laine 2017; Benthin et al. 2018): plane = origin + q scale with a power of two as scale, so that the product is exact
// and the sum rounded once, whether fused or not. Quantised boxes enclose the children's by the very arithmetic that
// traversal uses.
//
// A reference is the number of the line at which a child begins; bit 31 tells leaves, and these are the first children.
// Full nodes hold a reference for each child. The children of a quantised node stand side by side, so that a lane's number
// tells its reference (one base a node: Ylitie, Karras, Laine 2017).
//
// Lanes behind a node's last child have boxes that no ray meets, or, on a grid, hardly any.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <span>
#include <stdexcept>

#include "accel/base/lanes.h"
#include "accel/base/vec3.h"

namespace raybench {

inline constexpr uint32_t kLeafBit = 0x80000000u;

template <int kWidth>
struct FullNode {
  using F = FloatN<kWidth>;
  static constexpr bool kSiblingsTogether = false;

  float planes[6][kWidth];  // lower x y z, upper x y z
  uint32_t child[kWidth];   // behind the last one: the first one again

  void SetChildren(std::span<const uint32_t> refs, uint32_t, uint32_t) {
    for (size_t i = 0; i < kWidth; ++i) child[i] = refs[i < refs.size() ? i : 0];
  }
  [[gnu::always_inline]] uint32_t Child(unsigned lane, uint32_t, uint32_t) const { return child[lane]; }
  [[gnu::always_inline]] const void* References() const { return child; }
  [[gnu::always_inline]] unsigned WithChild(unsigned lanes) const { return lanes; }
  unsigned children() const {
    unsigned n = 1;
    while (n < kWidth && child[n] != child[0]) ++n;
    return n;
  }

  void SetBoxes(std::span<const Bounds3> boxes) {
    constexpr float kInf = std::numeric_limits<float>::infinity();
    for (size_t c = 0; c < kWidth; ++c) {
      for (int a = 0; a < 3; ++a) {
        planes[a][c] = c < boxes.size() ? boxes[c].lo[a] : kInf;
        planes[a + 3][c] = c < boxes.size() ? boxes[c].hi[a] : -kInf;
      }
    }
  }
  [[gnu::always_inline]] F Row(unsigned row) const { return Load<F>(planes[row]); }
  float Plane(unsigned row, unsigned i) const { return planes[row][i]; }
};

template <int kWidth, class Grid>
struct QuantizedNode {
  using F = FloatN<kWidth>;
  static constexpr int kMost = std::numeric_limits<Grid>::max();
  static constexpr bool kSiblingsTogether = true;

  float origin[3];
  uint8_t exponent[4];  // biased, as in a float; the last one is 0
  Grid q[6][kWidth];
  /// Lane i begins at leaf + i lines of a leaf, or, behind the leaves, at inner + i lines of a node.
  uint32_t leaf, inner;
  uint16_t leaves, lanes;  ///< how many; bits of those that have a child

  void SetChildren(std::span<const uint32_t> refs, uint32_t, uint32_t node_lines) {
    leaves = 0;
    while (leaves < refs.size() && (refs[leaves] & kLeafBit) != 0) ++leaves;
    leaf = refs[0] & ~kLeafBit;
    inner = leaves < refs.size() ? refs[leaves] - leaves * node_lines : 0;
    lanes = uint16_t((1u << refs.size()) - 1);
  }
  [[gnu::always_inline]] uint32_t Child(unsigned lane, uint32_t leaf_lines, uint32_t node_lines) const {
    return lane < leaves ? kLeafBit | (leaf + lane * leaf_lines) : inner + lane * node_lines;
  }
  [[gnu::always_inline]] const void* References() const { return &leaf; }
  /// A grid that is small beside its distance is met inverted, too.
  [[gnu::always_inline]] unsigned WithChild(unsigned met) const { return met & lanes; }
  unsigned children() const { return unsigned(__builtin_popcount(lanes)); }

  void SetBoxes(std::span<const Bounds3> boxes) {
    Bounds3 all;
    for (const Bounds3& b : boxes) all.Extend(b);
    exponent[3] = 0;
    for (int a = 0; a < 3; ++a) {
      origin[a] = all.lo[a];
      int e = 1;
      std::frexp((all.hi[a] - all.lo[a]) / float(kMost), &e);
      e = std::max(e + 126, 1);
      while (!TrySet(boxes, a, e)) ++e;
    }
  }
  [[gnu::always_inline]] F Row(unsigned row) const {
    const unsigned a = row < 3 ? row : row - 3;
    return MultiplyAdd<kWidth>(FloatsOf<kWidth>(q[row]), Splat<F>(Scale(a)), Splat<F>(origin[a]));
  }
  /// Row(row)[i].
  float Plane(unsigned row, unsigned i) const {
    const unsigned a = row < 3 ? row : row - 3;
    return MultiplyAdd<4>(Splat<Float4>(float(q[row][i])), Splat<Float4>(Scale(a)),
                          Splat<Float4>(origin[a]))[0];
  }

 private:
  [[gnu::always_inline]] float Scale(unsigned axis) const {
    const int32_t bits = int32_t(exponent[axis]) << 23;
    float scale;
    std::memcpy(&scale, &bits, sizeof scale);
    return scale;
  }
  float At(unsigned axis, int step) const { return origin[axis] + float(step) * Scale(axis); }

  /// False if boxes reach beyond the grid.
  bool TrySet(std::span<const Bounds3> boxes, int axis, int e) {
    if (e > 254) throw std::runtime_error("a box is too large for quantised nodes");
    const unsigned a = unsigned(axis);
    exponent[a] = uint8_t(e);
    for (size_t c = 0; c < kWidth; ++c) {
      int lower = kMost, upper = 0;
      if (c < boxes.size()) {
        const double scale = Scale(a), from = origin[a];
        const auto clamped = [](double x) { return int(std::min(std::max(x, 0.0), double(kMost))); };
        lower = clamped(std::floor((boxes[c].lo[axis] - from) / scale));
        upper = clamped(std::ceil((boxes[c].hi[axis] - from) / scale));
        while (lower > 0 && At(a, lower) > boxes[c].lo[axis]) --lower;
        while (upper < kMost && At(a, upper) < boxes[c].hi[axis]) ++upper;
        if (At(a, upper) < boxes[c].hi[axis]) return false;
      }
      q[a][c] = Grid(lower), q[a + 3][c] = Grid(upper);
    }
    return true;
  }
};

}  // namespace raybench
