#include "accel/bvh/spatial_sah.h"

#include "accel/base/parallel.h"
#include "accel/bvh/binning.h"
#include "accel/bvh/node_store.h"

namespace raybench {
namespace {

/// The corners of double-precision boxes, to be rounded outward.
struct Part {
  Vec3d lo{HUGE_VAL, HUGE_VAL, HUGE_VAL}, hi{-HUGE_VAL, -HUGE_VAL, -HUGE_VAL};

  void Extend(Vec3d p) {
    lo = Min(lo, p);
    hi = Max(hi, p);
  }
};

float RoundDown(double x) {
  const float f = float(x);
  return double(f) > x ? std::nextafter(f, -std::numeric_limits<float>::infinity()) : f;
}

class SpatialBuilder {
 public:
  SpatialBuilder(const rb_geometry& geometry, const SpatialSahOptions& options, const volatile int* cancel)
      : geometry_(geometry),
        costs_(options.costs),
        padded_(options.padded),
        bins_(options.bins),
        references_(SpatialSahCapacity(PrimCount(geometry), options.budget)),
        scratch_(references_.size()) {
    tree_.clipped = true;
    tree_.order = HugeArray<uint32_t>(references_.size());
    const RecordRange all = MakeRecords(geometry, padded_, references_);
    root_area_ = all.box.HalfArea();
    NodeStore store(references_.size());
    const NodeStore::Subtree nodes = BuildDown(
        Work{all, references_.size(), 0}, [this](auto&&... of) { return Divide(of...); }, store, cancel);
    references_ = {}, scratch_ = {};
    tree_.nodes = store.Take(nodes);
  }
  BinaryTree Take() { return std::move(tree_); }

 private:
  static constexpr float kOverlap = 1e-5f;

  /// Equal slices of a node's box along each axis. A reference enters in one and leaves in another.
  struct Slices {
    Float4 origin, scale;
    float width[3];
    uint32_t count;

    Slices(const Box4& box, uint32_t bins) : origin(box.lo), count(bins) {
      const Float4 extent = box.hi - box.lo;
      for (int a = 0; a < 3; ++a) {
        const float s = float(bins) / extent[a];
        scale[a] = extent[a] > 0 && s <= std::numeric_limits<float>::max() ? s : 0;
        width[a] = extent[a] / float(bins);
      }
      scale[3] = 0;
    }
    bool Usable(int axis) const { return scale[axis] > 0; }
    uint32_t Of(float x, int axis) const {
      return uint32_t(std::clamp((x - origin[axis]) * scale[axis], 0.0f, float(count - 1)));
    }
    float Plane(uint32_t slice, int axis) const { return origin[axis] + width[axis] * float(slice); }
  };

  struct SliceBins {
    Box4 box[3][kMaxBins];
    uint32_t enter[3][kMaxBins], leave[3][kMaxBins];

    explicit SliceBins(uint32_t bins) {
      for (int a = 0; a < 3; ++a) {
        for (uint32_t b = 0; b < bins; ++b) {
          box[a][b] = Box4::Empty();
          enter[a][b] = leave[a][b] = 0;
        }
      }
    }
    void Merge(const SliceBins& o, uint32_t bins) {
      for (int a = 0; a < 3; ++a) {
        for (uint32_t b = 0; b < bins; ++b) {
          box[a][b].Extend(o.box[a][b]);
          enter[a][b] += o.enter[a][b];
          leave[a][b] += o.leave[a][b];
        }
      }
    }
  };

  /// A plane in front of slice `bin`, with what would lie on either side.
  struct SpatialSplit : Split {
    uint32_t lefts = 0, rights = 0;
  };

  /// A triangle as planes across an axis see it.
  class Edges {
   public:
    struct Corners {
      Float4 p[3];
    };

    Edges(const Corners& corners, int axis) : corners_(corners), axis_(axis) {
      for (int i = 0; i < 3; ++i) {
        along_[i] = corners.p[(i + 1) % 3] - corners.p[i];
        per_unit_[i] = 1 / along_[i][axis];
      }
    }
    /// The box around what lies in a plane.
    Box4 Crossing(float plane) const {
      Box4 box = Box4::Empty();
      for (int i = 0; i < 3; ++i) {
        const float a = corners_.p[i][axis_], b = corners_.p[(i + 1) % 3][axis_];
        if ((a < plane) != (b < plane)) {
          const Float4 p = corners_.p[i] + along_[i] * ((plane - a) * per_unit_[i]);
          box.Extend({p, p});
        }
      }
      return box;
    }
    /// The box around the corners between two planes.
    Box4 Between(float from, float to) const {
      Box4 box = Box4::Empty();
      for (const Float4& p : corners_.p) {
        if (p[axis_] >= from && p[axis_] <= to) box.Extend({p, p});
      }
      return box;
    }

