// What a run measures: cases and their names.
#pragma once

#include <cstdint>
#include <set>
#include <string>
#include <vector>

#include "accel/host/registry.h"
#include "datasets/scene/scene.h"
#include "harness/plan/suite.h"

namespace raybench {

/// Scene x structure with all parameters x ray set x query kind x threads x seed. Building a tree is a case
/// too: its ray set and query are "build".
struct Case {
  uint64_t plan_index = 0;  ///< place in the plan; orders the rows of cases.csv and is no part of the name
  std::string scene, scene_hash;
  uint64_t primitives = 0;
  std::string structure, spec, params;
  std::string ray_set = "build", ray_hash, query = "build", order;
  uint64_t rays = 0;
  uint32_t threads = 1;
  uint64_t seed = 1;

  /// 16 hex digits over everything that makes the case what it is; the same on every machine.
  std::string Id() const;
  bool IsBuild() const { return query == "build"; }
};

/// What `raybench run` was asked for. A zero, or nothing, stands for what the suite says.
struct RunOptions {
  Suite suite;
  bool named_scenes = false;            ///< `scenes` were typed, and so must be there
  std::vector<std::string> scenes;      ///< those of the suite, or others
  std::vector<std::string> structures;  ///< as ChooseContestants() takes them
  std::vector<std::string> sets;        ///< ray sets to capture, by label or kind; empty: all
  std::vector<std::string> ray_files;   ///< .rays files or folders of them, replayed instead of captured sets
  std::vector<std::string> plugins;     ///< already loaded; recorded
  std::vector<uint32_t> threads;        ///< ascending; empty: queries 1, builds 1 and all
  bool resume = false, report = true, shuffled = false, drop_bad = false;
  std::string out;         ///< empty: results/<UTC time>
  bool keep_rays = false;  ///< store captured sets in out/rays, for `again`
  std::string again;       ///< folder of a run with `keep_rays` whose rays and verdicts are used; empty: none
  std::string parts_of;  ///< folder of a run on whose parts of the rays the same cases are timed; empty: none
  /// `rays` 0 with `ray_files`: whole files.
  uint64_t rays = 0, verify_rays = 0, memory_limit = 0, seed = 1;
  uint32_t repetitions = 0, depth = 2;
  uint32_t processes = 1;                    ///< one after the other, each takes all samples anew
  uint32_t shard = 1, shards = 1;            ///< this one, from 1, of so many
  double budget = 0;                         ///< seconds of timing a case
  uint64_t passes = 0;                       ///< of each sample; 0: as many as the budget pays
  std::vector<std::string> benchmark_flags;  ///< "--benchmark_..." as given
  std::vector<std::string> command_line;

  uint64_t RaysPerSet() const { return rays != 0 ? rays : suite.rays; }
  uint64_t RaysVerified() const { return verify_rays != 0 ? verify_rays : suite.verify_rays; }
  uint32_t Repetitions() const { return repetitions != 0 ? repetitions : suite.repetitions; }
  /// More samples by name are not shorter ones.
  double Budget() const { return budget != 0 ? budget : Repetitions() * suite.sample_seconds; }
};

/// Whether this shard measures that structure on that scene: of all pairs, scene by scene, each shard has a run
/// of the same length (but for one).
bool Owns(const RunOptions& options, size_t scene, size_t scenes, size_t structure, size_t structures);

/// Why the structure cannot be built over the scene, in words; empty if it can.
std::string WhyNotTaken(const rb_structure& structure, const Scene& scene);

/// The named structures. Without names, or with "families" alone, one of each family and what plugins
/// brought, and with "all" alone
/// every registered one, at their defaults with the variants worth seeing beside them. Throws InputError:
/// unknown, or given twice.
std::vector<Contestant> ChooseContestants(const Registry& registry, const std::vector<std::string>& specs);

/// The same, but what is not named comes at each value of its parameters `numerics` and `robust`, and
/// without `null`.
std::vector<Contestant> EveryArithmetic(const Registry& registry, const std::vector<std::string>& specs);

/// Half-open evenly spaced strata with one seeded pick in each: `count` distinct indices below `n`,
/// ascending; all of them if count >= n.
std::vector<uint32_t> PickSample(uint64_t n, uint64_t count, uint64_t seed, const std::string& stream);

/// `name` as a file name: letters, digits, '-' and single '_'. Of a path, the stem of its last component.
std::string FileStem(const std::string& name);

/// Names of files that are written beside each other: each only once.
class DistinctNames {
 public:
  /// `wanted`, or where that has been given before wanted_2, wanted_3, ...
  std::string operator()(const std::string& wanted);

 private:
  std::set<std::string> given_;
};

}  // namespace raybench
