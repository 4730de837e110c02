#include "accel/kd/build.h"

#include <algorithm>
#include <array>
#include <bit>
#include <stdexcept>

#include "accel/base/lifo_memory.h"
#include "accel/base/parallel.h"
#include "accel/contract/cancel.h"
#include "accel/kd/events.h"
#include "accel/ray/bounds.h"

namespace raybench {
namespace {

constexpr size_t kTask = size_t{1} << 12;           // cells with as many primitives have tasks of their own
constexpr size_t kParallelBlock = size_t{1} << 13;  // primitives handled by one task in larger cells
constexpr uint32_t kSweepBelow = 64;                // `binned` sweeps cells of no more primitives

/// A cell to build, whose lists belong to its parent's frame.
struct Cell {
  Bounds3 box;
  uint32_t depth;
  uint64_t spare;  // duplicates that may still be made
  std::span<KdRef> refs;
  std::span<KdEvent> events[3];  // not made where nothing is swept

  uint32_t size() const { return uint32_t(refs.size()); }
  bool HasEvents() const { return events[0].data() != nullptr; }
};

/// Calls fn(axis) for the three axes, at once where the cell is large.
template <class Fn>
void ForAxes(size_t prims, Fn&& fn) {
  if (prims < kTask) {
    for (int axis = 0; axis < 3; ++axis) fn(axis);
  } else {
    ParallelFor(0, 3, fn);
  }
}

std::array<int, 3> AxisOrder(KdAxisRule rule, const Cell& cell) {
  std::array<int, 3> axes = {0, 1, 2};
  if (rule == KdAxisRule::kCyclic) std::rotate(axes.begin(), axes.begin() + cell.depth % 3, axes.end());
  if (rule == KdAxisRule::kLargest) {
    const Vec3f e = cell.box.Extent();
    std::stable_sort(axes.begin(), axes.end(), [&](int a, int b) { return e[a] > e[b]; });
  }
  return axes;
}

/// How many primitives start and end in each of evenly spaced bins.
struct MinMaxBins {
  uint32_t starts[3][kMaxKdBins], ends[3][kMaxKdBins];

  explicit MinMaxBins(uint32_t bins) {
    for (int a = 0; a < 3; ++a) {
      std::fill_n(starts[a], bins, 0);
      std::fill_n(ends[a], bins, 0);
    }
  }
  void Merge(const MinMaxBins& o, uint32_t bins) {
    for (int a = 0; a < 3; ++a) {
      for (uint32_t b = 0; b < bins; ++b) {
        starts[a][b] += o.starts[a][b];
        ends[a][b] += o.ends[a][b];
      }
    }
  }
};

class Builder {
 public:
  Builder(const rb_geometry& geometry, const KdOptions& options, uint64_t memory_limit,
          const volatile int* cancel)
      : geometry_(geometry),
        options_(options),
        memory_limit_(memory_limit),
        cancel_(cancel),
        meter_(memory_limit) {
    const uint32_t depth = options.max_depth > 0 ? options.max_depth : DefaultKdDepth(PrimCount(geometry));
    max_depth_ = std::min(depth, KdTree::kMaxDepth - 1);
  }

  KdTree Build() {
    const uint64_t n = PrimCount(geometry_);
    if (n == 0) return {};
    if (n > kMaxKdRefs) throw std::runtime_error("a kd-tree takes fewer than 2^30 primitives");
    KdSubtree built;
    Bounds3 box;
    {
      LifoMemory memory(meter_);
      Cell root{{}, 0, uint64_t(options_.duplication * double(n)), memory.Take<KdRef>(n), {}};
      root.box = MakeRefs(root.refs);
      box = root.box;
      Recurse(root, memory, built);
    }
    return KdTree(geometry_, box, built, memory_limit_);
  }

 private:
  Bounds3 MakeRefs(std::span<KdRef> refs) {
    return ParallelReduce(
        Range<size_t>(0, refs.size(), kParallelBlock), Bounds3{},
        [&](const auto& block, Bounds3 sum) {
          for (size_t i = block.begin(); i < block.end(); ++i) {
            const uint32_t id = uint32_t(i);
            refs[i] = {options_.padded ? PaddedPrimBounds(geometry_, id) : PrimBounds(geometry_, id), id};
            sum.Extend(refs[i].box);
          }
          return sum;
        },
        [](Bounds3 a, const Bounds3& b) {
          a.Extend(b);
          return a;
        });
  }

