// raybench report: the Python part draws the plots of a result folder.
#include <fmt/format.h>

#include <filesystem>

#include "harness/commands.h"
#include "harness/python.h"

namespace raybench {

void AddReportCommand(CLI::App& app, Invocation& invocation) {
  AddCommand<std::string>(
      app, invocation, "report", "Draw the plots of a result folder",
      [](CLI::App& command, std::string& folder) {
        command.add_option("dir", folder, "What a run wrote with --out")->required()->type_name("DIR");
      },
      [](const std::string& folder, const Registry&) {
        std::error_code error;
        if (!std::filesystem::exists(std::filesystem::path(folder) / "cases.csv", error))
          throw InputError(fmt::format("{}: no result folder (it holds no cases.csv)", folder));
        return Reports().Run({folder});
      });
}

}  // namespace raybench
