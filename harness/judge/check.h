// What comes before any clock starts: a tree's answers against truth, contract and counting.
#pragma once

#include <string>
#include <vector>

#include "accel/host/registry.h"
#include "harness/base/columns.h"
#include "harness/rays/ray_sets.h"
#include "harness/truth/oracle.h"

namespace raybench {

/// A ray set with the truth of a seeded part of it.
struct PreparedSet : SourcedSet {
  std::vector<uint32_t> picks;
  std::vector<rb_ray> picked;
  std::vector<Truth> truth;
};

/// Where answers go. One for all trees of a scene, so that no tree gets better pages than another.
struct Answers {
  std::vector<rb_hit> hits;
  std::vector<uint8_t> occluded;

  explicit Answers(size_t n) : hits(n), occluded(n) {}
  rb_query Ask(const RaySet& set, rb_counts* counts = nullptr) {
    rb_query query = {};
    query.struct_size = sizeof query;
    query.kind = set.query;
    query.n = set.rays.size();
    query.rays = set.rays.data();
    query.hits = hits.data();
    query.occluded = occluded.data();
    query.counts = counts;
    return query;
  }
};

/// How many answers fell into the class.
inline ColumnOf<ColumnType::kCount> ClassColumn(Verdict v) { return {VerdictName(v)}; }

/// "nothing", "inexact", "watertight", "exact".
const char* ClaimName(uint32_t claim);

/// What about the answers to a set contradicts the contract whatever the truth is, in words; empty if nothing
/// does.
std::string ContractFlaw(const RaySet& set, const Answers& answers, uint64_t primitives);

/// Asks `tree`, through the instantiation that is timed and on all threads, about the whole set and fills the
/// columns of verdict, hits and counters in `values`. Returns, in words, what breaks the tree's claim or the
/// contract (malformed answers, counted answers that differ from uncounted ones); empty if nothing does.
/// `answers` and `counted` hold at least as many rays as the set and are overwritten.
std::string CheckAnswers(const Tree& tree, const Oracle& oracle, uint64_t primitives,
                         const PreparedSet& prepared, Row& values, Answers& answers, Answers& counted);

}  // namespace raybench
