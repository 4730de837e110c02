// Grids of cells, and grids inside cells: how they are stored and how rays walk them; the builder is
// in voxel_grid.cpp.
//
// A level is a box cut into res[0] x res[1] x res[2] equal cells. Most cells are empty, so what is stored is,
// for each tile of 4 x 4 x 4 cells, one bit a cell and where the tile's filled cells begin:
//
//     tile, 16 bytes:  mask (64 bits: x | y << 2 | z << 4) | first filled cell
//     cell,  8 bytes:  leaf: first block, primitives;  a grid inside: its level, kInner
//
// A filled cell is found by counting the bits below its own. Leaves are blocks of four (leaf_blocks.h).
//
// Rays walk from cell to cell in double (3D-DDA: Amanatides and Woo 1987), with t of each wall computed from
// its index, never accumulated: errors do not grow along the way.
//
// Why no hit is lost. Let u = 2^-24. A primitive that the test accepts at t has, on each axis a, a point of
// its padded box at some t_a with |t_a - t| <= s t, s = 40 u (ray/bounds.h: 32 u and its rounding). So it
// stands in one of the cells whose index on each axis is that of some moment within s of t: the cells that
// the ray meets, and those beside it where it crosses walls of two or three axes at nearly the same time.
// At each wall that it crosses, the walk also looks into the cells behind those walls of other axes that
// follow within 2 s (Beside). It begins 4 s before the box, and stops when the next wall, less s, lies
// behind the best hit; each hit found is kept, also behind the cell. Positions of walls are rounded by less
// than Insertion::slack(), which insertion allows for; an origin so far away that this does not hold has a
// larger s t. That takes each axis to cross one wall at most within 2 s: a ray from so far that 4 s t
// exceeds a cell is not walked, but tested against halves of the grid, halves of those and so on, by the
// slab test (Descend).
#pragma once

#include <cmath>
#include <vector>

#include "accel/ray/leaf_blocks.h"
#include "accel/space/insertion.h"

namespace raybench {

enum class GridRule : uint32_t { kRegular, kWoo, kHeterogeneous };
inline constexpr const char* kGridRuleChoices[] = {"regular", "woo", "heterogeneous", nullptr};
inline constexpr const char* kGridRuleDoc =
    "cells by axis, for density x primitives in all: regular (the cube root of that on each), woo (on the "
    "longest; cubic cells), heterogeneous (cubic cells, the number met)";

struct GridOptions {
  GridRule rule = GridRule::kHeterogeneous;
  double density = 1;                  ///< cells per primitive that the rule aims at
  uint32_t resolution[3] = {0, 0, 0};  ///< of the outermost grid; 0: by the rule
  bool exact = false;                  ///< insertion by overlap, else by bounds
  bool padded = true;                  ///< conservative insertion
  double references = 16;              ///< most references per primitive, where resolutions are by the rule
  uint32_t levels = 1;                 ///< of grids inside each other, >= 1
  uint32_t leaf_size = 8;              ///< cells with more primitives get a grid, as long as there are levels
};

class VoxelGrid {
 public:
  static constexpr uint32_t kMaxLevels = 8, kMaxResolution = 4096;

  VoxelGrid() = default;
  /// Runs inside the caller's task arena. At least one primitive. Throws std::runtime_error when cancelled,
  /// over the memory limit, or with more references than 32 bits can number.
  VoxelGrid(const rb_geometry& geometry, const rb_build_options& options, const GridOptions& grid);

  template <class Test, class Counter>
  void Query(const rb_query& query, bool mailbox) const {
    if (levels_.empty()) {
      ForEachRay<Counter>(query, [](auto, const RayQuery&, rb_hit&, Counter&) {});
    } else if (geometry_.procedural_count > 0) {
      mailbox ? Trace<Test, Counter, true, Mailbox>(query) : Trace<Test, Counter, true, NoMailbox>(query);
    } else {
      mailbox ? Trace<Test, Counter, false, Mailbox>(query) : Trace<Test, Counter, false, NoMailbox>(query);
    }
  }

  MemoryUse Memory() const {
    return {levels_.size() * sizeof(Level) + tiles_.size() * sizeof(Tile) + cells_.size() * sizeof(Cell),
            blocks_.bytes(), geometry_.procedural_count > 0};
  }

