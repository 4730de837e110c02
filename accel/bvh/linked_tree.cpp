#include "accel/bvh/linked_tree.h"

#include <cstring>
#include <vector>

namespace raybench {

LinkedTree Link(BinaryTree&& tree) {
  struct Pending {
    uint32_t slot, parent;  // a right child tells its parent where it stands
  };
  constexpr uint32_t kNone = 0xFFFFFFFFu;
  LinkedTree linked;
  linked.nodes = HugeArray<LinkedNode>(tree.nodes.size());
  linked.counts = HugeArray<uint32_t>(tree.nodes.size());
  std::vector<Pending> stack{{0, kNone}};
  while (!stack.empty()) {
    const Pending p = stack.back();
    stack.pop_back();
    const BuildNode& from = tree.nodes[p.slot];
    const uint32_t id = linked.size++;
    LinkedNode& node = linked.nodes[id];
    std::memcpy(node.lo, from.lo, sizeof node.lo);
    std::memcpy(node.hi, from.hi, sizeof node.hi);
    if (p.parent != kNone) linked.nodes[p.parent].right = id;
    if (from.count > 0) {
      node.left = from.first;
      node.right = LinkedNode::kLeaf;
      linked.counts[id] = from.count;
    } else {
      node.left = id + 1;
      node.right = 0;
      stack.push_back({from.right, id});
      stack.push_back({p.slot + 1, kNone});
    }
  }
  for (uint32_t id = linked.size; id-- > 0;) {  // children stand behind their parents
    const LinkedNode& node = linked.nodes[id];
    if (!node.is_leaf()) linked.counts[id] = linked.counts[node.left] + linked.counts[node.right];
  }
  linked.order = std::move(tree.order);
  linked.clipped = tree.clipped;
  return linked;
}

namespace {

class Flattener {
 public:
  Flattener(const LinkedTree& from, const SahCosts& costs) : from_(from), costs_(costs) {
    const size_t entries = from.counts[from.root];
    tree_.nodes = HugeArray<BuildNode>(2 * entries);
    tree_.order = HugeArray<uint32_t>(entries);
    tree_.clipped = from.clipped;
    Emit(from.root, 0, 0, 0);
  }
  BinaryTree Take() { return std::move(tree_); }

 private:
  /// Writes a subtree to its slots and entries; returns its cost times its area.
  float Emit(uint32_t id, uint32_t slot, size_t first, uint32_t depth) {
    const LinkedNode& node = from_.nodes[id];
    const size_t count = from_.counts[id];
    SetBounds(tree_.nodes[slot], node.box());
    const float area = node.box().HalfArea(), as_leaf = costs_.Blocks(count) * area;
    if (node.is_leaf()) {
      std::memcpy(&tree_.order[first], &from_.order[node.left], count * sizeof(uint32_t));
      SetLeaf(tree_.nodes[slot], first, count);
      return as_leaf;
    }
    if (depth >= kDecideDepth) {
      const std::vector<uint32_t> leaves = LeavesBelow(id);
      Balance(&leaves[0], leaves.size(), slot, first);
      return as_leaf;
    }
    const size_t lefts = from_.counts[node.left];
    const uint32_t right_slot = SetInner(tree_.nodes[slot], slot, lefts);
    float left = 0, right = 0;
    Both(
        count, [&] { left = Emit(node.left, slot + 1, first, depth + 1); },
        [&] { right = Emit(node.right, right_slot, first + lefts, depth + 1); });
    // Leaves of a clipped tree may share primitives: they stay apart.
    if (count > costs_.leaf_size || from_.clipped || costs_.Pays(left + right, count, area))
      return left + right + costs_.traversal * area;
    SetLeaf(tree_.nodes[slot], first, count);
    return as_leaf;
  }

  std::vector<uint32_t> LeavesBelow(uint32_t id) const {
    std::vector<uint32_t> leaves, stack{id};
    while (!stack.empty()) {
      id = stack.back();
      stack.pop_back();
      const LinkedNode& node = from_.nodes[id];
      if (node.is_leaf()) {
        leaves.push_back(id);
      } else {
        stack.push_back(node.right);
        stack.push_back(node.left);
      }
    }
    return leaves;
  }

  Box4 Balance(const uint32_t* leaves, size_t n, uint32_t slot, size_t first) {
    if (n == 1) {
      Emit(leaves[0], slot, first, kDecideDepth);
      return from_.nodes[leaves[0]].box();
    }
    size_t lefts = 0;
    for (size_t i = 0; i < n / 2; ++i) lefts += from_.counts[leaves[i]];
    const uint32_t right_slot = SetInner(tree_.nodes[slot], slot, lefts);
    Box4 box = Balance(leaves, n / 2, slot + 1, first);
    box.Extend(Balance(leaves + n / 2, n - n / 2, right_slot, first + lefts));
    SetBounds(tree_.nodes[slot], box);
    return box;
  }

  const LinkedTree& from_;
  SahCosts costs_;
  BinaryTree tree_;
};

}  // namespace

BinaryTree Flatten(const LinkedTree& tree, const SahCosts& costs) { return Flattener(tree, costs).Take(); }

}  // namespace raybench
