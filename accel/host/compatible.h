// What the range of each parameter alone does not tell.
#pragma once

#include <cstddef>
#include <string>

#include "accel/contract/raybench.h"

namespace raybench {

/// One line that says which parameters of a configuration exclude one another; empty: none. Knows parameters that mean
/// the same in every structure that has them.
std::string WhyIncompatible(const rb_structure& structure, const std::byte* config);

}  // namespace raybench