  void Recurse(Cell& cell, LifoMemory& memory, KdSubtree& out) {
    const size_t n = cell.size();
    if (n >= kTask) CheckCancel(cancel_);
    const LifoMemory::Frame frame(memory);
    Cell left, right;
    KdPlane plane;
    if (n <= options_.leaf_size || cell.depth >= max_depth_ || !Choose(cell, memory, plane) ||
        !Split(cell, plane, memory, left, right)) {
      out.nodes.push_back(KdNode::Leaf(uint32_t(out.prims.size()), uint32_t(n)));
      for (const KdRef& ref : cell.refs) out.prims.push_back(ref.prim);
      return;
    }
    const size_t slot = out.nodes.size();
    out.nodes.push_back(KdNode::Inner(plane.axis, plane.pos));
    if (n < kTask) {
      Recurse(left, memory, out);
      SetRight(out, slot);
      Recurse(right, memory, out);
      return;
    }
    KdSubtree right_out;
    ParallelInvoke([&] { BuildTask(left, memory, out); },
                   [&] {
                     LifoMemory own(meter_);
                     BuildTask(right, own, right_out);
                   });
    SetRight(out, slot);
    Append(right_out, out);
  }

  void BuildTask(Cell& cell, LifoMemory& memory, KdSubtree& out) {
    const uint64_t before = out.bytes();
    Recurse(cell, memory, out);
    if (cell.size() < kTask) meter_.Take(out.bytes() - before);  // larger ones consist of such
  }

  static void SetRight(KdSubtree& out, size_t slot) {
    if (out.nodes.size() >= KdTree::kMaxNodes) throw std::runtime_error("the kd-tree has too many nodes");
    out.nodes[slot].SetRight(out.nodes.size() - slot);
  }

  static void Append(const KdSubtree& from, KdSubtree& to) {
    const uint32_t prims = uint32_t(to.prims.size());
    for (KdNode node : from.nodes) {
      if (node.IsLeaf()) node.first += prims;
      to.nodes.push_back(node);
    }
    to.prims.insert(to.prims.end(), from.prims.begin(), from.prims.end());
  }

  bool Choose(Cell& cell, LifoMemory& memory, KdPlane& plane) {
    switch (options_.method) {
      case KdMethod::kSpatialMedian:
        return Median(cell, plane, [&](int axis) {
          return float(0.5 * (double(cell.box.lo[axis]) + double(cell.box.hi[axis])));
        });
      case KdMethod::kObjectMedian: {
        const LifoMemory::Frame frame(memory);
        const std::span<float> centres = memory.Take<float>(cell.size());
        return Median(cell, plane, [&](int axis) {
          for (size_t i = 0; i < centres.size(); ++i)
            centres[i] = 0.5f * (cell.refs[i].box.lo[axis] + cell.refs[i].box.hi[axis]);
          const auto middle = centres.begin() + std::ptrdiff_t(centres.size() / 2);
          std::nth_element(centres.begin(), middle, centres.end());
          return *middle;
        });
      }
      case KdMethod::kBinned:
        if (cell.size() > kSweepBelow) {
          const Binned binned = Bin(cell);
          return Cheapest(cell, plane, [&](int axis) { return CheapestOfBins(cell, binned, axis); });
        }
        break;
      case KdMethod::kSweep:
        break;
    }
    if (!cell.HasEvents()) MakeEvents(cell, memory);
    return Cheapest(cell, plane, [&](int axis) {
      return SweepKdEvents(cell.events[axis], cell.size(), KdAxisCost(options_.costs, cell.box, axis));
    });
  }

  /// The first axis on which the plane that `at` names does not cut everything.
  template <class At>
  bool Median(const Cell& cell, KdPlane& plane, At&& at) {
    for (int axis : AxisOrder(options_.axis, cell)) {
      plane.axis = axis;
      plane.pos = at(axis);
      if (!(cell.box.lo[axis] < plane.pos && plane.pos < cell.box.hi[axis])) continue;
      if (!std::all_of(cell.refs.begin(), cell.refs.end(),
                       [&](const KdRef& r) { return plane.GoesLeft(r) && plane.GoesRight(r); })) {
        return true;
      }
    }
    return false;
  }

