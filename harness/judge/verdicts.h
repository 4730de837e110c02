// The second step of judging a tree: its answers against the contract and against truth.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "harness/base/columns.h"
#include "harness/judge/ask.h"
#include "harness/truth/oracle.h"

namespace raybench {

/// The truth of a question's rays, or of those that are picked.
struct Known {
  std::span<const Truth> truth;          ///< empty: nothing is judged
  std::span<const uint32_t> picks = {};  ///< one a truth, or empty: all rays
};

/// One answer with all that is known of it.
struct JudgedAnswer {
  std::string set;  ///< of rays; may be empty
  uint32_t query = RB_CLOSEST;
  uint64_t index = 0;  ///< of the ray in its set
  rb_ray ray = {};
  rb_hit hit = {};        ///< RB_CLOSEST
  bool occluded = false;  ///< RB_ANY
  Truth truth;
  UvTruth uv;  ///< of a hit
  Judged judged;
};

/// What is said of the answers to a question.
struct Verdicts {
  std::string contract_flaw;             ///< the first malformed answer, in words; empty: none
  VerdictCounts counts;                  ///< of what is judged
  std::vector<Judged> judged;            ///< the same one by one
  std::optional<JudgedAnswer> breaking;  ///< the first that breaks the claim

  /// The `nth` of the judged ones.
  JudgedAnswer Answer(size_t nth, const Oracle& oracle, const Question& question, const Known& known,
                      const Answers& answers) const;
};

/// Judges answers that are there. What skips or resumes is held to the contract alone: the oracle knows
/// neither. `primitives`: of the scene.
Verdicts JudgeAnswers(uint32_t claim, const Oracle& oracle, uint64_t primitives, const Question& question,
                      const Known& known, const Answers& answers, uint32_t threads);

/// Asks the tree, and judges by what it claims.
Verdicts AskAndJudge(const Tree& tree, const Oracle& oracle, uint64_t primitives, const Question& question,
                     const Known& known, Answers& answers, uint32_t threads);

/// Asks once more, counted, and fills the counters' columns. Says what is answered differently then; empty if
/// nothing is, or where the structure cannot count, which leaves the columns empty.
std::string CountAnswers(const Tree& tree, const Question& question, const Answers& answers, Answers& counted,
                         uint32_t threads, Row& values);

/// What about the answers contradicts the contract whatever the truth is, in words; empty if nothing does.
std::string ContractFlaw(const Question& question, const Answers& answers, uint64_t primitives);

/// How many answers fell into the class.
inline ColumnOf<ColumnType::kCount> ClassColumn(Verdict v) { return {VerdictName(v)}; }

/// The columns of classes, u and v.
void SetClasses(Row& row, const VerdictCounts& counts);
/// Those of the errors of t, of closest hits.
void SetErrorsOfT(Row& row, const VerdictCounts& counts);

}  // namespace raybench
