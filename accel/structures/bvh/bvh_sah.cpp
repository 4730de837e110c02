// bvh_sah: a binary bounding volume hierarchy by the surface area heuristic, binned.
//
// The idea: enclose groups of primitives in boxes, boxes in larger boxes, and skip what lies in a box that
// the ray misses (Kay and Kajiya 1986). How to group is decided greedily by the expected cost of tracing a
// random line (Goldsmith and Salmon 1987; MacDonald and Booth 1990), estimated at the planes between bins
// (Wald 2007): accel/bvh/binned_sah.h. Layout and traversal: accel/bvh/bvh2.h;
// what was tried: accel/bvh/LOG.md. Robustness: accel/ray/bounds.h
// and accel/ray/triangle.h.
//
// Invariants: every primitive stands in exactly one leaf, whose bounds enclose it; depth stays below the
// traversal stack's; the same tree at any thread count.
//
// Parameters: more bins find better planes and take longer; `reinsertion` improves the tree after it is
// built (accel/bvh/reinsertion.h); `triangle`, `slab`, `fma`, `t_tolerance` and `max_depth` are for the
// study of accuracy (accel/ray/study.h).
#include "accel/bvh/binned_sah.h"
#include "accel/bvh/structure.h"
#include "accel/ray/study.h"

namespace raybench {
namespace {

class BvhSah : public BvhStructure {
 public:
  struct Config {
    BvhConfig bvh;
    int64_t bins;
    uint32_t triangle, slab, fma;
    double t_tolerance;
    int64_t max_depth;

    bool Padded() const { return bvh.Padded() && SlabRule(slab) == SlabRule::kAsNumerics; }
  };
  static constexpr const char* kName = "bvh_sah";
  static constexpr const char* kDoc = "binary BVH, binned SAH builder, eight-wide leaves";
  static constexpr const char* kSource =
      "Wald 2007: On fast construction of SAH-based bounding volume hierarchies";
  static std::span<const rb_param> Params() {
    static const rb_param params[] = {kBvhNumerics,
                                      IntParam("bins", "bins per axis", offsetof(Config, bins), 2, 64, 16),
                                      BvhLeafSize(16),
                                      kBvhTraversalCost,
                                      kBvhReinsertion,
                                      TriangleParam(offsetof(Config, triangle)),
                                      SlabParam(offsetof(Config, slab)),
                                      FmaParam(offsetof(Config, fma)),
                                      TToleranceParam(offsetof(Config, t_tolerance)),
                                      BoxDepthParam(offsetof(Config, max_depth), kMaxTreeDepth)};
    return params;
  }

  BvhSah(const rb_geometry& geometry, const rb_build_options& options, const Config& config)
      : BvhStructure(geometry, options, config.bvh, BinnedSahPeakBytes(PrimCount(geometry)),
                     [&] {
                       return BuildBinnedSah(geometry,
                                             {uint32_t(config.bins), config.bvh.Costs(), config.Padded()},
                                             options.cancel);
                     }),
        geometry_(geometry),
        numerics_(config.bvh.numerics),
        slab_{config.slab},
        study_(numerics_, config.triangle, config.fma != 0,
               slab_ != SlabRule::kAsNumerics || config.max_depth > 0, config.t_tolerance) {
    if (config.max_depth > 0) StandIn(uint32_t(config.max_depth));
    const MemoryUse use = BvhStructure::Memory();
    study_.Precompute(geometry, bvh().leaves(), use.nodes + use.prims, options);
  }

  template <class Counter>
  void Query(const rb_query& query) const {
    if (!study_.on()) return BvhStructure::Query<Counter>(query);
    bvh().QueryStudy<Counter>(study_, slab_, numerics_, query);
  }
  uint32_t Claims() const { return study_.on() ? study_.Claim(geometry_) : BvhStructure::Claims(); }
  MemoryUse Memory() const {
    MemoryUse use = BvhStructure::Memory();
    use.prims += study_.bytes();
    return use;
  }

 private:
  rb_geometry geometry_;
  uint32_t numerics_;
  SlabRule slab_;
  Study study_;
};

}  // namespace

RAYBENCH_STRUCTURE(bvh_sah, BvhSah)

}  // namespace raybench
