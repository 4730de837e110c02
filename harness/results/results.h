// The files a run leaves (reports/README.md). One JSON file a finished case is the source; both CSVs
// are derived.
#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "accel/base/files.h"
#include "harness/base/columns.h"
#include "harness/measure/measure.h"
#include "harness/plan/plan.h"

namespace raybench {

/// A case as its file has it.
struct FinishedCase {
  uint64_t plan_index = 0;
  Row row;  ///< of kCasesColumns
  std::vector<Sample> samples;
};

/// All finished cases of a result folder in the order of the plan. Throws InputError naming a file that cannot be
/// read.
std::vector<FinishedCase> ReadCases(const std::filesystem::path& folder);

class ResultFolder {
 public:
  /// Creates the folder. Throws InputError when it holds cases already and `resume` is not set, or cannot
  /// be made.
  ResultFolder(std::filesystem::path path, bool resume);

  const std::filesystem::path& path() const { return path_; }
  bool Has(const std::string& case_id) const;
  /// Whether it is there and has a time.
  bool IsTimed(const std::string& case_id) const;
  /// Stores a finished case. `values` gives columns of cases.csv beyond those of the key; those not given
  /// stay empty. A column of another table is a programming error (std::logic_error).
  void Store(const Case& key, const Row& values, std::span<const Sample> samples) const;
  /// The same as it is, from another folder.
  void Store(const FinishedCase& finished) const;
  /// run.json as an earlier session left it; null if there is none.
  Json PreviousRun() const;
  std::vector<FinishedCase> Cases() const;
  /// Derives samples.csv and cases.csv from the finished cases, and returns these.
  std::vector<FinishedCase> WriteCsvs() const;
  /// Adds the result format.
  void WriteRunJson(Json run) const;

 private:
  std::filesystem::path path_;
  std::optional<OneProcessLock> lock_;
};

}  // namespace raybench
