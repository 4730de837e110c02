// Judges answers by the rules of VERDICTS.md.
#include "harness/truth/verdict.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>

#include "accel/base/float_state.h"
#include "accel/base/parallel.h"
#include "accel/ray/exact.h"
#include "harness/truth/sheared.h"

namespace raybench {
namespace {

constexpr size_t kPatchLimit = 512;

/// Rows over GF(2); true if `target` is a sum of `rows`.
bool InSpan(std::vector<std::vector<uint64_t>> rows, std::vector<uint64_t> target) {
  for (size_t used = 0, bit = 0; bit < target.size() * 64; ++bit) {
    const size_t word = bit / 64;
    const uint64_t mask = uint64_t{1} << (bit % 64);
    const auto pivot =
        std::find_if(rows.begin() + ptrdiff_t(used), rows.end(), [&](auto& r) { return r[word] & mask; });
    if (pivot == rows.end()) {
      if (target[word] & mask) return false;
      continue;
    }
    std::swap(*pivot, rows[used]);
    const auto add = [&](std::vector<uint64_t>& to) {
      for (size_t w = 0; w < to.size(); ++w) to[w] ^= rows[used][w];
    };
    for (size_t r = used + 1; r < rows.size(); ++r)
      if (rows[r][word] & mask) add(rows[r]);
    if (target[word] & mask) add(target);
    ++used;
  }
  return true;
}

/// Where a float test may put the t of a hit.
struct TRange {
  double lo, hi;

