// What a claim of watertight or exact means: answers against geometry and integers, and intervals that end at them.
#include <cmath>

#include "harness/fuzz/examiner.h"
#include "harness/truth/uv.h"

namespace raybench::fuzz {
Text Examiner::Misjudged(const rb_ray& ray, const Truth& truth, const rb_hit& hit, bool ties) {
  const Judged judged = JudgeHit(TheOracle(), ray, truth, hit, /*has_uv=*/false);
  const bool loose = ties && IsExact() && !judged.strict;
  if (!judged.IsError() && !loose) return std::nullopt;
  return fmt::format("({}): {}, {}; true is {}", Describe(ray), Describe(hit),
                     judged.IsError() ? VerdictName(judged.verdict) : "not exact", DescribeTruth(truth));
}

Text Examiner::MisjudgedAt(const rb_ray& ray, const rb_hit& hit) {
  return Misjudged(ray, TheOracle().Ask({&ray, 1}, 1)[0], hit);
}

std::string Examiner::DescribeTruth(const Truth& truth) {
  if (!truth.hit) return truth.coplanar ? "a miss, or a triangle in whose plane the ray lies" : "a miss";
  return fmt::format("primitive {} at t {}", fmt::join(truth.tied, " or "), truth.t);
}

Text Examiner::ClosestIsTrue() {
  for (size_t i = 0; i < case_.rays.size(); ++i)
    if (auto text = Misjudged(case_.rays[i], Truths()[i], Closest().hits[i]))
      return fmt::format("ray {} {}", i, *text);
  return std::nullopt;
}

Text Examiner::AnyIsTrue() {
  for (size_t i = 0; i < case_.rays.size(); ++i) {
    const Judged judged = JudgeOccluded(TheOracle(), case_.rays[i], Truths()[i], Any().occluded[i] != 0);
    if (judged.Breaks(result_.claim))
      return fmt::format("{}: occluded {}, a {}; true is {}", RayText(i), Any().occluded[i],
                         VerdictName(judged.verdict), DescribeTruth(Truths()[i]));
  }
  return std::nullopt;
}

Text Examiner::UvIsTrue() {
  for (size_t i = 0; i < case_.rays.size(); ++i) {
    const rb_hit& hit = Closest().hits[i];
    const UvTruth uv = TrueUv(scene_, case_.rays[i], hit);
    if (uv.known && !(uv.Error(hit) <= 1))
      return fmt::format("{}: {}, but its point has u {} (within {}), v {} (within {})", RayText(i),
                         Describe(hit), uv.u, uv.u_bound, uv.v, uv.v_bound);
  }
  return std::nullopt;
}

Text Examiner::LowestCopy() {
  for (size_t i : Hitting()) {
    const rb_hit& hit = Closest().hits[i];
    for (uint32_t copy = 0; copy < hit.prim && hit.prim < case_.triangles.size(); ++copy)
      if (IsCopy(copy, hit.prim))
        return fmt::format("{}: {}, but primitive {} is the same triangle", RayText(i), Describe(hit), copy);
  }
  return std::nullopt;
}

Text Examiner::Lattice() {
  if (!case_.exact) return std::nullopt;
  for (size_t i = 0; i < case_.rays.size(); ++i) {
    const rb_ray& ray = case_.rays[i];
    auto hits = LatticeHits(case_, ray);
    if (!hits) continue;
    // An end of the interval at a hit is for others to check.
    const auto at_end = [&](const LatticeHit& h) {
      return std::fabs(h.t() - ray.tnear) < 1e-3 * h.t() || std::fabs(h.t() - ray.tfar) < 1e-3 * h.t();
    };
    if (std::any_of(hits->begin(), hits->end(), at_end)) continue;
    std::erase_if(*hits, [&](const LatticeHit& h) { return h.t() < ray.tnear || h.t() > ray.tfar; });
    if (auto text = LatticeAnswer(*hits, Closest().hits[i])) return RayText(i) + ": " + *text;
    if ((Any().occluded[i] != 0) == hits->empty())
      return fmt::format("{}: occluded {}, but there are {} hits", RayText(i), Any().occluded[i],
                         hits->size());
    if (!Can(RB_CAN_AFTER)) continue;
    std::vector<uint32_t> walked, true_ones;
    for (const rb_hit& h : WalkOf(i)) walked.push_back(h.prim);
    for (const LatticeHit& h : *hits) true_ones.push_back(h.prim);
    std::sort(walked.begin(), walked.end()), std::sort(true_ones.begin(), true_ones.end());
    if (walked != true_ones)
      return fmt::format("{}: `after` walks to the primitives {}; hit are {}", RayText(i),
                         fmt::join(walked, " "), fmt::join(true_ones, " "));
  }
  return std::nullopt;
}

Text Examiner::LatticeAnswer(const std::vector<LatticeHit>& hits, const rb_hit& answer) const {
  if (hits.empty()) {
    if (answer.prim == RAYBENCH_NONE) return std::nullopt;
    return Describe(answer) + ", but there is no hit";
  }
  for (const LatticeHit& h : hits)
    if (h.IsAt(hits[0]) && h.prim == answer.prim && std::fabs(answer.t - h.t()) <= h.FloatError())
      return std::nullopt;
  return fmt::format("{}, but primitive {} is hit at t {}/{}", Describe(answer), hits[0].prim, hits[0].num,
                     hits[0].den);
}

Text Examiner::EndsAtHit() {
  for (size_t i : Hitting()) {
    const rb_hit hit = Closest().hits[i];
    rb_ray ray = case_.rays[i];
    ray.tfar = hit.t;
    const rb_hit kept = Ask(tree_, One(ray)).hits[0];
    if (HasExactIntervals()) {
      if (auto text = MisjudgedAt(ray, kept))
        return fmt::format("ray {}, with tfar at its hit: {}", i, *text);
      ray.tfar = std::nextafter(hit.t, -kInfinity);
      if (auto text = MisjudgedAt(ray, Ask(tree_, One(ray)).hits[0]))
        return fmt::format("ray {}, with tfar before its hit: {}", i, *text);
      continue;
    }
    if (!SameHit(kept, hit))
      return fmt::format("{}: {}, but with tfar at that t {}", RayText(i), Describe(hit), Describe(kept));
    if (Ask(tree_, One(ray, RB_ANY)).occluded[0] != 1)
      return fmt::format("{}: {}, but with tfar at that t not occluded", RayText(i), Describe(hit));
    ray.tfar = std::nextafter(hit.t, -kInfinity);
    const rb_hit none = Ask(tree_, One(ray)).hits[0];
    if (none.prim != RAYBENCH_NONE || none.t != ray.tfar)
      return fmt::format("{}: {}, but with tfar just before that t {}", RayText(i), Describe(hit),
                         Describe(none));
    if (Ask(tree_, One(ray, RB_ANY)).occluded[0] != 0)
      return fmt::format("{}: {}, but with tfar just before that t still occluded", RayText(i),
                         Describe(hit));
  }
  return std::nullopt;
}

Text Examiner::BeginsAtHit() {
  for (size_t i : Hitting()) {
    const rb_hit hit = Closest().hits[i];
    if (!(hit.t > 0)) continue;
    rb_ray ray = case_.rays[i];
    ray.tnear = hit.t;
    const rb_hit next = Ask(tree_, One(ray)).hits[0];
    const bool any = Ask(tree_, One(ray, RB_ANY)).occluded[0] != 0;
    if (auto flaw = FlawOf(ray, next)) return fmt::format("{}, with tnear at the hit: {}", RayText(i), *flaw);
    if ((next.prim != RAYBENCH_NONE) != any)
      return fmt::format("{}, with tnear at the hit: {}, but any-hit says {}", RayText(i), Describe(next),
                         any);
    if (auto text = MisjudgedAt(ray, next)) return fmt::format("ray {}, with tnear at its hit: {}", i, *text);
    if (!Can(RB_CAN_AFTER) || HasExactIntervals()) continue;
    const std::vector<rb_hit>& walk = WalkOf(i);
    const auto walked = std::find_if(walk.begin(), walk.end(), [&](const rb_hit& h) { return h.t > hit.t; });
    // t is clamped into the primitive's box after the interval was looked at, which moves it by a few ulp.
    if (walked != walk.end() && walked->t <= hit.t * (1 + 0x1p-20f)) continue;
    if (walked == walk.end() ? next.prim != RAYBENCH_NONE : !SameHit(*walked, next))
      return fmt::format("{}, with tnear at the hit: {}, but `after` walks to {}", RayText(i), Describe(next),
                         walked == walk.end() ? "nothing" : Describe(*walked));
  }
  return std::nullopt;
}

}  // namespace raybench::fuzz
