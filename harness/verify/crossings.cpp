#include "harness/verify/crossings.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <filesystem>
#include <mutex>
#include <new>
#include <optional>

#include "accel/base/files.h"
#include "accel/base/parallel.h"
#include "accel/ray/bounds.h"
#include "datasets/scene/needs.h"
#include "harness/base/columns.h"
#include "harness/judge/claim.h"
#include "harness/measure/measure.h"
#include "harness/measure/statistics.h"
#include "harness/plan/build_options.h"
#include "harness/plan/plan.h"
#include "harness/results/table.h"
#include "harness/terminal/interrupt.h"
#include "harness/terminal/load.h"
#include "harness/terminal/progress.h"
#include "harness/verify/closed.h"
#include "harness/verify/report.h"

namespace raybench {
namespace fs = std::filesystem;
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
/// Of the scene's diagonal, behind each hit; a usual choice.
constexpr double kEpsilon = 1e-4;
constexpr size_t kAudited = 1 << 12;

/// How to tell inside from outside by rays.
enum Way : size_t { kRule, kAfter, kRestart, kVote, kWays };
constexpr const char* kWayNames[kWays] = {"rule", "after", "epsilon", "vote"};
bool NeedsAfter(size_t way) { return way <= kAfter; }

/// What one structure made of the points.
struct Tally {
  Contestant contestant;
  uint32_t claim = RB_CLAIM_NOTHING;
  uint64_t points = 0;
  std::array<uint64_t, kWays> wrong{};
  std::array<double, kWays> seconds{};  ///< of all threads
  std::vector<size_t> wrong_points;     ///< by the rule: the first ones
  std::string flaw;                     ///< what contradicts the contract, in the first batch with
  uint64_t flaw_batch = 0;              ///< such an answer

  /// Exact arithmetic takes lines as they are.
  bool IsTilted() const { return claim != RB_CLAIM_EXACT; }
  bool CanAfter() const { return (contestant.structure->capabilities & RB_CAN_AFTER) != 0; }
};

Vec3f Axis(const CrossingPoint& point) {
  Vec3f dir{0, 0, 0};
  dir[point.axis] = point.backward ? -1.0f : 1.0f;
  return dir;
}

rb_ray RayFrom(Vec3f org, Vec3f dir) { return {{org.x, org.y, org.z}, 0, {dir.x, dir.y, dir.z}, kInfinity}; }

/// Walks rays through all their hits, many rays at a time.
class Walker {
 public:
  /// Resumes at each hit by `after`, or `epsilon` behind it if that is above 0. Calls see(i, prim) for each
  /// hit of ray i.
  template <class See>
  void Walk(const Tree& tree, uint64_t primitives, std::span<const rb_ray> rays, float epsilon,
            const See& see) {
    rays_.assign(rays.begin(), rays.end());
    index_.resize(rays.size());
    for (size_t i = 0; i < rays.size(); ++i) index_[i] = uint32_t(i);
    after_.assign(rays.size(), RAYBENCH_NONE);
    hits_.resize(rays.size());
    while (!rays_.empty()) {
      rb_query query = {};
      query.struct_size = sizeof query;
      query.kind = RB_CLOSEST;
      query.n = rays_.size();
      query.rays = rays_.data();
      query.after = epsilon > 0 ? nullptr : after_.data();
      query.hits = hits_.data();
      tree.Query(query);
      size_t left = 0;
      for (size_t i = 0; i < rays_.size(); ++i) {
        const rb_hit& hit = hits_[i];
        if (hit.prim == RAYBENCH_NONE) continue;
        rb_ray ray = rays_[i];
        const bool comes_after =
            hit.t > ray.tnear || (hit.t == ray.tnear && after_[i] != RAYBENCH_NONE && hit.prim > after_[i]);
        if (hit.prim >= primitives || !comes_after || !(hit.t < kInfinity)) {
          flaw = fmt::format("a ray that resumes at t = {}, primitive {} hits primitive {} of {} at t = {}",
                             ray.tnear, int64_t(int32_t(after_[i])), hit.prim, primitives, hit.t);
          continue;
        }
        see(index_[i], hit.prim);
        ray.tnear = hit.t + epsilon;
        rays_[left] = ray;
        index_[left] = index_[i];
        after_[left++] = epsilon > 0 ? RAYBENCH_NONE : hit.prim;
      }
      rays_.resize(left);
      index_.resize(left);
    }
  }

  std::string flaw;  ///< the last answer that contradicts the contract, in words; its ray was given up

