// One structure on one scene of a run: its cases, its tree, what is known of them.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "accel/host/registry.h"
#include "harness/base/columns.h"
#include "harness/judge/tree_statistics.h"
#include "harness/plan/plan.h"
#include "harness/results/results.h"

namespace raybench {

struct PlannedCase {
  Case key;
  size_t set = 0;    ///< of the scene's sets; no meaning for a build
  std::string skip;  ///< why it is not measured; empty: it is

  /// What --benchmark_filter sees.
  std::string Name() const;
};

struct Entrant {
  const Contestant* contestant = nullptr;
  std::vector<PlannedCase> cases;            ///< builds first
  bool foreign = false;                      ///< of another shard: nothing of it is stored
  bool recalled = false;                     ///< the tree is the one that an earlier session judged
  bool too_slow = false;                     ///< for the larger ray sets, which are skipped
  Tree tree;                                 ///< the one that is judged and timed
  uint64_t tree_bytes = 0;                   ///< of nodes and copied primitives
  uint64_t build_bytes = 0;                  ///< what a building takes, the tree included
  uint64_t build_limit = 0;                  ///< that it was built with
  std::map<uint32_t, double> build_seconds;  ///< by threads
  std::map<uint32_t, Row> build_values;      ///< by threads
  std::vector<Row> set_values;               ///< verdict, hits and counters of each set

  std::string Spec() const { return contestant->Spec(); }
  bool Is(const char* name) const { return std::string_view(contestant->structure->name) == name; }
  bool Can(uint64_t capability) const { return (contestant->structure->capabilities & capability) != 0; }
  /// Whether it answers some query of the set.
  bool Answers(size_t set) const;
  bool AllDone(const ResultFolder& results) const;
  /// Whether what is known of its trees is of one with this TreeDigest(), or of one that shows no nodes.
  bool MayHaveDigest(const std::string& digest) const;

  /// Figures of the tree, for all builds that are known to make it.
  void SetTreeValues(const TreeStatistics& s, std::optional<double> overlap, std::optional<double> tightness);
  /// The columns of a case that are known before timing. A query shows the tree it ran on.
  Row ValuesOf(const PlannedCase& c) const;

  /// Ends the open cases that are skipped from the start.
  void StoreSkipped(const ResultFolder& results) const;
  /// Ends all open cases without a time, and gives the tree back.
  void Close(const ResultFolder& results, const std::string& status, const std::string& note);
};

/// What can be an anchor first: embree, then what works on the processor and does not look at every primitive, then
/// what answers some sets at least.
std::vector<Entrant*> AnchorsFirst(std::vector<Entrant>& entrants);

}  // namespace raybench
