// raybench history: runs kept over time, their trend, and exports for other tools.
#include <fmt/format.h>

#include "harness/cli/commands.h"
#include "harness/results/python.h"

namespace raybench {
namespace {

struct HistoryOptions {
  std::string folder, store = "history", out, format, check, commit;
};

void AddStore(CLI::App& command, HistoryOptions& options) {
  command.add_option("--store", options.store, "Folder of the history; default: history")->type_name("DIR");
}

void AddAdd(CLI::App& command, HistoryOptions& options) {
  command.add_option("dir", options.folder, "Result folder of run")->required()->type_name("DIR");
  command
      .add_option("--commit", options.commit,
                  "Of the code under test; default: the commit of raybench in run.json")
      ->type_name("ID");
  AddStore(command, options);
}

void AddExport(CLI::App& command, HistoryOptions& options) {
  command.add_option("dir", options.folder, "Result folder of run")->required()->type_name("DIR");
  command.add_option("--format", options.format, "google-benchmark, github-action-benchmark or bencher")
      ->required()
      ->check(CLI::IsMember({"google-benchmark", "github-action-benchmark", "bencher"}))
      ->type_name("FORMAT");
  command.add_option("--out", options.out, "File; default: standard output")->type_name("FILE");
}

void AddHistoryCommand(CLI::App& app, Invocation& invocation) {
  CLI::App& history = *app.add_subcommand("history", "Keep runs over time, draw their trend, export them");
  history.fallthrough();
  history.require_subcommand(0, 1);
  history.callback([&history] {
    if (history.get_subcommands().empty())
      throw InputError("raybench history: add 'add', 'trend' or 'export'; see raybench history --help");
  });
  AddCommand<HistoryOptions>(
      history, invocation, "add", "Append a run to the history", AddAdd,
      [](const HistoryOptions& options, const Registry&) {
        std::vector<std::string> words = {"history", "add", options.folder, "--store=" + options.store};
        if (!options.commit.empty()) words.push_back("--commit=" + options.commit);
        return Reports().Run(words);
      });
  AddCommand<HistoryOptions>(history, invocation, "trend",
                             "Draw trend.html: each case over time, with change points, machines apart",
                             AddStore, [](const HistoryOptions& options, const Registry&) {
                               return Reports().Run({"history", "trend", "--store=" + options.store});
                             });
  AddCommand<HistoryOptions>(
      history, invocation, "export", "Write a run in the format of another tool", AddExport,
      [](const HistoryOptions& options, const Registry&) {
        std::vector<std::string> words = {"history", "export", options.folder, "--format=" + options.format};
        if (!options.out.empty()) words.push_back("--out=" + options.out);
        return Reports().Run(words);
      });
}

}  // namespace

const Command kHistory = {92, AddHistoryCommand};

}  // namespace raybench