 private:
  std::vector<rb_ray> rays_;
  std::vector<uint32_t> index_, after_;
  std::vector<rb_hit> hits_;
};

/// On which side of the moved line the directed segment a -> b passes; 0 if its line has the same direction.
/// Moving the origin by v adds v . ((a - b) x dir) to the edge function.
int SideOfMoved(const exact::Line& line, Vec3d a, Vec3d b) {
  if (const int side = exact::SideOf(line, a, b)) return side;
  for (int k = 0; k < 3; ++k) {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    const auto moved =
        exact::Difference(a[i], b[i]) * line.dir[j] - exact::Difference(a[j], b[j]) * line.dir[i];
    if (const int side = moved.Sign()) return side;
  }
  return 0;
}

bool IsCrossed(const exact::Line& line, const exact::Corners& p) {
  const int side = SideOfMoved(line, p[0], p[1]);
  return side != 0 && SideOfMoved(line, p[1], p[2]) == side && SideOfMoved(line, p[2], p[0]) == side;
}

class Count {
 public:
  Count(const VerifyOptions& options, const std::string& name) : options_(options), name_(name) {
    LoadOptions load;
    load.seed = options.seed;
    load.drop_bad = options.drop_bad;
    scene_ = LoadWithProgress(name, load);
    const auto refuse = [&](const std::string& why) {
      throw InputError(fmt::format("--crossings: scene '{}' {}", name, why));
    };
    if (scene_.triangles.empty()) refuse("has no triangles");
    if (scene_.procedural_count() > 0) refuse("has procedural primitives; it must be of triangles alone");
    edges_ = MeshEdges(scene_);
    if (const std::string why = WhyNotClosed(scene_, edges_); !why.empty()) refuse("is not closed: " + why);
    truth_.emplace(scene_);
    diagonal_ = Length(ToDouble(scene_.bounds().Extent()));
    step_ = LatticeStep(scene_);
  }

  /// The counts so far are kept when interrupted.
  void Run(const std::vector<Contestant>& contestants) {
    share_ = 1 / double(contestants.size() + 1);
    MakePoints();
    for (size_t i = 0; i < contestants.size() && !Interrupted(); ++i) {
      done_ = double(i + 1) * share_;
      CountWith(contestants[i]);
    }
  }

  void Print() {
    progress_.Clear();
    for (const std::string& note : notes_) fmt::print("{}\n", note);
    if (tallies_.empty()) return;
    Grid grid({"structure", "points", "rule: wrong", "rate", "ns", "after: wrong", "ns", "epsilon: wrong",
               "ns", "vote: wrong", "ns"});
    for (const Tally& tally : tallies_) {
      std::vector<std::string> row = {tally.contestant.Spec(), fmt::format("{}", tally.points)};
      for (size_t way = 0; way < kWays; ++way) {
        const bool is_there = !NeedsAfter(way) || tally.CanAfter();
        row.push_back(is_there ? fmt::format("{}", tally.wrong[way]) : "-");
        if (way == kRule) row.push_back(is_there ? FormatUpperRate(tally.wrong[way], tally.points) : "-");
        row.push_back(is_there ? fmt::format("{:.0f}", NsOf(tally, way)) : "-");
      }
      grid.Add(std::move(row));
    }
    fmt::print("{}", grid.Format(1, 150));
    for (const Tally& tally : tallies_) PrintFindings(tally);
    std::fflush(stdout);
  }

  std::vector<Row> Rows() const {
    std::vector<Row> rows;
    for (const Tally& tally : tallies_) {
      for (size_t way = 0; way < kWays; ++way) {
        if (NeedsAfter(way) && !tally.CanAfter()) continue;
        Row row;
        row[column::scene] = name_;
        row[column::scene_hash] = scene_.hash();
        row[column::primitives] = scene_.primitive_count();
        row[column::structure] = tally.contestant.structure->name;
        row[column::spec] = tally.contestant.Spec();
        row[column::params] = tally.contestant.Params();
        row[column::claim] = ClaimName(tally.claim);
        row[column::seed] = options_.seed;
        row[column::way] = kWayNames[way];
        row[column::held] = !IsBroken(tally);
        row[column::points] = tally.points;
        row[column::wrong] = tally.wrong[way];
        row[column::wrong_upper] = UpperRate(tally.wrong[way], tally.points);
        row[column::ns_per_point] = NsOf(tally, way);
        rows.push_back(std::move(row));
      }
    }
    return rows;
  }

