#pragma once

#include <memory>

#include "accel/bvh/wide/collapse.h"
#include "accel/bvh/wide/leaf_test.h"
#include "accel/bvh/wide/rays.h"
#include "accel/contract/counting.h"
#include "accel/ray/leaf_blocks.h"
#include "accel/ray/primitive.h"

#ifndef PREFETCH
#define PREFETCH 7
#endif
namespace raybench {

/// Eight children, planes in rows.
template <int kWidth>
struct alignas(64) FullNode {
  float planes[6][kWidth];
  uint32_t child[kWidth];
};

template <int kWidth>
class WideTree {
 public:
  static constexpr uint32_t kLeaf = 0x80000000u, kEmpty = 0xFFFFFFFFu;
  using Node = FullNode<kWidth>;
  static constexpr int kLanes = kWidth < 8 ? kWidth : 8;
  using Blocks = LeafBlocks<kLanes>;
  using Block = typename Blocks::Block;
  using F = FloatN<kWidth>;
  struct alignas(32) Line {
    char bytes[32];
  };
  static constexpr uint32_t kNodeLines = sizeof(Node) / sizeof(Line), kBlockLines = sizeof(Block) / sizeof(Line);

  WideTree() = default;
  WideTree(const rb_geometry& geometry, const BinaryTree& tree, const WideTopology& topology)
      : geometry_(geometry), clipped_(tree.clipped) {
    constexpr float kInf = std::numeric_limits<float>::infinity();
    const BuildNode& root = tree.nodes[0];
    bounds_ = {LoadVec3(root.lo), LoadVec3(root.hi)};
    const uint32_t nodes = topology.nodes();
    if (nodes == 0) {
      lines_ = HugeArray<Line>(kBlockLines);
      leaf_count_ = 1, root_ = kLeaf;
      Fill(0, geometry, {&tree.order[topology.children[0].first], topology.children[0].count});
      return;
    }
    std::vector<uint32_t> place(nodes);
    uint64_t end = 0;
    for (uint32_t i = 0; i < nodes; ++i) {
      place[i] = uint32_t(end);
      end += kNodeLines;
      for (uint32_t c = topology.begin[i]; c < topology.begin[i + 1]; ++c)
        if (topology.children[c].count > 0) end += kBlockLines, ++leaf_count_;
    }
    node_count_ = nodes, root_ = 0;
    if (end >= kLeaf) throw std::runtime_error("too many primitives");
    lines_ = HugeArray<Line>(end);
    ParallelFor(Range<size_t>(0, nodes, 256), [&](const auto& range) {
      for (size_t i = range.begin(); i < range.end(); ++i) {
        Node& node = *reinterpret_cast<Node*>(&lines_[place[i]]);
        uint32_t leaf = place[i] + kNodeLines;
        const uint32_t begin = topology.begin[i], count = topology.begin[i + 1] - begin;
        for (uint32_t c = 0; c < uint32_t(kWidth); ++c) {
          if (c >= count) {
            for (int a = 0; a < 3; ++a) node.planes[a][c] = kInf, node.planes[a + 3][c] = -kInf;
            node.child[c] = kEmpty;
            continue;
          }
          const WideTopology::Child& child = topology.children[begin + c];
          const BuildNode& from = tree.nodes[child.slot];
          for (int a = 0; a < 3; ++a) node.planes[a][c] = from.lo[a], node.planes[a + 3][c] = from.hi[a];
          if (child.count > 0) {
            Fill(leaf, geometry, {&tree.order[child.first], child.count});
            node.child[c] = kLeaf | leaf;
            leaf += kBlockLines;
          } else {
            node.child[c] = place[child.first];
          }
        }
      }
    });
  }

