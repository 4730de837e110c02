// Families of rays that a command can be asked for: the tables stand in ray_sets.cpp (what `run` captures) and
// aim.cpp (what `verify` aims), and help and errors are made of them.
#pragma once

#include <span>
#include <string>
#include <vector>

namespace raybench {

struct RayFamily {
  const char* name;  ///< a label, or its beginning where `numbered`
  const char* query;
  const char* doc;        ///< where its rays begin and go
  bool numbered = false;  ///< "shadow.0" at depth 0
};

/// Throws InputError when `names` has one that is none of these, for the option `option`.
void CheckFamilyNames(const char* option, const std::vector<std::string>& names,
                      std::span<const RayFamily> families);

/// A line each, for help.
std::string FormatFamilies(std::span<const RayFamily> families);

}  // namespace raybench
