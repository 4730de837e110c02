// Private to the fuzzer: one case before one structure. What is promised stands in promises_*.cpp, a function
// each that says what broke; examine.cpp has the table of them.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "accel/host/parameters.h"
#include "harness/fuzz/asking.h"
#include "harness/fuzz/examine.h"
#include "harness/fuzz/lattice.h"
#include "harness/plan/build_options.h"
#include "harness/truth/oracle.h"

namespace raybench::fuzz {

/// What broke, in words; none if nothing did.
using Text = std::optional<std::string>;

inline constexpr float kInfinity = std::numeric_limits<float>::infinity();

class Examiner {
 public:
  Examiner(const Registry& registry, const Case& c)
      : registry_(registry),
        case_(c),
        contestant_(ParseContestant(registry, c.structure)),
        scene_(SceneOf(c)),
        geometry_(scene_.Geometry()) {}

  Examination Run(const std::function<void(const char*)>& on_check);
  static std::span<const CheckInfo> Infos();

 private:
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
  /// As far as parameters tell.
  bool TracesBatchesTogether() const {
    return Can(RB_NATIVE_BATCH) && ParameterOf("batch") != "single" && ParameterOf("packet") != "1";
  }
  /// An inexact library may trace a ray by one kernel or another, as its neighbours go.
  bool MayDependOnNeighbours() const { return TracesBatchesTogether() && !IsConservative(); }
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
  /// Rays that are asked about once more with another interval, skip or after: a few, or all for one promise alone.
  size_t Followed() const { return case_.check.empty() ? 12 : case_.rays.size(); }
  size_t MostHits() const { return 2 * case_.primitives() + 4; }
  const std::vector<rb_hit>& WalkOf(size_t ray) {
    const auto it = walks_.find(ray);
    if (it != walks_.end()) return it->second;
    return walks_[ray] = Walk(tree_, case_.rays[ray], MostHits());
  }
  /// Rays that hit something, a few of them.
  std::vector<size_t> Hitting() {
    std::vector<size_t> rays;
    for (size_t i = 0; i < case_.rays.size() && rays.size() < Followed(); ++i)
      if (Closest().hits[i].prim < case_.primitives()) rays.push_back(i);
    return rays;
  }
  std::string RayText(size_t i) const { return fmt::format("ray {} ({})", i, Describe(case_.rays[i])); }
  static Question One(const rb_ray& ray, uint32_t kind = RB_CLOSEST) {
    Question q;
    q.kind = kind, q.rays = {ray};
    return q;
  }

  // ---- promises_contract.cpp ----

  Text Contract();
  Text FlawOf(const rb_ray& ray, const rb_hit& hit, bool after = false) const;
  Text AnyIsClosest();
  Text Batches();
  Text Counting();
  Text CountsDiffer(const Answer& a, const Answer& b, const char* what) const;
  /// Threads that ask the same at the same time get what one gets.
  Text Threads();
  Text Skip();
  Text After();
  /// Triangles with the same corners in the same order are computed alike, so a walk meets all or none.
  Text LostCopy(const std::vector<rb_hit>& walk) const;
  bool IsCopy(uint32_t a, uint32_t b) const;
  /// What comes behind each hit of a walk, against the truth.
  Text JudgeWalk(size_t i, const std::vector<rb_hit>& walk);

  // ---- promises_claim.cpp ----

  /// `ties`: an exact claim is held to the primitive, too.
  Text Misjudged(const rb_ray& ray, const Truth& truth, const rb_hit& hit, bool ties = true);
  Text MisjudgedAt(const rb_ray& ray, const rb_hit& hit);
  static std::string DescribeTruth(const Truth& truth);
  Text ClosestIsTrue();
  Text AnyIsTrue();
  Text UvIsTrue();
  /// Of several copies the lowest is answered.
  Text LowestCopy();
  /// Where integers say what is true: the closest hit, whether there is one, and all of them.
  Text Lattice();
  Text LatticeAnswer(const std::vector<LatticeHit>& hits, const rb_hit& answer) const;
  /// An interval that ends at the hit keeps it; one that ends just before has nothing.
  Text EndsAtHit();
  /// An interval that begins at the hit has the next one.
  Text BeginsAtHit();

  // ---- promises_tree.cpp ----

  Text TreeIsSound();
  Text SameTreeTwice() { return Rebuilt({.threads = 1}, "built again"); }
  Text SameTreeOnThreads();
  Text Rebuilt(How how, const char* what);
  Text FewerNeeds();
  static uint64_t BytesOf(const Tree& tree);
  /// Half of what the tree takes is a limit that it cannot keep but by being another one.
  Text KeepsMemoryLimit();

  // ---- promises_own.cpp ----

  /// Brute force in the structure's arithmetic; null where nothing promises the same answers to the bit.
  const Contestant* BruteLike() const;
  Text IsBrute();
  /// The same case, changed in a way that changes no answer but the primitives' numbers, if `renamed`.
  Text SameAnswers(const Case& changed, const char* what, const std::function<uint32_t(uint32_t)>& renamed,
                   bool with_uv);
  static uint32_t Unchanged(uint32_t prim) { return prim; }
  /// Nothing under- or overflows if no number but 0 comes near the ends of the range.
  bool IsInMiddle() const;
  Text Scaled();
  Text Turned();
  Text Renumbered();
  /// Triangles that no ray comes near: behind all rays' origins and beside the scene.
  Text Added();

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

}  // namespace raybench::fuzz
