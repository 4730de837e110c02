// raybench merge: folders of shards, or of repeated runs, become one.
#include "harness/results/merge.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "harness/cli/commands.h"
#include "harness/results/table.h"

namespace raybench {
namespace {

struct MergeArguments {
  std::string out;
  std::vector<std::string> folders;
};

/// Lines of disagreement that are printed; more of them say no more.
constexpr size_t kShownDisagreements = 20;

int MergeFolders(const MergeArguments& arguments) {
  const Merged merged = Merge(arguments.out, arguments.folders,
                              [](const std::string& line) { fmt::print(stderr, "{}\n", line); });
  for (const auto& folder : merged.folders) {
    if (merged.folders.size() > 1) fmt::print("machine {}\n\n", folder.filename().string());
    fmt::print("{}", FormatTable(ReadCases(folder)));
    fmt::print("cases   {0}/cases.csv\nsamples {0}/samples.csv\nreport  raybench report {0}\n",
               folder.string());
  }
  if (merged.folders.size() > 1) fmt::print("{} machines, which are kept apart\n", merged.folders.size());
  if (merged.shared_cases > 0)
    fmt::print("{} cases are in several folders: counters, digests and verdicts {}\n", merged.shared_cases,
               merged.disagreements.empty() ? "agree" : "DISAGREE");
  for (size_t i = 0; i < std::min(kShownDisagreements, merged.disagreements.size()); ++i)
    fmt::print("  {}\n", merged.disagreements[i]);
  if (merged.disagreements.size() > kShownDisagreements)
    fmt::print("  and {} more\n", merged.disagreements.size() - kShownDisagreements);
  if (!merged.missing.empty()) fmt::print("missing: shard {}\n", fmt::join(merged.missing, ", "));
  return !merged.disagreements.empty() ? 1 : merged.missing.empty() ? 0 : 3;
}

void AddMergeCommand(CLI::App& app, Invocation& invocation) {
  CLI::App& command = AddCommand<MergeArguments>(
      app, invocation, "merge", "Put the folders of shards, or of repeated runs, together",
      [](CLI::App& merge, MergeArguments& arguments) {
        merge.add_option("out", arguments.out, "Folder to write; holds no run yet")
            ->required()
            ->type_name("OUT");
        merge.add_option("dirs", arguments.folders, "Folders of finished runs")->required()->type_name("DIR");
      },
      [](const MergeArguments& arguments, const Registry&) { return MergeFolders(arguments); });
  command.footer(
      "Runs of unlike versions, suites or options are refused. Folders of unlike machines become "
      "OUT/FINGERPRINT each;\n"
      "what both measured must agree in everything but times. Runs of one case on one machine give it the "
      "samples of all.\n"
      "Exit codes: 0; 1 folders disagree; 2 wrong input; 3 a shard is missing.\n\n"
      "  for i in 1 2 3 4; do raybench run --shard $i/4 --out part$i; done; raybench merge whole part1 part2 "
      "part3 part4");
}

}  // namespace

const Command kMerge = {95, AddMergeCommand};

}  // namespace raybench
