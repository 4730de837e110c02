// A wavefront Whitted tracer (Whitted 1980) over the plugin contract: it makes batches of camera, shadow,
// reflection and refraction rays, asks one tree, and shades. It does not know which structure answers.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "accel/registry.h"
#include "datasets/scene.h"
#include "tracer/ray_set.h"

namespace raybench {

/// Linear RGB, row 0 at the top.
struct Image {
  uint32_t width = 0, height = 0;
  std::vector<Vec3f> pixels;
};

struct TraceOptions {
  uint32_t width = 512, height = 512;
  uint32_t max_depth = 4;  ///< reflections and refractions in a row; 0: camera and shadow rays only
  uint32_t threads = 0;    ///< 0: all; the picture is the same at any number
  bool capture = false;    ///< freeze every batch
  /// Camera rays traced together, in [1, 2^31): bounds the memory, changes no result.
  uint32_t band_rays = 1u << 20;
  std::function<void(double fraction)> progress = {};  ///< called from one thread at a time; rises to 1
};

struct TraceResult {
  Image image;
  /// With `capture`: one set per kind and depth in the order traced (tiles of 8 x 8 pixels); empty ones left
  /// out.
  std::vector<RaySet> ray_sets;
  uint64_t camera_rays = 0, shadow_rays = 0, reflection_rays = 0, refraction_rays = 0;
};

/// Renders the scene with its first camera.
TraceResult Trace(const Scene& scene, const Tree& tree, const TraceOptions& options);

/// The camera rays of the pixels from `first` on, row by row from the top: the very rays of the same picture
/// by Trace(), which walks them in tiles. Invalid ones are InvalidRayStandIn(). `threads` as in TraceOptions.
void PixelRays(const Scene& scene, uint32_t width, uint32_t height, uint64_t first, std::span<rb_ray> rays,
               uint32_t threads);

/// Runs the query in chunks over at most `threads` oneTBB threads (0: all); results as from one call.
void QueryParallel(const Tree& tree, const rb_query& query, uint32_t threads);

}  // namespace raybench
