// `raybench offset`: the smallest safe offset of a scene, for each cure of self-intersection.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "accel/host/registry.h"

namespace raybench {

struct OffsetOptions {
  std::string scene, structure = "bvh_wide";
  uint64_t rays = 0;  ///< 0: 10^6, quick 65,536
  uint64_t seed = 1;
  uint32_t threads = 0;
  bool aimed = false;  ///< rays leave from edges and vertices
  bool quick = false, drop_bad = false;
  std::string out;  ///< folder for offset.csv and offset.json; empty: nothing is written
  std::vector<std::string> plugins, command_line;

  uint64_t Rays() const { return rays != 0 ? rays : quick ? 65536 : 1000000; }
};

/// Searches, prints a table and what to take, and writes the files. Returns the exit code: 0; 1 if no cure is safe.
/// Throws InputError: a scene without triangles or with procedural primitives, an unknown structure, a folder that
/// already holds such results.
int RunOffset(const Registry& registry, const OffsetOptions& options);

}  // namespace raybench
