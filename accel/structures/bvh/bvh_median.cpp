// bvh_median: a binary bounding volume hierarchy that halves the primitives.
//
// The idea: the oldest of the automatic builders (Kay and Kajiya 1986): sort the primitives by their
// centres along one axis, give half to each child, go on. The tree is balanced, whatever the scene, and
// blind to how large and how dense things are: what SAH builders are measured against. Layout and
// traversal: accel/bvh/bvh2.h.
//
// Invariants: every primitive stands in exactly one leaf, whose bounds enclose it; a child holds half of the
// primitives, so depth is at most log2 of their number; centres are ordered together with ids, so the tree is
// the same at any thread count.
//
// Parameters: `axis`: the longest extent of the centres, or X, Y, Z in turn.
#include "accel/bvh/build_records.h"
#include "accel/bvh/structure.h"

namespace raybench {
namespace {

enum class AxisRule : uint32_t { kLargest, kCyclic };
constexpr const char* kAxisChoices[] = {"largest", "cyclic", nullptr};

class MedianBuilder {
 public:
  static constexpr uint64_t kBytesPerPrim = sizeof(Record) + 2 * sizeof(BuildNode) + sizeof(uint32_t);

  MedianBuilder(const rb_geometry& geometry, const BvhConfig& config, AxisRule rule,
                const volatile int* cancel)
      : leaf_size_(size_t(config.leaf_size)), rule_(rule), cancel_(cancel), records_(PrimCount(geometry)) {
    tree_.nodes = HugeArray<BuildNode>(2 * records_.size());
    tree_.order = HugeArray<uint32_t>(records_.size());
    Recurse(MakeRecords(geometry, config.Padded(), records_), 0, 0);
  }
  BinaryTree Take() { return std::move(tree_); }

 private:
  void Recurse(const RecordRange& range, uint32_t slot, uint32_t depth) {
    const size_t n = range.size();
    if (n >= kTaskRange) CheckCancel(cancel_);
    BuildNode& node = tree_.nodes[slot];
    SetBounds(node, range.box);
    if (n <= leaf_size_) {
      for (size_t i = range.begin; i < range.end; ++i) tree_.order[i] = records_[i].id();
      std::sort(&tree_.order[range.begin], &tree_.order[range.begin] + n);
      SetLeaf(node, range.begin, n);
      return;
    }
    const int axis = rule_ == AxisRule::kCyclic ? int(depth % 3) : LargestExtent(range.centroids);
    const size_t middle = range.begin + n / 2;
    std::nth_element(&records_[range.begin], &records_[middle], &records_[range.begin] + n,
                     [axis](const Record& a, const Record& b) {
                       const float ca = a.Centroid2()[axis], cb = b.Centroid2()[axis];
                       return ca != cb ? ca < cb : a.id() < b.id();
                     });
    const uint32_t right_slot = SetInner(node, slot, middle - range.begin);
    Both(
        n, [&] { Recurse(Measure(range.begin, middle), slot + 1, depth + 1); },
        [&] { Recurse(Measure(middle, range.end), right_slot, depth + 1); });
  }

  static int LargestExtent(const Box4& box) {
    const Float4 e = box.hi - box.lo;
    return e[0] >= e[1] ? (e[0] >= e[2] ? 0 : 2) : (e[1] >= e[2] ? 1 : 2);
  }
  RecordRange Measure(size_t begin, size_t end) const {
    RecordRange range{begin, end};
    for (size_t i = begin; i < end; ++i) range.Extend(records_[i]);
    return range;
  }

  size_t leaf_size_;
  AxisRule rule_;
  const volatile int* cancel_;
  HugeArray<Record> records_;
  BinaryTree tree_;
};

class BvhMedian : public BvhStructure {
 public:
  struct Config {
    BvhConfig bvh;
    uint32_t axis;
  };
  static constexpr const char* kName = "bvh_median";
  static constexpr const char* kDoc = "binary BVH that halves the primitives at their median";
  static constexpr const char* kSource = "Kay, Kajiya 1986: Ray tracing complex scenes";
  static std::span<const rb_param> Params() {
    static const rb_param params[] = {
        kBvhNumerics,
        ChoiceParam("axis", "split along the largest extent of the centres, or X, Y, Z in turn",
                    offsetof(Config, axis), kAxisChoices, uint32_t(AxisRule::kLargest)),
        BvhLeafSize(8), kBvhTraversalCost, kBvhReinsertion};
    return params;
  }

  BvhMedian(const rb_geometry& geometry, const rb_build_options& options, const Config& config)
      : BvhStructure(geometry, options, config.bvh, MedianBuilder::kBytesPerPrim * PrimCount(geometry), [&] {
          return MedianBuilder(geometry, config.bvh, AxisRule(config.axis), options.cancel).Take();
        }) {}
};

}  // namespace

RAYBENCH_STRUCTURE(bvh_median, BvhMedian)

}  // namespace raybench