   private:
    Corners corners_;
    int axis_;
    Float4 along_[3];
    float per_unit_[3];
  };

  struct Work {
    RecordRange range;
    size_t limit;  // where the room of the range's subtree ends
    uint32_t depth;

    size_t size() const { return range.size(); }
    size_t room() const { return limit - range.begin; }
  };

  /// As BuildDown() wants it.
  bool Divide(const Work& work, BuildNode& node, Work& left_work, Work& right_work) {
    const auto& [range, limit, depth] = work;
    const size_t n = range.size();
    SetBounds(node, range.box);
    const Binning binning(range.centroids, std::min(bins_, uint32_t(4 + n / 4)));
    const Slices slices(range.box, bins_);
    Split object;
    SpatialSplit spatial;
    if (n > 1 && depth < kSahDepth) {
      BlockBins blocks;
      object = FindSplit(&references_[0], range, binning, costs_, blocks);
      if (limit > range.end && (object.axis < 0 || Overlap(object) > kOverlap * root_area_))
        spatial = FindSpatial(range, limit - range.end, slices);
    }
    const float cost = std::min(object.cost, spatial.cost);
    if (n == 1 || (n <= costs_.leaf_size && !costs_.Pays(cost, n, range.box.HalfArea()))) {
      for (size_t i = range.begin; i < range.end; ++i) tree_.order[i] = references_[i].id();
      SetLeaf(node, range.begin, n);
      return false;
    }

    RecordRange left{range.begin, range.begin}, right{range.end, range.end};
    bool is_split = false;
    if (spatial.cost < object.cost) is_split = PartitionSpace(range, slices, spatial, left, right);
    if (!is_split) PartitionObjects(range, binning, object, left, right);
    const size_t room = limit - range.begin - left.size() - right.size();
    const size_t left_limit =
        left.end + size_t(double(room) * double(left.size()) / double(left.size() + right.size()));
    std::memcpy(static_cast<void*>(&references_[left_limit]), &scratch_[range.begin],
                right.size() * sizeof(Record));
    right.end = left_limit + right.size();
    right.begin = left_limit;
    left_work = {left, left_limit, depth + 1}, right_work = {right, limit, depth + 1};
    return true;
  }

  static float Overlap(const Split& split) {
    const Float4 lo = Larger<4>(split.left.lo, split.right.lo),
                 hi = Smaller<4>(split.left.hi, split.right.hi);
    return IsEmpty({lo, hi}) ? 0 : Box4{lo, hi}.HalfArea();
  }
  static bool IsEmpty(const Box4& box) { return (Mask(box.lo > box.hi) & 7u) != 0; }

  SpatialSplit FindSpatial(const RecordRange& range, size_t room, const Slices& slices) const {
    auto add = [&](size_t begin, size_t end, SliceBins& bins) {
      for (size_t i = begin; i < end; ++i) {
        for (int a = 0; a < 3; ++a) {
          if (slices.Usable(a)) Add(references_[i], a, slices, bins);
        }
      }
    };
    SliceBins bins(slices.count);
    if (range.size() < kTaskRange) {
      add(range.begin, range.end, bins);
    } else {
      bins = ParallelReduce(
          Range<size_t>(range.begin, range.end, kTaskRange / 2), bins,
          [&](const auto& block, SliceBins sum) {
            add(block.begin(), block.end(), sum);
            return sum;
          },
          [&](SliceBins a, const SliceBins& b) {
            a.Merge(b, slices.count);
            return a;
          });
    }
    return BestPlane(bins, range.size(), room, slices);
  }

