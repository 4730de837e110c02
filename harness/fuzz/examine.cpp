#include "harness/fuzz/examine.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <map>
#include <memory>
#include <new>
#include <optional>
#include <thread>

#include "accel/base/hash.h"
#include "accel/contract/structure.h"
#include "accel/host/names.h"
#include "accel/host/parameters.h"
#include "harness/fuzz/asking.h"
#include "harness/fuzz/lattice.h"
#include "harness/judge/tree_statistics.h"
#include "harness/plan/build_options.h"
#include "harness/plan/plan.h"
#include "harness/truth/oracle.h"
#include "harness/truth/uv.h"

namespace raybench::fuzz {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
/// Rays of a case that are asked about once more with another interval, skip or after.
constexpr size_t kFollowed = 12;
/// What may be taken by a tree whose parameters were drawn at random.
constexpr uint64_t kMemoryLimit = 32u << 20;

/// Everything that a tree shows and answers, in a number.
uint64_t DigestOf(const Tree& tree) {
  Hash64 hash;
  if (tree.structure().visit == nullptr) return 0;
  tree.structure().visit(
      tree.get(),
      [](void* context, const rb_node* node) {
        Hash64& h = *static_cast<Hash64*>(context);
        for (uint32_t x : {node->depth, node->is_leaf, node->space_partition, node->shape, node->prim_count})
          h.AddValue(x);
        h.Add(node->bounds, node->bounds_count * sizeof(float));
        if (node->is_leaf) h.Add(node->prims, node->prim_count * sizeof(uint32_t));
        return 0;
      },
      &hash);
  return hash.value();
}

/// The case with its geometry and rays changed.
template <class Point, class Size>
Case Mapped(Case c, const Point& point, const Size& size) {
  for (Vec3f& p : c.positions) p = point(p);
  for (Sphere& s : c.spheres) s.center = point(s.center), s.radius = size(s.radius);
  for (Cone& k : c.cones) {
    k.base = point(k.base), k.base_radius = size(k.base_radius);
    k.apex = point(k.apex), k.apex_radius = size(k.apex_radius);
  }
  for (rb_ray& r : c.rays) {
    const Vec3f org = point(LoadVec3(r.org)), dir = point(LoadVec3(r.dir));
    for (int k = 0; k < 3; ++k) r.org[k] = org[k], r.dir[k] = dir[k];
  }
  return c;
}

class Examiner {
 public:
  Examiner(const Registry& registry, const Case& c)
      : registry_(registry),
        case_(c),
        contestant_(ParseContestant(registry, c.structure)),
        scene_(SceneOf(c)),
        geometry_(scene_.Geometry()) {}

  Examination Run(const std::function<void(const char*)>& on_check) {
    if (on_check) on_check("builds");
    result_.left_out = WhyNotTaken(*contestant_.structure, scene_);
    if (!result_.left_out.empty()) return std::move(result_);
    const bool by_default = case_.structure == contestant_.structure->name;
    try {
      tree_ = Build(contestant_, geometry_, {.memory_limit = by_default ? 0 : kMemoryLimit});
    } catch (const BuildError& error) {
      // Parameters may ask for more than there is, and are told so.
      if (!by_default) return result_.left_out = error.what(), std::move(result_);
      Found("builds", error.what());
      return std::move(result_);
    }
    result_.claim = tree_.Claims();
    result_.looked_at.push_back("builds");
    for (const auto& [info, check] : kTable) {
      if (!case_.check.empty() && case_.check != info.name) continue;
      if (!IsAskedOf(info.demand)) continue;
      if (on_check) on_check(info.name);
      result_.looked_at.push_back(info.name);
      if (auto text = (this->*check)()) Found(info.name, std::move(*text));
    }
    return std::move(result_);
  }

  static std::span<const CheckInfo> Infos() {
    static const auto infos = [] {
      std::vector<CheckInfo> all{
          {"builds", Demand::kAlways, "builds over valid input, at its default parameters"}};
      for (const Row& row : kTable) all.push_back(row.info);
      return all;
    }();
    return infos;
  }

 private:
  using Text = std::optional<std::string>;
  struct Row {
    CheckInfo info;
    Text (Examiner::*check)();
  };
  static const Row kTable[24];

