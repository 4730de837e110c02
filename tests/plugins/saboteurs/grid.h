// A uniform grid. The ray walks from layer to layer of its main axis and looks into all cells of the layer
// that it may be in meanwhile. For each wall there is an earliest and a latest t, as with the planes of a
// kd-tree, and accel/kd/tree.h says why no hit is lost so. A mailbox keeps primitives from being tested twice.
#pragma once

#include "accel/ray/leaf_blocks.h"
#include "tests/plugins/saboteurs/structure.h"

namespace raybench::saboteurs {

inline constexpr int kMostCells = 64;  // along an axis

/// When, at the earliest and at the latest, a ray meets each wall of an axis.
struct WallTimes {
  float earliest[kMostCells + 1], latest[kMostCells + 1];
};

class RayMailbox {
 public:
  /// Whether the primitive has surely been tested. From now on it has.
  bool Seen(uint32_t prim) { return (mailbox_.Unseen({prim, prim, prim, prim}) & 1) == 0; }

 private:
  Mailbox mailbox_;
};

struct HonestGrid : Honest {
  using Mailbox = RayMailbox;

  static void Meet(const SlabRay& ray, int axis, const std::vector<float>& walls, WallTimes& times) {
    for (size_t i = 0; i < walls.size(); ++i) {
      const float distance = walls[i] - ray.org[axis];
      times.earliest[i] = distance * ray.inv_near[axis], times.latest[i] = distance * ray.inv_far[axis];
    }
  }
  /// Whether a hit found in a cell that the ray leaves at `exit` is taken.
  static bool Keeps(const rb_hit&, float /*exit*/) { return true; }
};

template <class Fault>
class Grid : public Structure<Fault, Grid<Fault>> {
  using Base = Structure<Fault, Grid<Fault>>;

 public:
  struct Config {
    int64_t resolution;
  };
  static std::span<const rb_param> Params() {
    static const rb_param params[] = {IntParam("resolution", "cells along an axis at most",
                                               offsetof(Config, resolution), 1, kMostCells, 16)};
    return params;
  }

  Grid(const rb_geometry& geometry, const rb_build_options& options, const Config& config) : Base(geometry) {
    const uint32_t n = uint32_t(PrimCount(geometry));
    if (n == 0) return;
    for (uint32_t i = 0; i < n; ++i) box_.Extend(PaddedPrimBounds(geometry, i));
    uint64_t references = 0;
    for (cells_ = int(config.resolution);; cells_ /= 2) {
      PlaceWalls();
      references = 0;
      for (uint32_t i = 0; i < n; ++i) references += CellsOf(i).count();
      if (references <= kFewReferences + 16 * uint64_t{n} || cells_ == 1) break;
    }
    const size_t cells = size_t(cells_) * size_t(cells_) * size_t(cells_);
    CheckBuild<Fault>(options, (2 * (cells + 1) + references) * sizeof(uint32_t));
    first_.assign(cells + 1, 0);
    for (uint32_t i = 0; i < n; ++i) ForCells(i, [&](size_t cell) { ++first_[cell + 1]; });
    for (size_t c = 0; c < cells; ++c) first_[c + 1] += first_[c];
    prims_.resize(references);
    std::vector<uint32_t> next(first_.begin(), first_.end() - 1);
    for (uint32_t i = 0; i < n; ++i) ForCells(i, [&](size_t cell) { prims_[next[cell]++] = i; });
  }

  template <bool kAny, class Ray, class Counter>
  void Trace(const Ray& ray, rb_hit& best, Counter& counter) const {
    if (first_.empty()) return;
    float tnear, tfar;
    ray.slab.Interval(box_, tnear, tfar);
    counter.Bounds(1);
    tnear = std::max(tnear, ray.query.ray.tnear), tfar = std::min(tfar, best.t);
    if (!(tnear <= tfar)) return;
    WallTimes times[3];
    int main = 0;
    double most = -1;
    for (int a = 0; a < 3; ++a) {
      Fault::Meet(ray.slab, a, walls_[a], times[a]);
      const double cells_crossed = std::fabs(double(ray.query.ray.dir[a])) / double(box_.hi[a] - box_.lo[a]);
      if (cells_crossed > most) most = cells_crossed, main = a;
    }
    counter.Bounds(3 * uint64_t(cells_ + 1));
    const bool back = ray.slab.negative(main);
    typename Fault::Mailbox mailbox;
    for (int i = 0; i < cells_; ++i) {
      int from[3], to[3], at[3];
      from[main] = to[main] = back ? cells_ - 1 - i : i;
      const float entry = std::max(tnear, times[main].earliest[from[main] + back]);
      const float exit = std::min(tfar, times[main].latest[from[main] + !back]);
      if (entry > best.t) return;
      if (!(entry <= exit)) continue;
      for (int a = 0; a < 3; ++a) {
        if (a == main) continue;
        const bool down = ray.slab.negative(a);
        auto is_in = [&](int c) {
          return !(times[a].earliest[c + down] > exit) && !(times[a].latest[c + !down] < entry);
        };
        from[a] = 0, to[a] = cells_ - 1;
        while (from[a] <= to[a] && !is_in(from[a])) ++from[a];
        while (to[a] > from[a] && !is_in(to[a])) --to[a];
      }
      for (at[2] = from[2]; at[2] <= to[2]; ++at[2])
        for (at[1] = from[1]; at[1] <= to[1]; ++at[1])
          for (at[0] = from[0]; at[0] <= to[0]; ++at[0]) {
            float leaves = exit;
            for (int a = 0; a < 3; ++a)
              leaves = std::min(leaves, times[a].latest[at[a] + !ray.slab.negative(a)]);
            if (TestCell<kAny>(ray, CellAt(at[0], at[1], at[2]), leaves, mailbox, best, counter) && kAny)
              return;
          }
    }
  }

