// Tables of text. The one at the end of a run is a function of the finished cases only.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "harness/results/results.h"

namespace raybench {

/// Rows of text in aligned columns.
class Grid {
 public:
  explicit Grid(std::vector<std::string> header) { rows_.push_back(std::move(header)); }
  /// As many cells as the header has.
  void Add(std::vector<std::string> row);
  /// The first `left_columns` to the left, the others to the right; blocks of as many columns as fit into
  /// `width_limit` characters, the first column repeated.
  std::string Format(size_t left_columns, size_t width_limit = 120) const;

 private:
  std::vector<std::vector<std::string>> rows_;
};

/// At most 120 columns wide; one block a scene. `cases` as ResultFolder::Cases() gives them.
std::string FormatTable(std::span<const FinishedCase> cases);

/// Three significant digits: 0.0123, 4.56, 78.9, 1230.
std::string FormatFigure(double value);

}  // namespace raybench
