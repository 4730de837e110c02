// The table at the end of a run: a function of the finished cases only.
#pragma once

#include <span>
#include <string>

#include "harness/results.h"

namespace raybench {

/// At most 120 columns wide; one block a scene. `cases` as ResultFolder::Cases() gives them.
std::string FormatTable(std::span<const Json> cases);

/// Three significant digits: 0.0123, 4.56, 78.9, 1230.
std::string FormatFigure(double value);

}  // namespace raybench