  MemoryUse Memory() const {
    return {first_.size() * sizeof(uint32_t) + prims_.size() * sizeof(uint32_t), 0, true};
  }

  /// The grid, then the cells that are not empty.
  template <class Fn>
  int VisitNodes(Fn& node) const {
    if (first_.empty()) return 0;
    const float all[6] = {box_.lo.x, box_.lo.y, box_.lo.z, box_.hi.x, box_.hi.y, box_.hi.z};
    int stop = node(rb_node{0, 0, 1, RB_SHAPE_BOX, all, 6, 0, nullptr});
    for (int z = 0; z < cells_; ++z)
      for (int y = 0; y < cells_; ++y)
        for (int x = 0; x < cells_ && stop == 0; ++x) {
          const size_t cell = CellAt(x, y, z);
          const uint32_t count = first_[cell + 1] - first_[cell];
          const float bounds[6] = {walls_[0][x],     walls_[1][y],     walls_[2][z],
                                   walls_[0][x + 1], walls_[1][y + 1], walls_[2][z + 1]};
          if (count > 0) stop = node(rb_node{1, 1, 1, RB_SHAPE_BOX, bounds, 6, count, &prims_[first_[cell]]});
        }
    return stop;
  }

 private:
  size_t CellAt(int x, int y, int z) const { return size_t(x + cells_ * (y + cells_ * z)); }

  void PlaceWalls() {
    for (int a = 0; a < 3; ++a) {
      walls_[a].clear();
      const double lo = box_.lo[a], extent = double(box_.hi[a]) - lo;
      for (int i = 0; i < cells_; ++i) walls_[a].push_back(std::min(float(lo + extent * i / cells_), box_.hi[a]));
      walls_[a].push_back(box_.hi[a]);
    }
  }

  /// The cells that the primitive's box meets.
  struct Cells {
    int from[3], to[3];
    uint64_t count() const {
      return uint64_t(to[0] - from[0] + 1) * uint64_t(to[1] - from[1] + 1) * uint64_t(to[2] - from[2] + 1);
    }
  };
  Cells CellsOf(uint32_t prim) const {
    const Bounds3 b = PaddedPrimBounds(this->geometry_, prim);
    Cells c;
    for (int a = 0; a < 3; ++a) {
      c.from[a] = 0, c.to[a] = cells_ - 1;
      while (c.from[a] < c.to[a] && walls_[a][c.from[a] + 1] < b.lo[a]) ++c.from[a];
      while (c.to[a] > c.from[a] && walls_[a][c.to[a]] > b.hi[a]) --c.to[a];
    }
    return c;
  }
  template <class Fn>
  void ForCells(uint32_t prim, Fn&& fn) const {
    const Cells c = CellsOf(prim);
    for (int z = c.from[2]; z <= c.to[2]; ++z)
      for (int y = c.from[1]; y <= c.to[1]; ++y)
        for (int x = c.from[0]; x <= c.to[0]; ++x) fn(CellAt(x, y, z));
  }

  template <bool kAny, class Ray, class Counter>
  bool TestCell(const Ray& ray, size_t cell, float exit, typename Fault::Mailbox& mailbox, rb_hit& best,
                Counter& counter) const {
    const uint32_t begin = first_[cell], end = first_[cell + 1];
    counter.Step(2 * sizeof(uint32_t));
    counter.Leaf(begin == end);
    bool changed = false;
    for (uint32_t i = begin; i < end; ++i) {
      if (mailbox.Seen(prims_[i])) continue;
      rb_hit hit = best;
      if (!this->template TestPrims<kAny>(ray, &prims_[i], 1, hit, counter) || !Fault::Keeps(hit, exit))
        continue;
      best = hit, changed = true;
      if (kAny) return true;
    }
    return changed;
  }

  static constexpr uint64_t kFewReferences = 65536;  ///< beside 16 a primitive, as many at most

  int cells_ = 1;  ///< along an axis; by half as many while there are too many references
  Bounds3 box_;
  std::vector<float> walls_[3];
  std::vector<uint32_t> first_, prims_;
};

}  // namespace raybench::saboteurs
