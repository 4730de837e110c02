// The built-in structures. The list is made by CMake from the file names in accel/structures/, so that adding
// a file adds a structure, and static linking drops none.
#pragma once

#include <vector>

#include "accel/contract/structure.h"

namespace raybench {

/// Sorted by name.
std::vector<Builtin> BuiltinStructures();

/// A structure that not every build has.
struct OptionalStructure {
  const char* name;
  bool is_built;
  const char* takes;  ///< packages and options of a build that has it
};

/// Plugins that come with raybench, and what this build lacks of the built-in structures.
std::vector<OptionalStructure> OptionalStructures();

}  // namespace raybench
