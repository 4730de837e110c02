// The Python part, reports/raybench_report, as this program calls it.
#pragma once

#include <string>
#include <vector>

namespace raybench {

/// Runs `python -m raybench_report ARGUMENTS...` and returns its exit code. Throws InputError if that package
/// is not to be found or there is no Python that can run it.
int RunReports(const std::vector<std::string>& arguments);

/// Draws the plots after a run; where that cannot work, one line says how to get them.
void DrawReportIfPossible(const std::string& folder);

}  // namespace raybench
