// What traversal costs per pixel: the counters of one structure over the camera rays of a picture.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "accel/host/registry.h"
#include "datasets/scene/scene.h"

namespace raybench {

/// Counts of each pixel's camera ray, row 0 at the top; a count beyond 2^32 - 1 is stored as that.
struct HeatMap {
  uint32_t width = 0, height = 0;
  std::vector<uint32_t> steps;  ///< nodes or cells traversed (rb_counts::steps)
  std::vector<uint32_t> prims;  ///< ray-primitive tests (rb_counts::prims)
};

struct HeatOptions {
  uint32_t width = 512, height = 512;
  uint32_t threads = 0;           ///< 0: all; the counts are the same at any number
  uint32_t band_rays = 1u << 16;  ///< rays asked together, at least 1: bounds the memory, changes no result
  /// Called between bands, from the calling thread; rises to 1. What it throws ends the counting.
  std::function<void(double fraction)> progress = {};
};

/// Asks for the closest hits of the first camera's rays with counting. The rays are those of Trace() at the
/// same size, so the counts summed up are those of its ray set "camera". Throws InputError if the structure
/// cannot count or the size is none.
HeatMap CountPerPixel(const Scene& scene, const Tree& tree, const HeatOptions& options);

/// Sum and maximum of one map, for "mean 31.2, max 118".
struct HeatSummary {
  uint64_t sum = 0;
  uint32_t max = 0;
};
HeatSummary Summarize(const std::vector<uint32_t>& map);

}  // namespace raybench
