// What ends work early, as exceptions.
#pragma once

#include <stdexcept>

namespace raybench {

/// Wrong input by the user: one line that names the thing and says what is allowed. Exit code 2.
struct InputError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// A build that ended without a tree: cancelled, over the memory limit, or input the structure cannot hold.
struct BuildError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

}  // namespace raybench