  TRange(double t, double error)
      : lo(t - std::max(error, EightUlp(t))), hi(t + std::max(error, EightUlp(t))) {}
  /// Any sound test reports such a hit, and before `end`.
  bool Surely(const rb_ray& ray, double end) const { return lo > ray.tnear && hi < end; }
};

/// What surrounds a true hit within the error bound.
struct Patch {
  bool near_edge = false;  // the hit itself is within the bound of an edge
  bool sealed = false;     // by triangles that any sound test reports before `end`
};

/// As a test sees it that shears along `axis`.
Patch SurroundAlong(int axis, const Scene& scene, const Adjacency& adjacency, const rb_ray& ray,
                    uint32_t triangle, double end) {
  Patch patch;
  std::vector<uint32_t> members = {adjacency.Representative(triangle)};
  std::vector<Sheared> shapes;
  std::vector<std::pair<uint32_t, uint32_t>> edges;
  for (size_t m = 0; m < members.size(); ++m) {
    const Sheared& shape = shapes.emplace_back(ray, CornersOf(scene, members[m]), axis);
    const Adjacency::Corners corners = adjacency.CornersOf(members[m]);
    for (size_t i = 0; i < 3; ++i) {
      if (!shape.NearEdge(int(i))) continue;
      patch.near_edge |= m == 0;
      const auto edge = std::minmax(corners[(i + 1) % 3], corners[(i + 2) % 3]);
      if (std::find(edges.begin(), edges.end(), std::pair<uint32_t, uint32_t>(edge)) != edges.end()) continue;
      edges.push_back(edge);
      for (uint32_t other : adjacency.Around(edge.first)) {
        const auto c = adjacency.CornersOf(other);
        if (std::find(c.begin(), c.end(), edge.second) == c.end()) continue;
        if (std::find(members.begin(), members.end(), other) == members.end()) members.push_back(other);
      }
      // The error spans half the mesh: nothing can be asked of float arithmetic here.
      if (members.size() > kPatchLimit) return patch;
    }
  }
  const size_t words = (members.size() + 63) / 64;
  std::vector<uint64_t> covers(words);
  std::vector<std::vector<uint64_t>> rows(edges.size(), std::vector<uint64_t>(words));
  for (size_t m = 0; m < members.size(); ++m) {
    const Appraisal appraisal = shapes[m].Appraise();
    if (!TRange(appraisal.t, appraisal.t_error).Surely(ray, end)) continue;
    const uint64_t mask = uint64_t{1} << (m % 64);
    if (shapes[m].Covers()) covers[m / 64] |= mask;
    const auto c = adjacency.CornersOf(members[m]);
    for (size_t e = 0; e < edges.size(); ++e) {
      const auto has = [&](uint32_t position) { return std::find(c.begin(), c.end(), position) != c.end(); };
      if (has(edges[e].first) && has(edges[e].second)) rows[e][m / 64] |= mask;
    }
  }
  patch.sealed = !InSpan(std::move(rows), std::move(covers));
  return patch;
}

/// Sealed only if it is so for every test.
Patch Surround(const Scene& scene, const Adjacency& adjacency, const rb_ray& ray, uint32_t triangle,
               double end) {
  Patch patch = {.near_edge = false, .sealed = true};
  for (int axis : MainAxes(ray)) {
    const Patch along = SurroundAlong(axis, scene, adjacency, ray, triangle, end);
    patch.near_edge |= along.near_edge;
    patch.sealed &= along.sealed;
  }
  return patch;
}

double UlpOfFloat(double t) {
  const float f = std::fabs(float(t));
  return f < std::numeric_limits<float>::min() ? 0x1p-149 : std::ldexp(1.0, std::ilogb(f) - 23);
}

}  // namespace

double EightUlp(double t) { return 8 * UlpOfFloat(t); }

double ErrorInUlp(float answer, double truth) { return std::fabs(answer - truth) / UlpOfFloat(truth); }

float AnswerableT(float t, const rb_ray& ray) {
  return t == ray.tnear ? std::nextafterf(t, std::numeric_limits<float>::infinity()) : t;
}

Adjacency::Adjacency(const Scene& scene) : scene_(scene) {
  const size_t vertices = scene.positions.size(), triangles = scene.triangles.size();
  // Position ids: vertices sorted by bits (-0 counted as 0); equal ones share the lowest index.
  const auto key = [&](uint32_t v) {
    const Vec3f p = scene.positions[v] + Vec3f{0, 0, 0};
    return std::array<uint32_t, 3>{std::bit_cast<uint32_t>(p.x), std::bit_cast<uint32_t>(p.y),
                                   std::bit_cast<uint32_t>(p.z)};
  };
  std::vector<uint32_t> order(vertices);
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
    const auto ka = key(a), kb = key(b);
    return ka != kb ? ka < kb : a < b;
  });
  position_.resize(vertices);
  for (size_t i = 0; i < vertices; ++i)
    position_[order[i]] = i > 0 && key(order[i - 1]) == key(order[i]) ? position_[order[i - 1]] : order[i];

  const auto sorted = [&](uint32_t t) {
    auto c = CornersOf(t);
    std::sort(c.begin(), c.end());
    return c;
  };
  order.resize(triangles);
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
    const auto ka = sorted(a), kb = sorted(b);
    return ka != kb ? ka < kb : a < b;
  });
  representative_.resize(triangles);
  for (size_t i = 0; i < triangles; ++i)
    representative_[order[i]] =
        i > 0 && sorted(order[i - 1]) == sorted(order[i]) ? representative_[order[i - 1]] : order[i];

  first_.assign(vertices + 1, 0);
  const auto distinct = [&](auto&& fn) {
    for (uint32_t t = 0; t < triangles; ++t)
      if (representative_[t] == t)
        for (uint32_t c : CornersOf(t)) fn(t, c);
  };
  distinct([&](uint32_t, uint32_t c) { ++first_[c + 1]; });
  std::partial_sum(first_.begin(), first_.end(), first_.begin());
  fan_.resize(first_[vertices]);
  std::vector<uint32_t> next(first_.begin(), first_.end() - 1);
  distinct([&](uint32_t t, uint32_t c) { fan_[next[c]++] = t; });
}

Adjacency::Corners Adjacency::CornersOf(uint32_t triangle) const {
  const auto& v = scene_.triangles[triangle];
  return {position_[v[0]], position_[v[1]], position_[v[2]]};
}

std::vector<Truth> JudgingOracle::Ask(std::span<const rb_ray> rays, uint32_t threads) const {
  std::vector<Truth> truth(rays.size());
  ForEachOnThreads(rays.size(), threads, [&](size_t i) {
    truth[i] = AskTriangles(rays[i]);
    others_.Join(rays[i], truth[i]);
  });
  return truth;
}

std::vector<TrueHit> JudgingOracle::AllHits(const rb_ray& ray) const {
  std::vector<TrueHit> hits = TriangleHits(ray);
  for (const ExactTruth::Meeting& m : others_.All(ray)) hits.push_back({m.prim, m.t.v});
  return hits;
}

