// raybench doctor: what of this machine spoils timings, and what to do.
#include <fmt/format.h>

#include "harness/cli/commands.h"
#include "harness/measure/machine_state.h"

namespace raybench {
namespace {

struct DoctorOptions {
  bool json = false;
};

int Examine(const DoctorOptions& options, const Registry&) {
  std::vector<MachineFinding> findings = ExamineMachine();
  findings.push_back(FindingOf(MeasureJitter(0.5)));
  if (options.json) {
    fmt::print("{}\n", Dump(FactsOf(findings)));
    return 0;
  }
  for (const MachineFinding& f : findings) {
    fmt::print("{:<8} {:<12} {}\n", SeverityName(f.severity), f.subject, f.says);
    if (!f.cure.empty()) fmt::print("{:21} do: {}\n", "", f.cure);
  }
  const MachineFinding worst = WorstOf(findings);
  fmt::print(
      "\n{}\n",
      worst.severity == MachineFinding::kWarning
          ? "Times of single runs are not to be trusted here; ratios of pairs are (raybench check --run)."
      : worst.severity == MachineFinding::kNote
          ? "Times spread more than they need to; counters and digests do not."
          : "Nothing found that spoils timings.");
  return 0;
}

void AddDoctorCommand(CLI::App& app, Invocation& invocation) {
  AddCommand<DoctorOptions>(
      app, invocation, "doctor", "What of this machine spoils timings, and what to do",
      [](CLI::App& command, DoctorOptions& options) {
        command.add_flag("--json", options.json, "Print this as JSON");
        command.footer(
            "Takes a second, needs no rights and changes nothing. `run` keeps the same, without the jitter, "
            "in\nrun.json (machine_state).");
      },
      Examine);
}

}  // namespace

const Command kDoctor = {95, AddDoctorCommand};

}  // namespace raybench
