// What names and parameters may be, beyond their text: the nearest known name, and flaws of a description.
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "accel/contract/raybench.h"

namespace raybench {

/// " (did you mean X?)" with the one of `known` that is the fewest slips of the keyboard (a letter more,
/// less, another, or two swapped) away from `typed`: at most one in three letters. Empty if there is none.
std::string DidYouMean(std::string_view typed, std::span<const std::string_view> known);

/// What is wrong with a description, such as a default outside of its range, naming the parameter; empty: it
/// can be configured and printed.
std::string FlawOfParameters(std::span<const rb_param> params, size_t config_size);

}  // namespace raybench
