// raybench extremes: all points of the suites asked for, and the files they leave.
#pragma once

#include <string>
#include <vector>

#include "accel/host/registry.h"

namespace raybench::extremes {

struct Options {
  std::vector<std::string> suites;      ///< empty: all
  std::vector<std::string> structures;  ///< as EveryArithmetic() takes them
  std::vector<std::string> plugins, command_line;
  uint64_t rays = 0;  ///< at a point; 0: the default, which depends on `quick`
  uint64_t seed = 1;
  bool quick = false, report = true;
  std::string out;  ///< empty: results/extremes-<UTC time>

  uint64_t Rays() const { return rays != 0 ? rays : quick ? 256 : 2048; }
};

/// Measures and writes extremes.csv and extremes.json. Returns the exit code: 1 where a claim was broken
/// inside of a suite's range, 130 when interrupted (finished points are kept). Throws InputError: an unknown
/// suite or structure, a folder that holds such files already or cannot be made.
int Run(const Registry& registry, const Options& options);

}  // namespace raybench::extremes
