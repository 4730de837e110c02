// What BVH builders sort and sum up: boxes in four lanes, records of primitives, ranges of them.
#pragma once

#include <algorithm>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <utility>

#include "accel/base/huge_array.h"
#include "accel/base/lanes.h"
#include "accel/base/parallel.h"
#include "accel/bvh/binary_tree.h"
#include "accel/contract/cancel.h"
#include "accel/contract/structure.h"
#include "accel/ray/bounds.h"

namespace raybench {

struct Box4 {
  Float4 lo, hi;

  static Box4 Empty() {
    constexpr float kInf = std::numeric_limits<float>::infinity();
    return {Splat<Float4>(kInf), Splat<Float4>(-kInf)};
  }
  void Extend(Float4 p) { lo = Smaller<4>(p, lo), hi = Larger<4>(p, hi); }
  void Extend(const Box4& b) { lo = Smaller<4>(b.lo, lo), hi = Larger<4>(b.hi, hi); }
  float HalfArea() const {
    const Float4 e = hi - lo;
    return e[0] * e[1] + e[1] * e[2] + e[2] * e[0];
  }
};

/// A primitive's bounds; the id rides in the fourth lane of lo, where arithmetic ignores it.
struct alignas(16) Record {
  Float4 lo, hi;

  Float4 Centroid2() const { return lo + hi; }
  uint32_t id() const {
    uint32_t bits;
    std::memcpy(&bits, reinterpret_cast<const char*>(&lo) + 12, sizeof bits);
    return bits;
  }
  void SetId(uint32_t id) { std::memcpy(reinterpret_cast<char*>(&lo) + 12, &id, sizeof id); }
};

struct RecordRange {
  size_t begin = 0, end = 0;
  Box4 box = Box4::Empty(), centroids = Box4::Empty();

  size_t size() const { return end - begin; }
  void Extend(const Record& r) { box.Extend({r.lo, r.hi}), centroids.Extend(r.Centroid2()); }
  void Extend(const RecordRange& r) { box.Extend(r.box), centroids.Extend(r.centroids); }
};

inline void SetBounds(BuildNode& node, const Box4& box) {
  for (int a = 0; a < 3; ++a) node.lo[a] = box.lo[a], node.hi[a] = box.hi[a];
}
inline void SetLeaf(BuildNode& node, size_t first, size_t count) {
  node.right = 0, node.first = uint32_t(first), node.count = uint32_t(count);
}
/// The right child of the inner node in `slot`, whose left child stands over `left_prims` primitives.
inline uint32_t SetInner(BuildNode& node, uint32_t slot, size_t left_prims) {
  node.right = slot + 2 * uint32_t(left_prims), node.first = 0, node.count = 0;
  return node.right;
}

inline constexpr size_t kParallelRange = size_t{1} << 16;  ///< longer ranges are worked on in parallel
inline constexpr size_t kTaskRange = size_t{1} << 11;      ///< subtrees over more are tasks

/// Runs both, which belong to a subtree over n primitives; in parallel if that is worth a task.
template <class Left, class Right>
void Both(size_t n, Left&& left, Right&& right) {
  if (n >= kTaskRange) {
    ParallelInvoke(left, right);
  } else {
    left(), right();
  }
}

inline constexpr size_t kParallelBlock = size_t{1} << 13;
inline size_t BlocksIn(size_t n) { return (n + kParallelBlock - 1) / kParallelBlock; }

/// fn(begin, end) over blocks of kParallelBlock entries, in parallel.
template <class Fn>
void ForBlocks(size_t begin, size_t end, Fn&& fn) {
  ParallelFor(size_t{0}, BlocksIn(end - begin), [&](size_t b) {
    const size_t first = begin + b * kParallelBlock;
    fn(first, std::min(first + kParallelBlock, end));
  });
}

/// Fills `records`, which has room for all primitives (and maybe for more), in the order of their ids.
/// `padded`: with what conservative traversal must enclose, PaddedPrimBounds, else PrimBounds.
inline RecordRange MakeRecords(const rb_geometry& geometry, bool padded, HugeArray<Record>& records) {
  const size_t count = PrimCount(geometry);
  return ParallelReduce(
      Range<size_t>(0, count, kParallelBlock), RecordRange{0, count},
      [&](const auto& block, RecordRange sum) {
        for (size_t i = block.begin(); i < block.end(); ++i) {
          const uint32_t id = uint32_t(i);
          const Bounds3 b = padded ? PaddedPrimBounds(geometry, id) : PrimBounds(geometry, id);
          Record& record = records[i];
          record.lo = Float4{b.lo.x, b.lo.y, b.lo.z, 0}, record.hi = Float4{b.hi.x, b.hi.y, b.hi.z, 0};
          sum.Extend(record);
          record.SetId(id);
        }
        return sum;
      },
      [](RecordRange a, const RecordRange& b) {
        a.Extend(b);
        return a;
      });
}

}  // namespace raybench