  /// node(const rb_node&) in pre-order until it returns non-zero. A grid is an inner node, its cells follow
  /// by x, then y, then z.
  template <class Fn>
  int Visit(Fn&& node) const {
    std::vector<uint32_t> prims;
    return levels_.empty() ? 0 : VisitLevel(levels_[0], 0, node, prims);
  }

  struct Tile {
    uint64_t mask = 0;
    uint32_t first = 0, unused = 0;
  };
  static_assert(sizeof(Tile) == 16);
  struct Cell {
    uint32_t first, count;
  };
  static constexpr uint32_t kInner = 0xFFFFFFFFu;

  struct Level {
    Bounds3 box;
    int32_t res[3];
    uint32_t tile;                   ///< its first
    int32_t tile_stride[3];          ///< from one tile to the next along each axis
    double lo[3], width[3], inv[3];  ///< of cells; inv: 1 / width, 0 for a flat box

    Level() = default;
    Level(const Bounds3& bounds, const int32_t (&resolution)[3]) : box(bounds), tile(0) {
      for (int a = 0; a < 3; ++a) {
        res[a] = resolution[a];
        lo[a] = bounds.lo[a], width[a] = (double(bounds.hi[a]) - lo[a]) / res[a];
        inv[a] = width[a] > 0 ? 1 / width[a] : 0;
        tile_stride[a] = a == 0 ? 1 : tile_stride[a - 1] * ((res[a - 1] + 3) / 4);
      }
    }
    uint64_t Cells() const { return uint64_t(res[0]) * uint64_t(res[1]) * uint64_t(res[2]); }
    uint64_t Tiles() const { return uint64_t(tile_stride[2]) * uint64_t((res[2] + 3) / 4); }
    /// Index of the cell along axis a at coordinate x, outside the box that of the nearest.
    int32_t Index(int a, double x) const {
      auto i = int32_t(std::min(std::max((x - lo[a]) * inv[a], 0.0), double(res[a] - 1)));
      // Walls are what is computed from their index; the product may have been rounded across one.
      if (i > 0 && x < lo[a] + i * width[a]) return i - 1;
      return i + 1 < res[a] && x >= lo[a] + (i + 1) * width[a] ? i + 1 : i;
    }
    /// Lower wall of cell i; the upper end for i == res.
    float Wall(int a, int32_t i) const { return i == res[a] ? box.hi[a] : float(lo[a] + i * width[a]); }
    Bounds3 CellBox(const int32_t (&from)[3], const int32_t (&to)[3]) const {
      Bounds3 b;
      for (int a = 0; a < 3; ++a) b.lo[a] = Wall(a, from[a]), b.hi[a] = Wall(a, to[a]);
      return b;
    }
    /// What a grid inside cell c divides: the cell, rounded outward, since walls lie between floats, and by
    /// as much larger as the walk may err about where its walls are.
    Bounds3 InnerBox(const int32_t (&c)[3], double slack) const {
      constexpr float kInfinity = std::numeric_limits<float>::infinity();
      Bounds3 b;
      for (int a = 0; a < 3; ++a) {
        const float lower = Wall(a, c[a]), upper = Wall(a, c[a] + 1);
        b.lo[a] = std::max(std::min(std::nextafter(lower, -kInfinity), float(lower - slack)), box.lo[a]);
        b.hi[a] = std::min(std::max(std::nextafter(upper, kInfinity), float(upper + slack)), box.hi[a]);
      }
      return b;
    }
    uint32_t TileOf(const int32_t (&c)[3]) const {
      return tile + uint32_t((c[0] >> 2) + (c[1] >> 2) * tile_stride[1] + (c[2] >> 2) * tile_stride[2]);
    }
    static unsigned BitOf(const int32_t (&c)[3]) {
      return unsigned((c[0] & 3) | (c[1] & 3) << 2 | (c[2] & 3) << 4);
    }
  };

 private:
  template <class Test, class Counter, bool kProcedural, class Box>
  void Trace(const rb_query& query) const {
    ForEachRay<Counter>(query, [&](auto any, const RayQuery& q, rb_hit& best, Counter& counter) {
      Walker<Test, Counter, kProcedural, any.value, Box> walker(*this, q, best, counter);
      walker.Walk(levels_[0]);
    });
  }

  template <class Test, class Counter, bool kProcedural, bool kAnyHit, class Box>
  class Walker;