  /// The cheapest plane, best(axis) on each axis, if it is cheaper than a leaf.
  template <class Best>
  bool Cheapest(const Cell& cell, KdPlane& plane, Best&& best) {
    const float leaf = KdLeafCost(options_.costs, cell.box, cell.size());
    if (options_.axis != KdAxisRule::kBest) {
      for (int axis : AxisOrder(options_.axis, cell)) {
        plane = best(axis);
        if (plane.cost < leaf) return true;
      }
      return false;
    }
    KdPlane planes[3];
    ForAxes(cell.size(), [&](int axis) { planes[axis] = best(axis); });
    plane = planes[0];
    plane.Take(planes[1]);
    plane.Take(planes[2]);
    return plane.cost < leaf;
  }

  void MakeEvents(Cell& cell, LifoMemory& memory) {
    for (std::span<KdEvent>& events : cell.events) events = memory.Take<KdEvent>(2 * cell.refs.size());
    ForAxes(cell.size(), [&](int axis) {
      std::span<KdEvent>& events = cell.events[axis];
      size_t used = 0;
      for (uint32_t i = 0; i < cell.size(); ++i)
        used += WriteKdEvents(cell.refs[i].box, axis, i, &events[used]);
      events = events.first(used);
      if (cell.size() < kTask) {
        std::sort(events.begin(), events.end());
      } else {
        ParallelSort(events.begin(), events.end());
      }
    });
  }

  struct Binned {
    Bounds3 all;  // around what the cell holds
    MinMaxBins counts;
  };

  Binned Bin(const Cell& cell) const {
    const uint32_t bins = options_.bins;
    Bounds3 all;
    for (const KdRef& ref : cell.refs) all.Extend(ref.box);
    Float4 origin{}, scale{};
    for (int a = 0; a < 3; ++a) {
      const float s = float(bins) / (all.hi[a] - all.lo[a]);
      origin[a] = all.lo[a];
      scale[a] = s <= std::numeric_limits<float>::max() ? s : 0;
    }
    const int32_t last = int32_t(bins) - 1;
    auto add = [&](const auto& range, MinMaxBins sum) {
      for (size_t i = range.begin(); i < range.end(); ++i) {
        const Bounds3& box = cell.refs[i].box;
        const Int4 lo = __builtin_convertvector((Load<Float4>(&box.lo.x) - origin) * scale, Int4);
        const Int4 hi = __builtin_convertvector((Load<Float4>(&box.hi.x) - origin) * scale, Int4);
        for (int a = 0; a < 3; ++a) {
          ++sum.starts[a][std::min(lo[a], last)];
          ++sum.ends[a][std::min(hi[a], last)];
        }
      }
      return sum;
    };
    const Range<size_t> whole(0, cell.refs.size(), kParallelBlock);
    if (cell.size() < kTask) return {all, add(whole, MinMaxBins(bins))};
    return {all, ParallelReduce(whole, MinMaxBins(bins), add, [&](MinMaxBins a, const MinMaxBins& b) {
              a.Merge(b, bins);
              return a;
            })};
  }

  /// Of the planes between bins, and at either end of what the cell holds.
  KdPlane CheapestOfBins(const Cell& cell, const Binned& binned, int axis) const {
    const KdAxisCost cost(options_.costs, cell.box, axis);
    const uint32_t bins = options_.bins;
    const float lo = binned.all.lo[axis], hi = binned.all.hi[axis];
    KdPlane best;
    uint32_t left = 0, right = cell.size();
    for (uint32_t plane = 0; plane <= bins; ++plane) {
      const float pos = plane == bins ? hi : lo + (hi - lo) * (float(plane) / float(bins));
      if (cost.Splits(pos)) best.Take(cost(pos, left, right, plane > 0));
      if (plane < bins) {
        left += binned.counts.starts[axis][plane];
        right -= binned.counts.ends[axis][plane];
      }
    }
    return best;
  }

