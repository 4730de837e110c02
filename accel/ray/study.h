// Ray-triangle tests chosen when a structure is built: what `brute`, `bvh_sah` and `kdtree_sah` have beside `numerics`
// to measure speed against accuracy, one choice at a time.
//
// A structure that was built with such a choice tests the triangles of a leaf one by one, behind one call a block that
// is the same for all choices. So they compare among themselves. They do not compare with the structure at its
// defaults, where tests are compiled into the traversal and take all triangles of a block at once.
#pragma once

#include <cstddef>
#include <cstdint>

#include "accel/base/huge_array.h"
#include "accel/contract/cancel.h"
#include "accel/contract/parameters.h"
#include "accel/contract/structure.h"
#include "accel/ray/leaf_blocks.h"
#include "accel/ray/primitive.h"
#include "accel/ray/published.h"

namespace raybench {

/// Index of the parameter `triangle`.
enum class TriangleTest : uint32_t {
  kAsNumerics,
  kMollerTrumbore,
  kMollerTrumboreDouble,
  kBaldwinWeber,
  kPluecker,
  kWoop,
  kWoopDouble,
  kExact
};
inline constexpr const char* kTriangleChoices[] = {"as_numerics",
                                                   "moeller_trumbore",
                                                   "moeller_trumbore_double",
                                                   "baldwin_weber",
                                                   "pluecker",
                                                   "woop",
                                                   "woop_double",
                                                   "exact",
                                                   nullptr};
constexpr rb_param TriangleParam(size_t offset) {
  return ChoiceParam(
      "triangle",
      "ray-triangle test: that of `numerics`, or one as published, called triangle by triangle and "
      "claiming nothing; exact claims with numerics=exact (accel/ray/published.h)",
      offset, kTriangleChoices, uint32_t(TriangleTest::kAsNumerics), RB_PARAM_APPROXIMATE);
}
constexpr rb_param FmaParam(size_t offset) {
  return BoolParam("fma",
                   "the published tests with sums of products fused into one rounding; with "
                   "triangle=as_numerics that which `numerics` is made from",
                   offset, false, RB_PARAM_APPROXIMATE);
}

constexpr rb_param TToleranceParam(size_t offset) {
  return FloatParam("t_tolerance",
                    "closest-hit rays stop looking for a hit that would be nearer by no more: t is at most "
                    "1 + t_tolerance times the nearest hit's",
                    offset, 0, 1, 0, RB_PARAM_APPROXIMATE);
}

constexpr rb_param BoxDepthParam(size_t offset, double deepest) {
  return IntParam(
      "max_depth",
      "boxes at this depth stand for what they hold: rays hit their faces, named by the largest primitive "
      "in them; the tree below is kept, and not looked at; 0: none",
      offset, 0, deepest, 0, RB_PARAM_APPROXIMATE);
}

/// How a ray meets the two boxes of a node, where that is studied. The rules other than kAsNumerics are as published,
/// for boxes that are not padded.
enum class SlabRule : uint32_t {
  kAsNumerics,
  kNaive,    ///< minimum and maximum of both planes' t, as std::min and std::max are: NaN may come through
  kNanSafe,  ///< planes ordered by the direction's sign; NaN drops out
  kPadded,   ///< the same, the far end scaled by 1 + 2 gamma (Ize 2013: Robust BVH ray traversal)
};
inline constexpr const char* kSlabChoices[] = {"as_numerics", "naive", "nan_safe", "padded", nullptr};
constexpr rb_param SlabParam(size_t offset) {
  return ChoiceParam(
      "slab",
      "ray-box test: that of `numerics`, or one as published over boxes without padding, claiming "
      "nothing: std::min and std::max (naive), NaN-safe, or also with the far end padded",
      offset, kSlabChoices, uint32_t(SlabRule::kAsNumerics), RB_PARAM_APPROXIMATE);
}

/// How a ray's t at a splitting plane is allowed for, where that is studied. The rules other than kAsNumerics go with
/// boxes of primitives that are not padded.
enum class PlaneRule : uint32_t {
  kAsNumerics,
  kTextbook,  ///< as computed, for both sides (Havran 2000)
  kPadded,    ///< 1 -+ 2 gamma times that: cells overlap by the error of t
};

/// Triangles of a leaf as they lie in memory: coordinate `axis` of `corner` of triangle i is
/// v[(3 corner + axis) lanes + i].
struct StudyBlock {
  const float* v;
  const uint32_t* prim;
  uint32_t lanes, count;
  const published::BaldwinWeberMap* maps;  ///< of triangle 0; nullptr unless the test asks for them
};

/// What a structure keeps.
class Study {
 public:
  using Map = published::BaldwinWeberMap;
  struct Test;

  /// No study: the structure uses its ordinary way.
  Study() = default;
  /// `rules`: whether the structure departs from `numerics` in another way; then as_numerics is a test like the others, as
  /// it is where t_tolerance, >= 0, is not 0. With `fma` as_numerics is the
  /// published test that `numerics` is made from. Throws std::runtime_error where there is nothing to fuse.
  Study(uint32_t numerics, uint32_t triangle, bool fma, bool rules, double t_tolerance = 0);

