// What `raybench run --again DIR` takes from DIR.
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

 private:
  std::filesystem::path folder_;
  std::map<std::string, Row> rows_;
};

/// Where the `index`-th captured set of a scene is kept, below a result folder.
std::filesystem::path KeptRays(const std::filesystem::path& folder, const std::string& stem, size_t index);

}  // namespace raybench
