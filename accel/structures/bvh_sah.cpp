// bvh_sah: a binary bounding volume hierarchy by the surface area heuristic, binned.
//
// The idea: enclose groups of primitives in boxes, boxes in larger boxes, and skip what lies in a box that
// the ray misses (Kay and Kajiya 1986). How to group is decided greedily by the expected cost of tracing a
// random line (Goldsmith and Salmon 1987; MacDonald and Booth 1990), estimated at the planes between bins
// (Wald 2007): accel/binned_sah.h. Layout and traversal: accel/bvh2.h. Robustness: accel/ray_bounds.h and
// accel/ray_triangle.h.
//
// Invariants: every primitive stands in exactly one leaf, whose bounds enclose it; depth stays below the
// traversal stack's; the same tree at any thread count.
#include <fmt/format.h>
#include <tbb/task_arena.h>

#include "accel/binned_sah.h"
#include "accel/bvh2.h"

namespace raybench {
namespace {

class BvhSah {
 public:
  struct Config {
    int64_t bins, leaf_size;
    double traversal_cost;
    uint32_t numerics;
  };
  static constexpr const char* kName = "bvh_sah";
  static constexpr const char* kDoc = "binary BVH, binned SAH builder, four-wide leaves";
  static constexpr const char* kSource =
      "Wald 2007: On fast construction of SAH-based bounding volume hierarchies";
  static constexpr uint64_t kCapabilities =
      RB_CAN_COUNT | RB_CAN_PROCEDURAL | RB_CAN_AFTER | RB_CAN_SKIP | RB_DETERMINISTIC;
  static std::span<const rb_param> Params() {
    static const rb_param params[] = {
        {"numerics", kNumericsDoc, RB_CHOICE, 0, offsetof(Config, numerics), 0, 0, 0,
         double(Numerics::kWatertight), kNumericsChoices},
        {"bins", "bins per axis", RB_INT, 0, offsetof(Config, bins), 0, 2, 64, 16, nullptr},
        {"leaf_size", "most primitives in a leaf", RB_INT, 0, offsetof(Config, leaf_size), 0, 1,
         double(Bvh2::kMaxLeaf), 8, nullptr},
        {"traversal_cost", "cost of a node in units of one leaf block of four primitives", RB_FLOAT, 0,
         offsetof(Config, traversal_cost), 0, 0, 100, 1.5, nullptr}};
    return params;
  }

  BvhSah(const rb_geometry& geometry, const rb_build_options& options, const Config& config)
      : numerics_(config.numerics), claim_(ClaimOf(config.numerics, geometry)) {
    const uint64_t prims = PrimCount(geometry);
    if (prims == 0) return;
    if (const uint64_t need = BinnedSahPeakBytes(prims);
        options.memory_limit > 0 && need > options.memory_limit) {
      throw std::runtime_error(fmt::format("building needs about {} MiB, over the memory limit", need >> 20));
    }
    tbb::task_arena arena(int(options.threads));
    arena.execute([&] {
      const BinnedSahOptions build{.bins = uint32_t(config.bins),
                                   .leaf_size = uint32_t(config.leaf_size),
                                   .block_size = 4,
                                   .padded = IsConservative(config.numerics),
                                   .traversal_cost = float(config.traversal_cost)};
      bvh_ = Bvh2(geometry, BuildBinnedSah(geometry, build, options.cancel));
    });
  }

  template <class Counter>
  void Query(const rb_query& query) const {
    WithNumerics(numerics_, [&]<class Test>() { bvh_.Query<Test, Counter>(query); });
  }
  uint32_t Claims() const { return claim_; }
  MemoryUse Memory() const { return bvh_.Memory(); }
  template <class Fn>
  int Visit(Fn&& node) const {
    return bvh_.Visit(node);
  }

 private:
  uint32_t numerics_, claim_;
  Bvh2 bvh_;
};

}  // namespace

RAYBENCH_STRUCTURE(bvh_sah, BvhSah)

}  // namespace raybench
