// A plain tree of boxes that finds what a line may meet, for truth: it may find too much, never too little.
#pragma once

#include <cstdint>
#include <vector>

#include "accel/base/vec3.h"

namespace raybench {

/// A line whose meetings with boxes are widened by `pad` times the farthest coordinate of the box as seen
/// from the origin. The pad has to exceed 2^-45, what rounding takes here.
struct FatLine {
  Vec3d org, dir;
  double pad;
};

class BoxTree {
 public:
  struct Box {
    Vec3d lo{kInfinity, kInfinity, kInfinity}, hi{-kInfinity, -kInfinity, -kInfinity};

    void Extend(Vec3d p) {
      lo = Min(lo, p);
      hi = Max(hi, p);
    }
    void Extend(const Box& other) {
      lo = Min(lo, other.lo);
      hi = Max(hi, other.hi);
    }
  };

  /// Splits at the median of the widest axis.
  explicit BoxTree(const std::vector<Box>& boxes);

  /// Calls visit(i) for every box that the line may meet at some t in [from, to], the nearer half of each
  /// node first. What visit returns is the new `to`.
  template <class Visit>
  void Traverse(const FatLine& line, double from, double to, const Visit& visit) const {
    struct Open {
      uint32_t node;
      double entry;
    } stack[64];
    int size = 0;
    const auto push = [&](uint32_t node) {
      const double entry = Entry(line, nodes_[node].box, from, to);
      if (entry <= to) stack[size++] = {node, entry};
    };
    if (!nodes_.empty()) push(0);
    while (size > 0) {
      const Open open = stack[--size];
      if (open.entry > to) continue;
      const Node& node = nodes_[open.node];
      for (uint32_t i = 0; i < node.count; ++i) {
        const uint32_t item = items_[node.first + i];
        if (Entry(line, boxes_[item], from, to) <= to) to = visit(item);
      }
      if (node.count > 0) continue;
      push(open.node + 1);
      push(node.first);
      if (size >= 2 && stack[size - 1].entry > stack[size - 2].entry)
        std::swap(stack[size - 1], stack[size - 2]);
    }
  }

 private:
  static constexpr double kInfinity = std::numeric_limits<double>::infinity(),
                          kNone = std::numeric_limits<double>::quiet_NaN();

  struct Node {
    Box box;
    uint32_t first;  ///< of its items; in an inner node its second child, the first one being the next node
    uint32_t count;  ///< 0: an inner node
  };

  void Split(uint32_t first, uint32_t count);

  /// Lower bound of the t at which the line meets the box in [from, to]; NaN if it does not.
  static double Entry(const FatLine& line, const Box& box, double from, double to) {
    const Vec3d lo = box.lo - line.org, hi = box.hi - line.org;
    double reach = 0;
    for (int k = 0; k < 3; ++k) reach = std::max({reach, std::fabs(lo[k]), std::fabs(hi[k])});
    const double pad = line.pad * reach + 0x1p-140;
    for (int k = 0; k < 3; ++k) {
      const double a = lo[k] - pad, b = hi[k] + pad;
      if (line.dir[k] == 0) {
        if (a > 0 || b < 0) return kNone;
        continue;
      }
      const double t0 = a / line.dir[k], t1 = b / line.dir[k];
      from = std::max(from, std::min(t0, t1));
      to = std::min(to, std::max(t0, t1));
    }
    return from <= to ? from : kNone;
  }

  std::vector<Box> boxes_;
  std::vector<uint32_t> items_;
  std::vector<Node> nodes_;
};

}  // namespace raybench
