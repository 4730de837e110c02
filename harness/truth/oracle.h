// Truth for a ray: exact, and independent of every structure under test.
//
// This header knows nothing of CGAL. The implementation over CGAL's AABB tree lives in a library of its own
// (raybench_oracle, GPL through CGAL); a build without it finds candidates by a tree of its own, and says so.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "datasets/scene/scene.h"
#include "harness/truth/uv.h"

namespace raybench {

enum class Feature : uint8_t { kInterior, kEdge, kVertex };

/// What is exactly true of one ray over its interval (tnear, tfar].
struct Truth {
  bool hit = false;
  bool coplanar = false;  ///< the ray lies in the plane of a triangle or polygon it meets, or in a cone's
                          ///< side: hit and miss are both right for it; such a primitive is never in `tied`
  double t = 0;           ///< exact t of the nearest hit, rounded to double
  float t_rounded = 0;    ///< the exact t correctly rounded to float (ties to even; it is at most tfar and
                          ///< finite); the float after tnear where that is tnear, which no answer may be
  uint32_t first = RAYBENCH_NONE;  ///< lowest id of all primitives whose t, so rounded, is t_rounded: the
                                   ///< answer by the contract's order (float t, prim), perhaps not in `tied`
  std::vector<uint32_t> tied;      ///< every primitive hit at exactly that t, ascending; empty on a miss
  Feature feature = Feature::kInterior;  ///< where the lowest of them is hit
};

enum class Verdict : uint8_t {
  kExact,      ///< the lowest id of the tied set, t correct (a miss where truth is a miss); what IsStrict()
               ///< accepts
  kTie,        ///< another member of the tied set, t correct
  kNeighbour,  ///< shares a vertex with a true primitive, edge functions within the error bound, t within
               ///< twice the sum of both primitives' errors of t (either plane may be off at the ray)
  kLeak,       ///< went through a closed surface at an interior edge or vertex that was crossed transversally
  kWrong,
  kWrongMarginal,
  kFalseMiss,
  kFalseMissMarginal,
  kFalseHit,
  kFalseHitMarginal,
  kCount
};
const char* VerdictName(
    Verdict verdict);  ///< "exact", "tie", "neighbour", "leak", "wrong", "wrong_marginal", ...

/// All that is said of one answer.
struct Judged {
  Verdict verdict = Verdict::kExact;
  bool strict = true;  ///< the answer which `exact` promises: IsStrict(); any hit: the class exact
  /// ulp of float; of exact, tie and neighbour hits, and of wrong ones that name a primitive of the tied set
  std::optional<double> t_error;
  std::optional<double> uv_error;  ///< in units of its bound, UvTruth::Error(); of hits that are no errors

  /// A leak or a plain error: what no sound test answers.
  bool IsError() const {
    return verdict == Verdict::kLeak || verdict == Verdict::kWrong || verdict == Verdict::kFalseMiss ||
           verdict == Verdict::kFalseHit;
  }
  bool UvWrong() const { return uv_error && !(*uv_error <= 1); }
  /// A tree claiming `claim` may not give this answer: EXACT allows only strict ones, WATERTIGHT no leak and
  /// no plain error, both no u or v beyond its bound; the others allow all.
  bool Breaks(uint32_t claim) const;
};

/// How many rays of a set fell into each class, and the errors of t.
struct VerdictCounts {
  uint64_t rays = 0;
  uint64_t by_class[size_t(Verdict::kCount)] = {};
  uint64_t strict = 0;
  double t_error_p50 = 0, t_error_p99 = 0,
         t_error_max = 0;  ///< of Judged::t_error
  uint64_t uv_judged = 0, uv_wrong = 0;
  double uv_error_max = 0;  ///< in units of the bound; finite ones

