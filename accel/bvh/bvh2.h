// A binary BVH, laid out for traversal: how it is stored (bvh2.cpp) and how rays walk it (bvh2_query.cpp).
// Builders are apart; what they hand over is a BinaryTree.
//
// Node, 64 bytes, one cache line; holds the bounds of its two children:
//
//     x: lo0 lo1 hi0 hi1 | y: lo0 lo1 hi0 hi1 | z: lo0 lo1 hi0 hi1 | child0 child1 | stand_in0 stand_in1
//
// so that three four-lane operations an axis test both children, with the planes met first in lanes 0 and 1.
// Leaves are blocks of triangles (ray/leaf_blocks.h), told apart in the child reference: bit 31 set, then
// (primitives - 1) in 4 bits and the first block in 27.
//
// Traversal is conservative when the test is (ray/bounds.h): nothing that the primitive test accepts is
// culled, a node whose entry equals the best t is still visited, so that the lowest id wins ties, and the
// answer is that of `brute`.
#pragma once

#include <vector>

#include "accel/base/huge_array.h"
#include "accel/bvh/binary_tree.h"
#include "accel/contract/counting.h"
#include "accel/ray/leaf_blocks.h"
#include "accel/ray/primitive.h"

namespace raybench {

class Study;
enum class SlabRule : uint32_t;
class StudyTest;

class Bvh2 {
 public:
  static constexpr uint32_t kMaxLeaf = 16;

  Bvh2() = default;
  /// Lays out what a builder made. Runs inside the caller's task arena. An empty scene has no builder's tree:
  /// use the default constructor. Throws std::runtime_error if the tree is deeper or larger than references
  /// can tell.
  Bvh2(const rb_geometry& geometry, const BinaryTree& tree);

  /// Answers with the ray tests of `numerics`. Counter: NoCounting or Counting.
  template <class Counter>
  void Query(uint32_t numerics, const rb_query& query) const;
  /// The same with the tests of a study that is on (ray/study.h); `rule` kAsNumerics: the traversal of `numerics`.
  template <class Counter>
  void QueryStudy(const Study& study, SlabRule rule, uint32_t numerics, const rb_query& query) const;

  const auto& leaves() const { return leaves_; }

  /// From now on QueryStudy() takes the boxes of inner nodes at `depth`, > 0, for what they hold: a ray hits the face
  /// where it enters, or leaves if it starts inside, as the primitive in the box whose own is largest.
  void StandIn(uint32_t depth);

  MemoryUse Memory() const { return {nodes_.bytes(), leaves_.bytes(), leaves_.needs_geometry()}; }

  /// node(const rb_node&) in pre-order until it returns non-zero.
  template <class Fn>
  int Visit(Fn&& node) const {
    return root_ == kEmpty ? 0 : VisitBelow(root_, bounds_, 0, node);
  }

 private:
  /// As wide as a leaf test can be: a leaf costs less than the nodes that it saves.
  using Blocks = LeafBlocks<8>;
  static constexpr uint32_t kLeaf = 0x80000000u, kEmpty = 0xFFFFFFFFu, kBlockBits = 27;

  struct alignas(64) Node {
    float bounds[3][4];
    uint32_t child[2];
    uint32_t stand_in[2];  ///< StandIn(): 1 + the primitive that stands for what the child holds; else 0
  };
  static_assert(sizeof(Node) == 64);

  struct Part;
  static std::vector<Part> Divide(const BinaryTree& tree);
  static void Count(const BinaryTree& tree, Part& part);
  void LayOut(const BinaryTree& tree, const std::vector<Part>& parts, const Part& part);

  /// Where a child lies: asked for when it is pushed, since large trees are bound by memory.
  const void* Address(uint32_t ref) const {
    return (ref & kLeaf) != 0 ? static_cast<const void*>(leaves_.Address(FirstBlock(ref))) : &nodes_[ref];
  }
  static constexpr uint32_t LeafRef(uint32_t count, uint32_t first_block) {
    return kLeaf | ((count - 1) << kBlockBits) | first_block;
  }
  /// The last block that bits can name would make the largest leaf look like nothing.
  static constexpr uint32_t kMostFirstBlock = (1u << kBlockBits) - 2;
  static uint32_t LeafSize(uint32_t ref) { return ((ref >> kBlockBits) & 15u) + 1; }
  static uint32_t FirstBlock(uint32_t ref) { return ref & ((1u << kBlockBits) - 1); }

  template <class Test, class Counter, bool kProcedural>
  void QueryLeaves(const rb_query& query) const;

  template <class Test, class Counter, bool kProcedural, bool kAnyHit>
  void Trace(const RayState<Test>& ray, rb_hit& best, Counter& counter) const;
  template <class NodeTest, class Test, class Counter, bool kProcedural, bool kAnyHit>
  void Walk(const NodeTest& test, const RayState<Test>& ray, rb_hit& best, Counter& counter) const;

  template <class Test, class Counter, bool kProcedural, bool kAnyHit>
  bool Leaf(uint32_t ref, const RayState<Test>& ray, rb_hit& best, Counter& counter) const;

  template <class Ray, class Counter>
  static bool StandsIn(const Node& node, const Ray& ray, Float4 m, unsigned& hit, Float4 limits, rb_hit& best,
                       Counter& counter);

  template <class Fn>
  int VisitBelow(uint32_t ref, const Bounds3& box, uint32_t depth, Fn& node) const;
  void StandInBelow(uint32_t ref, uint32_t levels);
  uint32_t LargestBelow(uint32_t ref) const;

  HugeArray<Node> nodes_;
  Blocks leaves_;
  uint32_t root_ = kEmpty;
  Bounds3 bounds_;
  bool clipped_ = false, stands_in_ = false;
  rb_geometry geometry_{};
};

template <class Fn>
int Bvh2::VisitBelow(uint32_t ref, const Bounds3& box, uint32_t depth, Fn& node) const {
  const float bounds[6] = {box.lo.x, box.lo.y, box.lo.z, box.hi.x, box.hi.y, box.hi.z};
  rb_node shown{depth, 0, clipped_, RB_SHAPE_BOX, bounds, 6, 0, nullptr};
  if ((ref & kLeaf) != 0) {
    uint32_t prims[kMaxLeaf];
    shown.is_leaf = 1, shown.prim_count = LeafSize(ref), shown.prims = prims;
    for (uint32_t i = 0; i < shown.prim_count; ++i) prims[i] = leaves_.prim(FirstBlock(ref), i);
    return node(shown);
  }
  if (int stop = node(shown)) return stop;
  const Node& n = nodes_[ref];
  for (int c = 0; c < 2; ++c) {
    const auto& b = n.bounds;
    const Bounds3 child{{b[0][c], b[1][c], b[2][c]}, {b[0][c + 2], b[1][c + 2], b[2][c + 2]}};
    if (int stop = VisitBelow(n.child[c], child, depth + 1, node)) return stop;
  }
  return 0;
}

}  // namespace raybench