  bool on() const { return test_ != nullptr; }
  /// RB_CLAIM_*: only the exact test, in a traversal made for it, claims anything.
  uint32_t Claim(const rb_geometry& geometry) const;

  /// Makes what the test keeps for each triangle, if anything. prim_at(i): what stands at place i of the leaves. `used`:
  /// bytes that the structure takes already, of its memory limit.
  template <class PrimAt>
  void Precompute(const rb_geometry& geometry, size_t places, const PrimAt& prim_at, uint64_t used,
                  const rb_build_options& options) {
    if (!NeedsMaps()) return;
    RequireWithinLimit(used + places * sizeof(Map), options);
    maps_ = HugeArray<Map>(places);
    for (size_t i = 0; i < places; ++i) {
      if (i % 4096 == 0) CheckCancel(options.cancel);
      maps_[i] = MapOf(geometry, prim_at(i));
    }
  }
  /// For triangles in blocks.
  template <uint32_t kWidth>
  void Precompute(const rb_geometry& geometry, const LeafBlocks<kWidth>& blocks, uint64_t used,
                  const rb_build_options& options) {
    const size_t places = size_t(blocks.bytes() / sizeof(typename LeafBlocks<kWidth>::Block)) * kWidth;
    Precompute(
        geometry, places, [&](size_t i) { return blocks.prim(i / kWidth, uint32_t(i % kWidth)); }, used,
        options);
  }
  const Map* maps(size_t place) const { return maps_.size() == 0 ? nullptr : &maps_[place]; }
  uint64_t bytes() const { return maps_.bytes(); }
  /// What the test of `count` triangles reads, which takes `vertices` bytes where it needs their vertices.
  uint64_t BytesTested(uint64_t count, uint64_t vertices) const {
    return maps_.size() == 0 ? vertices : count * (sizeof(Map) + sizeof(uint32_t));
  }
  const Test& test() const { return *test_; }
  /// Of t: how near a hit must promise to be to be looked for.
  float reach() const { return reach_; }

 private:
  bool NeedsMaps() const;
  static Map MapOf(const rb_geometry& geometry, uint32_t prim);

  const Test* test_ = nullptr;
  uint32_t numerics_ = 0;
  bool claims_ = false;
  float reach_ = 1;
  HugeArray<Map> maps_;
};

/// How far traversal must look for what the tests of `numerics` accept.
Slack SlackOf(uint32_t numerics);

/// The ray's state for a test that only the study knows.
class StudyTest {};

template <>
class RayState<StudyTest> {
 public:
  static constexpr bool kInLanes = false;
  static constexpr size_t kStateBytes = 512;

  RayQuery query;
  SlabRay slab;  ///< of the traversal

  RayState(const Study& study, const RayQuery& q, const SlabRay& traversal);

  SlabRay SlabOfParts() const { return slab; }
  const Study& study() const { return study_; }

  /// What t a hit must come before to be looked for. A ray that resumes behind hits gets all in their order.
  float Reach(const rb_hit& best) const {
    return best.prim == RAYBENCH_NONE || query.after != RAYBENCH_NONE ? best.t : best.t * study_.reach();
  }

  /// Takes the nearest hit in the block into `best`; with `any`, the first one found. True if `best` changed.
  bool Take(const rb_geometry& geometry, const StudyBlock& block, bool any, rb_hit& best) const;

  /// Two boxes side by side, those of them that stand for their content (prim - 1, 0: it does not), of which `hit` has a
  /// bit where the ray meets one. m: entry of both, minus exit of both, no less than `limits`. Takes the nearest face into
  /// `best`, the bits of such boxes out of `hit`. True if `best` changed.
  bool TakeBoxes(const uint32_t (&prims)[2], Float4 m, Float4 limits, unsigned& hit, rb_hit& best) const {
    bool changed = false;
    for (int c = 0; c < 2; ++c) {
      if ((hit >> c & 1) == 0 || prims[c] == 0) continue;
      hit &= ~(1u << c);
      // What is at a limit is no face of the box.
      const float t = m[c] > limits[c] ? m[c] : -m[c + 2];
      const bool is_face = m[c] > limits[c] || m[c + 2] > limits[c + 2];
      if (!is_face || !query.Accepts(t, prims[c] - 1, best)) continue;
      best = {t, 1.0f / 3, 1.0f / 3, prims[c] - 1};
      changed = true;
    }
    return changed;
  }

  /// Take() for a leaf of `count` primitives, at least one, whose first place is `place`.
  template <class Block>
  bool TakeLeaf(const rb_geometry& geometry, const Block* block, size_t place, uint32_t count, bool any,
                rb_hit& best) const {
    constexpr uint32_t kLanes = uint32_t(sizeof block->prim / sizeof block->prim[0]);
    bool changed = false;
    for (uint32_t left = count;; left -= kLanes, place += kLanes, ++block) {
      changed |= Take(geometry,
                      {&block->v[0][0][0], block->prim, kLanes, std::min(left, kLanes), study_.maps(place)},
                      any, best);
      if (left <= kLanes || (any && changed)) return changed;
    }
  }

 private:
  const Study& study_;
  alignas(64) std::byte state_[kStateBytes];
};

}  // namespace raybench
