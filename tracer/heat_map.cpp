#include "tracer/heat_map.h"

#include <algorithm>
#include <limits>

#include "tracer/tracer.h"

namespace raybench {

HeatMap CountPerPixel(const Scene& scene, const Tree& tree, const HeatOptions& options) {
  const uint64_t pixels = uint64_t{options.width} * options.height;
  const size_t band = size_t(std::clamp<uint64_t>(options.band_rays, 1, std::max<uint64_t>(1, pixels)));
  std::vector<rb_ray> rays(band);
  std::vector<rb_hit> hits(band);
  std::vector<rb_counts> counts(band);
  PixelRays(scene, options.width, options.height, 0, {},
            options.threads);  // refuses sizes before memory is taken
  HeatMap map{options.width, options.height, std::vector<uint32_t>(pixels), std::vector<uint32_t>(pixels)};
  rb_query query{};
  query.struct_size = sizeof query;
  query.kind = RB_CLOSEST;
  query.rays = rays.data();
  query.hits = hits.data();
  query.counts = counts.data();
  const auto stored = [](uint64_t count) {
    return uint32_t(std::min<uint64_t>(count, std::numeric_limits<uint32_t>::max()));
  };
  for (uint64_t first = 0; first < pixels; first += band) {
    query.n = size_t(std::min<uint64_t>(band, pixels - first));
    PixelRays(scene, options.width, options.height, first, std::span(rays).first(query.n), options.threads);
    QueryParallel(tree, query, options.threads);
    for (size_t i = 0; i < query.n; ++i) {
      map.steps[first + i] = stored(counts[i].steps);
      map.prims[first + i] = stored(counts[i].prims);
    }
    if (options.progress) options.progress(double(first + query.n) / double(pixels));
  }
  return map;
}

HeatSummary Summarize(const std::vector<uint32_t>& map) {
  HeatSummary summary;
  for (uint32_t count : map) {
    summary.sum += count;
    summary.max = std::max(summary.max, count);
  }
  return summary;
}

}  // namespace raybench
