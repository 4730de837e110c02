// bvh_ploc: a bounding volume hierarchy built from the leaves up by clustering.
//
// The idea: the best trees come from merging, again and again, the two clusters whose common box is smallest
// (Walter et al. 2008), but finding them is slow. Parallel locally-ordered clustering (Meister and Bittner
// 2018) keeps the clusters in Morton order, looks for each one's best partner only `radius` places to either
// side, and merges all pairs in one round that choose each other. A few tens of rounds leave one cluster.
// Layout and traversal: accel/bvh/bvh2.h.
//
// Equal boxes are the danger: were the first of equal partners taken, coincident primitives would merge one
// pair a round. The tie is broken by the xor of the two places, which both sides see alike and which pairs
// clusters off. Chains, where each cluster likes the previous one best, are as bad: a round that merges fewer
// than a 32nd of the clusters is followed by one that pairs neighbours off whatever it costs. So rounds, and
// time, stay bounded.
//
// Invariants: every primitive stands in exactly one leaf, whose bounds enclose it; what a round does depends
// on the round before alone, so the tree is the same at any thread count; Flatten() bounds the depth and
// makes leaves of what costs less as one.
#include "accel/bvh/linked_tree.h"
#include "accel/bvh/morton.h"
#include "accel/bvh/structure.h"

namespace raybench {
namespace {

class PlocBuilder {
 public:
  static constexpr uint64_t kBytesPerPrim = sizeof(Record) + MortonOrder::kBytesPerPrim + 2 * sizeof(Record) +
                                            2 * (sizeof(LinkedNode) + sizeof(uint32_t)) +
                                            2 * sizeof(BuildNode) + 3 * sizeof(uint32_t);

  PlocBuilder(const rb_geometry& geometry, const BvhConfig& config, uint32_t radius,
              const volatile int* cancel)
      : radius_(radius) {
    const uint32_t n = uint32_t(PrimCount(geometry));
    tree_.nodes = HugeArray<LinkedNode>(2 * size_t(n));
    tree_.counts = HugeArray<uint32_t>(2 * size_t(n));
    tree_.order = HugeArray<uint32_t>(n);
    clusters_ = HugeArray<Record>(n), next_ = HugeArray<Record>(n), partners_ = HugeArray<uint32_t>(n);
    {
      HugeArray<Record> records(n);
      const RecordRange all = MakeRecords(geometry, config.Padded(), records);
      const MortonOrder curve(records, all.centroids);
      ForBlocks(0, n, [&](size_t begin, size_t end) {
        for (size_t i = begin; i < end; ++i) {
          Record& cluster = clusters_[i];
          cluster = records[curve.prim(i)];
          cluster.SetId(uint32_t(i));
          tree_.nodes[i].SetBox({cluster.lo, cluster.hi});
          tree_.nodes[i].left = uint32_t(i), tree_.nodes[i].right = LinkedNode::kLeaf;
          tree_.counts[i] = 1, tree_.order[i] = curve.prim(i);
        }
      });
    }
    tree_.size = n;
    uint32_t left = n;
    bool force = false;
    while (left > 1) {
      CheckCancel(cancel);
      const uint32_t before = left;
      left = Round(left, force);
      force = before - left < before / 32;
    }
    tree_.root = clusters_[0].id();
  }
  const LinkedTree& tree() const { return tree_; }

