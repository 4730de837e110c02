// The Python part, reports/raybench_report, as this program calls it.
#pragma once

#include <string>
#include <vector>

namespace raybench {

class Reports {
 public:
  /// Looks for the package and for a Python that can run it. Throws InputError if either is missing.
  Reports();
  /// Runs `python -m raybench_report ARGUMENTS...` and returns its exit code.
  int Run(const std::vector<std::string>& arguments) const;

 private:
  std::string folder_, python_;
};

/// The path of this very program, for what the Python part starts.
std::string ThisProgram();

/// Throws InputError where `folder` is no directory.
void RequireFolder(const std::string& folder);

/// Makes the page after a run; where that cannot work, one line says how to get them.
void DrawReportIfPossible(const std::string& folder);

}  // namespace raybench
