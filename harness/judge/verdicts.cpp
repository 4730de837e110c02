#include "harness/judge/verdicts.h"

#include <fmt/format.h>

#include <cmath>

namespace raybench {

std::string ContractFlaw(const Question& question, const Answers& answers, uint64_t primitives) {
  for (size_t i = 0; i < question.rays.size(); ++i) {
    if (question.query == RB_ANY) {
      if (answers.occluded[i] > 1)
        return fmt::format("ray {} is answered {}, not 0 or 1", i, answers.occluded[i]);
      continue;
    }
    const rb_hit& hit = answers.hits[i];
    const rb_ray& ray = question.rays[i];
    const bool resumes = !question.after.empty() && question.after[i] != RAYBENCH_NONE;
    const bool begun = hit.t > ray.tnear || (resumes && hit.t == ray.tnear);
    if (hit.prim == RAYBENCH_NONE) {
      if (!(hit.t == ray.tfar))
        return fmt::format("ray {} misses with t = {}, not tfar = {}", i, hit.t, ray.tfar);
    } else if (hit.prim >= primitives) {
      return fmt::format("ray {} hits primitive {} of {}", i, hit.prim, primitives);
    } else if (!(begun && hit.t <= ray.tfar && std::isfinite(hit.t))) {
      return fmt::format("ray {} hits at t = {}; a finite t in {}{}, {}] is allowed", i, hit.t,
                         resumes ? '[' : '(', ray.tnear, ray.tfar);
    }
  }
  return {};
}

JudgedAnswer Verdicts::Answer(size_t nth, const Oracle& oracle, const Question& question, const Known& known,
                              const Answers& answers) const {
  JudgedAnswer answer;
  const size_t i = known.picks.empty() ? nth : known.picks[nth];
  answer.query = question.query;
  answer.index = i;
  answer.ray = question.rays[i];
  answer.truth = known.truth[nth];
  answer.judged = judged[nth];
  if (question.query == RB_ANY) {
    answer.occluded = answers.occluded[i] != 0;
  } else {
    answer.hit = answers.hits[i];
    if (question.has_uv) answer.uv = oracle.Uv(answer.ray, answer.hit);
  }
  return answer;
}

Verdicts JudgeAnswers(uint32_t claim, const Oracle& oracle, uint64_t primitives, const Question& question,
                      const Known& known, const Answers& answers, uint32_t threads) {
  Verdicts verdicts;
  verdicts.contract_flaw = ContractFlaw(question, answers, primitives);
  if (known.truth.empty() || !question.skip.empty() || !question.after.empty()) return verdicts;
  std::span<const rb_ray> rays = question.rays;
  std::span<const rb_hit> hits = answers.hits;
  std::span<const uint8_t> occluded = answers.occluded;
  std::vector<rb_ray> picked_rays;
  std::vector<rb_hit> picked_hits;
  std::vector<uint8_t> picked_occluded;
  if (!known.picks.empty()) {
    for (uint32_t pick : known.picks) {
      picked_rays.push_back(rays[pick]);
      picked_hits.push_back(hits[pick]);
      picked_occluded.push_back(occluded[pick]);
    }
    rays = picked_rays;
    hits = picked_hits;
    occluded = picked_occluded;
  }
  const size_t n = rays.size();
  std::vector<Judged>& judged = verdicts.judged;
  verdicts.counts = JudgeAll(oracle, question.query, rays, known.truth, hits.first(n), occluded.first(n),
                             threads, &judged, question.has_uv);
  for (size_t nth = 0; nth < judged.size() && !verdicts.breaking; ++nth)
    if (judged[nth].Breaks(claim)) verdicts.breaking = verdicts.Answer(nth, oracle, question, known, answers);
  return verdicts;
}

Verdicts AskAndJudge(const Tree& tree, const Oracle& oracle, uint64_t primitives, const Question& question,
                     const Known& known, Answers& answers, uint32_t threads) {
  Ask(tree, question, answers, threads);
  return JudgeAnswers(tree.Claims(), oracle, primitives, question, known, answers, threads);
}

std::string CountAnswers(const Tree& tree, const Question& question, const Answers& answers, Answers& counted,
                         uint32_t threads, Row& values) {
  if ((tree.structure().capabilities & RB_CAN_COUNT) == 0) return {};
  std::vector<rb_counts> counts(question.rays.size());
  Ask(tree, question, counted, threads, counts.data());
  if (const size_t i = FirstDifference(question, answers, counted); i < counts.size())
    return fmt::format("ray {} is answered differently when counted", i);
  rb_counts sum = {};
  for (const rb_counts& c : counts) {
    sum.steps += c.steps;
    sum.leaves += c.leaves;
    sum.empty_leaves += c.empty_leaves;
    sum.bounds += c.bounds;
    sum.prims += c.prims;
    sum.bytes += c.bytes;
  }
  const double n = double(counts.size()), mean_leaves = double(sum.leaves) / n;
  double leaf_squares = 0;
  for (const rb_counts& c : counts) {
    const double off = double(c.leaves) - mean_leaves;
    leaf_squares += off * off;
  }
  values[column::steps] = double(sum.steps) / n;
  values[column::leaves] = double(sum.leaves) / n;
  values[column::empty_leaves] = double(sum.empty_leaves) / n;
  values[column::bounds] = double(sum.bounds) / n;
  values[column::prims] = double(sum.prims) / n;
  values[column::bytes] = double(sum.bytes) / n;
  values[column::lcv] = std::sqrt(leaf_squares / n);
  return {};
}

void SetClasses(Row& row, const VerdictCounts& counts) {
  for (size_t v = 0; v < size_t(Verdict::kCount); ++v) row[ClassColumn(Verdict(v))] = counts.by_class[v];
  if (counts.uv_judged == 0) return;
  row[column::uv_wrong] = counts.uv_wrong;
  row[column::uv_error_max] = counts.uv_error_max;
}

void SetErrorsOfT(Row& row, const VerdictCounts& counts) {
  if (counts[Verdict::kExact] + counts[Verdict::kTie] + counts[Verdict::kNeighbour] == 0) return;
  row[column::t_error_p50] = counts.t_error_p50;
  row[column::t_error_p99] = counts.t_error_p99;
  row[column::t_error_max] = counts.t_error_max;
}

}  // namespace raybench
