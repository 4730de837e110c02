#include "accel/space/voxel_grid.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <stdexcept>

#include "accel/base/parallel.h"
#include "accel/contract/cancel.h"

namespace raybench {
namespace {

constexpr size_t kChunk = 2048;             // primitives that a task puts into cells
constexpr size_t kParallelPrims = 1 << 15;  // grids over fewer are built by one task
constexpr uint64_t kMostReferences = uint64_t{1} << 32;

/// The real cube root, by Newton's method: libm's may differ between machines.
double CubeRoot(double x) {
  if (!(x > 0)) return 0;
  int e = 0;
  std::frexp(x, &e);
  double root = std::ldexp(1.0, (e + 2) / 3);
  for (int i = 0; i < 60; ++i) {
    const double next = (2 * root + x / (root * root)) / 3;
    if (next >= root) break;  // from above it falls until it is right to the last bit
    root = next;
  }
  return root;
}

/// A level and all inside it, before they are laid out together. Cell.first of a leaf counts from refs[0], of
/// a grid inside it is an index of `inside`.
struct Part {
  VoxelGrid::Level level;
  std::vector<VoxelGrid::Tile> tiles;
  std::vector<VoxelGrid::Cell> cells;
  std::vector<uint32_t> refs;
  std::vector<Part> inside;
};

class Builder {
 public:
  Builder(const Insertion& insertion, const rb_build_options& options, const GridOptions& grid)
      : insertion_(insertion), options_(options), grid_(grid) {}

  Part BuildRoot() {
    std::vector<uint32_t> all(insertion_.size());
    for (size_t i = 0; i < all.size(); ++i) all[i] = uint32_t(i);
    Part part;
    part.level = Choose(insertion_.Scene(), all, grid_.references, true);
    Build(all, 1, grid_.references, part);
    return part;
  }

 private:
  using Level = VoxelGrid::Level;

  struct CellRange {
    int32_t lo[3], hi[3];  // inclusive
    uint64_t Cells() const {
      uint64_t n = 1;
      for (int a = 0; a < 3; ++a) n *= uint64_t(hi[a] - lo[a] + 1);
      return n;
    }
  };
  CellRange RangeOf(const Level& level, uint32_t prim) const {
    const Bounds3& box = insertion_.Box(prim);
    CellRange r;
    for (int a = 0; a < 3; ++a) {
      r.lo[a] = level.Index(a, double(box.lo[a]) - insertion_.slack());
      r.hi[a] = level.Index(a, double(box.hi[a]) + insertion_.slack());
    }
    return r;
  }

  /// fn(dense index of the cell) for each cell that the primitive goes into.
  template <class Fn>
  void ForEachCell(const Level& level, uint32_t prim, Fn&& fn) const {
    const CellRange r = RangeOf(level, prim);
    const bool exact = insertion_.IsExact(prim) && r.Cells() > 1;
    int32_t c[3];
    for (c[2] = r.lo[2]; c[2] <= r.hi[2]; ++c[2]) {
      for (c[1] = r.lo[1]; c[1] <= r.hi[1]; ++c[1]) {
        for (c[0] = r.lo[0]; c[0] <= r.hi[0]; ++c[0]) {
          if (exact) {
            Vec3d lo, hi;
            for (int a = 0; a < 3; ++a)
              lo[a] = level.lo[a] + c[a] * level.width[a], hi[a] = level.lo[a] + (c[a] + 1) * level.width[a];
            if (!insertion_.TriangleMeets(prim, lo, hi)) continue;
          }
          fn(size_t(c[0]) + size_t(level.res[0]) * (size_t(c[1]) + size_t(level.res[1]) * size_t(c[2])));
        }
      }
    }
  }

  /// fn(prim) in parallel chunks, or in order where there are few.
  template <class Fn>
  void ForEachPrim(std::span<const uint32_t> prims, Fn&& fn) const {
    auto run = [&](size_t begin, size_t end) {
      CheckCancel(options_.cancel);
      for (size_t i = begin; i < end; ++i) fn(prims[i]);
    };
    if (prims.size() < kParallelPrims) return run(0, prims.size());
    ParallelFor(Range<size_t>(0, prims.size(), kChunk),
                [&](const auto& range) { run(range.begin(), range.end()); });
  }

