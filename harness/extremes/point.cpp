#include "harness/extremes/point.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <new>
#include <ranges>
#include <span>

#include "harness/judge/claim.h"
#include "harness/judge/tree_statistics.h"
#include "harness/measure/measure.h"
#include "harness/measure/statistics.h"
#include "harness/plan/build_options.h"
#include "harness/terminal/interrupt.h"

namespace raybench::extremes {
namespace {

/// A linear structure (RB_LINEAR) gets as many rays as test this many primitives in a pass, but never fewer
/// than kFewestRays.
constexpr double kLinearBudget = 0x1p20;
constexpr uint64_t kFewestRays = 16;
constexpr int kPasses = 3;
/// A tree whose pass lasts longer than this is passed once.
constexpr double kLongPassSeconds = 0.1;

/// One contestant at this point.
struct Entrant {
  const Contestant* contestant = nullptr;
  Row row;
  Tree tree;
  std::vector<rb_ray> rays;
  std::vector<uint32_t> skip;
  Answers answers;
  std::vector<double> pass_ns;

  Question Asked() const { return {RB_CLOSEST, rays, skip}; }
};

uint64_t RaysFor(const Contestant& contestant, const Scene& scene, uint64_t rays) {
  if ((contestant.structure->capabilities & RB_LINEAR) == 0) return rays;
  const auto affordable = uint64_t(kLinearBudget / double(std::max<uint64_t>(1, scene.primitive_count())));
  return std::min(rays, std::max(kFewestRays, affordable));
}

class PointRun {
 public:
  PointRun(const Suite& suite, const Point& point, const std::vector<Contestant>& contestants,
           const PointOptions& options)
      : suite_(suite), point_(point), options_(options) {
    for (const Contestant& contestant : contestants) {
      entrants_.emplace_back();
      entrants_.back().contestant = &contestant;
      Row& row = entrants_.back().row;
      row[column::suite] = suite.name;
      if (!point.variant.empty()) row[column::variant] = point.variant;
      row[column::magnitude] = point.magnitude;
      row[column::in_range] = point.valid;
      row[column::structure] = contestant.structure->name;
      row[column::spec] = contestant.Spec();
      row[column::params] = contestant.Params();
      row[column::seed] = options.seed;
    }
  }

  std::vector<Row> Go() {
    if (MakeWorkload()) {
      for (Entrant& e : entrants_) {
        ThrowIfInterrupted();
        if (options_.progress) options_.progress(e.row.Get(column::spec));
        try {
          Prepare(e);
        } catch (const QueryError& error) {
          Skip(e, error.what());
        }
      }
      Time();
    }
    std::vector<Row> rows;
    for (Entrant& e : entrants_) rows.push_back(std::move(e.row));
    return rows;
  }

 private:
  /// False where the scene model refuses the input; the rows say so then.
  bool MakeWorkload() {
    try {
      work_ = suite_.make(point_, options_.rays, options_.seed);
    } catch (const InputError& error) {
      for (Entrant& e : entrants_) {
        e.row[column::status] = "refused";
        e.row[column::note] = error.what();
      }
      return false;
    }
    geometry_ = work_.scene.Geometry();
    oracle_ = MakeOracle(work_.scene);
    constexpr size_t kChunk = 1 << 15;  // of a second at most, so that Ctrl-C is heard
    for (size_t first = 0; !work_.leave && first < work_.rays.size(); first += kChunk) {
      ThrowIfInterrupted();
      const size_t count = std::min(kChunk, work_.rays.size() - first);
      std::ranges::move(oracle_->Ask(std::span(work_.rays).subspan(first, count), 0),
                        std::back_inserter(truth_));
    }
    return true;
  }

  void Prepare(Entrant& e) {
    e.row[column::triangles] = work_.scene.triangles.size();
    e.row[column::oracle] = oracle_->Name();
    if (!work_.note.empty()) e.row[column::note] = work_.note;
    try {
      rb_build_options build = BuildOptions(1, options_.seed);
      build.needs |= RB_NEED_UV | (work_.leave ? RB_NEED_SKIP : 0);
      const bool device = IsOnDevice(*e.contestant->structure);
      const Pinned pinned(!device);
      const Stopwatch watch(/*process=*/true);
      e.tree = Tree(*e.contestant, geometry_, build);
      e.row[column::build_ms] = TimeOfWork(watch.Elapsed(), device) * 1e3;
    } catch (const BuildError& error) {
      ThrowIfInterrupted();
      return Skip(e, error.what());
    } catch (const std::bad_alloc&) {
      return Skip(e, "out of memory");
    }
    uint64_t nodes = 0, prims = 0;
    int needs_geometry = 0;
    e.tree.structure().memory(e.tree.get(), &nodes, &prims, &needs_geometry);
    e.row[column::node_bytes] = nodes;
    e.row[column::prim_bytes] = prims;
    e.row[column::claim] = ClaimName(e.tree.Claims());
    std::string flaw;
    if (const auto statistics = ReadTree(e.tree, geometry_)) {
      e.row[column::depth] = statistics->depth;
      flaw = statistics->flaw;
    }
    e.rays.assign(work_.rays.begin(),
                  work_.rays.begin() + long(RaysFor(*e.contestant, work_.scene, work_.rays.size())));
    e.answers = Answers(e.rays.size());
    if (work_.leave) {
      Ask(e.tree, e.Asked(), e.answers, 1);
      work_.leave(work_.scene, e.answers.hits, e.rays, e.skip);
      if (!e.skip.empty() && (e.tree.structure().capabilities & RB_CAN_SKIP) == 0)
        return Skip(e, "the structure cannot skip a primitive");
      e.answers = Answers(e.rays.size());
    }
    if (e.rays.empty()) return Skip(e, "no ray reaches the surface");
    Judge(e, std::move(flaw));
  }

