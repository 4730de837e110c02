// What a user can do wrong, as an exception.
#pragma once

#include <stdexcept>

namespace raybench {

/// Wrong input by the user: one line that names the thing and says what is allowed. Exit code 2.
struct InputError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

}  // namespace raybench