  uint64_t operator[](Verdict v) const { return by_class[size_t(v)]; }
  uint64_t plain_errors() const;  ///< wrong + false_miss + false_hit, not marginal
  uint64_t leaks() const { return (*this)[Verdict::kLeak]; }
  /// Those of other answers too; the percentiles of t stay.
  void Add(const VerdictCounts& more);
};

/// How many rays of a set `run` and `verify` give to Audit().
inline constexpr uint64_t kAuditedRays = 64;

class Oracle {
 public:
  virtual ~Oracle() = default;
  /// Truth of each ray, in parallel over at most `threads` (0: all). Rays must be valid (see IsValidRay).
  virtual std::vector<Truth> Ask(std::span<const rb_ray> rays, uint32_t threads) const = 0;
  /// True if the answer is, to the bit, what a structure claiming `exact` must give: (first, t_rounded), or a
  /// miss where truth is a miss. A triangle in whose plane the ray lies may be answered in place of either.
  virtual bool IsStrict(const rb_ray& ray, const Truth& truth, const rb_hit& answer) const = 0;
  /// Judges a closest-hit answer.
  virtual Verdict Judge(const rb_ray& ray, const Truth& truth, const rb_hit& answer) const = 0;
  /// Judges an any-hit answer: occluded must equal truth.hit; else false_hit/false_miss (marginal) or leak.
  virtual Verdict JudgeAny(const rb_ray& ray, const Truth& truth, bool occluded) const = 0;
  /// TrueUv() in the oracle's scene.
  virtual UvTruth Uv(const rb_ray& ray, const rb_hit& answer) const = 0;
  /// Derives the truth of `count` of these rays, chosen by `seed`, a second time by arithmetic that shares
  /// nothing with Ask() but the search for triangles near the ray; where there are procedural primitives,
  /// only what is true of the triangles among them. Returns how many were derived: all if there are fewer
  /// than `count`, 0 from an oracle that has no second arithmetic. Throws std::logic_error with the ray,
  /// its numbers in hexadecimal, where the two disagree; then no verdict may be trusted.
  virtual uint64_t Audit(std::span<const rb_ray> rays, std::span<const Truth> truth, uint64_t seed,
                         uint64_t count) const;
  virtual std::string Name() const = 0;  ///< such as "cgal 5.5.1 (epick, exact order)"
  virtual bool Exact() const = 0;
};

/// Exact oracle over CGAL's AABB tree for triangles, ExactTruth for procedural primitives. Null when the
/// build has no CGAL. The scene must outlive any oracle, unmoved.
std::unique_ptr<Oracle> MakeCgalOracle(const Scene& scene);
/// Exact oracle by ExactTruth alone.
std::unique_ptr<Oracle> MakeBoxOracle(const Scene& scene);
/// The one over CGAL, or the other in a build without.
std::unique_ptr<Oracle> MakeOracle(const Scene& scene);

/// Judges one closest-hit answer in every respect. `has_uv`: the tree was built with RB_NEED_UV.
Judged JudgeHit(const Oracle& oracle, const rb_ray& ray, const Truth& truth, const rb_hit& answer,
                bool has_uv = true);
/// Judges one any-hit answer.
Judged JudgeOccluded(const Oracle& oracle, const rb_ray& ray, const Truth& truth, bool occluded);

/// Judges all answers of a set; hits for RB_CLOSEST sets, occluded for RB_ANY. `judged`, if not null, becomes
/// what is said of each.
VerdictCounts JudgeAll(const Oracle& oracle, uint32_t query_kind, std::span<const rb_ray> rays,
                       std::span<const Truth> truth, std::span<const rb_hit> hits,
                       std::span<const uint8_t> occluded, uint32_t threads,
                       std::vector<Judged>* judged = nullptr, bool has_uv = true);

/// Where the ray ends: at tfar, or where t is no float any more. By the contract a hit with no finite t is
/// none. Oracles and audit all keep to this.
inline float LastT(const rb_ray& ray) { return std::min(ray.tfar, std::numeric_limits<float>::max()); }

/// |answer - truth| in ulp of float at the truth.
double ErrorInUlp(float answer, double truth);

/// True if a tree claiming `claim` may not give all of these answers: Judged::Breaks() of one of them.
bool BreaksClaim(uint32_t claim, const VerdictCounts& counts);

}  // namespace raybench