  template <class Counter>
  void Query(uint32_t numerics, const rb_query& query) const {
    WithNumerics(numerics, [&]<class Test>() {
      if (geometry_.procedural_count > 0) {
        QueryLeaves<SharedLeafTest<Test, true, kLanes>, Test, Counter>(query);
      } else if constexpr (std::is_same_v<Test, WatertightTest>) {
        QueryLeaves<WatertightLeafTest<kLanes>, Test, Counter>(query);
      } else {
        QueryLeaves<SharedLeafTest<Test, false, kLanes>, Test, Counter>(query);
      }
    });
  }

  MemoryUse Memory() const {
    return {node_count_ * sizeof(Node), leaf_count_ * sizeof(Block), geometry_.procedural_count > 0};
  }

  template <class Fn>
  int Visit(Fn&& node) const {
    return root_ == kEmpty ? 0 : VisitBelow(root_, bounds_, 0, node);
  }

 private:
  const Node& NodeOf(uint32_t ref) const { return reinterpret_cast<const Node&>(lines_[ref]); }
  const Block& BlockOf(uint32_t ref) const { return reinterpret_cast<const Block&>(lines_[ref & ~kLeaf]); }
  void Fill(uint32_t line, const rb_geometry& geometry, std::span<const uint32_t> prims) {
    LeafBlocks<kLanes>::FillBlock(geometry, prims, reinterpret_cast<Block&>(lines_[line]));
  }
  [[gnu::always_inline]] void Ask(uint32_t ref) const {
    const char* at = lines_[ref & ~kLeaf].bytes;
    for (int i = 0; i < PREFETCH; ++i) __builtin_prefetch(at + 64 * i);
  }
  template <class LeafTest, class Test, class Counter>
  void QueryLeaves(const rb_query& query) const {
    if (root_ == kEmpty) return ForEachRay<Counter>(query, [](auto, const auto&, auto&, auto&) {});
    ForEachRay<Counter>(query, [&](auto any, const RayQuery& q, rb_hit& best, Counter& counter) {
      const SlabRay4 slab(q.ray, Test::kSlack);
      const LeafTest leaf(q, slab, geometry_);
      if constexpr (!Counter::kCounts && kHasFma) {
        if (WideRay<kWidth, true>::Fits(slab)) [[likely]] {
          Trace<any.value>(WideRay<kWidth, true>(slab), leaf, q, best, counter);
          return;
        }
      }
      Trace<any.value>(WideRay<kWidth, false>(slab), leaf, q, best, counter);
    });
  }
  template <bool kAnyHit, class Ray, class LeafTest, class Counter>
  [[gnu::always_inline]] void Trace(const Ray& ray, const LeafTest& leaf, const RayQuery& q, rb_hit& best, Counter& counter) const {
    if constexpr (kAnyHit) {
      Any(ray, leaf, q, best, counter);
    } else {
      Closest(ray, leaf, q, best, counter);
    }
  }

  [[gnu::always_inline]] static const float* Row(const Node& node, uint32_t at) {
    return reinterpret_cast<const float*>(reinterpret_cast<const char*>(&node) + at);
  }
  template <class Ray>
  [[gnu::always_inline]] static unsigned Hits(const Node& node, const Ray& ray, F tnear, F tfar, F& entry) {
    const F nx = ray.Near(0, Load<F>(Row(node, ray.near_at[0]))),
            ny = ray.Near(1, Load<F>(Row(node, ray.near_at[1]))),
            nz = ray.Near(2, Load<F>(Row(node, ray.near_at[2]))),
            fx = ray.Far(0, Load<F>(Row(node, ray.far_at[0]))),
            fy = ray.Far(1, Load<F>(Row(node, ray.far_at[1]))),
            fz = ray.Far(2, Load<F>(Row(node, ray.far_at[2])));
    entry = Larger<kWidth>(nx, Larger<kWidth>(ny, Larger<kWidth>(nz, tnear)));
    const F exit = Smaller<kWidth>(fx, Smaller<kWidth>(fy, Smaller<kWidth>(fz, tfar)));
    return LessEqual<kWidth>(entry, exit);
  }