  uint64_t BoxReferences(const Level& level, std::span<const uint32_t> prims) const {
    return ParallelReduce(
        Range<size_t>(0, prims.size(), kParallelPrims), uint64_t{0},
        [&](const auto& range, uint64_t sum) {
          for (size_t i = range.begin(); i < range.end(); ++i) sum += RangeOf(level, prims[i]).Cells();
          return sum;
        },
        [](uint64_t a, uint64_t b) { return a + b; });
  }

  /// The resolution that the rule gives for about `cells` cells.
  void Rule(const Bounds3& box, double cells, int32_t (&res)[3]) const {
    const Vec3f e = box.Extent();
    const double longest = std::max({e.x, e.y, e.z});
    double size = longest;  // of a cell
    if (grid_.rule == GridRule::kHeterogeneous) {
      // Axes along which the box is thinner than a cell have one; the others share the cells.
      double product = 1;
      int axes = 0;
      bool thin[3] = {!(e[0] > 0), !(e[1] > 0), !(e[2] > 0)};
      for (bool changed = true; changed;) {
        changed = false, product = 1, axes = 0;
        for (int a = 0; a < 3; ++a) {
          if (!thin[a]) product *= e[a] / longest, ++axes;
        }
        const double volume = product / cells;
        size = longest * (axes == 3 ? CubeRoot(volume) : axes == 2 ? std::sqrt(volume) : volume);
        for (int a = 0; a < 3; ++a) {
          if (!thin[a] && e[a] < size && axes > 1) thin[a] = changed = true;
        }
      }
    } else {
      size = longest / std::max(CubeRoot(cells), 1.0);
    }
    for (int a = 0; a < 3; ++a) {
      const double n = !(e[a] > 0) ? 1 : grid_.rule == GridRule::kRegular ? CubeRoot(cells) : e[a] / size;
      res[a] = int32_t(std::min(std::max(std::floor(n + 0.5), 1.0), double(VoxelGrid::kMaxResolution)));
    }
  }

  Level Choose(const Bounds3& box, std::span<const uint32_t> prims, double references, bool outermost) const {
    // By the rule, and ever coarser while primitives would stand in too many cells: what many large
    // primitives cost is bounded by this. Exact overlap leaves some out, but has to look at all.
    const double allowed = references * (grid_.exact ? 4 : 1) * double(prims.size());
    for (double cells = std::max(1.0, grid_.density * double(prims.size()));; cells /= 2) {
      int32_t res[3];
      Rule(box, cells, res);
      bool given = true;
      for (int a = 0; a < 3; ++a) {
        if (outermost && grid_.resolution[a] > 0) {
          res[a] = int32_t(grid_.resolution[a]);
        } else {
          given = false;
        }
      }
      const Level level(box, res);
      if (given || cells < 2 || double(BoxReferences(level, prims)) <= allowed) return level;
    }
  }

  /// Adds to what all of the grid takes. Throws beyond the limit.
  void Account(uint64_t bytes, uint64_t references) {
    bytes_ += bytes;
    RequireWithinLimit(bytes_ + insertion_.bytes(), options_);
    if ((references_ += references) >= kMostReferences)
      throw std::runtime_error("more than 2^32 references: lower the resolution");
  }

