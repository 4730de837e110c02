#include "accel/bvh/wide/collapse.h"

#include <algorithm>
#include <cstring>
#include <limits>
#include <stdexcept>

#include "accel/base/huge_array.h"
#include "accel/bvh/build_records.h"

namespace raybench {
namespace {

float HalfArea(const BuildNode& n) {
  const float x = n.hi[0] - n.lo[0], y = n.hi[1] - n.lo[1], z = n.hi[2] - n.lo[2];
  return x * y + y * z + z * x;
}

template <uint32_t kWidth>
class Collapser {
  using F = FloatN<int(kWidth)>;
  using I = IntN<int(kWidth)>;

 public:
  Collapser(const BinaryTree& tree, const SahCosts& costs)
      : tree_(tree), costs_(costs), choices_(tree.nodes.size()) {
    const Subtree all{0, uint32_t(std::min<size_t>(tree.nodes.size(), std::numeric_limits<uint32_t>::max()))};
    Solution whole;
    Solve(all, whole);
    Emit(all);
  }
  WideTopology Take() { return std::move(out_); }

 private:
  static constexpr float kInf = std::numeric_limits<float>::infinity();

  /// What stands in the slots from `slot` to `end`: more of them than there are nodes.
  struct Subtree {
    uint32_t slot, end;
    uint32_t size() const { return end - slot; }
  };
  Subtree Left(const Subtree& s) const { return {s.slot + 1, tree_.nodes[s.slot].right}; }
  Subtree Right(const Subtree& s) const { return {tree_.nodes[s.slot].right, s.end}; }

  /// How the subtree of an inner binary node becomes i trees: left[i - 1] of them left (0: as one with i - 1).
  struct Choice {
    uint8_t left[kWidth];
    uint32_t count;  // primitives
    bool is_leaf;    // as one tree it is a leaf
  };
  struct Solution {
    float none[kWidth];  // infinite: what no trees cost
    float cost[kWidth];  // cost[i - 1] of i trees; infinite for more than `most`
    uint32_t most;       // more trees than that do not help
    uint32_t count;      // primitives
  };

  void Solve(const Subtree& subtree, Solution& s) {
    const BuildNode& node = tree_.nodes[subtree.slot];
    const float area = HalfArea(node);
    const F none = Splat<F>(kInf);
    std::memcpy(s.none, &none, sizeof none);
    if (node.count > 0) {
      std::memcpy(s.cost, &none, sizeof none);
      s.most = 1, s.count = node.count;
      s.cost[0] = costs_.Blocks(node.count) * area;
      return;
    }
    Solution l, r;
    Both(
        subtree.size() / 2, [&] { Solve(Left(subtree), l); }, [&] { Solve(Right(subtree), r); });
    Choice& choice = choices_[subtree.slot];
    s.count = choice.count = l.count + r.count;
    s.most = std::min(kWidth, l.most + r.most);
    // D(n, i) in lane i - 1; k ascends, the first of equal ones stays.
    F cost = none;
    I left{};
    for (uint32_t k = 1; k <= l.most; ++k) {
      const F with_k = Splat<F>(l.cost[k - 1]) + Load<F>(r.cost - k);
      const I is_less = with_k < cost;
      cost = is_less ? with_k : cost;
      left = is_less ? Splat<I>(int32_t(k)) : left;
    }
    std::memcpy(s.cost, &cost, sizeof cost);
    const auto lefts = __builtin_convertvector(left, Vec<uint8_t, int(kWidth)>);
    std::memcpy(choice.left, &lefts, sizeof lefts);
    float best = kInf;
    for (uint32_t i = 2; i <= s.most; ++i) best = std::min(best, s.cost[i - 1]);
    const float as_node = costs_.traversal * area + best;
    const bool fits_leaf = s.count <= costs_.leaf_size && !tree_.clipped;
    const float as_leaf = fits_leaf ? costs_.Blocks(s.count) * area : kInf;
    choice.is_leaf = fits_leaf && as_leaf <= as_node;  // areas of large boxes are infinite
    best = s.cost[0] = std::min(as_leaf, as_node);
    // Fewer trees may cost less than more of them.
    choice.left[0] = 0;
    float as_trees = kInf;
    for (uint32_t i = 2; i <= s.most; ++i) {
      const bool is_less = s.cost[i - 1] < as_trees;
      as_trees = is_less ? s.cost[i - 1] : as_trees;
      if (!is_less || best < as_trees) choice.left[i - 1] = 0;
      best = s.cost[i - 1] = std::min(best, as_trees);
    }
  }