  template <class Fn>
  int VisitLevel(const Level& level, uint32_t depth, Fn& node, std::vector<uint32_t>& prims) const;

  rb_geometry geometry_{};
  bool exact_ = false;         ///< insertion by overlap
  std::vector<Level> levels_;  // the outermost first
  HugeArray<Tile> tiles_;
  HugeArray<Cell> cells_;
  LeafBlocks<> blocks_;
};

/// One ray on its way. All functions return true to end it: a hit, where any one will do.
template <class Test, class Counter, bool kProcedural, bool kAnyHit, class Box>
class VoxelGrid::Walker {
 public:
  Walker(const VoxelGrid& grid, const RayQuery& q, rb_hit& best, Counter& counter)
      : grid_(grid), ray_(q), slab_(ray_.SlabOfParts()), best_(best), counter_(counter) {
    for (int a = 0; a < 3; ++a) org_[a] = q.ray.org[a], dir_[a] = q.ray.dir[a], inv_[a] = 1 / dir_[a];
  }

  bool Walk(const Level& level) {
    float tnear, tfar;
    if (!Meets(level.box, tnear, tfar)) return false;
    if constexpr (kSlack > 0) {
      for (int a = 0; a < 3; ++a) {
        if (4 * kSlack * double(tfar) > level.width[a] * std::fabs(inv_[a])) {
          const int32_t from[3] = {0, 0, 0};
          return Descend(level, from, level.res);
        }
      }
    }

    const double begin = double(tnear) * (1 - 4 * kSlack) - kRounding;
    int32_t cell[3], step[3], stop[3];
    double next[3], wall[3], base[3], delta[3];  // the wall with index wall[a] is met at base + wall delta
    for (int a = 0; a < 3; ++a) {
      const bool negative = ray_.slab.negative(a), parallel = dir_[a] == 0;
      cell[a] = level.Index(a, org_[a] + begin * dir_[a]);
      step[a] = negative ? -1 : 1;
      stop[a] = negative ? -1 : level.res[a];
      wall[a] = cell[a] + !negative;
      base[a] = parallel ? kInfinity : (level.lo[a] - org_[a]) * inv_[a];
      delta[a] = parallel ? 0 : level.width[a] * inv_[a];
      next[a] = base[a] + wall[a] * delta[a];
    }
    for (;;) {
      if (Visit(level, cell)) return true;
      const bool xy = next[0] < next[1], xz = next[0] < next[2], yz = next[1] < next[2];
      const int a = xy ? (xz ? 0 : 2) : (yz ? 1 : 2);
      const double t = next[a];
      if (t * (1 - kSlack) - kRounding > double(best_.t)) return false;
      if constexpr (kSlack > 0) {
        const double window = t * (1 + 2.5 * kSlack);
        const unsigned beside = (unsigned(next[0] <= window) | unsigned(next[1] <= window) << 1 |
                                 unsigned(next[2] <= window) << 2) &
                                ~(1u << a);
        if (beside != 0 && Beside(level, cell, step, beside)) [[unlikely]]
          return true;
      }
      cell[a] += step[a];
      if (cell[a] == stop[a]) return false;
      wall[a] += step[a];
      next[a] = base[a] + wall[a] * delta[a];
      counter_.Bounds(1);
    }
  }

 private:
  static constexpr double kSlack = Test::kSlack == Slack::kNone ? 0 : 40 * 0x1p-24;
  /// Of a subnormal t, and the next float where that is tnear.
  static constexpr double kRounding = kSlack > 0 ? 0x1p-148 : 0;
  static constexpr double kInfinity = std::numeric_limits<double>::infinity();

  /// Whether the ray's interval, up to the best hit, meets the box; and where: not beyond the largest float.
  bool Meets(const Bounds3& box, float& tnear, float& tfar) {
    counter_.Bounds(1);
    slab_.Interval(box, tnear, tfar);
    tnear = std::max(tnear, ray_.query.ray.tnear), tfar = std::min(tfar, best_.t);
    return tnear <= tfar && tnear <= std::numeric_limits<float>::max();
  }

