// Truth kept on disk: asking again about the same rays in the same scene costs a read.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "harness/truth/oracle.h"

namespace raybench {

/// What asking for truth tells while it works; each may be empty.
struct TruthListener {
  std::function<void(double fraction)> progress;  ///< in [0, 1]; may throw to end the asking
  std::function<void(const std::string&)> say;    ///< one line: a file that is of no use
};

/// What oracle.Ask(rays, threads) answers, from CacheDirectory()/truth where it lies there, else asked for
/// and put there. A file is named by what its truth depends on: scene and its state after loading, rays, the
/// oracle's name and sources. It repeats all that, and ends with a checksum; one that is broken or tells of
/// something else is said, ignored and written anew. So results never depend on the cache. The folder is kept
/// below 1 GB; what has not been used for longest goes first. RAYBENCH_TRUTH_CACHE=off neither reads nor
/// writes; a value other than on and off is an InputError. A cache that cannot be written is said, once.
std::vector<Truth> CachedTruth(const Oracle& oracle, const Scene& scene, std::span<const rb_ray> rays,
                               uint32_t threads, const TruthListener& listener);

}  // namespace raybench
