// Files of parameters, as `raybench tune` writes them: a table for each structure.
#pragma once

#include <string>
#include <vector>

#include "accel/host/registry.h"

namespace raybench {

/// `specs` (as ChooseContestants() takes them) with the parameters that the TOML file names for their
/// structures; what a spec says itself stays as it is. Throws InputError with one line: no TOML; a structure
/// or parameter that there is not, or a value that is not allowed; none of the structures is in the file.
std::vector<std::string> ApplyParams(const Registry& registry, const std::string& file,
                                     const std::vector<std::string>& specs);

}  // namespace raybench
