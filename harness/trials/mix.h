// The rays of trials: a mix of captured sets in two halves, one to choose by and one to report on.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "harness/rays/ray_sets.h"

namespace raybench {

/// One set of a mix. Its runs of 64 neighbouring rays (tiles of the picture) are dealt out at random.
struct MixedSet {
  std::string label;
  uint32_t query = RB_CLOSEST;
  double share = 0;  ///< of the mix; all shares sum to 1

  /// The first `count` rays of a half, rounded to runs of 64, at least one run; in the order of the set, so
  /// that coherence is that of the set.
  std::vector<rb_ray> Rays(bool held_out, uint64_t count) const;
  uint64_t Count(bool held_out) const;

  std::vector<rb_ray> rays;
  std::vector<uint32_t> training, held_out;  ///< starts of runs, in random order
};

struct MixOptions {
  std::string mix = "picture";  ///< see ParseMix()
  uint64_t rays = 1 << 14;      ///< of each set and half, at most
  uint64_t seed = 1;
  uint32_t depth = 2;
};

/// A name of a family or label, and its weight; 0: as often as the tracer asked.
struct MixWord {
  std::string name;
  double weight;
};

/// "picture" (all that the tracer asks for a picture, as often as it asks), or "camera=1,shadow=2,diffuse=4":
/// names of ray sets or families, each with a weight, 1 where none is given. Throws InputError.
std::vector<MixWord> ParseMix(const std::string& text);

/// Captures the sets of the mix. Sets that the scene has no rays for are said on stderr and left out; throws
/// InputError when none is left.
std::vector<MixedSet> CaptureMix(const Registry& registry, const Scene& scene, const MixOptions& options);

}  // namespace raybench
