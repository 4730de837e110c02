// embree_topology: the tree that Embree's builder makes, walked by a traversal of ours that counts.
//
// Embree tells nobody how many nodes its rays visit. rtcBuildBVH gives its builder (Wald et al. 2014) out of
// its hands, so the same boxes can be arranged by the same code and then be counted. That is a proxy, no
// more: Embree's own scene builders use other leaf sizes, other node types and, at HIGH, spatial splits, and
// its kernels order and cull in their own way. Its times say nothing about Embree.
//
// Node, 256 bytes, four cache lines: lower and upper ends of up to eight children by axis, then the
// references, with bit 31 set for leaves. Leaves are blocks of four triangles (leaf_blocks.h). Of the
// children met, the nearest is entered first. Robustness as everywhere: ray/bounds.h.
//
// Parameters: quality as Embree's LOW (Morton) and MEDIUM (binned SAH); width, the most children of a node;
// leaf_size. Invariants: every primitive stands in exactly one leaf, whose box encloses it. The tree depends
// on the number of threads as far as Embree's does.
#if RAYBENCH_EMBREE_MAJOR >= 4
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif
#include <fmt/format.h>

#include <memory>
#include <stdexcept>
#include <vector>

#include "accel/base/parallel.h"
#include "accel/contract/cancel.h"
#include "accel/ray/leaf_blocks.h"

namespace raybench {
namespace {

constexpr uint32_t kWidth = 8;
constexpr uint32_t kBuilderDepth = 60, kMaxDepth = 64;  // a leaf too large is halved further
constexpr uint32_t kMaxLeaf = 32;

/// What the builder's callbacks make.
struct Made {
  bool is_leaf;
  uint32_t count;  // leaf: primitives; inner: children
};
struct MadeNode : Made {
  const Made* child[kWidth];
  Bounds3 box[kWidth];
};
struct MadeLeaf : Made {
  uint32_t prims[1];  // and more behind it
};

Bounds3 FromEmbree(const RTCBounds& b) {
  return {{b.lower_x, b.lower_y, b.lower_z}, {b.upper_x, b.upper_y, b.upper_z}};
}

class EmbreeTopology {
 public:
  struct Config {
    uint32_t quality, numerics;
    int64_t width, leaf_size;
  };
  static constexpr const char* kName = "embree_topology";
  static constexpr const char* kDoc =
      "Embree's builder (rtcBuildBVH) under a counting traversal: a proxy for its node visits";
  static constexpr const char* kSource =
      "Wald, Woop, Benthin, Johnson, Ernst 2014: Embree, a kernel framework";
  static constexpr Kind kKind = {"library", "O(N log N)", "SIMD leaves"};
  static constexpr uint64_t kCapabilities = RB_CAN_COUNT | RB_CAN_PROCEDURAL | RB_CAN_AFTER | RB_CAN_SKIP;
  static std::span<const rb_param> Params() {
    static const char* const kQualities[] = {"low", "medium", nullptr};
    static const rb_param params[] = {
        ChoiceParam("quality", "build quality: low (Morton), medium (binned SAH)", offsetof(Config, quality),
                    kQualities, 1),
        NumericsParam(offsetof(Config, numerics)),
        IntParam("width", "most children of a node", offsetof(Config, width), 2, kWidth, kWidth),
        IntParam("leaf_size", "most primitives in a leaf", offsetof(Config, leaf_size), 1, kMaxLeaf, 8)};
    return params;
  }