  /// Fills part.level with the primitives, each of which may be referred to `allowed` times on average by all
  /// that is built here: what a level takes of that is not there for the grids inside.
  void Build(std::span<const uint32_t> prims, uint32_t depth, double allowed, Part& part) {
    const Level& level = part.level;
    const uint64_t cells = level.Cells();
    if (cells >= kMostReferences || level.Tiles() >= (uint64_t{1} << 31))
      throw std::runtime_error(fmt::format("{} cells are too many: lower the resolution", cells));
    Account(cells * sizeof(uint32_t) + level.Tiles() * sizeof(VoxelGrid::Tile), 0);
    if (!grid_.exact && BoxReferences(level, prims) >= kMostReferences)
      throw std::runtime_error("more than 2^32 references: lower the resolution");

    // Counting sort: how many go into each cell, where its part begins, then fill it.
    const bool parallel = prims.size() >= kParallelPrims;
    std::vector<uint32_t> ends(cells, 0);
    ForEachPrim(prims, [&](uint32_t prim) {
      ForEachCell(level, prim, [&](size_t cell) {
        parallel ? std::atomic_ref(ends[cell]).fetch_add(1, std::memory_order_relaxed) : ends[cell]++;
      });
    });
    uint64_t references = 0, blocks = 0;
    size_t filled = 0;
    for (uint32_t count : ends)
      references += count, blocks += LeafBlocks<>::BlocksOf(count), filled += count > 0;
    Account(references * sizeof(uint32_t) + blocks * sizeof(LeafBlocks<>::Block) +
                filled * sizeof(VoxelGrid::Cell),
            references);

    part.tiles.resize(level.Tiles());
    part.cells.reserve(filled);
    uint32_t sum = 0;
    ForEachTile(
        level,
        [&](VoxelGrid::Tile& tile, uint64_t bit, size_t cell) {
          const uint32_t count = ends[cell];
          ends[cell] = sum;  // its beginning, until it is filled
          if (count == 0) return;
          if (tile.mask == 0) tile.first = uint32_t(part.cells.size());
          tile.mask |= bit;
          part.cells.push_back({sum, count});
          sum += count;
        },
        part.tiles);
    part.refs.resize(references);
    ForEachPrim(prims, [&](uint32_t prim) {
      ForEachCell(level, prim, [&](size_t cell) {
        const uint32_t at =
            parallel ? std::atomic_ref(ends[cell]).fetch_add(1, std::memory_order_relaxed) : ends[cell]++;
        part.refs[at] = prim;
      });
    });
    ends = {};
    if (parallel) {  // threads came in any order
      ParallelFor(Range<size_t>(0, part.cells.size(), 4096), [&](const auto& range) {
        for (size_t i = range.begin(); i < range.end(); ++i) {
          const auto first = part.refs.begin() + part.cells[i].first;
          if (part.cells[i].count > 1) std::sort(first, first + part.cells[i].count);
        }
      });
    }
    const double left = allowed * double(prims.size()) / double(std::max<uint64_t>(references, 1));
    if (depth < grid_.levels && cells > 1 && left > 1) BuildInside(depth, left, part);
  }

  /// fn(tile, bit, dense index) for every cell, tile by tile, in the order of bits.
  template <class Fn>
  static void ForEachTile(const Level& level, Fn&& fn, std::vector<VoxelGrid::Tile>& tiles) {
    int32_t t[3], c[3];
    size_t tile = 0;
    for (t[2] = 0; t[2] < level.res[2]; t[2] += 4) {
      for (t[1] = 0; t[1] < level.res[1]; t[1] += 4) {
        for (t[0] = 0; t[0] < level.res[0]; t[0] += 4, ++tile) {
          for (c[2] = t[2]; c[2] < std::min(t[2] + 4, level.res[2]); ++c[2]) {
            for (c[1] = t[1]; c[1] < std::min(t[1] + 4, level.res[1]); ++c[1]) {
              for (c[0] = t[0]; c[0] < std::min(t[0] + 4, level.res[0]); ++c[0]) {
                fn(tiles[tile], uint64_t{1} << Level::BitOf(c),
                   size_t(c[0]) +
                       size_t(level.res[0]) * (size_t(c[1]) + size_t(level.res[1]) * size_t(c[2])));
              }
            }
          }
        }
      }
    }
  }

  /// Whether a grid would at least halve the tests of a line through its box: a cell is met by lines in
  /// proportion to its surface (MacDonald and Booth 1990). Not where most primitives lie across all of it.
  bool Pays(const Level& level, std::span<const uint32_t> prims) const {
    const double x = level.width[0], y = level.width[1], z = level.width[2];
    const double cell = x * y + y * z + z * x, all = level.box.HalfArea();
    return cell * double(BoxReferences(level, prims)) < 0.5 * all * double(prims.size());
  }

