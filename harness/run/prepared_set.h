// A ray set of a run, and what a tree must get right about it before any clock starts.
#pragma once

#include <string>
#include <vector>

#include "harness/base/columns.h"
#include "harness/judge/ask.h"
#include "harness/rays/ray_sets.h"
#include "harness/truth/oracle.h"

namespace raybench {

/// A ray set with the truth of a seeded part of it.
struct PreparedSet : SourcedSet {
  std::vector<uint32_t> picks;
  std::vector<Truth> truth;

  Question Asked() const { return {set.query, set.rays}; }
};

/// Asks `tree`, through the instantiation that is timed and on all threads, about the whole set and fills the
/// columns of verdict, hits and counters in `values`. Returns, in words, what breaks the tree's claim or the
/// contract (malformed answers, counted answers that differ from uncounted ones); empty if nothing does.
/// `answers` and `counted` hold at least as many rays as the set and are overwritten.
std::string CheckAnswers(const Tree& tree, const Oracle& oracle, const Scene& scene,
                         const PreparedSet& prepared, Row& values, Answers& answers, Answers& counted);

}  // namespace raybench
