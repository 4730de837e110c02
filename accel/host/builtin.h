// The built-in structures. The list is made by CMake from the file names in accel/structures/, so that adding
// a file adds a structure, and static linking drops none.
#pragma once

#include <vector>

#include "accel/contract/structure.h"

namespace raybench {

/// Sorted by name.
std::vector<Builtin> BuiltinStructures();

}  // namespace raybench
