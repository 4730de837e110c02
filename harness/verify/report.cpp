#include "harness/verify/report.h"

#include <fmt/format.h>

#include <bit>
#include <cmath>

#include "harness/judge/claim.h"
#include "harness/measure/statistics.h"
#include "harness/rays/ray_sets.h"
#include "harness/results/table.h"
#include "harness/verify/verify.h"

namespace raybench {
namespace {

constexpr int kShift = 17;  // what of a float's 32 bits is not looked at

const char* FeatureName(Feature feature) {
  return feature == Feature::kInterior ? "interior" : feature == Feature::kEdge ? "edge" : "vertex";
}

/// "12 (3)": plain and marginal; "12" without any marginal.
std::string Both(const VerdictCounts& c, Verdict plain, Verdict marginal) {
  return c[marginal] == 0 ? fmt::format("{}", c[plain]) : fmt::format("{} ({})", c[plain], c[marginal]);
}

std::string ErrorsOf(const ErrorHistogram& errors) {
  if (errors.count() == 0) return "-";
  return fmt::format("{:.2g} {:.2g} {:.2g}", errors.Percentile(50), errors.Percentile(99), errors.Max());
}

/// "0.31", in units of the bound; "2.5e+05 (12)" with how many are beyond it.
std::string ErrorOfUv(const VerdictCounts& c) {
  if (c.uv_judged == 0) return "-";
  return fmt::format("{:.2g}", c.uv_error_max) + (c.uv_wrong == 0 ? "" : fmt::format(" ({})", c.uv_wrong));
}

VerdictRow Total(const VerifiedTree& tree, uint32_t query) {
  VerdictRow total;
  total.query = query;
  for (const VerdictRow& row : tree.rows) {
    if (row.query != query) continue;
    total.counts.Add(row.counts);
    total.t_errors.Add(row.t_errors);
  }
  return total;
}

std::string TableOf(const VerifiedTree& tree) {
  Grid grid({"rays", "n", "exact", "tie", "neighbour", "leak", "wrong", "false miss", "false hit",
             "t error ulp", "uv error", "leak rate", "plain rate"});
  const auto add = [&](const std::string& name, const VerdictRow& row) {
    const VerdictCounts& c = row.counts;
    grid.Add({name, fmt::format("{}", c.rays), fmt::format("{}", c[Verdict::kExact]),
              fmt::format("{}", c[Verdict::kTie]), fmt::format("{}", c[Verdict::kNeighbour]),
              fmt::format("{}", c.leaks()), Both(c, Verdict::kWrong, Verdict::kWrongMarginal),
              Both(c, Verdict::kFalseMiss, Verdict::kFalseMissMarginal),
              Both(c, Verdict::kFalseHit, Verdict::kFalseHitMarginal), ErrorsOf(row.t_errors), ErrorOfUv(c),
              FormatUpperRate(c.leaks(), c.rays), FormatUpperRate(c.plain_errors(), c.rays)});
  };
  // Any-hit answers have three classes that say little per set; their sum shows whether there is a reason to
  // look into verdicts.csv.
  for (const VerdictRow& row : tree.rows)
    if (row.query == RB_CLOSEST) add(row.set, row);
  for (uint32_t query : {RB_CLOSEST, RB_ANY})
    if (const VerdictRow total = Total(tree, query); total.counts.rays > 0)
      add(query == RB_CLOSEST ? "all, closest hit" : "all, any hit", total);
  return grid.Format(1, 150);
}

std::string StructureLine(const VerifiedTree& tree) {
  if (!tree.statistics) return "structure: not shown (no visitor)";
  const TreeStatistics& s = *tree.statistics;
  std::string line =
      fmt::format("{} inner nodes, {} leaves, {} references, depth {}; structure: {}", s.inner_nodes,
                  s.leaf_nodes, s.references, s.depth, s.flaw.empty() ? "ok" : "BROKEN: " + s.flaw);
  if (s.unchecked_nodes > 0)
    line += fmt::format(" (the contents of {} nodes are not checked)", s.unchecked_nodes);
  return line;
}

std::string ClaimLine(const VerifiedTree& tree) {
  if (tree.claim == RB_CLAIM_NOTHING) return "claims nothing";
  if (tree.claim == RB_CLAIM_INEXACT) return "claims inexact: its errors are measured";
  std::string line =
      fmt::format("claims {}: {}", ClaimName(tree.claim), tree.ClaimHolds() ? "held" : "BROKEN");
  if (tree.claim == RB_CLAIM_EXACT) {
    const VerdictCounts all = tree.Counts();
    line += fmt::format(", {} of {} answers are exact to the bit", all.strict, all.rays);
  }
  return line;
}

/// As one word for a shell.
std::string Quote(const std::string& text) {
  if (text.find_first_of("\"$`\\!") == text.npos) return '"' + text + '"';
  std::string quoted = "'";
  for (char c : text) quoted += c == '\'' ? "'\\''" : std::string(1, c);
  return quoted + "'";
}

std::string Primitives(const std::vector<uint32_t>& prims) {
  constexpr size_t kShown = 8;
  std::string text;
  for (size_t i = 0; i < prims.size() && i < kShown; ++i)
    text += fmt::format("{}{}", i == 0 ? "" : ", ", prims[i]);
  if (prims.size() > kShown) text += fmt::format(" and {} more", prims.size() - kShown);
  return text;
}

}  // namespace

void ErrorHistogram::Add(double error) {
  if (buckets_.empty()) buckets_.resize((0x7F800000u >> kShift) + 1);
  ++buckets_[std::bit_cast<uint32_t>(float(error)) >> kShift];
  ++count_;
  max_ = std::max(max_, error);
}

void ErrorHistogram::Add(const ErrorHistogram& other) {
  if (buckets_.size() < other.buckets_.size()) buckets_.resize(other.buckets_.size());
  for (size_t i = 0; i < other.buckets_.size(); ++i) buckets_[i] += other.buckets_[i];
  count_ += other.count_;
  max_ = std::max(max_, other.max_);
}

double ErrorHistogram::Percentile(uint64_t percent) const {
  const uint64_t rank = (count_ * percent + 99) / 100;
  uint64_t below = 0;
  for (uint32_t i = 0; i < buckets_.size(); ++i)
    if (below += buckets_[i]; below >= rank)
      return i == 0 ? 0 : std::min(max_, double(std::bit_cast<float>((i + 1) << kShift)));
  return 0;
}

VerdictCounts VerifiedTree::Counts() const {
  VerdictCounts all;
  for (const VerdictRow& row : rows) all.Add(row.counts);
  return all;
}

bool VerifiedTree::Broken() const {
  return !ClaimHolds() || !contract_flaw.empty() || (statistics && !statistics->flaw.empty());
}

int Badness(const Judged& judged, uint32_t claim) {
  if (claim == RB_CLAIM_NOTHING) return 3;
  if (judged.verdict == Verdict::kLeak) return 0;
  return judged.IsError() ? 1 : judged.Breaks(claim) ? 2 : 3;
}

std::string FormatUpperRate(uint64_t events, uint64_t trials) {
  return trials == 0 ? "-" : fmt::format("< {:.1e}", UpperRate(events, trials));
}

std::string FormatVerified(const VerifiedTree& tree, const ReplayContext& context) {
  const std::string spec = tree.contestant.Spec();
  if (!tree.skipped.empty()) return fmt::format("{}: not verified: {}\n", spec, tree.skipped);
  std::string text = fmt::format("{} {}\n  {}\n", spec, ClaimLine(tree), StructureLine(tree));
  if (const std::string broken =
          BrokenClaim(tree.claim, tree.Counts(), tree.breaking, context.scale_exponent);
      !broken.empty())
    text += fmt::format("  {}\n", broken);
  if (!tree.contract_flaw.empty()) text += fmt::format("  contract BROKEN: {}\n", tree.contract_flaw);
  for (const std::string& note : tree.notes) text += fmt::format("  {}\n", note);
  if (!tree.rows.empty()) text += TableOf(tree);
  for (size_t i = 0; i < tree.examples.size(); ++i)
    text += fmt::format("  {}. {}     {}\n", i + 1, FormatExample(tree.examples[i]),
                        ReplayCommand(tree.contestant, tree.examples[i].ray, context));
  return text;
}

std::string ReplayCommand(const Contestant& contestant, const rb_ray& ray, const ReplayContext& context) {
  std::string line =
      fmt::format("raybench verify {} --structures {}", Quote(context.scene), Quote(contestant.Spec()));
  for (const std::string& plugin : context.plugins) line += " --plugin " + Quote(plugin);
  if (context.seed != 1) line += fmt::format(" --seed {}", context.seed);
  if (context.drop_bad) line += " --drop-bad";
  return line + fmt::format(" --replay \"{}\"", FormatRay(ray, context.scale_exponent));
}

std::string FormatExample(const JudgedAnswer& e) {
  std::string text = fmt::format("{}: {} hit, set {}, ray {}\n", VerdictName(e.judged.verdict),
                                 QueryName(e.query), e.set, e.index);
  if (e.query == RB_ANY) {
    text += fmt::format("     answer: {}\n", e.occluded ? "occluded" : "nothing hit");
  } else if (e.hit.prim == RAYBENCH_NONE) {
    text += "     answer: miss\n";
  } else {
    text += fmt::format("     answer: primitive {} at t = {} ({:a})\n", e.hit.prim, e.hit.t, double(e.hit.t));
  }
  if (e.truth.hit) {
    text += fmt::format("     truth: t = {} ({:a}), primitive{} {}, {}", e.truth.t, e.truth.t,
                        e.truth.tied.size() == 1 ? "" : "s", Primitives(e.truth.tied),
                        FeatureName(e.truth.feature));
    if (e.query == RB_CLOSEST && e.judged.verdict == Verdict::kExact)
      text += fmt::format("; to the bit: primitive {} at t = {:a}", e.truth.first, e.truth.t_rounded);
  } else {
    text += "     truth: miss";
  }
  if (e.truth.coplanar) text += "; the ray lies in the plane of a triangle that it meets";
  text += "\n";
  if (e.judged.UvWrong())
    text += fmt::format(
        "     u, v: {:a}, {:a}; of this primitive at the ray: {:a}, {:a}, give or take {:.2g}, {:.2g}\n",
        double(e.hit.u), double(e.hit.v), e.uv.u, e.uv.v, e.uv.u_bound, e.uv.v_bound);
  return text;
}

std::vector<Row> VerdictRows(const VerifiedTree& tree) {
  std::vector<Row> rows;
  for (const VerdictRow& verdict : tree.rows) {
    const VerdictCounts& c = verdict.counts;
    Row row;
    row[column::structure] = tree.contestant.structure->name;
    row[column::spec] = tree.contestant.Spec();
    row[column::params] = tree.contestant.Params();
    row[column::claim] = ClaimName(tree.claim);
    row[column::held] = !BreaksClaim(tree.claim, c);
    row[column::ray_set] = verdict.set;
    row[column::query] = QueryName(verdict.query);
    row[column::rays] = c.rays;
    SetClasses(row, c);
    row[column::strict] = c.strict;
    if (verdict.t_errors.count() > 0) {
      row[column::t_error_p50] = verdict.t_errors.Percentile(50);
      row[column::t_error_p99] = verdict.t_errors.Percentile(99);
      row[column::t_error_max] = verdict.t_errors.Max();
    }
    row[column::leak_upper] = UpperRate(c.leaks(), c.rays);
    row[column::plain_upper] = UpperRate(c.plain_errors(), c.rays);
    rows.push_back(std::move(row));
  }
  return rows;
}

Json FactsOf(const VerifiedTree& tree) {
  Json facts = {{"spec", tree.contestant.Spec()}};
  if (!tree.skipped.empty()) {
    facts["skipped"] = tree.skipped;
    return facts;
  }
  facts["claim"] = ClaimName(tree.claim);
  facts["held"] = tree.ClaimHolds();
  facts["contract_flaw"] = tree.contract_flaw;
  facts["notes"] = tree.notes;
  if (!tree.statistics) {
    facts["structure"] = nullptr;
    return facts;
  }
  const TreeStatistics& s = *tree.statistics;
  facts["structure"] = {{"inner_nodes", s.inner_nodes},         {"leaf_nodes", s.leaf_nodes},
                        {"references", s.references},           {"depth", s.depth},
                        {"unchecked_nodes", s.unchecked_nodes}, {"flaw", s.flaw}};
  return facts;
}

Json FactsOf(const JudgedAnswer& e, int scale_exponent) {
  Json facts = {{"verdict", VerdictName(e.judged.verdict)},
                {"ray_set", e.set},
                {"index", e.index},
                {"query", QueryName(e.query)},
                {"ray", FormatRay(e.ray, scale_exponent)}};
  if (e.query == RB_ANY) {
    facts["answer"] = {{"occluded", e.occluded}};
  } else if (e.hit.prim == RAYBENCH_NONE) {
    facts["answer"] = nullptr;
  } else {
    facts["answer"] = {{"prim", e.hit.prim}, {"t", fmt::format("{:a}", double(e.hit.t))}};
    if (e.judged.uv_error) facts["uv_error"] = *e.judged.uv_error;
  }
  facts["truth"] = nullptr;
  if (e.truth.hit)
    facts["truth"] = {{"prims", e.truth.tied},
                      {"t", fmt::format("{:a}", e.truth.t)},
                      {"feature", FeatureName(e.truth.feature)}};
  facts["coplanar"] = e.truth.coplanar;
  return facts;
}

}  // namespace raybench