  EmbreeTopology(const rb_geometry& geometry, const rb_build_options& options, const Config& config)
      : numerics_(config.numerics), claim_(ClaimOf(config.numerics, geometry)) {
    const uint64_t prims = PrimCount(geometry);
    if (prims == 0) return;
    RequireWithinLimit(prims * (sizeof(RTCBuildPrimitive) + sizeof(MadeNode) / 4 + sizeof(MadeLeaf)),
                       options);
    const bool padded = IsConservative(config.numerics);
    std::vector<RTCBuildPrimitive> boxes(prims);
    for (uint32_t i = 0; i < prims; ++i) {
      const Bounds3 b = padded ? PaddedPrimBounds(geometry, i) : PrimBounds(geometry, i);
      bounds_.Extend(b);
      boxes[i] = {b.lo.x, b.lo.y, b.lo.z, 0, b.hi.x, b.hi.y, b.hi.z, i};
    }
    const std::unique_ptr<RTCDeviceTy, void (*)(RTCDevice)> device(rtcNewDevice(nullptr), rtcReleaseDevice);
    if (!device) throw std::runtime_error("Embree gives no device");
    const std::unique_ptr<RTCBVHTy, void (*)(RTCBVH)> bvh(rtcNewBVH(device.get()), rtcReleaseBVH);
    RTCBuildArguments build = rtcDefaultBuildArguments();
    build.byteSize = sizeof build;
    build.buildQuality = config.quality == 0 ? RTC_BUILD_QUALITY_LOW : RTC_BUILD_QUALITY_MEDIUM;
    build.maxBranchingFactor = unsigned(config.width);
    build.maxDepth = kBuilderDepth;
    build.sahBlockSize = LeafBlocks<>::kLanes;
    build.minLeafSize = 1;
    build.maxLeafSize = unsigned(config.leaf_size);
    build.bvh = bvh.get();
    build.primitives = boxes.data(), build.primitiveCount = build.primitiveArrayCapacity = boxes.size();
    build.createNode = [](RTCThreadLocalAllocator allocator, unsigned, void*) -> void* {
      return new (rtcThreadLocalAlloc(allocator, sizeof(MadeNode), 16)) MadeNode{};
    };
    build.setNodeChildren = [](void* node, void** children, unsigned count, void*) {
      MadeNode& n = *static_cast<MadeNode*>(node);
      n.count = count;
      for (unsigned i = 0; i < count; ++i) n.child[i] = static_cast<const Made*>(children[i]);
    };
    build.setNodeBounds = [](void* node, const RTCBounds** bounds, unsigned count, void*) {
      for (unsigned i = 0; i < count; ++i) static_cast<MadeNode*>(node)->box[i] = FromEmbree(*bounds[i]);
    };
    build.createLeaf = [](RTCThreadLocalAllocator allocator, const RTCBuildPrimitive* prims, size_t count,
                          void*) -> void* {
      auto* leaf = static_cast<MadeLeaf*>(
          rtcThreadLocalAlloc(allocator, sizeof(MadeLeaf) + count * sizeof(uint32_t), 16));
      leaf->is_leaf = true, leaf->count = uint32_t(count);
      for (size_t i = 0; i < count; ++i) leaf->prims[i] = prims[i].primID;
      return leaf;
    };
    build.buildProgress = [](void* cancel, double) {
      return !IsCancelled(static_cast<const volatile int*>(cancel));
    };
    build.userPtr = const_cast<int*>(options.cancel);
    const Made* root;
    {
      const ThreadLimit threads(options.threads);
      root = static_cast<const Made*>(rtcBuildBVH(&build));
    }
    CheckCancel(options.cancel);
    if (root == nullptr)
      throw std::runtime_error(fmt::format("Embree reports error {}", int(rtcGetDeviceError(device.get()))));
    LayOut(geometry, *root);
    RequireWithinLimit(Memory().nodes + Memory().prims, options);
  }

  template <class Counter>
  void Query(const rb_query& query) const {
    WithNumerics(numerics_, [&]<class Test>() {
      ForEachRay<Counter>(query, [&](auto any, const RayQuery& q, rb_hit& best, Counter& counter) {
        const RayState<Test> ray(q);
        if (blocks_.needs_geometry()) {
          Trace<true, any.value>(ray, best, counter);
        } else {
          Trace<false, any.value>(ray, best, counter);
        }
      });
    });
  }
  uint32_t Claims() const { return claim_; }
  MemoryUse Memory() const {
    return {nodes_.size() * sizeof(Node) + leaves_.size() * sizeof(Leaf), blocks_.bytes(),
            blocks_.needs_geometry()};
  }
  template <class Fn>
  int Visit(Fn&& node) const {
    return root_ == kEmpty ? 0 : VisitBelow(root_, bounds_, 0, node);
  }

 private:
  static constexpr uint32_t kLeaf = 0x80000000u, kEmpty = 0xFFFFFFFFu;

  struct alignas(64) Node {
    float lo[3][kWidth], hi[3][kWidth];  // lanes without a child hold an empty box
    uint32_t child[kWidth];
    uint32_t count, unused[7];
  };
  static_assert(sizeof(Node) == 256);
  struct Leaf {
    uint32_t block, count;
  };

  void LayOut(const rb_geometry& geometry, const Made& root) {
    struct Pending {
      const Made* made;
      uint32_t parent, side, depth;
    };
    std::vector<Pending> stack{{&root, kEmpty, 0, 0}};
    std::vector<const MadeLeaf*> made_leaves;
    uint32_t blocks = 0;
    while (!stack.empty()) {
      const Pending p = stack.back();
      stack.pop_back();
      if (p.depth >= kMaxDepth) throw std::runtime_error("the tree is deeper than the traversal stack");
      uint32_t ref;
      if (p.made->is_leaf) {
        if (p.made->count > kMaxLeaf) throw std::runtime_error("a leaf has too many primitives");
        ref = kLeaf | uint32_t(leaves_.size());
        leaves_.push_back({blocks, p.made->count});
        made_leaves.push_back(static_cast<const MadeLeaf*>(p.made));
        blocks += uint32_t(LeafBlocks<>::BlocksOf(p.made->count));
      } else {
        const auto& made = static_cast<const MadeNode&>(*p.made);
        ref = uint32_t(nodes_.size());
        Node& node = nodes_.emplace_back();
        node.count = made.count;
        for (uint32_t i = 0; i < kWidth; ++i) {
          const Bounds3 box = i < node.count ? made.box[i] : Bounds3{};
          for (int a = 0; a < 3; ++a) node.lo[a][i] = box.lo[a], node.hi[a][i] = box.hi[a];
        }
        for (uint32_t i = node.count; i-- > 0;) stack.push_back({made.child[i], ref, i, p.depth + 1});
      }
      if (p.parent == kEmpty) {
        root_ = ref;
      } else {
        nodes_[p.parent].child[p.side] = ref;
      }
    }
    blocks_ = LeafBlocks<>(geometry, blocks);
    for (size_t i = 0; i < leaves_.size(); ++i)
      blocks_.Fill(leaves_[i].block, {made_leaves[i]->prims, leaves_[i].count});
  }