  static void Skip(Entrant& e, const std::string& why) {
    e.row[column::status] = "skipped";
    e.row[column::note] = why;
    e.tree = Tree();
  }

  void Judge(Entrant& e, std::string flaw) {
    const std::vector<Truth> own = work_.leave ? oracle_->Ask(e.rays, 0) : std::vector<Truth>();
    const std::span<const Truth> truth = std::span(work_.leave ? own : truth_).first(e.rays.size());
    e.row[column::rays] = e.rays.size();
    e.row[column::status] = "measured";
    Ask(e.tree, e.Asked(), e.answers, 1);
    const Verdicts verdicts = JudgeAnswers(e.tree.Claims(), *oracle_, work_.scene.primitive_count(),
                                           e.Asked(), {truth}, e.answers, 0);
    const VerdictCounts& counts = verdicts.counts;
    uint64_t failures = counts.leaks() + counts.plain_errors(), second = 0, second_rays = 0;
    if (work_.fails) failures = 0;
    for (size_t i = 0; i < e.rays.size(); ++i) {
      const rb_hit& hit = e.answers.hits[i];
      if (work_.fails) failures += work_.fails(truth[i], hit);
      if (work_.second && (!work_.second_on_odd_rays || i % 2 != 0)) {
        ++second_rays;
        second += work_.second(truth[i], hit);
      }
    }
    if (counts.rays > 0) {
      SetClasses(e.row, counts);
      SetErrorsOfT(e.row, counts);
      e.row[column::other_primitive] = counts.rays - counts[Verdict::kExact] - counts[Verdict::kTie];
    }
    if (flaw.empty()) flaw = verdicts.contract_flaw;
    if (flaw.empty())
      flaw = BrokenClaim(e.tree.Claims(), counts, verdicts.breaking, work_.scene.scale_exponent);
    e.row[column::failures] = failures;
    e.row[column::failure_rate] = double(failures) / double(e.rays.size());
    e.row[column::failure_bound] = UpperRate(failures, e.rays.size());
    if (work_.second) {
      e.row[column::second_rays] = second_rays;
      e.row[column::second] = second;
      if (second_rays > 0) e.row[column::second_rate] = double(second) / double(second_rays);
      e.row[column::second_bound] = UpperRate(second, second_rays);
    }
    if (!flaw.empty()) {
      e.row[column::status] = "broken";
      e.row[column::note] = flaw;
    }
  }

  /// Passes of all trees take turns; the median counts. Rough: few passes, one process.
  void Time() {
    for (int pass = 0; pass < kPasses; ++pass) {
      for (Entrant& e : entrants_) {
        if (!e.tree || (pass > 0 && e.pass_ns[0] * double(e.rays.size()) > kLongPassSeconds * 1e9)) continue;
        ThrowIfInterrupted();
        const bool device = IsOnDevice(e.tree.structure());
        const Pinned pinned(!device);
        const Stopwatch watch(/*process=*/false);
        try {
          Ask(e.tree, e.Asked(), e.answers, 1);
        } catch (const QueryError& error) {
          Skip(e, error.what());
          continue;
        }
        e.pass_ns.push_back(TimeOfWork(watch.Elapsed(), device) * 1e9 / double(e.rays.size()));
      }
    }
    for (Entrant& e : entrants_)
      if (!e.pass_ns.empty()) e.row[column::ns_per_ray] = MedianOf(e.pass_ns).median;
  }

  const Suite& suite_;
  const Point& point_;
  const PointOptions& options_;
  std::vector<Entrant> entrants_;
  Workload work_;
  rb_geometry geometry_ = {};
  std::unique_ptr<Oracle> oracle_;
  std::vector<Truth> truth_;
};

}  // namespace

std::vector<Row> MeasurePoint(const Suite& suite, const Point& point,
                              const std::vector<Contestant>& contestants, const PointOptions& options) {
  return PointRun(suite, point, contestants, options).Go();
}

}  // namespace raybench::extremes
