// The ray sets of a scene: captured from a picture, or replayed from files.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "accel/host/registry.h"
#include "harness/base/json.h"
#include "harness/rays/family.h"
#include "tracer/rays/ray_file.h"
#include "tracer/tracer.h"

namespace raybench {

/// A ray set with where it comes from.
struct SourcedSet {
  RaySet set;
  uint64_t captured = 0;               ///< rays before thinning
  std::string file, sha256, software;  ///< of a replayed set: the file and what wrote it; else empty
};

struct CaptureOptions {
  uint64_t rays = 0;              ///< of a set, at most
  uint64_t seed = 1;              ///< of what is random
  uint32_t depth = 2;             ///< bounces of the picture
  bool shuffled = false;          ///< add a shuffled twin of each set that the tracer made
  std::vector<std::string> sets;  ///< labels ("shadow.0") or kinds ("shadow"); empty: all
  std::function<void(double fraction)> progress;
  std::function<void(const std::string& line)> note;  ///< is told what was left out, and why
};

struct Capture {
  Image image;
  std::vector<SourcedSet> sets;
};

/// What a capture can have.
std::span<const RayFamily> CapturedFamilies();

/// Renders the scene with `bvh_sah`, at least 2 x `rays` pixels, freezes what the tracer asks, and adds the
/// synthetic sets: random, diffuse, ambient_occlusion, aimed. Throws InputError when none of the sets wanted
/// has rays.
Capture CaptureRaySets(const Registry& registry, const Scene& scene, const CaptureOptions& options);

/// The .rays files that `paths` name; a folder stands for those in it, by name. Throws InputError: a folder
/// without any, or a file that is not there.
std::vector<std::string> RayFiles(const std::vector<std::string>& paths);

/// Reads the files and gives each to the scenes that have its geometry, with its stem as label, cut down to
/// `limit` rays (0: all). Throws InputError: a broken file, one that belongs to none of the scenes, a scene
/// that gets none, two sets of a scene with the same label and order.
std::vector<std::vector<SourcedSet>> ReplayRayFiles(const std::vector<std::string>& files,
                                                    std::span<const Scene* const> scenes, uint64_t limit);

/// Puts a shuffled twin behind each set that has none yet.
void AddShuffledTwins(std::vector<SourcedSet>& sets, uint64_t seed, const Bounds3& bounds);

/// For run.json.
Json FactsOf(const SourcedSet& s);

/// "closest" or "any".
const char* QueryName(uint32_t query);

}  // namespace raybench