  /// Extends the bins of the slices that a reference reaches by its parts there. They are estimates,
  /// in float.
  void Add(const Record& reference, int axis, const Slices& slices, SliceBins& bins) const {
    const uint32_t first = slices.Of(reference.lo[axis], axis), last = slices.Of(reference.hi[axis], axis);
    ++bins.enter[axis][first];
    ++bins.leave[axis][last];
    const Box4 whole{reference.lo, reference.hi};
    if (first == last) {
      bins.box[axis][first].Extend(whole);
      return;
    }
    const bool is_triangle = reference.id() < geometry_.triangle_count;
    const Edges edges(is_triangle ? Triangle(reference.id()) : Edges::Corners{}, axis);
    Box4 crossing = edges.Crossing(reference.lo[axis]);
    float from = reference.lo[axis];
    for (uint32_t b = first; b <= last; ++b) {
      const float to = b < last ? slices.Plane(b + 1, axis) : reference.hi[axis];
      Box4 slab = whole;  // of a procedural primitive nothing is known but its bounds
      slab.lo[axis] = std::max(from, whole.lo[axis]);
      slab.hi[axis] = std::min(to, whole.hi[axis]);
      if (is_triangle) {
        const Box4 next = edges.Crossing(to);
        Box4 part = edges.Between(from, to);
        part.Extend(crossing);
        part.Extend(next);
        slab.lo = Larger<4>(part.lo, slab.lo);
        slab.hi = Smaller<4>(part.hi, slab.hi);
        crossing = next;
      }
      if (!IsEmpty(slab)) bins.box[axis][b].Extend(slab);
      from = to;
    }
  }

  Edges::Corners Triangle(uint32_t prim) const {
    Edges::Corners corners;
    for (int i = 0; i < 3; ++i) {
      const Vec3f v = Vertex(geometry_, prim, i);
      corners.p[i] = Float4{v.x, v.y, v.z, 0};
    }
    return corners;
  }

  SpatialSplit BestPlane(const SliceBins& bins, size_t n, size_t room, const Slices& slices) const {
    SpatialSplit best;
    for (int a = 0; a < 3; ++a) {
      if (!slices.Usable(a)) continue;
      Box4 rights[kMaxBins];
      uint32_t right_count[kMaxBins];
      Box4 box = Box4::Empty();
      uint32_t count = 0;
      for (uint32_t b = slices.count - 1; b > 0; --b) {
        box.Extend(bins.box[a][b]);
        count += bins.leave[a][b];
        rights[b] = box;
        right_count[b] = count;
      }
      box = Box4::Empty();
      count = 0;
      for (uint32_t b = 1; b < slices.count; ++b) {
        box.Extend(bins.box[a][b - 1]);
        count += bins.enter[a][b - 1];
        if (count == 0 || right_count[b] == 0 || count + right_count[b] - n > room) continue;
        if (IsEmpty(box) || IsEmpty(rights[b])) continue;
        const float cost =
            box.HalfArea() * costs_.Blocks(count) + rights[b].HalfArea() * costs_.Blocks(right_count[b]);
        if (cost >= best.cost) continue;
        best.cost = cost;
        best.axis = a;
        best.bin = int(b);
        best.left = box;
        best.right = rights[b];
        best.lefts = count;
        best.rights = right_count[b];
      }
    }
    return best;
  }

  /// The boxes of what lies below and above the plane of the reference's part of its primitive.
  std::pair<Box4, Box4> Cut(const Record& reference, int axis, float plane) const {
    Box4 left{reference.lo, reference.hi}, right = left;
    const uint32_t prim = reference.id();
    if (prim >= geometry_.triangle_count) {  // nothing is known but its bounds
      left.hi[axis] = std::min(left.hi[axis], plane);
      right.lo[axis] = std::max(right.lo[axis], plane);
      return {left, right};
    }
    Vec3d corners[3];
    Bounds3 whole;
    for (int i = 0; i < 3; ++i) {
      const Vec3f corner = Vertex(geometry_, prim, i);
      whole.Extend(corner);
      corners[i] = ToDouble(corner);
    }
    Part below, above;
    for (int i = 0; i < 3; ++i) {
      const Vec3d a = corners[i], b = corners[(i + 1) % 3];
      const double da = a[axis] - plane, db = b[axis] - plane;
      if (da <= 0) below.Extend(a);
      if (da >= 0) above.Extend(a);
      if ((da < 0 && db > 0) || (da > 0 && db < 0)) {
        Vec3d crossing = a + (b - a) * (da / (da - db));
        crossing[axis] = plane;
        below.Extend(crossing);
        above.Extend(crossing);
      }
    }
    const Vec3f extent = whole.Extent();
    return {Clip(left, below, extent), Clip(right, above, extent)};
  }

