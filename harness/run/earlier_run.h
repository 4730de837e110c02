// What `raybench run --again DIR` and `--parts-of DIR` take from DIR.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "datasets/scene/scene.h"
#include "harness/base/columns.h"
#include "harness/rays/ray_sets.h"

namespace raybench {

/// How many of its rays each timed case was timed on, by case_id.
using TimedParts = std::map<std::string, uint64_t>;
/// Those of the run in `folder`, of whatever program. Throws InputError where there is no run.
TimedParts ReadTimedParts(const std::filesystem::path& folder);

/// A finished run of this very program.
class EarlierRun {
 public:
  /// `program`: its digest. Throws InputError: no run there, one of another program or plugin, or one without finished cases.
  EarlierRun(std::filesystem::path folder, const std::string& program);

  /// The captured sets of a scene, in their order, with the hashes they had. Throws InputError where there are
  /// none, or they belong to another scene.
  std::vector<SourcedSet> Rays(const std::string& stem, const Scene& scene) const;
  /// What does not vary between runs, of a case that was not refused; null if there is none.
  const Row* Find(const std::string& case_id) const;
  const TimedParts& parts() const { return parts_; }

 private:
  std::filesystem::path folder_;
  std::map<std::string, Row> rows_;
  TimedParts parts_;
};

/// Where the `index`-th captured set of a scene is kept, below a result folder or its journal.
std::filesystem::path KeptRays(const std::filesystem::path& folder, const std::string& stem, size_t index);
/// All sets that are kept there, in their order. Throws InputError where one belongs to another scene.
std::vector<SourcedSet> ReadKeptRays(const std::filesystem::path& folder, const std::string& stem,
                                     const Scene& scene);

}  // namespace raybench
