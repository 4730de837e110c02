// Private to the oracles: what they share to judge answers. The rules stand in VERDICTS.md.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <span>
#include <vector>

#include "harness/truth/exact.h"
#include "harness/truth/margins.h"
#include "harness/truth/oracle.h"

namespace raybench {

/// Which triangles meet at a vertex *position*. Coincident triangles (the same three positions) count once.
class Adjacency {
 public:
  explicit Adjacency(const Scene& scene);

  using Corners = std::array<uint32_t, 3>;  ///< position ids: the same number for bit-identical positions
  Corners CornersOf(uint32_t triangle) const;
  /// Distinct triangles around a position, each by its lowest id.
  std::span<const uint32_t> Around(uint32_t position) const {
    return {fan_.data() + first_[position], first_[position + 1] - first_[position]};
  }
  /// Lowest id among the triangles that coincide with this one.
  uint32_t Representative(uint32_t triangle) const { return representative_[triangle]; }

 private:
  const Scene& scene_;
  std::vector<uint32_t> position_;  // vertex -> position id
  std::vector<uint32_t> representative_;
  std::vector<uint32_t> first_, fan_;
};

/// A primitive that the ray truly meets.
struct TrueHit {
  uint32_t prim;
  double t;
};

/// An oracle that can list true hits and near misses; judging follows from these.
class JudgingOracle : public Oracle {
 public:
  /// Primitives with ids below `first` are the derived class's matter, and are triangles; the others are
  /// asked about by ExactTruth.
  JudgingOracle(const Scene& scene, uint32_t first)
      : scene_(scene), adjacency_(scene), others_(scene, first) {}

  bool IsStrict(const rb_ray& ray, const Truth& truth, const rb_hit& answer) const final;
  std::vector<Truth> Ask(std::span<const rb_ray> rays, uint32_t threads) const final;
  bool Exact() const final { return true; }
  UvTruth Uv(const rb_ray& ray, const rb_hit& answer) const final { return TrueUv(scene_, ray, answer); }
  Verdict Judge(const rb_ray& ray, const Truth& truth, const rb_hit& answer) const final;
  Verdict JudgeAny(const rb_ray& ray, const Truth& truth, bool occluded) const final;

 protected:
  /// The truth about the derived class's triangles alone.
  virtual Truth AskTriangles(const rb_ray&) const { return {}; }
  /// Every one of them met at t in (tnear, tfar], in any order; those in whose plane the ray lies left out.
  virtual std::vector<TrueHit> TriangleHits(const rb_ray&) const { return {}; }
  /// True if `accept` holds for some of them whose bounds, widened by the float tests' error, the ray's whole
  /// line meets.
  virtual bool AnyTriangleNear(const rb_ray&, const std::function<bool(uint32_t prim)>& /*accept*/) const {
    return false;
  }

  const Scene& scene_;
  const Adjacency adjacency_;

 private:
  enum class Excuse { kMarginal, kPlain, kLeak };
  std::vector<TrueHit> AllHits(const rb_ray& ray) const;
  /// What it means that nothing was answered before `end`, although this hit lies there.
  Excuse Passed(const rb_ray& ray, const TrueHit& hit, double end) const;
  /// The worst of all hits before `end`.
  Excuse PassedBefore(const rb_ray& ray, double end) const;
  /// `root`: curved primitives only, see AppraiseProcedural().
  Appraisal Appraise(const rb_ray& ray, uint32_t prim, int root) const;
  /// The root nearer to t.
  Appraisal AppraiseAt(const rb_ray& ray, uint32_t prim, double t) const;
  /// The two t are the same within the errors.
  bool Agree(const rb_ray& ray, const TrueHit& hit, const rb_hit& answer) const;
  bool SharesVertex(uint32_t prim, const std::vector<uint32_t>& others) const;
  /// The answer is a primitive in whose plane the ray lies, and not behind the truth.
  bool AcceptedInPlane(const rb_ray& ray, const Truth& truth, const rb_hit& answer) const;

  const ExactTruth others_;
};

/// What an answer may say of a hit in (tnear, tfar] whose exact t rounds to `t`: t itself, or the float after
/// tnear where t is tnear.
float AnswerableT(float t, const rb_ray& ray);

/// 8 ulp of float at |t|, the least tolerance of any comparison of t.
double EightUlp(double t);

/// body(0) ... body(count - 1) over at most `threads` threads (0: all), in IEEE floating-point state.
void ForEachOnThreads(size_t count, uint32_t threads, const std::function<void(size_t)>& body);

}  // namespace raybench
