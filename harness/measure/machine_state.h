// What of this machine, as it is now, spoils timings: what `raybench doctor` says.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "harness/base/json.h"

namespace raybench {

struct MachineFinding {
  enum Severity {
    kFine,     ///< looked at, nothing to say
    kUnknown,  ///< the system does not tell
    kNote,     ///< widens the spread, or a limit of what can be concluded
    kWarning,  ///< times are not to be trusted without pairing
  };
  std::string subject;  ///< a word or two, such as "load"
  Severity severity = kFine;
  std::string says;  ///< what was found
  std::string cure;  ///< what to do; empty where nothing is to be done
};

/// Load, cores allowed, cgroup limits, frequency governor, turbo, SMT, stolen time, virtual machine, swap and memory,
/// in this order; read from /proc and /sys below `root`, which tests replace. Takes no time and changes nothing.
std::vector<MachineFinding> ExamineMachine(const std::filesystem::path& root = "/");

/// Times the same work over and over on one pinned CPU for about `seconds`: how much longer than the shortest a
/// pass takes, by its CPU time, in the middle and at the 95th percentile. 0: no longer.
struct Jitter {
  double median = 0, p95 = 0;
};
Jitter MeasureJitter(double seconds);
/// The same in words, as a finding.
MachineFinding FindingOf(const Jitter& jitter);

/// The gravest, the first of equals; of kFine if nothing is amiss.
MachineFinding WorstOf(const std::vector<MachineFinding>& findings);

/// "fine", "unknown", "note", "warning".
const char* SeverityName(MachineFinding::Severity severity);
/// For run.json: subject, severity, says, cure of each.
Json FactsOf(const std::vector<MachineFinding>& findings);

}  // namespace raybench
