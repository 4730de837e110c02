// The command line of raybench as a function.
#pragma once

#include <string>
#include <vector>

namespace raybench {

/// Does what `arguments` (the program's name first) ask for and returns the exit code. Throws InputError for
/// what is wrong with them, and whatever the command throws.
int RunCommandLine(std::vector<std::string> arguments);

}  // namespace raybench