  template <bool kAnyHit, class LeafTest, class Counter>
  [[gnu::always_inline]] bool Leaf(uint32_t ref, const LeafTest& leaf, rb_hit& best, Counter& counter) const {
    counter.Step(0), counter.Leaf(false);
    if constexpr (Counter::kCounts) counter.Prims(LeafSize(ref), sizeof(Block));
    return leaf.template Take<kAnyHit>(BlockOf(ref), best);
  }
  /// The lanes behind a leaf's last primitive repeat it.
  uint32_t LeafSize(uint32_t ref) const {
    const auto& prims = BlockOf(ref).prim;
    uint32_t n = 1;
    while (prims[n - 1] != prims[kLanes - 1]) ++n;
    return n;
  }

  template <class Ray, class LeafTest, class Counter>
  [[gnu::always_inline]] void Any(const Ray& ray, const LeafTest& leaf, const RayQuery& q, rb_hit& best, Counter& counter) const {
    struct Entry {
      const Node* node;
      unsigned mask;
    };
    Entry stack[kMaxTreeDepth];
    Entry* top = stack;
    if (root_ != 0) {
      Leaf<true>(root_, leaf, best, counter);
      return;
    }
    const F tnear = Splat<F>(q.ray.tnear), tfar = Splat<F>(best.t);
    const Node* node = &NodeOf(0);
    for (;;) {
      F entry;
      counter.Step(sizeof(Node)), counter.Bounds(kWidth);
      unsigned mask = Hits(*node, ray, tnear, tfar, entry);
      for (;;) {
        while (mask == 0) {
          if (top == stack) return;
          --top;
          node = top->node, mask = top->mask;
        }
        const uint32_t ref = node->child[__builtin_ctz(mask)];
        mask &= mask - 1;
        if ((ref & kLeaf) != 0) {
          if (Leaf<true>(ref, leaf, best, counter)) return;
          continue;
        }
        if (PREFETCH > 0 && mask != 0) Ask(node->child[__builtin_ctz(mask)]);
        *top = {node, mask};
        top += mask != 0;
        node = &NodeOf(ref);
        break;
      }
    }
  }