  template <bool kProcedural, bool kAnyHit, class Test, class Counter>
  void Trace(const RayState<Test>& ray, rb_hit& best, Counter& counter) const {
    struct Entry {
      uint32_t ref;
      float tnear;
    };
    Entry stack[kMaxDepth * (kWidth - 1) + 1];
    if (root_ == kEmpty) return;
    uint32_t top = 0;
    stack[top++] = {root_, ray.query.ray.tnear};
    while (top > 0) {
      const Entry at = stack[--top];
      if (at.tnear > best.t) continue;
      if ((at.ref & kLeaf) != 0) {
        const Leaf& leaf = leaves_[at.ref & ~kLeaf];
        counter.Step(sizeof(Leaf));
        counter.Leaf(false);
        if (blocks_.Intersect<kProcedural, kAnyHit>(leaf.block, leaf.count, ray, best, counter,
                                                    NoMailbox{}) &&
            kAnyHit)
          return;
        continue;
      }
      const Node& node = nodes_[at.ref];
      counter.Step(sizeof(Node));
      counter.Bounds(node.count);
      Entry hit[kWidth];
      uint32_t hits = 0;
      for (uint32_t half = 0; half < kWidth; half += 4) {
        Float4 entry = Splat<Float4>(ray.query.ray.tnear), exit = Splat<Float4>(best.t);
        for (int a = 0; a < 3; ++a) {
          const bool negative = ray.slab.negative(a);
          const Float4 front = Load<Float4>((negative ? node.hi : node.lo)[a] + half),
                       back = Load<Float4>((negative ? node.lo : node.hi)[a] + half),
                       org = Splat<Float4>(ray.slab.org[a]);
          entry = MaxOrSecond((front - org) * ray.slab.inv_near[a], entry);
          exit = MinOrSecond((back - org) * ray.slab.inv_far[a], exit);
        }
        for (unsigned met = Mask(entry <= exit); met != 0; met &= met - 1) {
          const int lane = __builtin_ctz(met);
          hit[hits++] = {node.child[half + uint32_t(lane)], entry[lane]};
        }
      }
      // The farthest goes to the bottom of the stack.
      for (uint32_t i = 1; i < hits; ++i)
        for (uint32_t k = i; k > 0 && hit[k - 1].tnear < hit[k].tnear; --k) std::swap(hit[k - 1], hit[k]);
      for (uint32_t i = 0; i < hits; ++i) stack[top++] = hit[i];
    }
  }

  template <class Fn>
  int VisitBelow(uint32_t ref, const Bounds3& box, uint32_t depth, Fn& node) const {
    const float bounds[6] = {box.lo.x, box.lo.y, box.lo.z, box.hi.x, box.hi.y, box.hi.z};
    rb_node shown{depth, 0, 0, RB_SHAPE_BOX, bounds, 6, 0, nullptr};
    if ((ref & kLeaf) != 0) {
      const Leaf& leaf = leaves_[ref & ~kLeaf];
      uint32_t prims[kMaxLeaf];
      for (uint32_t i = 0; i < leaf.count; ++i) prims[i] = blocks_.prim(leaf.block, i);
      shown.is_leaf = 1, shown.prim_count = leaf.count, shown.prims = prims;
      return node(shown);
    }
    if (int stop = node(shown)) return stop;
    const Node& n = nodes_[ref];
    for (uint32_t i = 0; i < n.count; ++i) {
      const Bounds3 child{{n.lo[0][i], n.lo[1][i], n.lo[2][i]}, {n.hi[0][i], n.hi[1][i], n.hi[2][i]}};
      if (int stop = VisitBelow(n.child[i], child, depth + 1, node)) return stop;
    }
    return 0;
  }

  uint32_t numerics_, claim_, root_ = kEmpty;
  Bounds3 bounds_;
  std::vector<Node> nodes_;
  std::vector<Leaf> leaves_;
  LeafBlocks<> blocks_;
};

}  // namespace

RAYBENCH_STRUCTURE(embree_topology, EmbreeTopology)

}  // namespace raybench