  struct How {
    uint32_t threads = 1;
    uint64_t needs = RB_NEED_UV | RB_NEED_ANY | RB_NEED_AFTER | RB_NEED_SKIP;
    uint64_t memory_limit = 0;
  };

  void Found(const char* check, std::string text) { result_.findings.push_back({check, std::move(text)}); }

  bool Can(uint64_t capability) const { return (contestant_.structure->capabilities & capability) != 0; }
  bool IsConservative() const {
    return result_.claim == RB_CLAIM_WATERTIGHT || result_.claim == RB_CLAIM_EXACT;
  }
  bool IsExact() const { return result_.claim == RB_CLAIM_EXACT; }
  /// Where arithmetic is exact the interval holds for the true t of a triangle, and its answer is rounded: what
  /// an interval that ends at an answer holds can then only be said by truth.
  bool HasExactIntervals() const { return IsExact() || ParameterOf("numerics") == "exact"; }
  /// Empty if there is no such parameter.
  std::string ParameterOf(std::string_view name) const {
    const rb_structure& s = *contestant_.structure;
    for (uint32_t i = 0; i < s.param_count; ++i)
      if (s.params[i].name == name) return FormatParameter(s.params[i], contestant_.config.data());
    return {};
  }
  bool IsAskedOf(Demand demand) const {
    if (demand == Demand::kAlways) return true;
    if (demand == Demand::kConservative) return IsConservative();
    return IsConservative() && BruteLike() != nullptr;
  }

  Tree Build(const Contestant& contestant, const rb_geometry& geometry, How how) const {
    rb_build_options options = BuildOptions(how.threads, case_.seed, how.needs);
    if (!Can(RB_CAN_AFTER)) options.needs &= ~uint64_t{RB_NEED_AFTER};
    if (!Can(RB_CAN_SKIP)) options.needs &= ~uint64_t{RB_NEED_SKIP};
    options.memory_limit = how.memory_limit;
    return Tree(contestant, geometry, options);
  }
  Tree Build(How how) const { return Build(contestant_, geometry_, how); }

  // ---- what several checks need, asked once ----

  Question All(uint32_t kind) const {
    Question q;
    q.kind = kind, q.rays = case_.rays;
    return q;
  }
  const Answer& Closest() {
    if (!closest_) closest_ = Ask(tree_, All(RB_CLOSEST));
    return *closest_;
  }
  const Answer& Any() {
    if (!any_) any_ = Ask(tree_, All(RB_ANY));
    return *any_;
  }
  const Oracle& TheOracle() {
    if (!oracle_) oracle_ = MakeBoxOracle(scene_);
    return *oracle_;
  }
  const std::vector<Truth>& Truths() {
    if (!truth_) truth_ = TheOracle().Ask(case_.rays, 1);
    return *truth_;
  }
  size_t MostHits() const { return 2 * case_.primitives() + 4; }
  const std::vector<rb_hit>& WalkOf(size_t ray) {
    const auto it = walks_.find(ray);
    if (it != walks_.end()) return it->second;
    return walks_[ray] = Walk(tree_, case_.rays[ray], MostHits());
  }
  /// Rays that hit something, a few of them.
  std::vector<size_t> Hitting() {
    std::vector<size_t> rays;
    for (size_t i = 0; i < case_.rays.size() && rays.size() < kFollowed; ++i)
      if (Closest().hits[i].prim < case_.primitives()) rays.push_back(i);
    return rays;
  }
  std::string RayText(size_t i) const { return fmt::format("ray {} ({})", i, Describe(case_.rays[i])); }
  static Question One(const rb_ray& ray, uint32_t kind = RB_CLOSEST) {
    Question q;
    q.kind = kind, q.rays = {ray};
    return q;
  }

  // ---- the contract ----

