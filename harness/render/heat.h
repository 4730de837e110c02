// Heat maps of several structures side by side: what `raybench render --heat` does.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "accel/host/registry.h"
#include "datasets/scene/scene.h"

namespace raybench {

struct RenderHeatOptions {
  std::string scene_name, out;          ///< `out`: .png, a sheet with legends; .exr, the raw counts
  std::string kind = "both";            ///< steps, prims or both
  std::string scale = "auto";           ///< linear, log or auto: how colours run on the sheet
  std::vector<Contestant> contestants;  ///< of HeatContestants()
  uint32_t width = 512, height = 512;
  uint32_t depth = 4;    ///< of the picture beside the maps
  uint32_t threads = 0;  ///< 0: all
  uint64_t seed = 1;
};

/// The named structures; of none, the default ones that can count, but for `null`, which has nothing to show,
/// and `brute`, beside which nothing else has a colour. Throws InputError: unknown, or given twice.
std::vector<Contestant> HeatContestants(const Registry& registry, const std::vector<std::string>& specs);

/// Counts, writes `out` and prints a line a structure. What `out` needs is looked for first. Throws
/// InputError: none of the structures can count, no Python for a sheet, a file that cannot be written.
/// Returns the exit code.
int RenderHeat(const Registry& registry, const Scene& scene, const RenderHeatOptions& options);

}  // namespace raybench
