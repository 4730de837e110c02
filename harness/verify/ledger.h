// Rays fired at closed meshes, added up over runs in a JSON file.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "harness/base/json.h"

namespace raybench {

/// Only rays with the same key add up: the same tree, code and kind of query.
struct LedgerKey {
  std::string scene_hash, structure, params;
  std::string query;            ///< "closest" or "any"
  std::string version, commit;  ///< of raybench
  std::string plugin_sha256;    ///< of the plugin that brought the structure; empty: built in
};

struct LedgerTotals {
  uint64_t rays = 0, misses = 0, runs = 0;
};

/// Every call reads the file, changes it and renames a new one into place, under a lock on its folder:
/// several processes may add to one ledger. All throw InputError naming the file and what is wrong: not
/// readable, not a ledger, figures that do not add up, a seed used twice, not writable.
class Ledger {
 public:
  /// A file that is not there is an empty ledger.
  explicit Ledger(std::filesystem::path path);

  /// Enters a run of no rays yet with the lowest seed from `seed` on that the key has not used, and returns
  /// that seed: the same rays are never counted twice. `scene` is how the user calls the scene.
  uint64_t Begin(const LedgerKey& key, const std::string& scene, uint64_t seed);
  /// What the run with this seed has fired so far.
  void Record(const LedgerKey& key, uint64_t seed, uint64_t rays, uint64_t misses);
  /// Over all runs of the key.
  LedgerTotals Totals(const LedgerKey& key) const;

 private:
  Json ReadChecked() const;
  void Write(const Json& ledger) const;

  std::filesystem::path path_;
};

}  // namespace raybench