  template <class Ray, class LeafTest, class Counter>
  [[gnu::always_inline]] void Closest(const Ray& ray, const LeafTest& leaf, const RayQuery& q, rb_hit& best, Counter& counter) const {
    struct Group {
      F entry;
      const Node* node;
      unsigned mask;
    };
    Group stack[kMaxTreeDepth];
    Group* top = stack;
    if (root_ != 0) {
      Leaf<false>(root_, leaf, best, counter);
      return;
    }
    const F tnear = Splat<F>(q.ray.tnear + 0.0f);
    F tfar = Splat<F>(best.t);
    const Node* node = &NodeOf(0);
    for (;;) {
      F entry;
      counter.Step(sizeof(Node)), counter.Bounds(kWidth);
      unsigned mask = Hits(*node, ray, tnear, tfar, entry);
      for (;;) {
        while (mask == 0) {
          if (top == stack) return;
          --top;
          node = top->node, entry = top->entry;
          mask = top->mask & LessEqual<kWidth>(entry, tfar);
        }
#if NEAREST == 0
        const unsigned i = Nearest(entry, mask);
#else
        const unsigned i = (mask & (mask - 1)) == 0 ? unsigned(__builtin_ctz(mask)) : Nearest(entry, mask);
#endif
        const uint32_t ref = node->child[i];
        mask &= ~(1u << i);
        if ((ref & kLeaf) != 0) {
          if (Leaf<false>(ref, leaf, best, counter)) {
            tfar = Splat<F>(best.t);
            mask &= LessEqual<kWidth>(entry, tfar);
          }
          continue;
        }
        if (PREFETCH > 0 && mask != 0) Ask(node->child[__builtin_ctz(mask)]);
        top->entry = entry, top->node = node, top->mask = mask;
        top += mask != 0;
        node = &NodeOf(ref);
        break;
      }
    }
  }

#ifndef NEAREST
#define NEAREST 1
#endif
  [[gnu::always_inline]] static unsigned Nearest(F entry, unsigned mask) {
    using I = IntN<kWidth>;
    I key = (I(entry) & ~(kWidth - 1)) | Iota<I>();
#if defined(__AVX512VL__)
    if constexpr (kWidth == 8) {
      __m256i k = _mm256_mask_mov_epi32(_mm256_set1_epi32(0x7FFFFFFF), __mmask8(mask), __m256i(key));
      __m128i m = _mm_min_epi32(_mm256_castsi256_si128(k), _mm256_extracti128_si256(k, 1));
      m = _mm_min_epi32(m, _mm_shuffle_epi32(m, 0x4E));
      m = _mm_min_epi32(m, _mm_shuffle_epi32(m, 0xB1));
      return unsigned(_mm_cvtsi128_si32(m)) & 7;
    }
    if constexpr (kWidth == 4) {
      __m128i m = _mm_mask_mov_epi32(_mm_set1_epi32(0x7FFFFFFF), __mmask8(mask), __m128i(key));
      m = _mm_min_epi32(m, _mm_shuffle_epi32(m, 0x4E));
      m = _mm_min_epi32(m, _mm_shuffle_epi32(m, 0xB1));
      return unsigned(_mm_cvtsi128_si32(m)) & 3;
    }
    if constexpr (kWidth == 16) {
      __m512i w = _mm512_mask_mov_epi32(_mm512_set1_epi32(0x7FFFFFFF), __mmask16(mask), __m512i(key));
      __m256i k = _mm256_min_epi32(_mm512_castsi512_si256(w), _mm512_extracti64x4_epi64(w, 1));
      __m128i m = _mm_min_epi32(_mm256_castsi256_si128(k), _mm256_extracti128_si256(k, 1));
      m = _mm_min_epi32(m, _mm_shuffle_epi32(m, 0x4E));
      m = _mm_min_epi32(m, _mm_shuffle_epi32(m, 0xB1));
      return unsigned(_mm_cvtsi128_si32(m)) & 15;
    }
#endif
    unsigned best = 0;
    int32_t least = 0x7FFFFFFF;
    for (; mask != 0; mask &= mask - 1) {
      const unsigned i = unsigned(__builtin_ctz(mask));
      if (key[i] < least) least = key[i], best = i;
    }
    return best;
  }

  template <class Fn>
  int VisitBelow(uint32_t ref, const Bounds3& box, uint32_t depth, Fn& node) const {
    const float bounds[6] = {box.lo.x, box.lo.y, box.lo.z, box.hi.x, box.hi.y, box.hi.z};
    rb_node shown{depth, 0, clipped_, RB_SHAPE_BOX, bounds, 6, 0, nullptr};
    if ((ref & kLeaf) != 0) {
      const uint32_t* prims = BlockOf(ref).prim;
      shown.is_leaf = 1, shown.prims = prims, shown.prim_count = LeafSize(ref);
      return node(shown);
    }
    if (int stop = node(shown)) return stop;
    const Node& n = NodeOf(ref);
    for (int c = 0; c < kWidth && n.child[c] != kEmpty; ++c) {
      const auto& p = n.planes;
      const Bounds3 child{{p[0][c], p[1][c], p[2][c]}, {p[3][c], p[4][c], p[5][c]}};
      if (int stop = VisitBelow(n.child[c], child, depth + 1, node)) return stop;
    }
    return 0;
  }

  rb_geometry geometry_{};
  HugeArray<Line> lines_;
  uint64_t node_count_ = 0, leaf_count_ = 0;
  uint32_t root_ = kEmpty;
  Bounds3 bounds_;
  bool clipped_ = false;
};

}  // namespace raybench
