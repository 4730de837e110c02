#include "harness/verify/closed.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <mutex>
#include <new>
#include <optional>

#include "accel/base/parallel.h"
#include "accel/base/random.h"
#include "datasets/models/fetch.h"
#include "datasets/scene/needs.h"
#include "harness/base/point_triangle.h"
#include "harness/judge/claim.h"
#include "harness/measure/machine.h"
#include "harness/measure/measure.h"
#include "harness/plan/build_options.h"
#include "harness/plan/plan.h"
#include "harness/rays/ray_sets.h"
#include "harness/terminal/interrupt.h"
#include "harness/terminal/load.h"
#include "harness/terminal/progress.h"
#include "harness/truth/inside.h"
#include "harness/truth/oracle.h"
#include "harness/verify/ledger.h"
#include "harness/verify/report.h"

namespace raybench {
namespace {

constexpr size_t kOrigins = 64;
constexpr int kCandidates = 4096;
/// Rays that a thread makes and asks at a time: their answers stay in the caches.
constexpr size_t kPiece = 1 << 11;
/// Rays of each campaign that the oracle is asked about beforehand: it must see a hit for all.
constexpr size_t kCrossChecked = 1 << 10;
/// How often a long campaign is entered into the ledger.
constexpr double kRecordSeconds = 60;

/// To the nearest triangle.
double Clearance(const Scene& scene, Vec3f point) {
  const double squared = ParallelReduce(
      Range<size_t>(0, scene.triangles.size(), 1024), std::numeric_limits<double>::infinity(),
      [&](const Range<size_t>& range, double least) {
        for (size_t i = range.begin(); i < range.end(); ++i)
          least = std::min(least, SquaredDistance(ToDouble(point), CornersOf(scene, i)));
        return least;
      },
      [](double a, double b) { return std::min(a, b); });
  return std::sqrt(squared);
}

class Campaign {
 public:
  Campaign(const Registry& registry, const VerifyOptions& options, const std::string& name)
      : registry_(registry), options_(options), name_(name) {
    LoadOptions load;
    load.seed = options.seed;
    load.drop_bad = options.drop_bad;
    scene_ = LoadWithProgress(name, load);
    if (scene_.triangles.empty())
      throw InputError(fmt::format("--closed: scene '{}' has no triangles", name));
    edges_ = MeshEdges(scene_);
    if (const std::string why = WhyNotClosed(scene_, edges_); !why.empty())
      throw InputError(fmt::format("--closed: scene '{}' is not closed: {}", name, why));
  }

  int Run(const std::vector<Contestant>& contestants, std::optional<Ledger>& ledger) {
    for (const Contestant& contestant : contestants) Fire(contestant, ledger);
    return lost_ ? 1 : inconclusive_ ? 3 : 0;
  }

 private:
  void Fire(const Contestant& contestant, std::optional<Ledger>& ledger) {
    ThrowIfInterrupted();
    const std::string spec = contestant.Spec();
    Tree tree;
    try {
      if (const std::string why = WhyNotTaken(*contestant.structure, scene_); !why.empty())
        throw BuildError(why);
      tree =
          Tree(contestant, scene_.Geometry(),
               BuildOptions(options_.threads, options_.seed, NeedsOf(scene_).BuildNeeds() | kCheckedNeeds));
    } catch (const BuildError& error) {
      ThrowIfInterrupted();
      fmt::print("{}, {}: not verified: {}\n", name_, spec, error.what());
      inconclusive_ = true;
      return;
    }
    const LedgerKey key = KeyOf(contestant);
    const uint64_t seed = ledger ? ledger->Begin(key, name_, options_.seed) : options_.seed;
    Prepare(seed);
    rays_ = misses_ = 0;
    examples_.clear();
    const Stopwatch watch(false);
    const double seconds = FireAll(tree, seed, [&] {
      if (ledger) ledger->Record(key, seed, rays_, misses_);
    });
    Print(contestant, tree.Claims(), seconds);
    if (ledger) {
      const LedgerTotals sum = ledger->Totals(key);
      fmt::print("  ledger {}: {} rays in {} runs, {} misses, leak rate {}\n", options_.ledger, sum.rays,
                 sum.runs, sum.misses, FormatUpperRate(sum.misses, sum.rays));
    }
    std::fflush(stdout);
    ThrowIfInterrupted();
  }

  LedgerKey KeyOf(const Contestant& contestant) const {
    const Json build = BuildFacts();
    const auto text = [&](const char* name) {
      return build.contains(name) && build[name].is_string() ? build[name].get<std::string>() : "";
    };
    const std::string plugin = registry_.OriginOf(*contestant.structure);
    return {scene_.hash(),
            contestant.structure->name,
            contestant.Params(),
            Query(),
            text("version"),
            text("commit"),
            plugin.empty() ? "" : Sha256OfFile(plugin)};
  }

  const char* Query() const { return QueryName(options_.any ? RB_ANY : RB_CLOSEST); }