  Box4 Clip(const Box4& box, const Part& part, Vec3f extent) const {
    if (part.lo.x > part.hi.x) return Box4::Empty();
    Bounds3 b;
    for (int a = 0; a < 3; ++a) {
      b.lo[a] = RoundDown(part.lo[a]);
      b.hi[a] = -RoundDown(-part.hi[a]);
    }
    if (padded_) b = Padded(b, extent);
    const Float4 zero{};  // -0 becomes 0
    return {Larger<4>(Float4{b.lo.x, b.lo.y, b.lo.z, 0} + zero, box.lo),
            Smaller<4>(Float4{b.hi.x, b.hi.y, b.hi.z, 0} + zero, box.hi)};
  }

  /// Left ones move to the front of the range, right ones to the scratch array. Returns false if there are
  /// none on one side: then nothing is lost, but nothing is split.
  bool PartitionSpace(const RecordRange& range, const Slices& slices, const SpatialSplit& split,
                      RecordRange& left, RecordRange& right) {
    const float plane = slices.Plane(uint32_t(split.bin), split.axis);
    const float left_area = split.left.HalfArea(), right_area = split.right.HalfArea();
    const float lefts = float(split.lefts), rights = float(split.rights);
    size_t l = range.begin, r = range.begin;
    auto go_left = [&](const Record& record) {
      references_[l++] = record;
      left.Extend(record);
    };
    auto go_right = [&](const Record& record) {
      scratch_[r++] = record;
      right.Extend(record);
    };
    for (size_t i = range.begin; i < range.end; ++i) {
      const Record whole = references_[i];
      const int first = int(slices.Of(whole.lo[split.axis], split.axis)),
                last = int(slices.Of(whole.hi[split.axis], split.axis));
      if (last < split.bin) {
        go_left(whole);
        continue;
      }
      if (first >= split.bin) {
        go_right(whole);
        continue;
      }
      const auto [below, above] = Cut(whole, split.axis, plane);
      auto with = [&](Box4 box) {
        box.Extend({whole.lo, whole.hi});
        return box.HalfArea();
      };
      const float cut = left_area * lefts + right_area * rights,
                  all_left = with(split.left) * lefts + right_area * (rights - 1),
                  all_right = left_area * (lefts - 1) + with(split.right) * rights;
      if (IsEmpty(above) || all_left <= std::min(cut, all_right)) {
        go_left(whole);
      } else if (IsEmpty(below) || all_right <= cut) {
        go_right(whole);
      } else {
        Record part{below.lo, below.hi};
        part.SetId(whole.id());
        // Both sides are written before the next one is read; the left one's place has been read already.
        go_left(part);
        part = {above.lo, above.hi};
        part.SetId(whole.id());
        go_right(part);
      }
    }
    if (l == range.begin || r == range.begin) {
      if (l == range.begin)
        std::memcpy(static_cast<void*>(&references_[l]), &scratch_[range.begin],
                    (r - range.begin) * sizeof(Record));
      left = {range.begin, range.begin};
      right = {range.end, range.end};
      return false;
    }
    left.end = l;
    right.begin = range.begin;
    right.end = r;
    return true;
  }

  /// The same for whole references; halves the range where no plane separates the centres.
  void PartitionObjects(const RecordRange& range, const Binning& binning, const Split& split,
                        RecordRange& left, RecordRange& right) {
    size_t l = range.begin, r = range.begin;
    for (size_t i = range.begin; i < range.end; ++i) {
      const Record record = references_[i];
      const bool is_left =
          split.axis < 0 ? i - range.begin < range.size() / 2 : binning.Of(record)[split.axis] < split.bin;
      if (is_left) {
        references_[l++] = record;
        left.Extend(record);
      } else {
        scratch_[r++] = record;
        right.Extend(record);
      }
    }
    left.end = l;
    right.begin = range.begin;
    right.end = r;
  }

  const rb_geometry& geometry_;
  SahCosts costs_;
  bool padded_;
  uint32_t bins_;
  HugeArray<Record> references_, scratch_;
  float root_area_ = 0;
  BinaryTree tree_;
};

}  // namespace

BinaryTree BuildSpatialSah(const rb_geometry& geometry, const SpatialSahOptions& options,
                           const volatile int* cancel) {
  return SpatialBuilder(geometry, options, cancel).Take();
}

uint64_t SpatialSahPeakBytes(uint64_t prims, double budget) {
  const uint64_t most = SpatialSahCapacity(prims, budget);
  return NodeStore::Bytes(most) + std::max(2 * most * sizeof(Record), NodeStore::Bytes(most)) +
         most * sizeof(uint32_t);
}

}  // namespace raybench