  Text Contract() {
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

  Text FlawOf(const rb_ray& ray, const rb_hit& hit, bool after = false) const {
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

  Text AnyIsClosest() {
    if (result_.claim == RB_CLAIM_NOTHING) return std::nullopt;
    for (size_t i = 0; i < case_.rays.size(); ++i)
      if ((Closest().hits[i].prim != RAYBENCH_NONE) != (Any().occluded[i] != 0))
        return fmt::format("{}: closest-hit says {}, any-hit {}", RayText(i), Describe(Closest().hits[i]),
                           Any().occluded[i]);
    return std::nullopt;
  }

  Text Batches() {
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

  Text Counting() {
    if (!Can(RB_CAN_COUNT)) return std::nullopt;
    for (uint32_t kind : {RB_CLOSEST, RB_ANY}) {
      Question q = All(kind);
      q.counted = true;
      const Answer counted = Ask(tree_, q);
      if (!counted.flaw.empty()) return "counted: " + counted.flaw;
      if (auto text = Difference(q, kind == RB_CLOSEST ? Closest() : Any(), counted, "counted")) return text;
      for (size_t i = 0; i < q.rays.size(); ++i) {
        const rb_counts& c = counted.counts[i];
        const bool hit =
            kind == RB_CLOSEST ? counted.hits[i].prim != RAYBENCH_NONE : counted.occluded[i] != 0;
        if (c.leaves > c.steps || c.empty_leaves > c.leaves || (hit && c.prims == 0))
          return fmt::format("{}: counts {} steps, {} leaves, {} empty leaves and {} primitive tests{}",
                             RayText(i), c.steps, c.leaves, c.empty_leaves, c.prims, hit ? " for a hit" : "");
      }
      if (Can(RB_NATIVE_BATCH)) continue;  // rays may share their steps there
      q.batch = 1;
      if (auto text = CountsDiffer(counted, Ask(tree_, q), "asked alone")) return text;
    }
    return std::nullopt;
  }

  Text CountsDiffer(const Answer& a, const Answer& b, const char* what) const {
    for (size_t i = 0; i < a.counts.size(); ++i) {
      const rb_counts &x = a.counts[i], &y = b.counts[i];
      if (x.steps != y.steps || x.leaves != y.leaves || x.empty_leaves != y.empty_leaves ||
          x.bounds != y.bounds || x.prims != y.prims)
        return fmt::format("{}: counts {} steps, {} bounds and {} primitive tests, but {} {}, {} and {}",
                           RayText(i), x.steps, x.bounds, x.prims, what, y.steps, y.bounds, y.prims);
    }
    return std::nullopt;
  }

  /// Threads that ask the same at the same time get what one gets.
  Text Threads() {
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

  Text Skip() {
    if (!Can(RB_CAN_SKIP)) return std::nullopt;
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

  Text After() {
    if (!Can(RB_CAN_AFTER) || result_.claim == RB_CLAIM_NOTHING) return std::nullopt;
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

  /// Triangles with the same corners in the same order are computed alike, so a walk meets all or none.
  Text LostCopy(const std::vector<rb_hit>& walk) const {
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
  bool IsCopy(uint32_t a, uint32_t b) const {
    for (size_t k = 0; k < 3; ++k)
      if (!(case_.positions[case_.triangles[a][k]] == case_.positions[case_.triangles[b][k]])) return false;
    return true;
  }

  /// What comes behind each hit of a walk, against the truth.
  Text JudgeWalk(size_t i, const std::vector<rb_hit>& walk) {
    std::vector<rb_ray> rays;
    std::vector<rb_hit> hits;
    for (size_t k = 0; k < std::min(walk.size(), kFollowed); ++k) {
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

  // ---- the claim ----

  /// `ties`: an exact claim is held to the primitive, too.
  Text Misjudged(const rb_ray& ray, const Truth& truth, const rb_hit& hit, bool ties = true) {
    const Judged judged = JudgeHit(TheOracle(), ray, truth, hit, /*has_uv=*/false);
    const bool loose = ties && IsExact() && !judged.strict;
    if (!judged.IsError() && !loose) return std::nullopt;
    return fmt::format("({}): {}, {}; true is {}", Describe(ray), Describe(hit),
                       judged.IsError() ? VerdictName(judged.verdict) : "not exact", DescribeTruth(truth));
  }
  Text MisjudgedAt(const rb_ray& ray, const rb_hit& hit) {
    return Misjudged(ray, TheOracle().Ask({&ray, 1}, 1)[0], hit);
  }
  static std::string DescribeTruth(const Truth& truth) {
    if (!truth.hit) return truth.coplanar ? "a miss, or a triangle in whose plane the ray lies" : "a miss";
    return fmt::format("primitive {} at t {}", fmt::join(truth.tied, " or "), truth.t);
  }

  Text ClosestIsTrue() {
    for (size_t i = 0; i < case_.rays.size(); ++i)
      if (auto text = Misjudged(case_.rays[i], Truths()[i], Closest().hits[i]))
        return fmt::format("ray {} {}", i, *text);
    return std::nullopt;
  }

  Text AnyIsTrue() {
    for (size_t i = 0; i < case_.rays.size(); ++i) {
      const Judged judged = JudgeOccluded(TheOracle(), case_.rays[i], Truths()[i], Any().occluded[i] != 0);
      if (judged.Breaks(result_.claim))
        return fmt::format("{}: occluded {}, a {}; true is {}", RayText(i), Any().occluded[i],
                           VerdictName(judged.verdict), DescribeTruth(Truths()[i]));
    }
    return std::nullopt;
  }

  Text UvIsTrue() {
    for (size_t i = 0; i < case_.rays.size(); ++i) {
      const rb_hit& hit = Closest().hits[i];
      const UvTruth uv = TrueUv(scene_, case_.rays[i], hit);
      if (uv.known && !(uv.Error(hit) <= 1))
        return fmt::format("{}: {}, but its point has u {} (within {}), v {} (within {})", RayText(i),
                           Describe(hit), uv.u, uv.u_bound, uv.v, uv.v_bound);
    }
    return std::nullopt;
  }

  /// Of several copies the lowest is answered.
  Text LowestCopy() {
    for (size_t i : Hitting()) {
      const rb_hit& hit = Closest().hits[i];
      for (uint32_t copy = 0; copy < hit.prim && hit.prim < case_.triangles.size(); ++copy)
        if (IsCopy(copy, hit.prim))
          return fmt::format("{}: {}, but primitive {} is the same triangle", RayText(i), Describe(hit),
                             copy);
    }
    return std::nullopt;
  }

  /// Where integers say what is true: the closest hit, whether there is one, and all of them.
  Text Lattice() {
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
  Text LatticeAnswer(const std::vector<LatticeHit>& hits, const rb_hit& answer) const {
    if (hits.empty()) {
      if (answer.prim == RAYBENCH_NONE) return std::nullopt;
      return Describe(answer) + ", but there is no hit";
    }
    for (const LatticeHit& h : hits)
      if (h.IsAt(hits[0]) && h.prim == answer.prim && std::fabs(answer.t - h.t()) <= 1e-5 * h.t())
        return std::nullopt;
    return fmt::format("{}, but primitive {} is hit at t {}/{}", Describe(answer), hits[0].prim, hits[0].num,
                       hits[0].den);
  }

  /// An interval that ends at the hit keeps it; one that ends just before has nothing.
  Text EndsAtHit() {
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

  /// An interval that begins at the hit has the next one.
  Text BeginsAtHit() {
    for (size_t i : Hitting()) {
      const rb_hit hit = Closest().hits[i];
      if (!(hit.t > 0)) continue;
      rb_ray ray = case_.rays[i];
      ray.tnear = hit.t;
      const rb_hit next = Ask(tree_, One(ray)).hits[0];
      const bool any = Ask(tree_, One(ray, RB_ANY)).occluded[0] != 0;
      if (auto flaw = FlawOf(ray, next))
        return fmt::format("{}, with tnear at the hit: {}", RayText(i), *flaw);
      if ((next.prim != RAYBENCH_NONE) != any)
        return fmt::format("{}, with tnear at the hit: {}, but any-hit says {}", RayText(i), Describe(next),
                           any);
      if (auto text = MisjudgedAt(ray, next))
        return fmt::format("ray {}, with tnear at its hit: {}", i, *text);
      if (!Can(RB_CAN_AFTER) || HasExactIntervals()) continue;
      const std::vector<rb_hit>& walk = WalkOf(i);
      const auto walked =
          std::find_if(walk.begin(), walk.end(), [&](const rb_hit& h) { return h.t > hit.t; });
      if (walked == walk.end() ? next.prim != RAYBENCH_NONE : !SameHit(*walked, next))
        return fmt::format("{}, with tnear at the hit: {}, but `after` walks to {}", RayText(i),
                           Describe(next), walked == walk.end() ? "nothing" : Describe(*walked));
    }
    return std::nullopt;
  }

  // ---- trees ----

  Text TreeIsSound() {
    if (result_.claim == RB_CLAIM_NOTHING) return std::nullopt;
    const auto statistics = ReadTree(tree_, geometry_);
    return statistics && !statistics->flaw.empty() ? Text(statistics->flaw) : std::nullopt;
  }

  Text SameTreeTwice() { return Rebuilt({.threads = 1}, "built again"); }
  Text SameTreeOnThreads() {
    for (uint32_t threads : {2u, 3u})
      if (auto text =
              Rebuilt({.threads = threads}, threads == 2 ? "built on 2 threads" : "built on 3 threads"))
        return text;
    return std::nullopt;
  }
  Text Rebuilt(How how, const char* what) {
    if (!Can(RB_DETERMINISTIC)) return std::nullopt;
    const Tree other = Build(how);
    if (DigestOf(tree_) != DigestOf(other)) return fmt::format("{}, it shows other nodes", what);
    for (uint32_t kind : {RB_CLOSEST, RB_ANY}) {
      Question q = All(kind);
      if (auto text = Difference(q, kind == RB_CLOSEST ? Closest() : Any(), Ask(other, q), what)) return text;
    }
    if (!Can(RB_CAN_COUNT)) return std::nullopt;
    Question q = All(RB_CLOSEST);
    q.counted = true;
    return CountsDiffer(Ask(tree_, q), Ask(other, q), what);
  }

  Text FewerNeeds() {
    if (!Can(RB_DETERMINISTIC)) return std::nullopt;
    const Tree other = Build({.needs = RB_NEED_ANY});
    for (uint32_t kind : {RB_CLOSEST, RB_ANY}) {
      const Question q = All(kind);
      if (auto text = Difference(q, kind == RB_CLOSEST ? Closest() : Any(), Ask(other, q),
                                 "built for fewer needs", /*with_uv=*/false))
        return text;
    }
    return std::nullopt;
  }

  static uint64_t BytesOf(const Tree& tree) {
    uint64_t nodes = 0, prims = 0;
    int needs_geometry = 0;
    tree.structure().memory(tree.get(), &nodes, &prims, &needs_geometry);
    return nodes + prims;
  }
  /// Half of what the tree takes is a limit that it cannot keep but by being another one.
  Text KeepsMemoryLimit() {
    const uint64_t limit = BytesOf(tree_) / 2;
    if (limit == 0) return std::nullopt;
    try {
      const Tree other = Build({.memory_limit = limit});
      if (BytesOf(other) <= limit) return std::nullopt;
      return fmt::format("may take {} bytes, and builds a tree of {}", limit, BytesOf(other));
    } catch (const BuildError&) {
      return std::nullopt;
    }
  }

  // ---- raybench's own numerics ----

  /// Brute force in the structure's arithmetic; null where nothing promises the same answers to the bit.
  const Contestant* BruteLike() const {
    if (brute_) return brute_->structure != nullptr ? &*brute_ : nullptr;
    brute_.emplace();
    if (!registry_.OriginOf(*contestant_.structure).empty()) return nullptr;
    const std::string numerics = ParameterOf("numerics");
    if (numerics.empty()) return nullptr;
    brute_ = ParseContestant(registry_, "brute(numerics=" + numerics + ")");
    return &*brute_;
  }

  Text IsBrute() {
    const Tree brute = Build(*BruteLike(), geometry_, {});
    for (uint32_t kind : {RB_CLOSEST, RB_ANY}) {
      const Question q = All(kind);
      if (auto text = Difference(q, kind == RB_CLOSEST ? Closest() : Any(), Ask(brute, q), "brute force"))
        return text;
    }
    for (size_t i : Hitting()) {
      if (!Can(RB_CAN_AFTER)) break;
      const std::vector<rb_hit>&walk = WalkOf(i), expected = Walk(brute, case_.rays[i], MostHits());
      for (size_t k = 0; k < std::max(walk.size(), expected.size()); ++k)
        if (k >= walk.size() || k >= expected.size() || !SameHit(walk[k], expected[k]))
          return fmt::format("{}: hit {} by `after` is {}, but of brute force {}", RayText(i), k,
                             k < walk.size() ? Describe(walk[k]) : "none",
                             k < expected.size() ? Describe(expected[k]) : "none");
    }
    return std::nullopt;
  }

  /// The same case, changed in a way that changes no answer but the primitives' numbers, if `renamed`.
  Text SameAnswers(const Case& changed, const char* what, const std::function<uint32_t(uint32_t)>& renamed,
                   bool with_uv) {
    std::optional<Scene> scene;
    try {
      scene = SceneOf(changed);
    } catch (const InputError&) {
      return std::nullopt;  // out of range: nothing is promised
    }
    const Tree other = Build(contestant_, scene->Geometry(), {});
    Question q = All(RB_CLOSEST);
    q.rays = changed.rays;
    Answer answer = Ask(other, q);
    for (size_t i = 0; i < q.rays.size(); ++i) {
      rb_hit& hit = answer.hits[i];
      if (hit.prim != RAYBENCH_NONE) hit.prim = renamed(hit.prim);
      const rb_hit& mine = Closest().hits[i];
      const bool same = SameHit(hit, mine, with_uv);
      // Of two at the same t the lowest number wins, and numbers have changed.
      const bool tied = renamed(0) != 0 && hit.t == mine.t && hit.prim != mine.prim &&
                        hit.prim != RAYBENCH_NONE && mine.prim != RAYBENCH_NONE;
      if (!same && !tied)
        return fmt::format("{}: {}, but {}: {}", RayText(i), Describe(mine), what, Describe(hit));
    }
    return std::nullopt;
  }
  static uint32_t Unchanged(uint32_t prim) { return prim; }

  /// Nothing under- or overflows if no number but 0 comes near the ends of the range.
  bool IsInMiddle() const {
    bool middle = true;
    const auto look = [&](float x) {
      middle &= x == 0 || (std::fabs(x) > 0x1p-20f && std::fabs(x) < 0x1p20f);
    };
    Mapped(
        case_, [&](Vec3f p) { return look(p.x), look(p.y), look(p.z), p; },
        [&](float r) { return look(r), r; });
    for (const rb_ray& ray : case_.rays) look(ray.tnear);
    return middle;
  }

  Text Scaled() {
    if (!IsInMiddle()) return std::nullopt;
    for (float scale : {0x1p7f, 0x1p-9f}) {
      const auto by = [&](auto x) { return x * scale; };
      if (auto text = SameAnswers(Mapped(case_, by, by), "scaled by a power of two", Unchanged, true))
        return text;
    }
    return std::nullopt;
  }

  Text Turned() {
    if (!IsExact() || case_.primitives() > case_.triangles.size()) return std::nullopt;
    const auto same = [](float r) { return r; };
    const auto turn = [](Vec3f p) { return Vec3f{p.y, p.z, p.x}; };
    if (auto text = SameAnswers(Mapped(case_, turn, same), "with axes exchanged", Unchanged, false))
      return text;
    const auto mirror = [](Vec3f p) { return Vec3f{-p.x, p.y, p.z}; };
    return SameAnswers(Mapped(case_, mirror, same), "mirrored", Unchanged, false);
  }

  Text Renumbered() {
    Case changed = case_;
    std::reverse(changed.triangles.begin(), changed.triangles.end());
    const uint32_t n = uint32_t(case_.triangles.size());
    return SameAnswers(
        changed, "with triangles in reverse order",
        [n](uint32_t prim) { return prim < n ? n - 1 - prim : prim; }, true);
  }

  /// Triangles that no ray comes near: behind all rays' origins and beside the scene.
  Text Added() {
    Case changed = case_;
    const Bounds3 box = scene_.bounds();
    if (box.Empty()) return std::nullopt;
    const float size = std::max({box.Extent().x, box.Extent().y, box.Extent().z}), far = 4 * size;
    if (!(far > 0) || !(std::fabs(box.lo.x) + far < 0x1p29f)) return std::nullopt;
    Case alone;
    for (float side : {-1.0f, 1.0f}) {
      const Vec3f at = {side < 0 ? box.lo.x - far : box.hi.x + far, box.lo.y - far, box.hi.z + far};
      for (Case* c : {&changed, &alone}) {
        const uint32_t first = uint32_t(c->positions.size());
        for (Vec3f p : {at, Vec3f{at.x + side * size, at.y, at.z}, Vec3f{at.x, at.y - size, at.z}})
          c->positions.push_back(p);
        c->triangles.push_back({first, first + 1, first + 2});
      }
    }
    // Numbers of what follows the triangles change.
    const uint32_t n = uint32_t(case_.triangles.size());
    try {
      const Scene scene = SceneOf(alone);
      const Tree brute = Build(*BruteLike(), scene.Geometry(), {});
      for (uint8_t occluded : Ask(brute, All(RB_ANY)).occluded)
        if (occluded != 0) return std::nullopt;
    } catch (const InputError&) {
      return std::nullopt;
    }
    return SameAnswers(
        changed, "with triangles that no ray meets",
        [n](uint32_t prim) { return prim < n ? prim : prim - 2; }, true);
  }

  const Registry& registry_;
  const Case& case_;
  const Contestant contestant_;
  const Scene scene_;
  const rb_geometry geometry_;
  Examination result_;
  Tree tree_;
  std::unique_ptr<Oracle> oracle_;
  std::optional<Answer> closest_, any_;
  std::optional<std::vector<Truth>> truth_;
  std::map<size_t, std::vector<rb_hit>> walks_;
  mutable std::optional<Contestant> brute_;
};

using enum Demand;
const Examiner::Row Examiner::kTable[] = {
    {{"contract", kAlways, "every answer is written and possible: t, primitive, occluded"},
     &Examiner::Contract},
    {{"tree", kAlways, "the nodes it shows hold every primitive, in bounds that enclose it"},
     &Examiner::TreeIsSound},
    {{"closest", kConservative, "closest hits as exact geometry allows by the claim"},
     &Examiner::ClosestIsTrue},
    {{"any", kConservative, "any-hit answers likewise"}, &Examiner::AnyIsTrue},
    {{"uv", kConservative, "u and v of the point that is hit"}, &Examiner::UvIsTrue},
    {{"ties", kConservative, "of several hits at one t the lowest primitive"}, &Examiner::LowestCopy},
    {{"lattice", kConservative, "all hits where integers leave no doubt"}, &Examiner::Lattice},
    {{"any_closest", kAlways, "any-hit says whether there is a closest hit"}, &Examiner::AnyIsClosest},
    {{"tfar", kConservative, "tfar at a hit keeps it, tfar before it does not"}, &Examiner::EndsAtHit},
    {{"tnear", kConservative, "tnear at a hit leads to the next one"}, &Examiner::BeginsAtHit},
    {{"skip", kAlways, "a skipped primitive is not hit, and nothing else is lost"}, &Examiner::Skip},
    {{"after", kAlways, "`after` walks all hits in order"}, &Examiner::After},
    {{"batch", kAlways, "the same answers in batches of any size, and asked again"}, &Examiner::Batches},
    {{"counted", kAlways, "counting changes no answer, and counts the same each time"}, &Examiner::Counting},
    {{"threads", kAlways, "several threads may ask at once"}, &Examiner::Threads},
    {{"rebuilt", kAlways, "the same tree each time"}, &Examiner::SameTreeTwice},
    {{"build_threads", kAlways, "the same tree on any number of threads"}, &Examiner::SameTreeOnThreads},
    {{"needs", kAlways, "the same hits where less is needed"}, &Examiner::FewerNeeds},
    {{"memory_limit", kAlways, "a tree within the memory limit, or none"}, &Examiner::KeepsMemoryLimit},
    {{"brute", kOwn, "the answers of brute force, to the bit"}, &Examiner::IsBrute},
    {{"scaled", kOwn, "scaling by a power of two changes no bit"}, &Examiner::Scaled},
    {{"turned", kOwn, "axes exchanged or mirrored change no bit of exact arithmetic"}, &Examiner::Turned},
    {{"renumbered", kOwn, "the order of primitives changes no t"}, &Examiner::Renumbered},
    {{"added", kOwn, "geometry that no ray meets changes no answer"}, &Examiner::Added},
};

}  // namespace

std::span<const CheckInfo> Checks() { return Examiner::Infos(); }

const CheckInfo& FindCheck(std::string_view name) {
  std::vector<std::string_view> names;
  for (const CheckInfo& info : Checks()) {
    if (name == info.name) return info;
    names.push_back(info.name);
  }
  throw InputError(fmt::format("unknown check '{}'{}; there are {}", name, DidYouMean(name, names),
                               fmt::join(names, ", ")));
}

Examination Examine(const Registry& registry, const Case& c,
                    const std::function<void(const char*)>& on_check) {
  if (!c.check.empty()) FindCheck(c.check);
  return Examiner(registry, c).Run(on_check);
}

}  // namespace raybench::fuzz
