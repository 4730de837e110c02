#include "accel/bvh/wide/collapse.h"

#include <algorithm>
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
 public:
  Collapser(const BinaryTree& tree, const SahCosts& costs)
      : tree_(tree), costs_(costs), choices_(tree.nodes.size()) {
    Solve(0, uint32_t(std::min<size_t>(tree.nodes.size(), std::numeric_limits<uint32_t>::max())));
    Emit();
  }
  WideTopology Take() { return std::move(out_); }

 private:
  /// How the subtree of a binary node becomes i trees: split[i]: i trees, of them so many left (0: as one
  /// with i - 1). is_leaf: as one tree it is a leaf.
  struct Choice {
    uint8_t left[kWidth + 1];
    uint8_t is_leaf;
    uint32_t count;
  };
  struct Solution {
    float cost[kWidth + 1];  // cost[i]; 1 <= i <= most
    uint32_t most;           // more trees than that do not help
    uint32_t count;          // primitives
  };

  /// `entries`: an upper bound of the subtree's primitives, to tell when it is worth a task.
  Solution Solve(uint32_t slot, uint32_t entries) {
    const BuildNode& node = tree_.nodes[slot];
    const float area = HalfArea(node);
    Choice& choice = choices_[slot];
    Solution s;
    if (node.count > 0) {
      s.most = 1, s.count = node.count;
      s.cost[1] = costs_.Blocks(node.count) * area;
      choice.is_leaf = 1, choice.count = node.count;
      return s;
    }
    Solution l, r;
    const uint32_t lefts = (node.right - slot) / 2;
    Both(
        entries, [&] { l = Solve(slot + 1, lefts); },
        [&] { r = Solve(node.right, entries - std::min(lefts, entries)); });
    s.count = choice.count = l.count + r.count;
    s.most = std::min(kWidth, l.most + r.most);
    float best = std::numeric_limits<float>::infinity();
    for (uint32_t i = 2; i <= s.most; ++i) {
      s.cost[i] = best, choice.left[i] = 0;
      const uint32_t k_begin = i > r.most ? i - r.most : 1, k_end = std::min(l.most, i - 1);
      for (uint32_t k = k_begin; k <= k_end; ++k) {
        const float cost = l.cost[k] + r.cost[i - k];
        if (cost < s.cost[i]) s.cost[i] = cost, choice.left[i] = uint8_t(k);
      }
      best = s.cost[i];
    }
    const float as_node = costs_.traversal * area + best;
    const float as_leaf = s.count <= costs_.leaf_size && !tree_.clipped
                              ? costs_.Blocks(s.count) * area
                              : std::numeric_limits<float>::infinity();
    choice.is_leaf = as_leaf <= as_node;
    s.cost[1] = std::min(as_leaf, as_node);
    // Fewer trees may cost less than more of them.
    for (uint32_t i = 2; i <= s.most; ++i) {
      if (s.cost[i - 1] < s.cost[i]) s.cost[i] = s.cost[i - 1], choice.left[i] = 0;
    }
    for (uint32_t i = s.most + 1; i <= kWidth; ++i) choice.left[i] = 0;
    return s;
  }

  /// The trees that `slot` becomes if it may become `most`.
  void Gather(uint32_t slot, uint32_t most, std::vector<uint32_t>& out) const {
    const BuildNode& node = tree_.nodes[slot];
    const Choice& choice = choices_[slot];
    if (node.count == 0)
      while (most > 1 && choice.left[most] == 0) --most;
    if (node.count > 0 || most == 1) {
      out.push_back(slot);
      return;
    }
    Gather(slot + 1, choice.left[most], out);
    Gather(node.right, most - choice.left[most], out);
  }
  bool IsLeaf(uint32_t slot) const { return choices_[slot].is_leaf != 0; }
  uint32_t First(uint32_t slot) const {
    while (tree_.nodes[slot].count == 0) ++slot;
    return tree_.nodes[slot].first;
  }

  void Emit() {
    out_.begin.push_back(0);
    if (IsLeaf(0)) {
      out_.children.push_back({0, First(0), choices_[0].count});
      return;
    }
    constexpr uint32_t kNone = 0xFFFFFFFFu;
    struct Pending {
      uint32_t slot, child, depth;  // child: which entry of `children` it is
    };
    std::vector<Pending> stack{{0, kNone, 0}};
    std::vector<uint32_t> trees;
    while (!stack.empty()) {
      const Pending p = stack.back();
      stack.pop_back();
      if (p.depth >= kMaxTreeDepth) throw std::runtime_error("the tree is deeper than the traversal stack");
      if (p.child != kNone) out_.children[p.child].first = out_.nodes();
      Children(p.slot, trees);
      const size_t begin = out_.children.size();
      for (const uint32_t slot : trees) {
        const bool is_leaf = IsLeaf(slot);
        out_.children.push_back({slot, is_leaf ? First(slot) : 0, is_leaf ? choices_[slot].count : 0});
      }
      for (size_t i = trees.size(); i-- > 0;)
        if (!IsLeaf(trees[i])) stack.push_back({trees[i], uint32_t(begin + i), p.depth + 1});
      out_.begin.push_back(uint32_t(out_.children.size()));
    }
  }

  /// The children of the node that the subtree of `slot` becomes.
  void Children(uint32_t slot, std::vector<uint32_t>& trees) const {
    trees.clear();
    const Choice& choice = choices_[slot];
    const uint32_t right = tree_.nodes[slot].right;
    uint32_t most = kWidth;
    while (most > 2 && choice.left[most] == 0) --most;
    if (choice.left[most] == 0) {  // one tree would do, but it is no leaf
      trees.push_back(slot + 1), trees.push_back(right);
    } else {
      Gather(slot + 1, choice.left[most], trees);
      Gather(right, most - choice.left[most], trees);
    }
    std::sort(trees.begin(), trees.end(), [&](uint32_t a, uint32_t b) {
      const bool leaf_a = IsLeaf(a), leaf_b = IsLeaf(b);
      if (leaf_a != leaf_b) return leaf_a;
      const float area_a = HalfArea(tree_.nodes[a]), area_b = HalfArea(tree_.nodes[b]);
      return area_a != area_b ? area_a > area_b : a < b;
    });
  }

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