Appraisal JudgingOracle::Appraise(const rb_ray& ray, uint32_t prim, int root) const {
  if (prim >= scene_.triangles.size()) return AppraiseProcedural(scene_, ray, prim, root);
  const MainAxes axes(ray);
  const exact::Corners p = CornersOf(scene_, prim);
  Appraisal result = Sheared(ray, p, axes.axis[0]).Appraise();
  for (int k = 1; k < axes.count; ++k) result = Either(result, Sheared(ray, p, axes.axis[k]).Appraise());
  return result;
}

Appraisal JudgingOracle::AppraiseAt(const rb_ray& ray, uint32_t prim, double t) const {
  const Appraisal first = Appraise(ray, prim, 0);
  if (RootCount(scene_, prim) == 1) return first;
  const Appraisal second = Appraise(ray, prim, 1);
  if (first.possible != second.possible) return first.possible ? first : second;
  return std::fabs(first.t - t) <= std::fabs(second.t - t) ? first : second;
}

bool JudgingOracle::SharesVertex(uint32_t prim, const std::vector<uint32_t>& others) const {
  if (prim >= scene_.triangles.size()) return false;
  const auto c = adjacency_.CornersOf(prim);
  uint32_t last = RAYBENCH_NONE;  // runs of copies are looked at once
  for (uint32_t other : others) {
    if (other >= scene_.triangles.size()) break;
    if (adjacency_.Representative(other) == last) continue;
    last = adjacency_.Representative(other);
    for (uint32_t p : adjacency_.CornersOf(other))
      if (std::find(c.begin(), c.end(), p) != c.end()) return true;
  }
  return false;
}

bool JudgingOracle::AcceptedInPlane(const rb_ray& ray, const Truth& truth, const rb_hit& answer) const {
  if (!truth.coplanar || answer.prim >= scene_.primitive_count() || !std::isfinite(answer.t) ||
      !(answer.t > ray.tnear && answer.t <= ray.tfar) ||
      (truth.hit && answer.t > truth.t + EightUlp(truth.t))) {
    return false;
  }
  if (answer.prim >= scene_.triangles.size()) return LiesInSurface(scene_, ray, answer.prim, answer.t);
  const exact::Line line(ray);
  const exact::Corners p = CornersOf(scene_, answer.prim);
  const double slack = EightUlp(answer.t);
  return exact::Meet(line, p) == exact::Meeting::kInPlane &&
         exact::MeetsInPlane(line, p, float(answer.t - slack), float(answer.t + slack));
}

JudgingOracle::Excuse JudgingOracle::Passed(const rb_ray& ray, const TrueHit& hit, double end) const {
  if (hit.prim >= scene_.triangles.size()) {
    const Appraisal appraisal = AppraiseAt(ray, hit.prim, hit.t);
    return !appraisal.grazing && TRange(hit.t, appraisal.t_error).Surely(ray, end) ? Excuse::kPlain
                                                                                   : Excuse::kMarginal;
  }
  const Patch patch = Surround(scene_, adjacency_, ray, hit.prim, end);
  if (!patch.sealed) return Excuse::kMarginal;
  return patch.near_edge ? Excuse::kLeak : Excuse::kPlain;
}

JudgingOracle::Excuse JudgingOracle::PassedBefore(const rb_ray& ray, double end) const {
  Excuse worst = Excuse::kMarginal;
  for (const TrueHit& hit : AllHits(ray)) {
    if (hit.t >= end) continue;
    const Excuse excuse = Passed(ray, hit, end);
    if (excuse == Excuse::kLeak) return excuse;
    if (excuse == Excuse::kPlain) worst = excuse;
  }
  return worst;
}

bool JudgingOracle::Agree(const rb_ray& ray, const TrueHit& hit, const rb_hit& answer) const {
  const Appraisal a = AppraiseAt(ray, hit.prim, hit.t), b = AppraiseAt(ray, answer.prim, answer.t);
  return std::fabs(answer.t - hit.t) <= std::max(EightUlp(hit.t), 2 * (a.t_error + b.t_error));
}

bool JudgingOracle::IsStrict(const rb_ray& ray, const Truth& truth, const rb_hit& answer) const {
  if (answer.prim == RAYBENCH_NONE) return !truth.hit && answer.t == ray.tfar;
  return (truth.hit && answer.prim == truth.first && answer.t == truth.t_rounded) ||
         AcceptedInPlane(ray, truth, answer);
}