  /// Origins for this seed; the oracle must see a hit for the first rays.
  void Prepare(uint64_t seed) {
    if (prepared_ == seed) return;
    progress_.Update(0, fmt::format("{}: looking for points inside", name_));
    inside_ = FindInsidePoints(scene_, kOrigins, seed, options_.threads);
    if (inside_.points.empty())
      throw InputError(fmt::format(
          "--closed: scene '{}' has no point inside that is 1/1024 of its diagonal away from its surface, "
          "as far as {} tries tell",
          name_, kCandidates));
    if (!oracle_) {
      progress_.Clear();
      fmt::print(
          "{}: closed, {} triangles, {} edges; rays from {} points inside, at least {:.3g} from the "
          "surface (diagonal {:.3g}), at vertices and edges\n",
          name_, scene_.triangles.size(), edges_.size(), inside_.points.size(), inside_.margin,
          Length(ToDouble(scene_.bounds().Extent())));
      std::fflush(stdout);
      oracle_ = MakeOracle(scene_);
    }
    std::vector<rb_ray> rays(kCrossChecked);
    FillClosedBatch(scene_, edges_, inside_, seed, 0, rays);
    for (const Truth& truth : oracle_->Ask(rays, options_.threads))
      if (!truth.hit) throw std::logic_error("a ray from inside a closed mesh misses, says the oracle");
    prepared_ = seed;
  }

  /// Until all are fired or Ctrl-C; returns the seconds it took. `record` is called now and then, and at
  /// the end.
  template <class Record>
  double FireAll(const Tree& tree, uint64_t seed, const Record& record) {
    const uint64_t batches = (options_.closed + kClosedBatch - 1) / kClosedBatch;
    const uint32_t threads = options_.threads != 0 ? options_.threads : AllThreads();
    Arena arena(threads);
    const Stopwatch watch(false);
    double recorded = 0;
    // Rounds of a few batches a thread; more as soon as they prove short.
    uint64_t round = threads;
    for (uint64_t begin = 0; begin < batches && !Interrupted();) {
      const double before = watch.Elapsed().wall;
      const uint64_t end = std::min(batches, begin + round);
      arena.Run([&] {
        ParallelFor(begin, end, [&](uint64_t b) {
          if (!Interrupted()) FireBatch(tree, seed, b);
        });
      });
      begin = end;
      const double now = watch.Elapsed().wall;
      if (now - before < 0.3) round *= 2;
      progress_.Update(double(begin) / double(batches),
                       fmt::format("{}: {} of {} rays fired, {} misses", tree.structure().name, rays_,
                                   options_.closed, misses_));
      if (now - recorded > kRecordSeconds) {
        record();
        recorded = now;
      }
    }
    const double seconds = watch.Elapsed().wall;
    progress_.Clear();
    record();
    KeepLowest();
    return seconds;
  }

  void FireBatch(const Tree& tree, uint64_t seed, uint64_t batch) {
    const size_t n = size_t(std::min(kClosedBatch, options_.closed - batch * kClosedBatch));
    std::vector<rb_ray> rays(n);
    FillClosedBatch(scene_, edges_, inside_, seed, batch, rays);
    Answers answers(kPiece);
    uint64_t misses = 0;
    std::vector<JudgedAnswer> examples;
    for (size_t begin = 0; begin < n; begin += kPiece) {
      const std::span<const rb_ray> piece = std::span(rays).subspan(begin, std::min(kPiece, n - begin));
      const Question question{options_.any ? RB_ANY : RB_CLOSEST, piece};
      Ask(tree, question, answers, 1);
      for (size_t i = 0; i < piece.size(); ++i) {
        if (options_.any ? answers.occluded[i] != 0 : answers.hits[i].prim != RAYBENCH_NONE) continue;
        ++misses;
        if (examples.size() >= options_.examples) continue;
        JudgedAnswer& example = examples.emplace_back();
        example.set = "closed";
        example.query = question.query;
        example.index = batch * kClosedBatch + begin + i;
        example.ray = piece[i];
        example.hit = answers.hits[i];
      }
    }
    const std::lock_guard lock(mutex_);
    rays_ += n;
    misses_ += misses;
    examples_.insert(examples_.end(), examples.begin(), examples.end());
    if (examples_.size() > 4096) KeepLowest();
  }

  /// The same ones whatever threads fired them.
  void KeepLowest() {
    const auto by_index = [](const JudgedAnswer& a, const JudgedAnswer& b) { return a.index < b.index; };
    std::sort(examples_.begin(), examples_.end(), by_index);
    if (examples_.size() > options_.examples) examples_.resize(options_.examples);
  }