  /// The exit code.
  int Code() const {
    for (const Tally& tally : tallies_)
      if (IsBroken(tally) || !tally.flaw.empty()) return 1;
    return inconclusive_ ? 3 : 0;
  }

 private:
  void MakePoints() {
    points_.resize(options_.crossings);
    const uint64_t batches = (points_.size() + kCrossingBatch - 1) / kCrossingBatch;
    Arena arena(options_.threads);
    std::atomic<uint64_t> on_surface = 0, made = 0;
    ForRounds(
        batches,
        [&](uint64_t b) {
          on_surface += FillCrossingBatch(scene_, edges_, *truth_, options_.seed, b, Batch(b));
          made += Batch(b).size();
          return made.load();
        },
        "places found");
    if (Interrupted()) return;
    std::vector<Vec3f> audited;
    std::vector<Place> places;
    uint64_t inside = 0;
    for (const CrossingPoint& point : points_) {
      inside += point.inside;
      if (audited.size() == kAudited) continue;
      audited.push_back(point.at);
      places.push_back(point.inside ? Place::kInside : Place::kOutside);
    }
    arena.Run([&] { truth_->Audit(audited, places, options_.seed); });
    on_lattice_ = IsOnLattice(scene_);
    notes_.push_back(
        fmt::format("{}: closed, {} triangles; {} points, {:.0f} % of them inside; {} more were on the "
                    "surface; {} audited by integers",
                    name_, scene_.triangles.size(), points_.size(),
                    100 * double(inside) / double(std::max<size_t>(1, points_.size())), on_surface.load(),
                    audited.size()));
    if (!on_lattice_)
      notes_.push_back(
          "  vertices have bits below 2^-51 of the bounds: the rule is proven for numerics=exact only");
  }

  std::span<CrossingPoint> Batch(uint64_t b) {
    const size_t begin = size_t(b * kCrossingBatch);
    return {points_.data() + begin, std::min<size_t>(kCrossingBatch, points_.size() - begin)};
  }

  /// In parallel until all are done or Ctrl-C; `work` returns how many points are done.
  template <class Work>
  void ForRounds(uint64_t batches, const Work& work, const std::string& what) {
    const uint32_t threads = options_.threads != 0 ? options_.threads : AllThreads();
    Arena arena(threads);
    std::atomic<uint64_t> done = 0;
    const uint64_t round = 16 * threads;
    for (uint64_t begin = 0; begin < batches && !Interrupted(); begin += round) {
      arena.Run([&] {
        ParallelFor(begin, std::min(batches, begin + round), [&](uint64_t b) {
          if (!Interrupted()) done = work(b);
        });
      });
      progress_.Update(done_ + share_ * double(begin) / double(batches),
                       fmt::format("{}: {} of {} {}", name_, done.load(), points_.size(), what));
    }
  }

  void CountWith(const Contestant& contestant) {
    const std::string spec = contestant.Spec();
    const auto leave_out = [&](const std::string& why) {
      notes_.push_back(fmt::format("  {}: not counted with: {}", spec, why));
    };
    Tree tree;
    try {
      if (const std::string why = WhyNotTaken(*contestant.structure, scene_); !why.empty())
        throw BuildError(why);
      tree = Tree(contestant, scene_.Geometry(),
                  BuildOptions(options_.threads, options_.seed,
                               NeedsOf(scene_).BuildNeeds() | kCheckedNeeds | RB_NEED_AFTER));
    } catch (const BuildError& error) {
      if (Interrupted()) return;
      leave_out(error.what());
      inconclusive_ = true;
      return;
    } catch (const std::bad_alloc&) {
      leave_out("out of memory");
      inconclusive_ = true;
      return;
    }
    if (tree.Claims() == RB_CLAIM_NOTHING) return leave_out("it claims nothing");
    Tally tally;
    tally.contestant = contestant;
    tally.claim = tree.Claims();
    try {
      CountAll(tree, tally);
    } catch (const QueryError& error) {
      leave_out(error.what());
      inconclusive_ = true;
      return;
    }
    tallies_.push_back(std::move(tally));
  }