Verdict JudgingOracle::Judge(const rb_ray& ray, const Truth& truth, const rb_hit& answer) const {
  if (IsStrict(ray, truth, answer)) return Verdict::kExact;
  if (answer.prim == RAYBENCH_NONE) {
    if (!(answer.t == ray.tfar)) return truth.hit ? Verdict::kFalseMiss : Verdict::kFalseHit;
    const Excuse excuse = PassedBefore(ray, LastT(ray));
    return excuse == Excuse::kLeak    ? Verdict::kLeak
           : excuse == Excuse::kPlain ? Verdict::kFalseMiss
                                      : Verdict::kFalseMissMarginal;
  }
  const Verdict plain = truth.hit ? Verdict::kWrong : Verdict::kFalseHit;
  if (answer.prim >= scene_.primitive_count() || !std::isfinite(answer.t) || !(answer.t > ray.tnear) ||
      !(answer.t <= ray.tfar)) {
    return plain;
  }
  const auto plausible_at = [&](double t) {
    const Appraisal a = AppraiseAt(ray, answer.prim, t);
    return a.possible && std::fabs(answer.t - a.t) <= std::max(EightUlp(answer.t), a.t_error);
  };
  if (std::binary_search(truth.tied.begin(), truth.tied.end(), answer.prim) && plausible_at(truth.t))
    return answer.prim == truth.tied.front() ? Verdict::kExact : Verdict::kTie;
  if (!plausible_at(answer.t)) return plain;
  if (!truth.hit) return Verdict::kFalseHitMarginal;
  // Nothing is surely reported within 8 ulp of the nearest hit.
  const Excuse excuse =
      answer.t > truth.t + EightUlp(truth.t) ? PassedBefore(ray, answer.t) : Excuse::kMarginal;
  if (excuse == Excuse::kLeak) return Verdict::kLeak;
  if (excuse == Excuse::kPlain) return Verdict::kWrong;
  const bool neighbour =
      SharesVertex(answer.prim, truth.tied) && Agree(ray, {truth.tied.front(), truth.t}, answer);
  return neighbour ? Verdict::kNeighbour : Verdict::kWrongMarginal;
}

Verdict JudgingOracle::JudgeAny(const rb_ray& ray, const Truth& truth, bool occluded) const {
  if (occluded == truth.hit || (occluded && truth.coplanar)) return Verdict::kExact;
  if (!occluded) {
    const Excuse excuse = PassedBefore(ray, LastT(ray));
    return excuse == Excuse::kLeak    ? Verdict::kLeak
           : excuse == Excuse::kPlain ? Verdict::kFalseMiss
                                      : Verdict::kFalseMissMarginal;
  }
  const auto may_be_met = [&](uint32_t prim) {
    for (int root = 0; root < RootCount(scene_, prim); ++root) {
      const Appraisal a = Appraise(ray, prim, root);
      const double error = std::max(EightUlp(a.t), a.t_error);
      if (a.possible && a.t + error > ray.tnear && a.t - error <= ray.tfar) return true;
    }
    return false;
  };
  const bool near =
      ray.tnear < ray.tfar && (AnyTriangleNear(ray, may_be_met) || others_.AnyNear(ray, may_be_met));
  return near ? Verdict::kFalseHitMarginal : Verdict::kFalseHit;
}

uint64_t Oracle::Audit(std::span<const rb_ray>, std::span<const Truth>, uint64_t, uint64_t) const {
  return 0;
}

const char* VerdictName(Verdict verdict) {
  static constexpr const char* names[] = {
      "exact",          "tie",        "neighbour",           "leak",      "wrong",
      "wrong_marginal", "false_miss", "false_miss_marginal", "false_hit", "false_hit_marginal"};
  static_assert(std::size(names) == size_t(Verdict::kCount));
  return verdict < Verdict::kCount ? names[size_t(verdict)] : "unknown";
}

uint64_t VerdictCounts::plain_errors() const {
  return (*this)[Verdict::kWrong] + (*this)[Verdict::kFalseMiss] + (*this)[Verdict::kFalseHit];
}

void VerdictCounts::Add(const VerdictCounts& more) {
  rays += more.rays;
  strict += more.strict;
  uv_judged += more.uv_judged;
  uv_wrong += more.uv_wrong;
  for (size_t v = 0; v < size_t(Verdict::kCount); ++v) by_class[v] += more.by_class[v];
  uv_error_max = std::max(uv_error_max, more.uv_error_max);
}

bool Judged::Breaks(uint32_t claim) const {
  if (claim == RB_CLAIM_EXACT) return !strict || UvWrong();
  return claim == RB_CLAIM_WATERTIGHT && (IsError() || UvWrong());
}

