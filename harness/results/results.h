// The files a run leaves (reports/README.md). One JSON file a finished case is the source; both CSVs are
// derived.
#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "harness/base/files.h"
#include "harness/base/json.h"
#include "harness/measure/measure.h"
#include "harness/plan/plan.h"

namespace raybench {

/// The columns of cases.csv and samples.csv in order.
std::span<const char* const> CaseColumns();
std::span<const char* const> SampleColumns();

/// One field as CSV (RFC 4180): text quoted where needed, numbers in the shortest form that reads back the
/// same, null as nothing.
std::string CsvField(const Json& value);

class ResultFolder {
 public:
  /// Creates the folder. Throws InputError when it holds cases already and `resume` is not set, or cannot be
  /// made.
  ResultFolder(std::filesystem::path path, bool resume);

  const std::filesystem::path& path() const { return path_; }
  bool Has(const std::string& case_id) const;
  /// Whether it is there and has a time.
  bool IsTimed(const std::string& case_id) const;
  /// Stores a finished case. `values` gives columns of cases.csv beyond those of the key; those not given
  /// stay empty. A key that is no column is a programming error (std::logic_error).
  void Store(const Case& key, const Json& values, std::span<const Sample> samples) const;
  /// All finished cases in the order of the plan. Throws InputError naming a file that cannot be read.
  std::vector<Json> Cases() const;
  /// Derives samples.csv and cases.csv from the finished cases.
  void WriteCsvs() const;
  void WriteRunJson(const Json& run) const;

 private:
  std::filesystem::path path_;
  std::optional<OneProcessLock> lock_;
};

}  // namespace raybench