  void CountAll(const Tree& tree, Tally& tally) {
    const uint64_t batches = (points_.size() + kCrossingBatch - 1) / kCrossingBatch;
    ForRounds(
        batches,
        [&](uint64_t b) {
          Tally own = CountBatch(tree, tally, b);
          const std::lock_guard lock(mutex_);
          tally.points += own.points;
          for (size_t way = 0; way < kWays; ++way) {
            tally.wrong[way] += own.wrong[way];
            tally.seconds[way] += own.seconds[way];
          }
          if (!own.flaw.empty() && (tally.flaw.empty() || b < tally.flaw_batch)) {
            tally.flaw = own.flaw;
            tally.flaw_batch = b;
          }
          // The first ones, whatever threads found them.
          auto& kept = tally.wrong_points;
          kept.insert(kept.end(), own.wrong_points.begin(), own.wrong_points.end());
          std::sort(kept.begin(), kept.end());
          if (kept.size() > options_.examples) kept.resize(options_.examples);
          return tally.points;
        },
        "points counted with " + tally.contestant.Spec());
    for (size_t index : tally.wrong_points) findings_.push_back(Explain(tree, tally, index));
  }

  Tally CountBatch(const Tree& tree, const Tally& whole, uint64_t batch) {
    const std::span<const CrossingPoint> points = Batch(batch);
    const size_t n = points.size();
    const uint64_t primitives = scene_.primitive_count();
    Tally tally;
    tally.points = n;
    Walker walker;
    std::vector<rb_ray> rays(n);
    std::vector<uint8_t> odd(n);
    // Rays are made before the clock starts.
    const auto run = [&](Way way, float epsilon, const auto& see) {
      std::fill(odd.begin(), odd.end(), uint8_t(0));
      const Stopwatch watch(false);
      walker.Walk(tree, primitives, rays, epsilon, see);
      tally.seconds[way] += TimeOfWork(watch.Elapsed(), IsOnDevice(tree.structure()));
    };
    const auto count_all = [&](uint32_t i, uint32_t) { odd[i] ^= 1; };
    const auto judge = [&](Way way) {
      for (size_t i = 0; i < n; ++i) {
        if ((odd[i] != 0) == points[i].inside) continue;
        ++tally.wrong[way];
        if (way == kRule && tally.wrong_points.size() < options_.examples)
          tally.wrong_points.push_back(size_t(batch * kCrossingBatch) + i);
      }
    };
    if (whole.CanAfter()) {
      std::vector<double> t(n);
      for (size_t i = 0; i < n; ++i) rays[i] = CountingRay(points[i], step_, whole.IsTilted(), t[i]);
      run(kRule, 0, [&](uint32_t i, uint32_t prim) {
        if (truth_->distinct()[prim])
          odd[i] ^= CrossesBehind(exact::Line(rays[i]), CornersOf(scene_, prim), t[i]);
      });
      judge(kRule);
    }
    for (size_t i = 0; i < n; ++i) rays[i] = RayFrom(points[i].at, Axis(points[i]));
    if (whole.CanAfter()) {
      run(kAfter, 0, count_all);
      judge(kAfter);
    }
    const auto epsilon = float(kEpsilon * diagonal_);
    run(kRestart, epsilon, count_all);
    judge(kRestart);

    std::vector<uint8_t> votes(n);
    Random random(options_.seed ^ 0x766f7465, batch);
    for (int turn = 0; turn < 3; ++turn) {
      for (size_t i = 0; i < n; ++i) rays[i] = RayFrom(points[i].at, ToFloat(random.UnitVector()));
      run(kVote, epsilon, count_all);
      for (size_t i = 0; i < n; ++i) votes[i] += odd[i];
    }
    for (size_t i = 0; i < n; ++i) odd[i] = votes[i] >= 2;
    judge(kVote);
    tally.flaw = walker.flaw;
    return tally;
  }

  /// Of a point that is counted wrong: what the tree does not show.
  std::string Explain(const Tree& tree, const Tally& tally, size_t index) {
    const CrossingPoint& point = points_[index];
    std::vector<bool> shown(scene_.triangles.size());
    double t;
    const rb_ray ray = CountingRay(point, step_, tally.IsTilted(), t);
    Walker().Walk(tree, scene_.primitive_count(), std::span(&ray, 1), 0,
                  [&](uint32_t, uint32_t prim) { shown[prim] = true; });
    std::vector<size_t> missing;
    const exact::Line line(ray);
    for (size_t i = 0; i < shown.size(); ++i)
      if (truth_->distinct()[i] && !shown[i] && IsCrossed(line, CornersOf(scene_, i))) missing.push_back(i);
    // In the coordinates of the scene's file.
    const auto in_file = [&](int k) { return std::ldexp(double(point.at[k]), -scene_.scale_exponent); };
    return fmt::format("{}: point {} at ({:a}, {:a}, {:a}) is {}; along {}{} {}", tally.contestant.Spec(),
                       index, in_file(0), in_file(1), in_file(2), point.inside ? "inside" : "outside",
                       point.backward ? '-' : '+', "xyz"[point.axis],
                       missing.empty() ? "it shows all triangles, and so one of them twice"
                                       : fmt::format("it does not show triangle {}", missing[0]));
  }