  bool IsLeaf(uint32_t slot) const { return tree_.nodes[slot].count > 0 || choices_[slot].is_leaf; }
  uint32_t Count(uint32_t slot) const {
    return tree_.nodes[slot].count > 0 ? tree_.nodes[slot].count : choices_[slot].count;
  }
  uint32_t First(uint32_t slot) const {
    while (tree_.nodes[slot].count == 0) ++slot;
    return tree_.nodes[slot].first;
  }

  /// A tree of the forest that becomes a node's children.
  struct Tree {
    Subtree subtree;
    float area;
    bool is_leaf;

    bool operator<(const Tree& o) const {
      if (is_leaf != o.is_leaf) return is_leaf;
      return area != o.area ? area > o.area : subtree.slot < o.subtree.slot;
    }
  };
  struct Forest {  // sorted
    Tree trees[kWidth];
    uint32_t size = 0;

    void Add(const Tree& tree) {
      uint32_t i = size++;
      for (; i > 0 && tree < trees[i - 1]; --i) trees[i] = trees[i - 1];
      trees[i] = tree;
    }
  };

  /// Adds the trees that the subtree becomes if it may become `most`.
  void Gather(const Subtree& subtree, uint32_t most, Forest& out) const {
    const BuildNode& node = tree_.nodes[subtree.slot];
    if (node.count == 0 && most > 1) {
      const Choice& choice = choices_[subtree.slot];
      while (most > 1 && choice.left[most - 1] == 0) --most;
      if (most > 1) {
        Gather(Left(subtree), choice.left[most - 1], out);
        Gather(Right(subtree), most - choice.left[most - 1], out);
        return;
      }
    }
    out.Add({subtree, HalfArea(node), IsLeaf(subtree.slot)});
  }

  /// The children of the node that a subtree becomes.
  Forest Children(const Subtree& subtree) const {
    Forest forest;
    const Choice& choice = choices_[subtree.slot];
    uint32_t most = kWidth;
    while (most > 2 && choice.left[most - 1] == 0) --most;
    // Where one tree would do, but it is no leaf, there are two.
    const uint32_t lefts = choice.left[most - 1];
    Gather(Left(subtree), lefts > 0 ? lefts : 1, forest);
    Gather(Right(subtree), lefts > 0 ? most - lefts : 1, forest);
    return forest;
  }

  /// Nodes that follow each other: a whole subtree, or a single one above such.
  struct Part {
    Subtree subtree;
    uint32_t depth;
    bool is_whole;
    WideTopology topology{};  // numbers of nodes: within the subtree; of a single one, of parts
  };
  static constexpr uint32_t kPartSlots = 1u << 13;

  void Emit(const Subtree& all) {
    if (IsLeaf(0)) {
      out_.begin.push_back(0);
      out_.children.push_back({0, First(0), Count(0)});
      return;
    }
    std::vector<Part> parts;
    Divide(all, parts);
    ParallelFor(size_t{0}, parts.size(), [&](size_t i) {
      if (parts[i].is_whole) EmitWhole(parts[i]);
    });
    Join(parts);
  }

