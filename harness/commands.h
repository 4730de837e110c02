// The commands beside `run`.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "accel/registry.h"

namespace raybench {

struct RenderOptions {
  std::string scene, structure = "bvh_sah", out;
  uint32_t width = 512, height = 512, depth = 4, threads = 0;
  uint64_t seed = 1;
  bool drop_bad = false;
};

/// Renders one picture and says how many rays it took. Throws InputError.
int RenderCommand(const Registry& registry, const RenderOptions& options);

/// Every structure with its parameters, types, ranges and defaults, to stdout.
int ListStructures(const Registry& registry);
/// Generators with their parameters and the models of the manifest, to stdout.
int ListScenes();

/// Fetches the named models, or all. Throws InputError naming the first that cannot be had, after trying the
/// rest.
int FetchCommand(const std::vector<std::string>& names, bool all);

/// Draws the plots of a result folder with the Python part; its exit code. Throws InputError if the folder is
/// no result folder or there is no Python to run it.
int ReportCommand(const std::string& folder);
/// The same after a run: where the Python part cannot work, one line says how to get it.
void DrawReportIfPossible(const std::string& folder);

/// "raybench 0.1.0", for the metadata of pictures.
std::string SoftwareName();

}  // namespace raybench
