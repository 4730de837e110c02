#include "harness/judge/check.h"

#include <fmt/format.h>

#include <cmath>
#include <cstring>

#include "tracer/tracer.h"

namespace raybench {
namespace {

bool SameBits(float a, float b) { return std::memcmp(&a, &b, sizeof a) == 0; }

/// The first ray whose answers differ, in words; empty if all are the same to the bit.
std::string Difference(const RaySet& set, const Answers& a, const Answers& b) {
  for (size_t i = 0; i < set.rays.size(); ++i) {
    const rb_hit &x = a.hits[i], &y = b.hits[i];
    const bool same = set.query == RB_ANY
                          ? a.occluded[i] == b.occluded[i]
                          : x.prim == y.prim && SameBits(x.t, y.t) &&
                                (x.prim == RAYBENCH_NONE || (SameBits(x.u, y.u) && SameBits(x.v, y.v)));
    if (!same) return fmt::format("ray {} is answered differently when counted", i);
  }
  return {};
}

std::string BrokenClaim(uint32_t claim, const VerdictCounts& counts) {
  std::string text = fmt::format("claims {}, but of {} rays", ClaimName(claim), counts.rays);
  const char* separator = " ";
  if (claim == RB_CLAIM_EXACT) {
    text += fmt::format(" {} are not answered exactly to the bit", counts.rays - counts.strict);
    separator = ": ";
    if (const uint64_t close = counts[Verdict::kExact] - counts.strict; close > 0) {
      text += fmt::format("{}{} exact within the error", separator, close);
      separator = ", ";
    }
  }
  for (size_t v = size_t(Verdict::kExact) + 1; v < size_t(Verdict::kCount); ++v) {
    if (counts.by_class[v] == 0) continue;
    const bool allowed = Verdict(v) == Verdict::kTie || Verdict(v) == Verdict::kNeighbour ||
                         std::string_view(VerdictName(Verdict(v))).ends_with("_marginal");
    if (claim == RB_CLAIM_WATERTIGHT && allowed) continue;
    text += fmt::format("{}{} {}", separator, counts.by_class[v], VerdictName(Verdict(v)));
    separator = ", ";
  }
  return text;
}

}  // namespace

const char* ClaimName(uint32_t claim) {
  static constexpr const char* kNames[] = {"nothing", "inexact", "watertight", "exact"};
  return claim < std::size(kNames) ? kNames[claim] : "unknown";
}

std::string ContractFlaw(const RaySet& set, const Answers& answers, uint64_t primitives) {
  for (size_t i = 0; i < set.rays.size(); ++i) {
    if (set.query == RB_ANY) {
      if (answers.occluded[i] > 1)
        return fmt::format("ray {} is answered {}, not 0 or 1", i, answers.occluded[i]);
      continue;
    }
    const rb_hit& hit = answers.hits[i];
    const rb_ray& ray = set.rays[i];
    if (hit.prim == RAYBENCH_NONE) {
      if (!(hit.t == ray.tfar))
        return fmt::format("ray {} misses with t = {}, not tfar = {}", i, hit.t, ray.tfar);
    } else if (hit.prim >= primitives) {
      return fmt::format("ray {} hits primitive {} of {}", i, hit.prim, primitives);
    } else if (!(hit.t > ray.tnear && hit.t <= ray.tfar && std::isfinite(hit.t))) {
      return fmt::format("ray {} hits at t = {}; a finite t in ({}, {}] is allowed", i, hit.t, ray.tnear,
                         ray.tfar);
    }
  }
  return {};
}

std::string CheckAnswers(const Tree& tree, const Oracle& oracle, uint64_t primitives,
                         const PreparedSet& prepared, Row& values, Answers& answers, Answers& counted) {
  const RaySet& set = prepared.set;
  QueryParallel(tree, answers.Ask(set), 0);
  if (std::string flaw = ContractFlaw(set, answers, primitives); !flaw.empty()) return flaw;

  std::vector<rb_hit> hits;
  std::vector<uint8_t> occluded;
  for (uint32_t pick : prepared.picks) {
    if (set.query == RB_ANY) {
      occluded.push_back(answers.occluded[pick]);
    } else {
      hits.push_back(answers.hits[pick]);
    }
  }
  const VerdictCounts verdict =
      JudgeAll(oracle, set.query, prepared.picked, prepared.truth, hits, occluded, 0);
  values[column::oracle] = oracle.Name();
  values[column::verified] = verdict.rays;
  for (size_t v = 0; v < size_t(Verdict::kCount); ++v) values[ClassColumn(Verdict(v))] = verdict.by_class[v];
  if (verdict[Verdict::kExact] + verdict[Verdict::kTie] + verdict[Verdict::kNeighbour] > 0 &&
      set.query == RB_CLOSEST) {
    values[column::t_error_p50] = verdict.t_error_p50;
    values[column::t_error_p99] = verdict.t_error_p99;
    values[column::t_error_max] = verdict.t_error_max;
  }
  uint64_t hit_count = 0;
  for (size_t i = 0; i < set.rays.size(); ++i) {
    hit_count += set.query == RB_ANY ? answers.occluded[i] != 0 : answers.hits[i].prim != RAYBENCH_NONE;
  }
  values[column::hits] = hit_count;
  if (BreaksClaim(tree.Claims(), verdict)) return BrokenClaim(tree.Claims(), verdict);

  if ((tree.structure().capabilities & RB_CAN_COUNT) == 0) return {};
  std::vector<rb_counts> counts(set.rays.size());
  QueryParallel(tree, counted.Ask(set, counts.data()), 0);
  if (std::string flaw = Difference(set, answers, counted); !flaw.empty()) return flaw;
  rb_counts sum = {};
  for (const rb_counts& c : counts) {
    sum.steps += c.steps, sum.leaves += c.leaves, sum.empty_leaves += c.empty_leaves;
    sum.bounds += c.bounds, sum.prims += c.prims, sum.bytes += c.bytes;
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

}  // namespace raybench
