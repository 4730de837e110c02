// Where the tasks of a builder leave their nodes, so that they end up in depth-first order without gaps whatever
// thread made them when.
#pragma once

#include <atomic>
#include <span>
#include <vector>

#include "accel/bvh/binary_tree.h"
#include "accel/bvh/build_records.h"

namespace raybench {

/// The nodes of a subtree in depth-first order, while it is being made. `right` counts from the node itself.
class NodeList {
 public:
  /// Room for every tree over so many primitives.
  explicit NodeList(size_t prims) : nodes_(2 * prims) {}

  /// The node's index; it is not initialised.
  uint32_t Add() { return size_++; }
  BuildNode& operator[](uint32_t i) { return nodes_[i]; }
  /// Its left child follows, its right child is the next to be added.
  void SetRight(uint32_t node) { nodes_[node].right = size_ - node; }
  /// Drops what was added after the node.
  void CutBehind(uint32_t node) { size_ = node + 1; }
  std::span<const BuildNode> nodes() const { return {nodes_.data(), size_}; }

 private:
  HugeArray<BuildNode> nodes_;
  uint32_t size_ = 0;
};

class NodeStore {
 public:
  struct Piece {
    uint32_t begin, count;
  };
  struct Subtree {
    std::vector<Piece> pieces;  // in depth-first order
    uint32_t nodes = 0;
  };

  /// For a tree over so many primitives.
  explicit NodeStore(size_t prims) : nodes_(2 * prims) {}

  /// Thread-safe, as is the next one.
  Subtree Put(std::span<const BuildNode> nodes) {
    const uint32_t count = uint32_t(nodes.size()), begin = used_.fetch_add(count);
    std::copy(nodes.begin(), nodes.end(), &nodes_[begin]);
    return {{{begin, count}}, count};
  }
  /// A node above two subtrees.
  Subtree Join(BuildNode node, const Subtree& left, const Subtree& right) {
    node.right = 1 + left.nodes, node.first = node.count = 0;
    Subtree all = Put({&node, 1});
    for (const Subtree* s : {&left, &right}) {
      all.pieces.insert(all.pieces.end(), s->pieces.begin(), s->pieces.end());
      all.nodes += s->nodes;
    }
    return all;
  }
  /// The nodes of the whole tree, as BinaryTree wants them.
  HugeArray<BuildNode> Take(const Subtree& all) const {
    HugeArray<BuildNode> nodes(all.nodes);
    std::vector<uint32_t> places;
    uint32_t sum = 0;
    for (const Piece& piece : all.pieces) places.push_back(sum), sum += piece.count;
    ParallelFor(size_t{0}, all.pieces.size(), [&](size_t p) {
      for (uint32_t i = 0; i < all.pieces[p].count; ++i) {
        BuildNode node = nodes_[all.pieces[p].begin + i];
        if (node.count == 0) node.right += places[p] + i;
        nodes[places[p] + i] = node;
      }
    });
    return nodes;
  }

  /// Bytes for so many primitives: here, and of the whole tree at most.
  static uint64_t Bytes(uint64_t prims) { return prims * 2 * sizeof(BuildNode); }

 private:
  HugeArray<BuildNode> nodes_;
  std::atomic<uint32_t> used_{0};
};

/// Builds from the root down. `Work` describes a subtree: size() primitives now, room() at most when done.
/// divide(work, node, left, right) either makes a leaf of the node and returns false; or gives it bounds, says what is to
/// be done on both sides, and returns true. Small subtrees are built serially, others as tasks.
template <class Work, class Divide>
void BuildSmall(const Work& work, const Divide& divide, NodeList& nodes) {
  const uint32_t node = nodes.Add();
  Work left, right;
  if (!divide(work, nodes[node], left, right)) return;
  nodes[node].first = nodes[node].count = 0;
  BuildSmall(left, divide, nodes);
  nodes.SetRight(node);
  BuildSmall(right, divide, nodes);
}
template <class Work, class Divide>
NodeStore::Subtree BuildDown(const Work& work, const Divide& divide, NodeStore& store,
                             const volatile int* cancel) {
  if (work.size() < kTaskRange) {
    NodeList nodes(work.room());
    BuildSmall(work, divide, nodes);
    return store.Put(nodes.nodes());
  }
  CheckCancel(cancel);
  BuildNode node;
  Work left, right;
  if (!divide(work, node, left, right)) return store.Put({&node, 1});
  NodeStore::Subtree lefts, rights;
  ParallelInvoke([&] { lefts = BuildDown(left, divide, store, cancel); },
                 [&] { rights = BuildDown(right, divide, store, cancel); });
  return store.Join(node, lefts, rights);
}

}  // namespace raybench
