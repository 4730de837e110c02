// How traversal tests leaves, one block each.
#pragma once

#include "accel/bvh/wide/compact_leaves.h"
#include "accel/ray/leaf_blocks.h"

namespace raybench {

/// Whatever is asked seldom, as a call: any test, also of procedural primitives, in any form of leaves.
template <int kLanes>
class CalledLeafTest {
 public:
  using Block = typename LeafBlocks<kLanes>::Block;

  /// codec: nullptr for copied leaves.
  template <class Test>
  CalledLeafTest(const RayState<Test>& state, const rb_geometry& geometry, const LeafCodec<kLanes>* codec)
      : state_(&state),
        geometry_(geometry),
        decode_(codec == nullptr ? nullptr : codec->decode),
        closest_(geometry.procedural_count > 0 ? &Call<Test, true, false> : &Call<Test, false, false>),
        any_(geometry.procedural_count > 0 ? &Call<Test, true, true> : &Call<Test, false, true>) {}

  template <bool kAnyHit>
  bool Take(const void* leaf, rb_hit& best) const {
    const Function test = kAnyHit ? any_ : closest_;
    if (decode_ == nullptr) return test(state_, geometry_, *static_cast<const Block*>(leaf), best);
    Block block;
    decode_(geometry_, leaf, block);
    return test(state_, geometry_, block, best);
  }

 private:
  using Function = bool (*)(const void* state, const rb_geometry&, const Block&, rb_hit&);

  template <class Test, bool kProcedural, bool kAnyHit>
  static bool Call(const void* state, const rb_geometry& geometry, const Block& block, rb_hit& best) {
    NoCounting counted;
    return LeafBlocks<kLanes>::template IntersectBlocks<kProcedural, kAnyHit>(
        geometry, &block, kLanes, *static_cast<const RayState<Test>*>(state), best, counted, NoMailbox{});
  }

  const void* state_;
  const rb_geometry& geometry_;
  void (*decode_)(const rb_geometry&, const void*, Block&);
  Function closest_, any_;
};

/// A test of copied leaves that decides some triangles at once, inlined. Made for a ray that has met the first node.
template <int kLanes, class Test>
class InlinedLeafTest {
 public:
  using Block = typename LeafBlocks<kLanes>::Block;

  [[gnu::always_inline]] InlinedLeafTest(const RayQuery& query, const SlabRay& slab, bool needs_uv)
      : query_(query), slab_(slab), lanes_(query, slab, Test(query.ray)), needs_uv_(needs_uv) {}

  template <bool kAnyHit>
  [[gnu::always_inline]] bool Take(const void* leaf, rb_hit& best) const {
    const Block& block = *static_cast<const Block*>(leaf);
    // The registers belong to the node test: what is needed here stays in memory.
    const InlinedLeafTest* self = this;
    asm("" : "+r"(self));
    return self->lanes_.template Take<kAnyHit>(block, kAllLanes<kLanes>, self->query_, self->slab_,
                                               self->needs_uv_, best);
  }

 private:
  const RayQuery& query_;
  const SlabRay& slab_;
  LanesOfTest<Test> lanes_;
  bool needs_uv_;
};

}  // namespace raybench