Judged JudgeHit(const Oracle& oracle, const rb_ray& ray, const Truth& truth, const rb_hit& answer,
                bool has_uv) {
  Judged judged;
  judged.strict = oracle.IsStrict(ray, truth, answer);
  if (!judged.strict) judged.verdict = oracle.Judge(ray, truth, answer);
  // A wrong t on the right primitive counts too: were it left out, approximate tests would look better than exact ones.
  const bool is_right = judged.verdict <= Verdict::kNeighbour ||
                        (judged.verdict == Verdict::kWrong && std::isfinite(answer.t) &&
                         std::binary_search(truth.tied.begin(), truth.tied.end(), answer.prim));
  // Where the ray lies in the plane of what it meets, many t are right.
  if (truth.hit && !truth.coplanar && is_right) judged.t_error = ErrorInUlp(answer.t, truth.t);
  if (!has_uv || answer.prim == RAYBENCH_NONE || judged.IsError()) return judged;
  if (const UvTruth uv = oracle.Uv(ray, answer); uv.known) judged.uv_error = uv.Error(answer);
  return judged;
}

Judged JudgeOccluded(const Oracle& oracle, const rb_ray& ray, const Truth& truth, bool occluded) {
  Judged judged;
  judged.verdict = oracle.JudgeAny(ray, truth, occluded);
  judged.strict = judged.verdict == Verdict::kExact;
  return judged;
}

VerdictCounts JudgeAll(const Oracle& oracle, uint32_t query_kind, std::span<const rb_ray> rays,
                       std::span<const Truth> truth, std::span<const rb_hit> hits,
                       std::span<const uint8_t> occluded, uint32_t threads, std::vector<Judged>* judged_out,
                       bool has_uv) {
  const bool closest = query_kind == RB_CLOSEST;
  if (truth.size() != rays.size() || (closest ? hits.size() : occluded.size()) != rays.size())
    throw InputError("verdict: rays, truth and answers differ in number");
  std::vector<Judged> judged(rays.size());
  ForEachOnThreads(rays.size(), threads, [&](size_t i) {
    judged[i] = closest ? JudgeHit(oracle, rays[i], truth[i], hits[i], has_uv)
                        : JudgeOccluded(oracle, rays[i], truth[i], occluded[i] != 0);
  });

  VerdictCounts counts;
  counts.rays = rays.size();
  std::vector<double> errors;
  for (const Judged& j : judged) {
    ++counts.by_class[size_t(j.verdict)];
    counts.strict += j.strict;
    if (j.t_error) errors.push_back(*j.t_error);
    if (!j.uv_error) continue;
    ++counts.uv_judged;
    counts.uv_wrong += j.UvWrong();
    if (std::isfinite(*j.uv_error)) counts.uv_error_max = std::max(counts.uv_error_max, *j.uv_error);
  }
  if (!errors.empty()) {
    std::sort(errors.begin(), errors.end());
    const auto percentile = [&](uint64_t percent) {
      return errors[(errors.size() * percent + 99) / 100 - 1];
    };  // nearest rank
    counts.t_error_p50 = percentile(50);
    counts.t_error_p99 = percentile(99);
    counts.t_error_max = errors.back();
  }
  if (judged_out != nullptr) *judged_out = std::move(judged);
  return counts;
}

bool BreaksClaim(uint32_t claim, const VerdictCounts& counts) {
  if (claim == RB_CLAIM_EXACT) return counts.strict != counts.rays || counts.uv_wrong > 0;
  return claim == RB_CLAIM_WATERTIGHT && counts.leaks() + counts.plain_errors() + counts.uv_wrong > 0;
}

void ForEachOnThreads(size_t count, uint32_t threads, const std::function<void(size_t)>& body) {
  const size_t grain = 64;
  Arena arena(threads);
  arena.Run([&] {
    ParallelFor(Range<size_t>(0, count, grain), [&](const Range<size_t>& range) {
      const FloatState ieee;
      for (size_t i = range.begin(); i < range.end(); ++i) body(i);
    });
  });
}

std::unique_ptr<Oracle> MakeOracle(const Scene& scene) {
  if (auto oracle = MakeCgalOracle(scene)) return oracle;
  return MakeBoxOracle(scene);
}

#ifndef RAYBENCH_HAS_CGAL
std::unique_ptr<Oracle> MakeCgalOracle(const Scene&) { return nullptr; }
#endif

}  // namespace raybench
