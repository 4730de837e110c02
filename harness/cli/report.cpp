// raybench report: the Python part makes a page, or figures and tables, of result folders.
#include "harness/cli/commands.h"
#include "harness/results/python.h"

namespace raybench {

namespace {

struct ReportArguments {
  std::vector<std::string> folders;
  std::string out;
  bool figures = false;
};

void AddOptions(CLI::App& command, ReportArguments& arguments) {
  command
      .add_option(
          "dirs", arguments.folders,
          "Result folders of run, verify, extremes, fuzz, check-plugin, check or tradeoff, or the store "
          "of history add; several runs stand side by side")
      ->required()
      ->type_name("DIR");
  command
      .add_option(
          "-o,--out", arguments.out,
          "The page; default: report.html in the first DIR. With --figures a folder; default: figures in "
          "the first DIR")
      ->type_name("FILE");
  command.add_flag(
      "--figures", arguments.figures,
      "Figures (PDF, SVG, PNG) and tables (LaTeX, Markdown, CSV) for a paper instead of the page");
  command.footer(
      "The page is one file that needs no network: mail it, or put it on a web server.\n\n"
      "Examples:\n"
      "  raybench report results/mine                       results/mine/report.html\n"
      "  raybench report before after -o both.html          two runs side by side\n"
      "  raybench report results/mine --figures -o paper    figures for \\includegraphics, tables for "
      "\\input");
}

void AddReportCommand(CLI::App& app, Invocation& invocation) {
  AddCommand<ReportArguments>(app, invocation, "report", "Make a page, or figures, of result folders",
                              AddOptions, [](const ReportArguments& arguments, const Registry&) {
                                for (const std::string& folder : arguments.folders) RequireFolder(folder);
                                std::vector<std::string> words = arguments.folders;
                                if (!arguments.out.empty())
                                  words.insert(words.end(), {"--out", arguments.out});
                                if (arguments.figures) words.push_back("--figures");
                                return Reports().Run(words);
                              });
}

}  // namespace

const Command kReport = {100, AddReportCommand};

}  // namespace raybench