  void Print(const Contestant& contestant, uint32_t claim, double seconds) {
    const bool broken = misses_ > 0 && (claim == RB_CLAIM_WATERTIGHT || claim == RB_CLAIM_EXACT);
    lost_ |= broken;
    fmt::print("{}, claims {}{}: {} {}-hit rays, {} misses, leak rate {}; {:.1f} s, {:.3g} Mrays/s\n",
               contestant.Spec(), ClaimName(claim), broken ? " (BROKEN)" : "", rays_, Query(), misses_,
               FormatUpperRate(misses_, rays_), seconds, double(rays_) * 1e-6 / std::max(1e-9, seconds));
    const ReplayContext context{name_, options_.seed, options_.plugins, options_.drop_bad,
                                scene_.scale_exponent};
    for (size_t i = 0; i < examples_.size(); ++i) {
      // No miss needs the oracle; that it agrees shows that the mesh is closed and the oracle is not blind.
      JudgedAnswer& e = examples_[i];
      e.truth = oracle_->Ask(std::span(&e.ray, 1), 1)[0];
      e.judged = e.query == RB_ANY ? JudgeOccluded(*oracle_, e.ray, e.truth, false)
                                   : JudgeHit(*oracle_, e.ray, e.truth, e.hit);
      if (!e.truth.hit) throw std::logic_error("a ray from inside a closed mesh misses, says the oracle");
      fmt::print("  {}. {}     {}\n", i + 1, FormatExample(e), ReplayCommand(contestant, e.ray, context));
    }
  }

  const Registry& registry_;
  const VerifyOptions& options_;
  const std::string name_;
  Scene scene_;
  std::vector<MeshEdge> edges_;
  InsidePoints inside_;
  std::optional<uint64_t> prepared_;  // the seed of `inside_`
  std::unique_ptr<Oracle> oracle_;
  Progress progress_;
  bool lost_ = false, inconclusive_ = false;

  // Of the structure that is fired at.
  std::mutex mutex_;
  uint64_t rays_ = 0, misses_ = 0;
  std::vector<JudgedAnswer> examples_;
};

}  // namespace

std::string WhyNotClosed(const Scene& scene, std::span<const MeshEdge> edges) {
  uint64_t open = 0;
  const MeshEdge* first = nullptr;
  for (const MeshEdge& edge : edges) {
    if (edge.count % 2 == 0) continue;
    if (open++ == 0) first = &edge;
  }
  if (first == nullptr) return {};
  const Vec3f a = scene.positions[first->a], b = scene.positions[first->b];
  return fmt::format(
      "{} of {} edges have an odd number of triangles; one of them runs from ({}, {}, {}) to ({}, {}, {}) "
      "and has {}, of which triangle {} is the first",
      open, edges.size(), a.x, a.y, a.z, b.x, b.y, b.z, first->count, first->triangles[0]);
}

InsidePoints FindInsidePoints(const Scene& scene, size_t count, uint64_t seed, uint32_t threads) {
  const Bounds3& box = scene.bounds();
  InsidePoints inside;
  inside.margin = std::ldexp(Length(ToDouble(box.hi) - ToDouble(box.lo)), -10);
  const InsideTruth truth(scene);
  Arena arena(threads);
  for (uint64_t candidate = 0; candidate < uint64_t(kCandidates) && inside.points.size() < count;
       ++candidate) {
    ThrowIfInterrupted();
    Random random(~seed, candidate);
    Vec3f point;
    for (int k = 0; k < 3; ++k)
      point[k] = float(box.lo[k] + random.NextDouble() * (double(box.hi[k]) - box.lo[k]));
    const Place place = truth.Of(point, random);
    if (truth.Of(point, random) != place)
      throw std::logic_error("a point is inside and outside of a closed mesh");
    if (place != Place::kInside) continue;
    // The error of the distance in double is far below a millionth of it.
    if (arena.Run([&] { return Clearance(scene, point); }) >= inside.margin * (1 + 1e-6))
      inside.points.push_back(point);
  }
  return inside;
}

void FillClosedBatch(const Scene& scene, std::span<const MeshEdge> edges, const InsidePoints& inside,
                     uint64_t seed, uint64_t batch, std::span<rb_ray> rays) {
  Random random(seed, batch);
  for (rb_ray& ray : rays) {
    const uint64_t bits = random.NextBits();
    const MeshEdge& edge = edges[random.Below(edges.size())];
    const Vec3f org = inside.points[(bits >> 8) % inside.points.size()];
    Vec3f target = scene.positions[bits & 1 ? edge.a : edge.b];
    if ((bits & 6) != 0) {  // three of four at a point between
      const Vec3d a = ToDouble(scene.positions[edge.a]), b = ToDouble(scene.positions[edge.b]);
      target = ToFloat(a + (b - a) * ((bits & 6) == 2 ? 0.5 : random.NextDouble()));
    }
    const Vec3f dir = target - org;
    ray = {{org.x, org.y, org.z}, 0, {dir.x, dir.y, dir.z}, std::numeric_limits<float>::infinity()};
  }
}

int RunClosed(const Registry& registry, const VerifyOptions& options) {
  std::vector<Contestant> contestants = EveryArithmetic(registry, options.structures);
  if (options.structures.empty())
    std::erase_if(contestants,
                  [](const Contestant& c) { return (c.structure->capabilities & RB_LINEAR) != 0; });
  std::optional<Ledger> ledger;
  if (!options.ledger.empty()) ledger.emplace(options.ledger);
  int code = 0;
  for (const std::string& name : options.scenes) {
    const int own = Campaign(registry, options, name).Run(contestants, ledger);
    code = code == 1 || own == 1 ? 1 : std::max(code, own);
  }
  return code;
}

}  // namespace raybench