 private:
  /// Clusters carry the number of their node. Returns how many are left.
  uint32_t Round(uint32_t n, bool force) {
    ForBlocks(0, n, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i)
        partners_[i] = force ? std::min(uint32_t(i ^ 1), n - 1) : Partner(uint32_t(i), n);
    });
    // How many clusters each block keeps and makes, then where it puts them.
    struct Counts {
      uint32_t kept, made;
    };
    std::vector<Counts> starts((n + kParallelBlock - 1) / kParallelBlock);
    auto merges = [&](uint32_t i) { return partners_[i] != i && partners_[partners_[i]] == i; };
    ForBlocks(0, n, [&](size_t begin, size_t end) {
      Counts own{0, 0};
      for (uint32_t i = uint32_t(begin); i < end; ++i) {
        const bool merging = merges(i), first = merging && i < partners_[i];
        own.kept += !merging || first, own.made += first;
      }
      starts[begin / kParallelBlock] = own;
    });
    Counts sum{0, tree_.size};
    for (Counts& s : starts) {
      const Counts own = std::exchange(s, sum);
      sum.kept += own.kept, sum.made += own.made;
    }
    ForBlocks(0, n, [&](size_t begin, size_t end) {
      Counts at = starts[begin / kParallelBlock];
      for (uint32_t i = uint32_t(begin); i < end; ++i) {
        if (!merges(i)) {
          next_[at.kept++] = clusters_[i];
        } else if (i < partners_[i]) {
          next_[at.kept++] = Merge(clusters_[i], clusters_[partners_[i]], at.made++);
        }
      }
    });
    std::swap(clusters_, next_);
    tree_.size = sum.made;
    return sum.kept;
  }

  uint32_t Partner(uint32_t i, uint32_t n) const {
    const Record& own = clusters_[i];
    const uint32_t first = i > radius_ ? i - radius_ : 0, last = std::min(n - 1, i + radius_);
    uint32_t best = i;
    float best_area = std::numeric_limits<float>::infinity();
    for (uint32_t j = first; j <= last; ++j) {
      if (j == i) continue;
      const Box4 both{MinOrSecond(own.lo, clusters_[j].lo), MaxOrSecond(own.hi, clusters_[j].hi)};
      const float area = both.HalfArea();
      if (area < best_area || (area == best_area && (i ^ j) < (i ^ best))) best_area = area, best = j;
    }
    return best;
  }

  Record Merge(const Record& a, const Record& b, uint32_t id) {
    LinkedNode& node = tree_.nodes[id];
    Box4 box{a.lo, a.hi};
    box.Extend({b.lo, b.hi});
    node.SetBox(box);
    node.left = a.id(), node.right = b.id();
    tree_.counts[id] = tree_.counts[node.left] + tree_.counts[node.right];
    Record merged{box.lo, box.hi};
    merged.SetId(id);
    return merged;
  }

  uint32_t radius_;
  HugeArray<Record> clusters_, next_;
  HugeArray<uint32_t> partners_;
  LinkedTree tree_;
};

class BvhPloc : public BvhStructure {
 public:
  struct Config {
    BvhConfig bvh;
    int64_t radius;
  };
  static constexpr const char* kName = "bvh_ploc";
  static constexpr const char* kDoc = "binary BVH by parallel locally-ordered clustering";
  static constexpr const char* kSource =
      "Meister, Bittner 2018: Parallel locally-ordered clustering for bounding volume hierarchy construction";
  static constexpr Kind kKind = {"BVH", "O(N)", "SIMD leaves"};
  static std::span<const rb_param> Params() {
    static const rb_param params[] = {kBvhNumerics,
                                      IntParam("radius", "clusters looked at on either side, in Morton order",
                                               offsetof(Config, radius), 1, 1000, 16),
                                      BvhLeafSize(16), kBvhTraversalCost, kBvhReinsertion};
    return params;
  }

  BvhPloc(const rb_geometry& geometry, const rb_build_options& options, const Config& config)
      : BvhStructure(geometry, options, config.bvh, PlocBuilder::kBytesPerPrim * PrimCount(geometry), [&] {
          const PlocBuilder builder(geometry, config.bvh, uint32_t(config.radius), options.cancel);
          return Flatten(builder.tree(), config.bvh.Costs());
        }) {}
};

}  // namespace

RAYBENCH_STRUCTURE(bvh_ploc, BvhPloc)

}  // namespace raybench