  /// Watertight arithmetic is bound to what is proven of it.
  bool IsBroken(const Tally& tally) const {
    return tally.wrong[kRule] > 0 &&
           (tally.claim == RB_CLAIM_EXACT || (tally.claim == RB_CLAIM_WATERTIGHT && on_lattice_));
  }

  void PrintFindings(const Tally& tally) const {
    const std::string spec = tally.contestant.Spec();
    if (!tally.CanAfter()) fmt::print("  {}: cannot resume by `after`, so there is no rule for it\n", spec);
    if (IsBroken(tally)) fmt::print("  {} claims {}: BROKEN\n", spec, ClaimName(tally.claim));
    if (!tally.flaw.empty()) fmt::print("  {}: contract BROKEN: {}\n", spec, tally.flaw);
    for (const std::string& finding : findings_)
      if (finding.starts_with(spec + ":")) fmt::print("  {}\n", finding);
  }

  /// Per point, of one thread's time.
  static double NsOf(const Tally& tally, size_t way) {
    return 1e9 * tally.seconds[way] / double(std::max<uint64_t>(1, tally.points));
  }

  const VerifyOptions& options_;
  const std::string name_;
  Scene scene_;
  std::vector<MeshEdge> edges_;
  std::optional<InsideTruth> truth_;
  double diagonal_ = 0, step_ = 0;
  std::vector<CrossingPoint> points_;
  bool on_lattice_ = true, inconclusive_ = false;
  std::vector<Tally> tallies_;
  std::vector<std::string> notes_, findings_;
  std::mutex mutex_;
  Progress progress_;
  double done_ = 0, share_ = 1;  ///< of the scene's work; of it, what is at work
};

void WriteCsv(const std::string& out, const std::vector<Row>& rows) {
  std::string csv = CsvHeader(kCrossingsColumns) + "\n";
  for (const Row& row : rows) csv += row.ToCsv(kCrossingsColumns) + "\n";
  WriteFileAtomically(fs::path(out) / "crossings.csv", csv);
}

/// The bounds that points are drawn in: a little larger than the scene's.
Bounds3 DrawnBounds(const Scene& scene) {
  Bounds3 box = scene.bounds();
  const float margin = LargestExtent(box.lo, box.hi) / 16;
  for (int k = 0; k < 3; ++k) {
    box.lo[k] -= margin;
    box.hi[k] += margin;
  }
  return box;
}

}  // namespace

rb_ray CountingRay(const CrossingPoint& point, double step, bool tilted, double& t) {
  constexpr float kLength = 0x1p20f;
  const double start = std::ldexp(step, 52), sign = point.backward ? -1 : 1;
  rb_ray ray = RayFrom(point.at, {0, 0, 0});
  ray.org[point.axis] = float(-sign * start);
  ray.dir[point.axis] = float(sign) * kLength;
  if (tilted) ray.dir[(point.axis + 1) % 3] = std::numeric_limits<float>::denorm_min();
  t = (start + sign * double(point.at[point.axis])) / kLength;
  return ray;
}

bool CrossesBehind(const exact::Line& line, const exact::Corners& p, double t) {
  return IsCrossed(line, p) && CompareT(line, p, t) > 0;
}

double LatticeStep(const Scene& scene) {
  const Bounds3 box = DrawnBounds(scene);
  float largest = 0;
  for (int k = 0; k < 3; ++k) largest = std::max({largest, std::fabs(box.lo[k]), std::fabs(box.hi[k])});
  return std::ldexp(1.0, std::ilogb(largest) + 1 - 51);
}

bool IsOnLattice(const Scene& scene) {
  const double step = LatticeStep(scene);
  return std::all_of(scene.positions.begin(), scene.positions.end(), [&](Vec3f p) {
    for (int k = 0; k < 3; ++k)
      if (const double multiple = double(p[k]) / step; multiple != std::rint(multiple)) return false;
    return true;
  });
}