  bool Visit(const Level& level, const int32_t (&index)[3]) {
    const Tile& tile = grid_.tiles_[level.TileOf(index)];
    const unsigned bit = Level::BitOf(index);
    counter_.Step(sizeof(Tile));
    const bool filled = (tile.mask >> bit & 1) != 0;
    if (!filled) {
      counter_.Leaf(true);
      return false;
    }
    const auto rank = unsigned(__builtin_popcountll(tile.mask & ((uint64_t{1} << bit) - 1)));
    const Cell& cell = grid_.cells_[tile.first + rank];
    if (cell.count == kInner) return Walk(grid_.levels_[cell.first]);
    counter_.Leaf(false);
    return grid_.blocks_.template Intersect<kProcedural, kAnyHit>(cell.first, cell.count, ray_, best_,
                                                                  counter_, mailbox_) &&
           kAnyHit;
  }

  /// The cells behind one or more of the walls of the axes in `beside`.
  bool Beside(const Level& level, const int32_t (&cell)[3], const int32_t (&step)[3], unsigned beside) {
    for (unsigned set = beside; set != 0; set = (set - 1) & beside) {
      int32_t c[3];
      bool inside = true;
      for (int a = 0; a < 3; ++a) {
        c[a] = cell[a] + ((set >> a & 1) != 0 ? step[a] : 0);
        inside = inside && c[a] >= 0 && c[a] < level.res[a];
      }
      if (inside && Visit(level, c)) return true;
    }
    return false;
  }

  /// All cells from `from` up to `to`, exclusively, that the slab test lets through, in about the
  /// ray's order.
  bool Descend(const Level& level, const int32_t (&from)[3], const int32_t (&to)[3]) {
    float tnear, tfar;
    if (!Meets(level.CellBox(from, to), tnear, tfar)) return false;
    int axis = 0;
    for (int a = 1; a < 3; ++a) {
      if (to[a] - from[a] > to[axis] - from[axis]) axis = a;
    }
    if (to[axis] - from[axis] == 1) return Visit(level, from);
    int32_t middle_to[3] = {to[0], to[1], to[2]}, middle_from[3] = {from[0], from[1], from[2]};
    middle_to[axis] = middle_from[axis] = from[axis] + (to[axis] - from[axis]) / 2;
    return ray_.slab.negative(axis) ? Descend(level, middle_from, to) || Descend(level, from, middle_to)
                                    : Descend(level, from, middle_to) || Descend(level, middle_from, to);
  }

  const VoxelGrid& grid_;
  const RayState<Test> ray_;
  const SlabRay slab_;
  rb_hit& best_;
  Counter& counter_;
  Box mailbox_;
  double org_[3], dir_[3], inv_[3];
};

template <class Fn>
int VoxelGrid::VisitLevel(const Level& level, uint32_t depth, Fn& node, std::vector<uint32_t>& prims) const {
  float bounds[6];
  rb_node shown{depth, 0, 1, RB_SHAPE_BOX, bounds, 6, 0, nullptr};
  auto show = [&](const Bounds3& box) {
    for (int a = 0; a < 3; ++a) bounds[a] = box.lo[a], bounds[a + 3] = box.hi[a];
    return node(shown);
  };
  if (int stop = show(level.box)) return stop;
  shown.depth = depth + 1, shown.is_leaf = 1;
  int32_t c[3];
  for (c[2] = 0; c[2] < level.res[2]; ++c[2]) {
    for (c[1] = 0; c[1] < level.res[1]; ++c[1]) {
      for (c[0] = 0; c[0] < level.res[0]; ++c[0]) {
        const Tile& tile = tiles_[level.TileOf(c)];
        const uint64_t bit = uint64_t{1} << Level::BitOf(c);
        prims.clear();
        if ((tile.mask & bit) != 0) {
          const Cell& cell = cells_[tile.first + unsigned(__builtin_popcountll(tile.mask & (bit - 1)))];
          if (cell.count == kInner) {
            if (int stop = VisitLevel(levels_[cell.first], depth + 1, node, prims)) return stop;
            continue;
          }
          blocks_.Append(cell.first, cell.count, prims);
        }
        shown.prim_count = uint32_t(prims.size()), shown.prims = prims.data();
        const int32_t end[3] = {c[0] + 1, c[1] + 1, c[2] + 1};
        // Walls lie between floats, and where triangles are only in cells that they meet, part of them may lie
        // between a wall and the float next to it.
        if (int stop = show(exact_ ? level.InnerBox(c, 0) : level.CellBox(c, end))) return stop;
      }
    }
  }
  return 0;
}

}  // namespace raybench
