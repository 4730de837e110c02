// A plugin with one of several flaws, each of which loses rays: what `raybench verify` must find. Two leaves
// below a root, every primitive of a leaf tested in turn.
#include <algorithm>
#include <array>
#include <vector>

#include "accel/ray/primitive.h"

using namespace raybench;

namespace {

const char* const kFlaws[] = {"none", "drop", "box", "gap", nullptr};
enum Flaw : uint32_t { kNone, kDrop, kBox, kGap };

class Leaky {
 public:
  struct Config {
    uint32_t flaw;
  };
  static constexpr const char* kName = "leaky";
  static constexpr const char* kDoc = "a test of raybench verify";
  static constexpr const char* kSource = "raybench's tests";
  static constexpr uint64_t kCapabilities = RB_CAN_AFTER | RB_DETERMINISTIC;
  static std::span<const rb_param> Params() {
    static const rb_param params[] = {ChoiceParam(
        "flaw",
        "drop: the middle triangle is in no leaf; box: a leaf's box ends too early; gap: a cell of a "
        "space partition lacks a triangle that reaches into it",
        offsetof(Config, flaw), kFlaws, 0)};
    return params;
  }

  Leaky(const rb_geometry& geometry, const rb_build_options&, const Config& config)
      : geometry_(geometry), space_partition_(config.flaw == kGap) {
    const uint32_t n = uint32_t(geometry.triangle_count);
    for (uint32_t i = 0; i < n; ++i) root_.Extend(PaddedPrimBounds(geometry, i));
    if (space_partition_) {
      const float plane = 0.5f * (root_.lo.x + root_.hi.x);
      box_[0] = box_[1] = root_;
      box_[0].hi.x = box_[1].lo.x = plane;
      uint32_t straddling = 0;
      for (uint32_t i = 0; i < n; ++i) {
        const Bounds3 b = PrimBounds(geometry, i);
        if (b.lo.x <= plane) prims_[0].push_back(i);
        if (b.hi.x >= plane && !(b.lo.x < plane && b.hi.x > plane && straddling++ == 0))
          prims_[1].push_back(i);
      }
      return;
    }
    for (uint32_t i = 0; i < n; ++i) {
      if (config.flaw == kDrop && i == n / 2) continue;
      box_[i < n / 2 ? 0 : 1].Extend(PaddedPrimBounds(geometry, i));
      prims_[i < n / 2 ? 0 : 1].push_back(i);
    }
    if (config.flaw == kBox) box_[1].hi.y -= 0.25f * (box_[1].hi.y - box_[1].lo.y);
  }

  template <class Counter>
  void Query(const rb_query& query) const {
    using Test = WatertightTest;
    ForEachRay<Counter>(query, [&](auto any, const RayQuery& q, rb_hit& best, Counter&) {
      const RayState<Test> ray(q);
      for (int leaf = 0; leaf < 2; ++leaf) {
        float tnear, tfar;
        ray.slab.Interval(box_[leaf], tnear, tfar);
        if (!(std::max(tnear, q.ray.tnear) <= std::min(tfar, best.t))) continue;
        for (uint32_t prim : prims_[leaf])
          if (ray.Primitive(geometry_, prim, best) && any.value) return;
      }
    });
  }
  uint32_t Claims() const { return RB_CLAIM_WATERTIGHT; }
  MemoryUse Memory() const { return {sizeof *this, 0, true}; }
  template <class Fn>
  int Visit(Fn&& node) const {
    const auto show = [&](const Bounds3& b, uint32_t depth, const std::vector<uint32_t>* prims) {
      const float bounds[] = {b.lo.x, b.lo.y, b.lo.z, b.hi.x, b.hi.y, b.hi.z};
      return node(rb_node{depth, prims != nullptr, space_partition_, RB_SHAPE_BOX, bounds, 6,
                          prims ? uint32_t(prims->size()) : 0, prims ? prims->data() : nullptr});
    };
    int stop = show(root_, 0, nullptr);
    for (int leaf = 0; leaf < 2 && stop == 0; ++leaf) stop = show(box_[leaf], 1, &prims_[leaf]);
    return stop;
  }

 private:
  rb_geometry geometry_;
  uint32_t space_partition_;
  Bounds3 root_;
  std::array<Bounds3, 2> box_;
  std::array<std::vector<uint32_t>, 2> prims_;
};

}  // namespace

RAYBENCH_PLUGIN(Leaky)
