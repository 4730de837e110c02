// The boxes of trees as files, for the Python part to draw.
#pragma once

#include <filesystem>
#include <string>

#include "accel/host/registry.h"

namespace raybench {

/// Adds the upper levels of a tree to the JSON file `path`, which it makes: whole levels, from the root, as long as
/// they have no more than `most` boxes together. Nothing is added where the tree shows no nodes, where its root is no
/// box, or where it has levels of the structure `spec` already. Throws InputError if the file cannot be written.
void AddBoxes(const std::filesystem::path& path, const std::string& spec, const Tree& tree,
              size_t most = 1000);

}  // namespace raybench
