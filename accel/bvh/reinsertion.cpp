#include "accel/bvh/reinsertion.h"

#include <atomic>
#include <vector>

#include "accel/base/parallel.h"
#include "accel/bvh/linked_tree.h"

namespace raybench {
namespace {

constexpr uint32_t kNone = 0xFFFFFFFFu;
constexpr size_t kSearchBlock = 256;

struct Move {
  float gain;
  uint32_t node, target;  ///< `node` shall become the sibling of `target`
};

class Optimizer {
 public:
  explicit Optimizer(LinkedTree&& tree)
      : tree_(std::move(tree)), parents_(tree_.size), touched_(tree_.size), arrived_(tree_.size) {
    parents_[tree_.root] = kNone;
    for (uint32_t id = 0; id < tree_.size; ++id) {
      const LinkedNode& node = tree_.nodes[id];
      if (!node.is_leaf()) parents_[node.left] = parents_[node.right] = id;
    }
  }

  /// Returns whether anything moved.
  bool Pass(const volatile int* cancel) {
    const std::vector<Move> moves = FindMoves(cancel);
    std::fill_n(touched_.data(), touched_.size(), uint8_t{0});
    bool any = false;
    for (const Move& move : moves) any |= Carry(move);
    if (any) Refit();
    return any;
  }
  const LinkedTree& tree() const { return tree_; }

 private:
  uint32_t Sibling(uint32_t id) const {
    const LinkedNode& parent = tree_.nodes[parents_[id]];
    return parent.left == id ? parent.right : parent.left;
  }
  static float Area(const Box4& a, const Box4& b) {
    Box4 both = a;
    both.Extend(b);
    return both.HalfArea();
  }

  /// All moves that gain something, best first.
  std::vector<Move> FindMoves(const volatile int* cancel) {
    const size_t blocks = (tree_.size + kSearchBlock - 1) / kSearchBlock;
    std::vector<std::vector<Move>> found(blocks);
    ParallelFor(size_t{0}, blocks, [&](size_t block) {
      CheckCancel(cancel);
      std::vector<Pending> stack;
      const size_t end = std::min<size_t>((block + 1) * kSearchBlock, tree_.size);
      for (size_t id = block * kSearchBlock; id < end; ++id) {
        const Move move = Search(uint32_t(id), stack);
        if (move.target != kNone) found[block].push_back(move);
      }
    });
    std::vector<Move> moves;
    for (const auto& f : found) moves.insert(moves.end(), f.begin(), f.end());
    ParallelSort(moves.begin(), moves.end(), [](const Move& a, const Move& b) {
      return a.gain != b.gain ? a.gain > b.gain : a.node < b.node;
    });
    return moves;
  }

  struct Pending {
    float gain;  ///< of the area given up on the way, were the node inserted without a new parent
    uint32_t id;
  };

  /// The best place for a subtree. The root and its children stay.
  Move Search(uint32_t id, std::vector<Pending>& stack) const {
    Move best{0, id, kNone};
    uint32_t pivot = parents_[id];
    if (pivot == kNone || parents_[pivot] == kNone) return best;
    const Box4 box = tree_.nodes[id].box();
    const float area = box.HalfArea();
    // Gains below rounding are none.
    best.gain = tree_.nodes[tree_.root].box().HalfArea() * 0x1p-20f;
    uint32_t sibling = Sibling(id);
    Box4 left_over = tree_.nodes[sibling].box();
    float gain = tree_.nodes[pivot].box().HalfArea();  // the parent goes
    for (;;) {
      stack.push_back({gain, sibling});
      while (!stack.empty()) {
        const Pending p = stack.back();
        stack.pop_back();
        if (p.gain - area <= best.gain) continue;  // a new parent is at least as large as the subtree
        const LinkedNode& node = tree_.nodes[p.id];
        const Box4 at = node.box();
        const float enlarged = Area(at, box);
        if (p.gain - enlarged > best.gain) best.gain = p.gain - enlarged, best.target = p.id;
        if (node.is_leaf()) continue;
        const float below = p.gain - (enlarged - at.HalfArea());
        if (below - area <= best.gain) continue;
        stack.push_back({below, node.right});
        stack.push_back({below, node.left});
      }
      if (parents_[pivot] == kNone) return best;
      if (pivot != parents_[id]) {  // going on, the pivot shrinks to what it encloses without the subtree
        left_over.Extend(tree_.nodes[sibling].box());
        gain += tree_.nodes[pivot].box().HalfArea() - left_over.HalfArea();
      }
      sibling = Sibling(pivot);
      pivot = parents_[pivot];
    }
  }

  bool Carry(const Move& move) {
    const uint32_t id = move.node, target = move.target, parent = parents_[id], sibling = Sibling(id),
                   above = parents_[parent], beside = parents_[target];
    for (uint32_t n : {id, target, parent, sibling, above, beside}) {
      if (touched_[n] != 0) return false;
    }
    for (uint32_t n = beside; n != kNone; n = parents_[n]) {
      if (n == id) return false;  // an earlier move put the target into the subtree
    }
    for (uint32_t n : {id, target, parent, sibling, above, beside}) touched_[n] = 1;
    Replace(above, parent, sibling);
    // `beside` may have been the parent that went.
    Replace(parents_[target], target, parent);
    tree_.nodes[parent].left = target, tree_.nodes[parent].right = id;
    parents_[target] = parent, parents_[id] = parent;
    return true;
  }
  void Replace(uint32_t parent, uint32_t child, uint32_t by) {
    LinkedNode& node = tree_.nodes[parent];
    (node.left == child ? node.left : node.right) = by;
    parents_[by] = parent;
  }

  /// Boxes and counts from the leaves up: the second thread that arrives at a node goes on.
  void Refit() {
    std::memset(arrived_.data(), 0, arrived_.bytes());
    ForBlocks(0, tree_.size, [&](size_t begin, size_t end) {
      for (size_t leaf = begin; leaf < end; ++leaf) {
        if (!tree_.nodes[leaf].is_leaf()) continue;
        for (uint32_t id = parents_[leaf]; id != kNone; id = parents_[id]) {
          if (std::atomic_ref(arrived_[id]).exchange(1, std::memory_order_acq_rel) == 0) break;
          LinkedNode& node = tree_.nodes[id];
          Box4 box = tree_.nodes[node.left].box();
          box.Extend(tree_.nodes[node.right].box());
          node.SetBox(box);
          tree_.counts[id] = tree_.counts[node.left] + tree_.counts[node.right];
        }
      }
    });
  }

  LinkedTree tree_;
  HugeArray<uint32_t> parents_;
  HugeArray<uint8_t> touched_, arrived_;
};

}  // namespace

BinaryTree Reinsert(BinaryTree&& tree, uint32_t passes, const SahCosts& costs, const volatile int* cancel) {
  Optimizer optimizer(Link(std::move(tree)));
  for (uint32_t pass = 0; pass < passes && optimizer.Pass(cancel); ++pass) {
  }
  return Flatten(optimizer.tree(), costs);
}

uint64_t ReinsertionPeakBytes(uint64_t prims) {
  return prims * (2 * (2 * sizeof(BuildNode) + sizeof(uint32_t)) +
                  2 * (sizeof(LinkedNode) + 2 * sizeof(uint32_t) + 2 + sizeof(Move)));
}

}  // namespace raybench
