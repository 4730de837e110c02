// Result folders of one suite become one: shards of a run, or repeated runs.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace raybench {

struct Merged {
  std::vector<std::filesystem::path> folders;  ///< written: one, or one for each machine
  std::vector<std::string> missing;            ///< shards that none of the folders holds, such as "3/4"
  uint64_t shared_cases = 0;                   ///< that several folders hold
  std::vector<std::string> disagreements;  ///< between folders on what no machine may change, one line each
};

/// Merges finished runs into `out`, which must hold no run. Folders of unlike machines (by fingerprint) are kept
/// apart, in `out`/FINGERPRINT. A case that several runs of one machine have gets the samples of all, each run's
/// as sessions of its own; if they were timed on different parts of the rays, the first folder's stay. `note` is
/// given a line for what was left out. Throws InputError with one line: a folder without a finished run, runs of
/// unlike versions, suites or options.
Merged Merge(const std::filesystem::path& out, const std::vector<std::string>& folders,
             const std::function<void(const std::string&)>& note);

}  // namespace raybench
