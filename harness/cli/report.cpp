// raybench report: the Python part draws the plots of a result folder.
#include <fmt/format.h>

#include <filesystem>

#include "harness/cli/commands.h"
#include "harness/results/python.h"

namespace raybench {

namespace {

void AddReportCommand(CLI::App& app, Invocation& invocation) {
  AddCommand<std::string>(
      app, invocation, "report", "Draw the plots of a result folder again",
      [](CLI::App& command, std::string& folder) {
        command.add_option("dir", folder, "Result folder of run or extremes")->required()->type_name("DIR");
      },
      [](const std::string& folder, const Registry&) {
        const auto holds = [&](const char* file) {
          std::error_code error;
          return std::filesystem::exists(std::filesystem::path(folder) / file, error);
        };
        if (!holds("cases.csv") && !holds("extremes.csv"))
          throw InputError(
              fmt::format("{}: not a result folder (it has neither cases.csv nor extremes.csv)", folder));
        return Reports().Run({folder});
      });
}

}  // namespace

const Command kReport = {100, AddReportCommand};

}  // namespace raybench