  /// Grids inside cells that hold too many.
  void BuildInside(uint32_t depth, double references, Part& part) {
    struct Candidate {
      size_t cell;
      Bounds3 box;
    };
    std::vector<Candidate> candidates;
    int32_t c[3];
    for (c[2] = 0; c[2] < part.level.res[2]; ++c[2]) {
      for (c[1] = 0; c[1] < part.level.res[1]; ++c[1]) {
        for (c[0] = 0; c[0] < part.level.res[0]; ++c[0]) {
          const VoxelGrid::Tile& tile = part.tiles[part.level.TileOf(c)];
          const uint64_t bit = uint64_t{1} << Level::BitOf(c);
          if ((tile.mask & bit) == 0) continue;
          const size_t cell = tile.first + unsigned(__builtin_popcountll(tile.mask & (bit - 1)));
          if (part.cells[cell].count > grid_.leaf_size)
            candidates.push_back({cell, part.level.InnerBox(c, insertion_.slack())});
        }
      }
    }
    std::vector<Part> inside(candidates.size());
    ParallelFor(Range<size_t>(0, candidates.size(), 1), [&](const auto& range) {
      for (size_t i = range.begin(); i < range.end(); ++i) {
        const VoxelGrid::Cell& cell = part.cells[candidates[i].cell];
        const auto held = std::span(part.refs).subspan(cell.first, cell.count);
        inside[i].level = Choose(candidates[i].box, held, references, false);
        if (Pays(inside[i].level, held)) Build(held, depth + 1, references, inside[i]);
      }
    });
    for (size_t i = 0; i < inside.size(); ++i) {
      if (inside[i].tiles.empty()) continue;
      part.cells[candidates[i].cell] = {uint32_t(part.inside.size()), VoxelGrid::kInner};
      part.inside.push_back(std::move(inside[i]));
    }
  }

  const Insertion& insertion_;
  const rb_build_options& options_;
  const GridOptions& grid_;
  std::atomic<uint64_t> bytes_{0}, references_{0};
};

}  // namespace

VoxelGrid::VoxelGrid(const rb_geometry& geometry, const rb_build_options& options, const GridOptions& grid)
    : geometry_(geometry), exact_(grid.exact) {
  const Insertion insertion(geometry, grid.exact, grid.padded);
  const Part root = Builder(insertion, options, grid).BuildRoot();

  // Lay all levels out, a level before those inside it.
  struct Placed {
    const Part* part;
    size_t tile, cell;
  };
  std::vector<Placed> placed{{&root, 0, 0}};
  std::vector<size_t> first_inside;
  size_t tiles = 0, cells = 0;
  for (size_t i = 0; i < placed.size(); ++i) {
    const Part& part = *placed[i].part;
    placed[i].tile = tiles, placed[i].cell = cells;
    tiles += part.tiles.size(), cells += part.cells.size();
    first_inside.push_back(placed.size());
    for (const Part& inner : part.inside) placed.push_back({&inner, 0, 0});
  }
  if (tiles >= (uint64_t{1} << 32)) throw std::runtime_error("too many cells: lower the resolution");
  tiles_ = HugeArray<Tile>(tiles);
  cells_ = HugeArray<Cell>(cells);
  std::vector<size_t> first_block(placed.size() + 1, 0);
  for (size_t i = 0; i < placed.size(); ++i) {
    const auto& [part, tile, cell] = placed[i];
    levels_.push_back(part->level);
    levels_.back().tile = uint32_t(tile);
    for (size_t k = 0; k < part->tiles.size(); ++k) {
      tiles_[tile + k] = part->tiles[k];
      tiles_[tile + k].first += uint32_t(cell);
    }
    size_t block = first_block[i];
    for (size_t k = 0; k < part->cells.size(); ++k) {
      Cell& to = cells_[cell + k] = part->cells[k];
      if (to.count == kInner) {
        to.first += uint32_t(first_inside[i]);
      } else {
        to.first = uint32_t(block), block += LeafBlocks<>::BlocksOf(to.count);
      }
    }
    first_block[i + 1] = block;
  }
  blocks_ = LeafBlocks<>(geometry, first_block.back());
  ParallelFor(Range<size_t>(0, placed.size(), 1), [&](const auto& range) {
    for (size_t i = range.begin(); i < range.end(); ++i) {
      const Part& part = *placed[i].part;
      ParallelFor(Range<size_t>(0, part.cells.size(), 4096), [&](const auto& some) {
        for (size_t k = some.begin(); k < some.end(); ++k) {
          const Cell& from = part.cells[k];
          if (from.count == kInner) continue;
          blocks_.Fill(cells_[placed[i].cell + k].first,
                       std::span(part.refs).subspan(from.first, from.count));
        }
      });
    }
  });
}

}  // namespace raybench
