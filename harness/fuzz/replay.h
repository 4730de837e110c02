// `raybench replay`: a case file again, with all that it takes to understand it.
#pragma once

#include <string>
#include <vector>

#include "accel/host/registry.h"

namespace raybench::fuzz {

struct ReplayOptions {
  std::vector<std::string> files;  ///< case files, or folders of them
  std::string structure;           ///< in place of the cases' own; empty: theirs
  bool brief = false;              ///< a line each
  std::string shrunk;              ///< folder for smaller cases that break the same promises; empty: none
};

/// Examines each case, by all checks, and prints verdict and exact numbers; shrinks those that break something, if
/// asked to. Returns 0 if nothing is broken, 1
/// if something is. Throws InputError: a file that is no case, a folder without one.
int RunReplay(const Registry& registry, const ReplayOptions& options);

}  // namespace raybench::fuzz
