#include "harness/run/prepared_set.h"

#include "harness/judge/claim.h"

namespace raybench {

std::string CheckAnswers(const Tree& tree, const Oracle& oracle, const Scene& scene,
                         const PreparedSet& prepared, Row& values, Answers& answers, Answers& counted) {
  const Question question = prepared.Asked();
  const Verdicts verdicts = AskAndJudge(tree, oracle, scene.primitive_count(), question,
                                        {prepared.truth, prepared.picks}, answers, 0);
  if (!verdicts.contract_flaw.empty()) return verdicts.contract_flaw;
  values[column::oracle] = oracle.Name();
  values[column::verified] = verdicts.counts.rays;
  SetClasses(values, verdicts.counts);
  if (question.query == RB_CLOSEST) SetErrorsOfT(values, verdicts.counts);
  uint64_t hits = 0;
  for (size_t i = 0; i < question.rays.size(); ++i)
    hits += question.query == RB_ANY ? answers.occluded[i] != 0 : answers.hits[i].prim != RAYBENCH_NONE;
  values[column::hits] = hits;
  values[column::hits_digest] = DigestOf(question, answers);
  const std::string broken =
      BrokenClaim(tree.Claims(), verdicts.counts, verdicts.breaking, scene.scale_exponent);
  return !broken.empty() ? broken : CountAnswers(tree, question, answers, counted, 0, values);
}

}  // namespace raybench
