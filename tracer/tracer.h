// A wavefront Whitted tracer (Whitted 1980) over the plugin contract: it makes batches of camera, shadow,
// reflection and refraction rays, asks one tree, and shades (shading.h). It does not know which structure
// answers. It does what the scene needs and no more: shadow rays stop at the first blocker unless light
// passes some surface; textures, vertex normals and alpha are looked up only where there are any.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "accel/host/registry.h"
#include "datasets/scene/scene.h"
#include "tracer/rays/ray_set.h"
#include "tracer/sampling.h"

namespace raybench {

/// Linear RGB, row 0 at the top.
struct Image {
  uint32_t width = 0, height = 0;
  std::vector<Vec3f> pixels;
};

/// How a ray that starts on a surface is kept from hitting it again.
enum class SelfIntersection : uint8_t {
  kErrorBound,     ///< origin moved along the normal by a bound of all errors (surface.cpp): the default
  kNone,           ///< nothing: what goes wrong without
  kFixedTnear,     ///< tnear = `self_intersection_size`
  kNormalOffset,   ///< origin moved along the normal by `self_intersection_size`
  kIntegerOffset,  ///< Waechter and Binder 2019: origin moved by units in the last place
  kSkip,  ///< a flat primitive that the ray starts on is skipped (rb_query::skip); others: kErrorBound
};

/// Which rays a picture needs.
enum class TraceRules : uint8_t {
  kWhitted,  ///< the model of shading.h
  /// That of Haines' Standard Procedural Databases, for counting: shadow rays towards every light in front of
  /// the shading normal, blocked by whatever they hit; a mirror ray where Ks > 0 or T > 0; a refracted one
  /// where T > 0; tnear 1e-6; depth of the camera ray 1, at most 5. `fresnel`, `min_contribution` and
  /// `max_depth` do not count.
  kSpd,
};

enum class FresnelMode : uint8_t { kMaterial, kOff, kOn };

/// What shadow rays ask where nothing lets light through; elsewhere they follow all that they pass.
enum class ShadowQuery : uint8_t {
  kAny,      ///< whether anything is in the way (RB_ANY)
  kClosest,  ///< what is nearest (RB_CLOSEST): the same picture, and what stopping early saves
};

struct TraceOptions {
  uint32_t width = 512, height = 512;
  Sampling sampling = {};
  TraceRules rules = TraceRules::kWhitted;
  SelfIntersection self_intersection = SelfIntersection::kErrorBound;
  float self_intersection_size = 1e-4f;  ///< in the units of the scene's file
  FresnelMode fresnel = FresnelMode::kMaterial;
  ShadowQuery shadows = ShadowQuery::kAny;
  /// Paths whose weight is below this in every channel end; 0: none does.
  float min_contribution = 0;
  uint32_t max_depth = 4;  ///< reflections and refractions in a row; 0: camera and shadow rays only
  /// Does what AllNeedsOf() says, not NeedsOf(): to see what the latter saves.
  bool all_needs = false;
  uint32_t threads = 0;  ///< 0: all; the picture is the same at any number
  bool capture = false;  ///< freeze every batch
  /// Camera rays traced together, in [1, 2^31): bounds the memory, changes no result.
  uint32_t band_rays = 1u << 20;
  std::function<void(double fraction)> progress = {};  ///< called from one thread at a time; rises to 1
};

/// What was traced at one depth.
struct WaveCounts {
  uint64_t rays = 0, hits = 0;       ///< camera rays, or reflected and refracted ones
  uint64_t shadow = 0, blocked = 0;  ///< shadow rays
};

struct TraceResult {
  Image image;
  /// With `capture`: one set per kind and depth in the order traced (tiles of 8 x 8 pixels); empty ones left
  /// out. A ray that goes on behind a hit (transmittance, alpha) stands there once, as it started; shadow
  /// rays are any-hit rays, also where the tracer had to find all that they pass.
  std::vector<RaySet> ray_sets;
  uint64_t camera_rays = 0, shadow_rays = 0, reflection_rays = 0, refraction_rays = 0;
  uint64_t camera_hits = 0, shadow_blocked = 0, reflection_hits = 0, refraction_hits = 0;
  /// Hits that shadow rays went on through: on transmitting surfaces, and in holes cut out by alpha.
  uint64_t shadow_resumed = 0;
  std::vector<WaveCounts> waves;  ///< one for each depth that had rays
};

/// What all rays but those of the camera meet instead of the scene: a level of detail of it, by its own materials under
/// the scene's lights and surroundings. The idea is in Tabellion and Lamorlette 2004 ("An approximate global illumination
/// system for computer generated films"), and in Yoon, Lauterbach, Manocha 2006 ("R-LODs").
/// A hit of a camera ray may lie behind the coarser surface, and is then in its shadow: only an offset (`TraceOptions::
/// self_intersection`) as long as the surfaces are apart surely prevents that.
struct SecondaryScene {
  const Scene& scene;
  const Tree& tree;
};

/// Renders the scene with its first camera. Throws InputError on options out of range, textures that cannot
/// be read, structures that cannot go on behind a hit, or skip, where that is needed, and a `secondary` scene whose
/// scale_exponent is another one.
TraceResult Trace(const Scene& scene, const Tree& tree, const TraceOptions& options,
                  const SecondaryScene* secondary = nullptr);

/// Gives a secondary scene what is not geometry and has to be that of `scene`: lights, ambient light, no environment.
void TakeLights(const Scene& scene, Scene& secondary);

/// The camera rays of the pixels from `first` on, row by row from the top: the very rays of the same picture
/// by Trace(), which walks them in tiles. Invalid ones are InvalidRayStandIn(). `threads` as in TraceOptions.
void PixelRays(const Scene& scene, uint32_t width, uint32_t height, uint64_t first, std::span<rb_ray> rays,
               uint32_t threads);

/// Runs the query in chunks over at most `threads` oneTBB threads (0: all); results as from one call.
void QueryParallel(const Tree& tree, const rb_query& query, uint32_t threads);

}  // namespace raybench
