// What `raybench verify` found, and how it is shown: tables, examples, files.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "accel/host/registry.h"
#include "harness/base/columns.h"
#include "harness/base/json.h"
#include "harness/judge/tree_statistics.h"
#include "harness/judge/verdicts.h"

namespace raybench {

/// Percentiles of errors in bounded memory: a histogram over floats with 6 bits of mantissa. The maximum is
/// exact; a percentile is at most 1/64 above the true one.
class ErrorHistogram {
 public:
  void Add(double error);  ///< finite and >= 0
  void Add(const ErrorHistogram& other);
  uint64_t count() const { return count_; }
  double Max() const { return max_; }
  /// By nearest rank; 0 of nothing.
  double Percentile(uint64_t percent) const;

 private:
  std::vector<uint64_t> buckets_;  // none until the first error
  uint64_t count_ = 0;
  double max_ = 0;
};

/// The verdicts on one tree's answers to one ray set and kind of query.
struct VerdictRow {
  std::string set;
  uint32_t query = RB_CLOSEST;
  VerdictCounts counts;  ///< but for the errors of t, which stand here:
  ErrorHistogram t_errors;
  uint64_t bad[3] = {0, 0, 0};  ///< answers by Badness()
};

/// One structure on one scene.
struct VerifiedTree {
  Contestant contestant;
  std::string skipped;  ///< why there is no tree; nothing below is set then
  uint32_t claim = RB_CLAIM_NOTHING;
  std::optional<TreeStatistics> statistics;
  std::vector<VerdictRow> rows;
  std::vector<std::string> notes;        ///< sets that are absent, and why; fewer rays, and why
  std::string contract_flaw;             ///< the first malformed answer, in words
  std::vector<JudgedAnswer> examples;    ///< the worst ones, worst first
  std::optional<JudgedAnswer> breaking;  ///< the first that breaks the claim

  VerdictCounts Counts() const;  ///< of all rows, but for the errors of t
  bool ClaimHolds() const { return !BreaksClaim(claim, Counts()); }
  /// Claim, contract or tree.
  bool Broken() const;
};

/// What examples need to be replayed.
struct ReplayContext {
  std::string scene;  ///< as the user named it
  uint64_t seed = 1;
  std::vector<std::string> plugins;
  bool drop_bad = false;
  int scale_exponent = 0;  ///< of the scene
};

/// Worst first: 0 leak, 1 plain error, 2 what else breaks `claim`; 3 nothing to show.
int Badness(const Judged& judged, uint32_t claim);

std::string FormatVerified(const VerifiedTree& tree, const ReplayContext& context);
/// The command that judges this ray alone.
std::string ReplayCommand(const Contestant& contestant, const rb_ray& ray, const ReplayContext& context);
/// Verdict, answer and truth, a line each, and one for u and v that are wrong.
std::string FormatExample(const JudgedAnswer& example);
/// "< 3.0e-6": the upper bound at 95 % of a rate.
std::string FormatUpperRate(uint64_t events, uint64_t trials);

/// A tree's rows of verdicts.csv (kVerdictsColumns), without what they share with other trees of the scene.
std::vector<Row> VerdictRows(const VerifiedTree& tree);
Json FactsOf(const VerifiedTree& tree);
/// The ray in the coordinates of the scene's file.
Json FactsOf(const JudgedAnswer& example, int scale_exponent);

}  // namespace raybench
