// What the contract asks of everybody: answers, batches, counting, threads, skip, after.
#include <atomic>
#include <cmath>
#include <cstring>
#include <thread>

#include "harness/fuzz/examiner.h"

namespace raybench::fuzz {
namespace {

/// Hits of a walk that are compared with truth.
constexpr size_t kJudgedHits = 12;

}  // namespace

Text Examiner::Contract() {
  for (const Answer* answer : {&Closest(), &Any()})
    if (!answer->flaw.empty()) return answer->flaw;
  Question alone = All(RB_CLOSEST);
  alone.batch = 1;
  if (const std::string flaw = Ask(tree_, alone).flaw; !flaw.empty()) return "asked ray by ray, " + flaw;
  for (size_t i = 0; i < case_.rays.size(); ++i) {
    if (auto flaw = FlawOf(case_.rays[i], Closest().hits[i])) return RayText(i) + ": " + *flaw;
    if (Any().occluded[i] > 1)
      return fmt::format("{}: occluded is {}, not 0 or 1", RayText(i), Any().occluded[i]);
  }
  return std::nullopt;
}

Text Examiner::FlawOf(const rb_ray& ray, const rb_hit& hit, bool after) const {
  if (hit.prim == RAYBENCH_NONE) {
    if (!(hit.t == ray.tfar)) return fmt::format("a miss has t {}, not tfar", hit.t);
  } else if (hit.prim >= case_.primitives()) {
    return fmt::format("primitive {} of {}", hit.prim, case_.primitives());
  } else if (!(after ? hit.t >= ray.tnear : hit.t > ray.tnear) || !(hit.t <= ray.tfar) ||
             !std::isfinite(hit.t)) {
    return fmt::format("{} lies outside of the interval", Describe(hit));
  }
  return std::nullopt;
}

Text Examiner::AnyIsClosest() {
  if (result_.claim == RB_CLAIM_NOTHING || MayDependOnNeighbours()) return std::nullopt;
  for (size_t i = 0; i < case_.rays.size(); ++i)
    if ((Closest().hits[i].prim != RAYBENCH_NONE) != (Any().occluded[i] != 0))
      return fmt::format("{}: closest-hit says {}, any-hit {}", RayText(i), Describe(Closest().hits[i]),
                         Any().occluded[i]);
  return std::nullopt;
}

Text Examiner::Batches() {
  if (MayDependOnNeighbours()) return std::nullopt;
  for (uint32_t kind : {RB_CLOSEST, RB_ANY}) {
    const Answer& whole = kind == RB_CLOSEST ? Closest() : Any();
    for (size_t batch : {size_t{0}, size_t{1}, size_t{3}, size_t{5}}) {
      Question q = All(kind);
      q.batch = batch;
      const Answer parts = Ask(tree_, q);
      if (!parts.flaw.empty()) return parts.flaw;
      if (auto text = Difference(q, whole, parts,
                                 batch == 0 ? "asked again" : fmt::format("in batches of {}", batch)))
        return text;
    }
  }
  return std::nullopt;
}

Text Examiner::Counting() {
  for (uint32_t kind : {RB_CLOSEST, RB_ANY}) {
    Question q = All(kind);
    q.counted = true;
    const Answer counted = Ask(tree_, q);
    if (!counted.flaw.empty()) return "counted: " + counted.flaw;
    if (auto text = Difference(q, kind == RB_CLOSEST ? Closest() : Any(), counted, "counted")) return text;
    for (size_t i = 0; i < q.rays.size(); ++i) {
      const rb_counts& c = counted.counts[i];
      const bool hit = kind == RB_CLOSEST ? counted.hits[i].prim != RAYBENCH_NONE : counted.occluded[i] != 0;
      if (c.leaves > c.steps || c.empty_leaves > c.leaves || (hit && c.prims == 0))
        return fmt::format("{}: counts {} steps, {} leaves, {} empty leaves and {} primitive tests{}",
                           RayText(i), c.steps, c.leaves, c.empty_leaves, c.prims, hit ? " for a hit" : "");
    }
    if (TracesBatchesTogether()) continue;  // rays may share their steps there
    q.batch = 1;
    if (auto text = CountsDiffer(counted, Ask(tree_, q), "asked alone")) return text;
  }
  return std::nullopt;
}

Text Examiner::CountsDiffer(const Answer& a, const Answer& b, const char* what) const {
  for (size_t i = 0; i < a.counts.size(); ++i) {
    const rb_counts &x = a.counts[i], &y = b.counts[i];
    if (x.steps != y.steps || x.leaves != y.leaves || x.empty_leaves != y.empty_leaves ||
        x.bounds != y.bounds || x.prims != y.prims)
      return fmt::format("{}: counts {} steps, {} bounds and {} primitive tests, but {} {}, {} and {}",
                         RayText(i), x.steps, x.bounds, x.prims, what, y.steps, y.bounds, y.prims);
  }
  return std::nullopt;
}

Text Examiner::Threads() {
  constexpr size_t kThreads = 4, kRays = 512;
  Question q = All(RB_CLOSEST);
  q.counted = Can(RB_CAN_COUNT);
  while (!q.rays.empty() && q.rays.size() < kRays) {
    const size_t n = std::min(case_.rays.size(), kRays - q.rays.size());
    q.rays.insert(q.rays.end(), case_.rays.begin(), case_.rays.begin() + ptrdiff_t(n));
  }
  const Answer alone = Ask(tree_, q);
  std::vector<Answer> answers(kThreads);
  std::atomic<size_t> ready = 0;
  {
    std::vector<std::jthread> threads;
    for (size_t i = 0; i < kThreads; ++i)
      threads.emplace_back([&, i] {
        for (++ready; ready < kThreads;) std::this_thread::yield();
        answers[i] = Ask(tree_, q);
      });
  }
  for (const Answer& answer : answers) {
    if (!answer.flaw.empty()) return "while other threads ask: " + answer.flaw;
    if (auto text = Difference(q, alone, answer, "while other threads ask")) return text;
    if (!q.counted) continue;
    for (size_t i = 0; i < q.rays.size(); ++i)
      if (std::memcmp(&alone.counts[i], &answer.counts[i], sizeof(rb_counts)) != 0)
        return fmt::format(
            "{}: counts {} steps and {} primitive tests, but {} and {} while other threads ask",
            RayText(i % case_.rays.size()), alone.counts[i].steps, alone.counts[i].prims,
            answer.counts[i].steps, answer.counts[i].prims);
  }
  return std::nullopt;
}

Text Examiner::Skip() {
  for (size_t i : Hitting()) {
    const uint32_t prim = Closest().hits[i].prim;
    const PrimKind kind = scene_.Locate(prim).kind;
    if (kind != PrimKind::kTriangle && kind != PrimKind::kPolygon) continue;
    for (uint32_t query : {RB_CLOSEST, RB_ANY}) {
      Question q = One(case_.rays[i], query);
      q.skip = {prim};
      const Answer answer = Ask(tree_, q);
      if (query == RB_CLOSEST && answer.hits[0].prim == prim)
        return fmt::format("{}: primitive {} is to be skipped and is hit", RayText(i), prim);
      if (query == RB_CLOSEST)
        if (auto flaw = FlawOf(case_.rays[i], answer.hits[0]))
          return fmt::format("{}, skipping primitive {}: {}", RayText(i), prim, *flaw);
      if (!IsConservative() || !Can(RB_CAN_AFTER)) continue;
      if (HasExactIntervals() && case_.rays[i].tnear > 0) continue;  // see After()
      const std::vector<rb_hit>& walk = WalkOf(i);
      const auto next =
          std::find_if(walk.begin(), walk.end(), [&](const rb_hit& h) { return h.prim != prim; });
      if (query == RB_ANY && (answer.occluded[0] != 0) != (next != walk.end()))
        return fmt::format("{}, skipping primitive {}: occluded {}, but `after` walks to {} others",
                           RayText(i), prim, answer.occluded[0], walk.end() - next);
      if (query == RB_CLOSEST &&
          (next == walk.end() ? answer.hits[0].prim != RAYBENCH_NONE : !SameHit(*next, answer.hits[0])))
        return fmt::format("{}, skipping primitive {}: {}, but `after` walks to {}", RayText(i), prim,
                           Describe(answer.hits[0]), next == walk.end() ? "nothing else" : Describe(*next));
    }
  }
  return std::nullopt;
}

Text Examiner::After() {
  if (result_.claim == RB_CLAIM_NOTHING) return std::nullopt;
  for (size_t i : Hitting()) {
    const std::vector<rb_hit>& walk = WalkOf(i);
    if (walk.size() == MostHits()) return RayText(i) + ": `after` walks on and on";
    for (size_t k = 0; k < walk.size(); ++k) {
      rb_ray rest = case_.rays[i];
      if (k > 0) rest.tnear = walk[k - 1].t;
      if (auto flaw = FlawOf(rest, walk[k], k > 0))
        return fmt::format("{}, hit {}: {}", RayText(i), k, *flaw);
      if (k > 0 && walk[k].t == walk[k - 1].t && walk[k].prim <= walk[k - 1].prim)
        return fmt::format("{}: after {} comes {}", RayText(i), Describe(walk[k - 1]), Describe(walk[k]));
    }
    if (!IsConservative()) continue;
    if (walk.empty() || !SameHit(walk[0], Closest().hits[i]))
      return fmt::format("{}: `after` walks first to {}, but the closest hit is {}", RayText(i),
                         walk.empty() ? "nothing" : Describe(walk[0]), Describe(Closest().hits[i]));
    // An exact hit that rounds to tnear is answered behind it, and a walk goes on from there.
    if (HasExactIntervals() && case_.rays[i].tnear > 0) continue;
    if (auto text = LostCopy(walk)) return fmt::format("{}: {}", RayText(i), *text);
    if (auto text = JudgeWalk(i, walk)) return text;
  }
  return std::nullopt;
}

Text Examiner::LostCopy(const std::vector<rb_hit>& walk) const {
  for (const rb_hit& hit : walk) {
    if (hit.prim >= case_.triangles.size()) continue;
    for (uint32_t copy = 0; copy < case_.triangles.size(); ++copy)
      if (IsCopy(copy, hit.prim) && std::none_of(walk.begin(), walk.end(), [&](const rb_hit& h) {
            return h.prim == copy && h.t == hit.t;
          }))
        return fmt::format("`after` walks to {}, but not to its copy, primitive {}", Describe(hit), copy);
  }
  return std::nullopt;
}

bool Examiner::IsCopy(uint32_t a, uint32_t b) const {
  for (size_t k = 0; k < 3; ++k)
    if (!(case_.positions[case_.triangles[a][k]] == case_.positions[case_.triangles[b][k]])) return false;
  return true;
}

Text Examiner::JudgeWalk(size_t i, const std::vector<rb_hit>& walk) {
  std::vector<rb_ray> rays;
  std::vector<rb_hit> hits;
  for (size_t k = 0; k < std::min(walk.size(), kJudgedHits); ++k) {
    rb_ray ray = case_.rays[i];
    ray.tnear = walk[k].t;
    const bool last = k + 1 == walk.size();
    if (!last && walk[k + 1].t == walk[k].t) continue;  // at the open end of the interval
    rays.push_back(ray);
    hits.push_back(last ? rb_hit{ray.tfar, 0, 0, RAYBENCH_NONE} : walk[k + 1]);
  }
  const std::vector<Truth> truth = TheOracle().Ask(rays, 1);
  for (size_t k = 0; k < rays.size(); ++k)
    if (auto text = Misjudged(rays[k], truth[k], hits[k], /*ties=*/false))
      return fmt::format("ray {}, walking by `after`: {}", i, *text);
  return std::nullopt;
}

}  // namespace raybench::fuzz