uint64_t FillCrossingBatch(const Scene& scene, std::span<const MeshEdge> edges, const InsideTruth& truth,
                           uint64_t seed, uint64_t batch, std::span<CrossingPoint> points) {
  const Bounds3 box = DrawnBounds(scene);
  const double step = LatticeStep(scene);
  Random random(seed, batch);
  const auto snap = [&](double x) { return float(std::rint(x / step) * step); };
  // By up to `most` steps, of an ulp or of the lattice.
  const auto jitter = [&](float x, int64_t most) {
    const double ulp = x != 0 ? std::ldexp(1.0, std::ilogb(x) - 23) : step;
    return snap(x + double(int64_t(random.Below(uint64_t(2 * most + 1))) - most) * std::max(ulp, step));
  };
  const auto vertex = [&] { return scene.positions[edges[random.Below(edges.size())].a]; };
  const auto edge_point = [&] {
    const MeshEdge& edge = edges[random.Below(edges.size())];
    const Vec3d a = ToDouble(scene.positions[edge.a]), b = ToDouble(scene.positions[edge.b]);
    return ToFloat(a + (b - a) * ((random.NextBits() & 1) != 0 ? 0.5 : random.NextDouble()));
  };
  const auto triangle_point = [&] {
    const exact::Corners p = CornersOf(scene, random.Below(scene.triangles.size()));
    double u = random.NextDouble(), v = random.NextDouble();
    if (u + v > 1) {
      u = 1 - u;
      v = 1 - v;
    }
    return ToFloat(p[0] + (p[1] - p[0]) * u + (p[2] - p[0]) * v);
  };

  uint64_t on_surface = 0;
  for (CrossingPoint& point : points) {
    for (;;) {
      const uint64_t bits = random.NextBits();
      point.axis = uint8_t((bits >> 8) % 3);
      point.backward = (bits >> 3 & 1) != 0;
      for (int k = 0; k < 3; ++k)
        point.at[k] = snap(box.lo[k] + random.NextDouble() * (double(box.hi[k]) - box.lo[k]));
      // 0 to 3: uniform.
      const unsigned kind = bits & 7;
      if (kind == 4 || kind == 5) {
        // The line goes through a vertex or a point of an edge, or runs between coordinates of two of them.
        const Vec3f one = kind == 4 ? vertex() : edge_point(), other = (bits >> 4 & 3) != 0 ? one : vertex();
        const int i = (point.axis + 1) % 3, j = (point.axis + 2) % 3;
        point.at[i] = snap(one[i]);
        point.at[j] = snap(other[j]);
        if ((bits >> 6 & 1) != 0) point.at[point.axis] = jitter(vertex()[point.axis], 1);
      } else if (kind >= 6) {
        const Vec3f near = kind == 6 ? vertex() : triangle_point();
        for (int k = 0; k < 3; ++k) point.at[k] = jitter(near[k], kind == 6 ? 3 : 1);
      }
      const Place place = truth.Of(point.at, random);
      point.inside = place == Place::kInside;
      if (place != Place::kOnSurface) break;
      ++on_surface;
    }
  }
  return on_surface;
}

int RunCrossings(const Registry& registry, const VerifyOptions& options) {
  std::vector<Contestant> contestants = EveryArithmetic(registry, options.structures);
  std::vector<std::string> linear;
  if (options.structures.empty()) {
    std::erase_if(contestants, [&](const Contestant& c) {
      if ((c.structure->capabilities & RB_LINEAR) == 0) return false;
      linear.push_back(c.Spec());
      return true;
    });
  }
  std::optional<OneProcessLock> lock;
  if (!options.out.empty()) {
    std::error_code error;
    if (fs::exists(fs::path(options.out) / "crossings.csv", error))
      throw InputError(fmt::format("{}: holds the results of another verification", options.out));
  }
  std::vector<Row> rows;
  int code = 0;
  for (const std::string& name : options.scenes) {
    Count count(options, name);
    if (!options.out.empty() && !lock) {
      std::error_code error;
      fs::create_directories(options.out, error);
      if (error) throw InputError(fmt::format("{}: cannot be made: {}", options.out, error.message()));
      lock.emplace(options.out);
    }
    count.Run(contestants);
    count.Print();
    for (Row& row : count.Rows()) rows.push_back(std::move(row));
    if (lock) WriteCsv(options.out, rows);
    ThrowIfInterrupted();
    const int own = count.Code();
    code = code == 1 || own == 1 ? 1 : std::max(code, own);
  }
  if (!linear.empty())
    fmt::print("left out, since they look at every primitive: {}\n", fmt::join(linear, ", "));
  if (lock) fmt::print("crossings {}\n", (fs::path(options.out) / "crossings.csv").string());
  return code;
}

}  // namespace raybench
