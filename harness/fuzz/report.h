// What `raybench fuzz` tells and leaves behind.
#pragma once

#include <filesystem>
#include <string>

#include "harness/fuzz/fuzz.h"
#include "harness/plan/plan.h"

namespace raybench::fuzz {

/// "2 primitives, 1 ray".
std::string SizeOf(const Case& c);

/// The case files of a campaign, in a folder that is made with the first.
class FindingFiles {
 public:
  explicit FindingFiles(std::filesystem::path folder) : folder_(std::move(folder)) {}
  /// Writes `smallest` to the fault's `file`, which it names if it has none yet. Throws InputError if that is not
  /// possible.
  void Write(FoundFault& fault);

 private:
  std::filesystem::path folder_;
  DistinctNames names_;
};

/// Writes a case file for each fault and fuzz.json into options.out. Throws InputError if that is not possible.
void WriteFindings(const FuzzOptions& options, FindingFiles& files, FuzzResult& result);

/// Runs Fuzz(), prints the table and the findings, and writes these: each as soon as it is found, and once more when
/// it is shrunk. Returns 0 nothing found,
/// 1 findings, 130 interrupted without any.
int RunFuzz(const Registry& registry, FuzzOptions options);

}  // namespace raybench::fuzz