  /// The parts in depth-first order.
  void Divide(const Subtree& all, std::vector<Part>& parts) const {
    struct Pending {
      Subtree subtree;
      uint32_t depth, part, child;  // which child of which part
    };
    std::vector<Pending> stack{{all, 0, kNone, 0}};
    while (!stack.empty()) {
      const Pending p = stack.back();
      stack.pop_back();
      const uint32_t part = uint32_t(parts.size());
      if (p.part != kNone) parts[p.part].topology.children[p.child].first = part;
      parts.push_back({p.subtree, p.depth, p.subtree.size() < kPartSlots});
      if (!parts.back().is_whole)
        EmitNode(p.subtree, p.depth, parts.back().topology, [&](const Subtree& inner, uint32_t child) {
          stack.push_back({inner, p.depth + 1, part, child});
        });
    }
  }

  void EmitWhole(Part& part) const {
    struct Pending {
      Subtree subtree;
      uint32_t depth, child;
    };
    WideTopology& out = part.topology;
    std::vector<Pending> stack{{part.subtree, part.depth, kNone}};
    while (!stack.empty()) {
      const Pending p = stack.back();
      stack.pop_back();
      if (p.child != kNone) out.children[p.child].first = uint32_t(out.begin.size());
      EmitNode(p.subtree, p.depth, out, [&](const Subtree& inner, uint32_t child) {
        stack.push_back({inner, p.depth + 1, child});
      });
    }
  }

  /// Appends the node that the subtree becomes; push(subtree, child) for its inner children, the last one first.
  template <class Push>
  void EmitNode(const Subtree& subtree, uint32_t depth, WideTopology& out, const Push& push) const {
    if (depth >= kMaxTreeDepth) throw std::runtime_error("the tree is deeper than the traversal stack");
    const Forest forest = Children(subtree);
    const uint32_t begin = uint32_t(out.children.size());
    out.begin.push_back(begin);
    for (uint32_t c = 0; c < forest.size; ++c) {
      const uint32_t slot = forest.trees[c].subtree.slot;
      const bool is_leaf = forest.trees[c].is_leaf;
      out.children.push_back({slot, is_leaf ? First(slot) : 0, is_leaf ? Count(slot) : 0});
    }
    for (uint32_t c = forest.size; c-- > 0;)
      if (!forest.trees[c].is_leaf) push(forest.trees[c].subtree, begin + c);
  }

  void Join(const std::vector<Part>& parts) {
    struct Place {
      uint32_t node, child;
    };
    std::vector<Place> places{{0, 0}};
    for (const Part& part : parts)
      places.push_back({places.back().node + uint32_t(part.topology.begin.size()),
                        places.back().child + uint32_t(part.topology.children.size())});
    out_.begin.resize(places.back().node + size_t{1});
    out_.children.resize(places.back().child);
    out_.begin.back() = places.back().child;
    ParallelFor(size_t{0}, parts.size(), [&](size_t i) {
      const WideTopology& from = parts[i].topology;
      for (size_t n = 0; n < from.begin.size(); ++n)
        out_.begin[places[i].node + n] = places[i].child + from.begin[n];
      for (size_t c = 0; c < from.children.size(); ++c) {
        WideTopology::Child child = from.children[c];
        if (child.count == 0)
          child.first = parts[i].is_whole ? places[i].node + child.first : places[child.first].node;
        out_.children[places[i].child + c] = child;
      }
    });
  }

  static constexpr uint32_t kNone = 0xFFFFFFFFu;

  const BinaryTree& tree_;
  SahCosts costs_;
  HugeArray<Choice> choices_;
  WideTopology out_;
};

}  // namespace

uint64_t CollapsePeakBytes(uint64_t entries, uint32_t width) {
  return entries * (2 * (sizeof(BuildNode) + width + 8) + sizeof(uint32_t));
}

WideTopology Collapse(const BinaryTree& tree, uint32_t width, const SahCosts& costs) {
  switch (width) {
    case 4:
      return Collapser<4>(tree, costs).Take();
    case 8:
      return Collapser<8>(tree, costs).Take();
    default:
      return Collapser<16>(tree, costs).Take();
  }
}

}  // namespace raybench
