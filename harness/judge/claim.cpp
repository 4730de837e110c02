#include "harness/judge/claim.h"

#include <fmt/format.h>

#include <cmath>

namespace raybench {
namespace {

std::string CountsInWords(uint32_t claim, const VerdictCounts& counts) {
  std::string text = fmt::format("claims {}, but of {} rays", ClaimName(claim), counts.rays);
  const char* separator = " ";
  const auto add = [&](uint64_t count, std::string_view what) {
    if (count == 0) return;
    text += fmt::format("{}{} {}", separator, count, what);
    separator = ", ";
  };
  const bool exact = claim == RB_CLAIM_EXACT;
  if (exact && counts.strict < counts.rays) {
    text += fmt::format(" {} are not answered exactly to the bit", counts.rays - counts.strict);
    separator = ": ";
    add(counts[Verdict::kExact] - counts.strict, "exact within the error");
  }
  for (size_t v = size_t(Verdict::kExact) + 1; v < size_t(Verdict::kCount); ++v) {
    Judged judged;
    judged.verdict = Verdict(v);
    judged.strict = false;
    if (judged.Breaks(claim)) add(counts.by_class[v], VerdictName(Verdict(v)));
  }
  add(counts.uv_wrong, "with u or v beyond its bound");
  return text;
}

std::string Exactly(const float (&v)[3], int scale_exponent) {
  const auto in_file = [&](float x) { return std::ldexp(double(x), -scale_exponent); };
  return fmt::format("({:a}, {:a}, {:a})", in_file(v[0]), in_file(v[1]), in_file(v[2]));
}

std::string AnswerInWords(const JudgedAnswer& a) {
  if (a.query == RB_ANY) return a.occluded ? "occluded" : "free";
  if (a.hit.prim == RAYBENCH_NONE) return "miss";
  std::string text = fmt::format("primitive {} at t {:a}", a.hit.prim, double(a.hit.t));
  if (a.judged.UvWrong()) text += fmt::format(", u {:a} v {:a}", double(a.hit.u), double(a.hit.v));
  return text;
}

std::string TruthInWords(const JudgedAnswer& a, bool exact) {
  std::string text = "miss";
  if (a.truth.hit)
    text = fmt::format("primitive {} at t {:a}", exact ? a.truth.first : a.truth.tied.front(),
                       exact ? double(a.truth.t_rounded) : a.truth.t);
  if (a.judged.UvWrong())
    text += fmt::format(", of the answered one u {:a} +- {:.2g} v {:a} +- {:.2g}", a.uv.u, a.uv.u_bound,
                        a.uv.v, a.uv.v_bound);
  return text;
}

}  // namespace

const char* ClaimName(uint32_t claim) {
  static constexpr const char* kNames[] = {"nothing", "inexact", "watertight", "exact"};
  return claim < std::size(kNames) ? kNames[claim] : "unknown";
}

std::string BrokenClaim(uint32_t claim, const VerdictCounts& counts,
                        const std::optional<JudgedAnswer>& breaking, int scale_exponent) {
  if (!BreaksClaim(claim, counts)) return {};
  std::string text = CountsInWords(claim, counts);
  if (!breaking) return text;
  const JudgedAnswer& a = *breaking;
  const std::string set = a.set.empty() ? "" : " of set " + a.set;
  return text + fmt::format("; ray {}{}: org {} dir {} tnear {:a} tfar {:a} is answered {} ({}); true is {}",
                            a.index, set, Exactly(a.ray.org, scale_exponent),
                            Exactly(a.ray.dir, scale_exponent), double(a.ray.tnear), double(a.ray.tfar),
                            AnswerInWords(a), VerdictName(a.judged.verdict),
                            TruthInWords(a, claim == RB_CLAIM_EXACT));
}

}  // namespace raybench