  /// False if that would make more duplicates than the cell may.
  bool Split(const Cell& cell, const KdPlane& plane, LifoMemory& memory, Cell& left, Cell& right) {
    uint32_t lefts = 0, rights = 0;
    for (const KdRef& ref : cell.refs) {
      lefts += plane.GoesLeft(ref);
      rights += plane.GoesRight(ref);
    }
    const uint32_t cut = lefts + rights - cell.size();
    if (cut > cell.spare) return false;

    left.depth = right.depth = cell.depth + 1;
    left.box = right.box = cell.box;
    left.box.hi[plane.axis] = right.box.lo[plane.axis] = plane.pos;
    left.refs = memory.Take<KdRef>(lefts);
    right.refs = memory.Take<KdRef>(rights);
    if (cell.HasEvents()) {
      for (int axis = 0; axis < 3; ++axis) {
        left.events[axis] = memory.Take<KdEvent>(2 * size_t(lefts) + 1);
        right.events[axis] = memory.Take<KdEvent>(2 * size_t(rights) + 1);
      }
    }
    const LifoMemory::Frame frame(memory);
    const std::span<KdPlace> places = memory.Take<KdPlace>(cell.HasEvents() ? cell.size() : 0);
    const std::span<uint32_t> fresh_left = memory.Take<uint32_t>(cut),
                              fresh_right = memory.Take<uint32_t>(cut);
    uint32_t l = 0, r = 0, fresh_l = 0, fresh_r = 0;
    for (uint32_t i = 0; i < cell.size(); ++i) {
      const KdRef& ref = cell.refs[i];
      KdPlace place = KdPlace::Anew();
      if (!plane.GoesRight(ref)) {
        place = KdPlace::Left(l);
        left.refs[l++] = ref;
      } else if (!plane.GoesLeft(ref)) {
        place = KdPlace::Right(r);
        right.refs[r++] = ref;
      } else {
        const KdParts parts =
            SplitRef(geometry_, ref, plane.axis, left.box, right.box, options_.clip, options_.padded);
        if (!parts.left.Empty()) {
          fresh_left[fresh_l++] = l;
          left.refs[l++] = {parts.left, ref.prim};
        }
        if (!parts.right.Empty()) {
          fresh_right[fresh_r++] = r;
          right.refs[r++] = {parts.right, ref.prim};
        }
      }
      if (!places.empty()) places[i] = place;
    }
    left.refs = left.refs.first(l);
    right.refs = right.refs.first(r);
    if (cell.HasEvents()) {
      std::span<KdEvent> fresh[2][3];
      for (int axis = 0; axis < 3; ++axis) {
        fresh[0][axis] = memory.Take<KdEvent>(2 * size_t(fresh_l));
        fresh[1][axis] = memory.Take<KdEvent>(2 * size_t(fresh_r));
      }
      ForAxes(cell.size(), [&](int axis) {
        auto write = [&](const Cell& child, std::span<const uint32_t> from, std::span<KdEvent>& to) {
          size_t used = 0;
          for (uint32_t ref : from) used += WriteKdEvents(child.refs[ref].box, axis, ref, &to[used]);
          to = to.first(used);
        };
        write(left, fresh_left.first(fresh_l), fresh[0][axis]);
        write(right, fresh_right.first(fresh_r), fresh[1][axis]);
        const KdEventCounts counts = SplitKdEvents(cell.events[axis], places, fresh[0][axis], fresh[1][axis],
                                                   left.events[axis].data(), right.events[axis].data());
        left.events[axis] = left.events[axis].first(counts.left);
        right.events[axis] = right.events[axis].first(counts.right);
      });
    }

    const uint64_t sum =
        uint64_t(l) + r;  // at most cut more than there were; fewer, if clipping left nothing
    const uint64_t spare = cell.spare - (sum > cell.size() ? sum - cell.size() : 0);
    left.spare = sum == 0 ? 0 : uint64_t(double(spare) * double(l) / double(sum));
    right.spare = spare - left.spare;
    return true;
  }

  rb_geometry geometry_;
  KdOptions options_;
  uint32_t max_depth_;
  uint64_t memory_limit_;
  const volatile int* cancel_;
  MemoryMeter meter_;
};

}  // namespace

uint32_t DefaultKdDepth(uint64_t n) {
  return 8 + 13 * uint32_t(std::bit_width(std::max<uint64_t>(n, 1)) - 1) / 10;
}

KdTree BuildKdTree(const rb_geometry& geometry, const KdOptions& options, uint64_t memory_limit,
                   const volatile int* cancel) {
  return Builder(geometry, options, memory_limit, cancel).Build();
}

}  // namespace raybench
