#include "harness/run/run.h"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <malloc.h>

#include <algorithm>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <map>
#include <new>
#include <set>

#include "accel/base/hash.h"
#include "datasets/models/fetch.h"
#include "datasets/scene/facts.h"
#include "datasets/scene/needs.h"
#include "harness/base/json.h"
#include "harness/judge/bound_tightness.h"
#include "harness/judge/check.h"
#include "harness/judge/end_point_overlap.h"
#include "harness/judge/tree_statistics.h"
#include "harness/judge/truth_cache.h"
#include "harness/measure/machine.h"
#include "harness/measure/measure.h"
#include "harness/measure/statistics.h"
#include "harness/plan/build_options.h"
#include "harness/plan/cost_model.h"
#include "harness/plan/time_budget.h"
#include "harness/rays/ray_sets.h"
#include "harness/results/heat_files.h"
#include "harness/results/python.h"
#include "harness/results/results.h"
#include "harness/results/run_facts.h"
#include "harness/results/table.h"
#include "harness/terminal/interrupt.h"
#include "harness/terminal/load.h"
#include "harness/terminal/progress.h"
#include "harness/truth/oracle.h"
#include "tracer/camera_rays.h"
#include "tracer/image_io.h"
#include "tracer/tracer.h"

namespace raybench {
namespace fs = std::filesystem;
namespace {

/// The smallest part of a set that is timed has at least so many rays; with more threads, what gives each of
/// them a few chunks.
constexpr uint64_t kLeastRays = 1024, kLeastChunks = 4 * 4096;
/// A pass that lasts this long says how long a longer one takes.
constexpr double kProbeSeconds = 0.002;
/// Rays that are traced beforehand, through camera and anywhere half of them, to learn what a scene costs a
/// structure; and the largest scene on which all are built for that. Larger ones cost more to build than to
/// ask.
constexpr uint64_t kProbeRays = 512, kLargestProbed = 300000;
/// What is linear (RB_LINEAR) is left out where one pass would look at more primitives than this, about half
/// a second; in a quick run a quarter of it.
constexpr double kLinearBudget = 0x1p25;

/// Triangles whose overlap with strange nodes is measured, and lines that meet bounds; also of a quick run.
constexpr uint64_t kTreeSamples = 1 << 14, kQuickTreeSamples = 1 << 12;

/// Pixels across the heat maps of the report, and of a quick run's.
constexpr uint32_t kHeatSide = 256, kQuickHeatSide = 128;

/// Seconds that drawing the report takes, more or less.
constexpr double kReportGuess = 12;

constexpr const char* kAllInvalid = "all rays of the set are invalid";

std::string UtcTime(const char* format) {
  const std::time_t now = std::time(nullptr);
  std::tm utc;
  gmtime_r(&now, &utc);
  char text[32];
  std::strftime(text, sizeof text, format, &utc);
  return text;
}

struct PlannedCase {
  Case key;
  size_t set = 0;    ///< of the scene's sets; no meaning for a build
  std::string skip;  ///< why it is not measured; empty: it is

  /// What --benchmark_filter sees.
  std::string Name() const {
    return fmt::format("{}/{}/{}/{}/{}/threads:{}", key.scene, key.spec, key.ray_set, key.order, key.query,
                       key.threads);
  }
};

/// One structure on one scene.
struct Entrant {
  const Contestant* contestant = nullptr;
  std::vector<PlannedCase> cases;            ///< builds first
  bool too_slow = false;                     ///< for the larger ray sets, which are skipped
  Tree tree;                                 ///< the one that is judged and timed
  uint64_t tree_bytes = 0;                   ///< of nodes and copied primitives
  uint64_t build_bytes = 0;                  ///< what a building takes, the tree included
  uint64_t build_limit = 0;                  ///< that it was built with
  std::map<uint32_t, double> build_seconds;  ///< by threads
  std::map<uint32_t, Row> build_values;      ///< by threads
  std::vector<Row> set_values;               ///< verdict, hits and counters of each set
};

class Run {
 public:
  Run(const Registry& registry, const RunOptions& options)
      : registry_(registry),
        options_(options),
        engine_(options.benchmark_flags),
        budget_{options.Budget(), options.Repetitions(),
                options.repetitions != 0 || engine_.min_time().has_value(), options.quick ? 1u : 3u},
        memory_(options.memory_limit != 0 ? options.memory_limit : UsableMemory() / 2) {}

  int Go() {
    contestants_ = ChooseContestants(registry_, options_.structures);
    InitialiseEngine(engine_);
    // Big blocks come from fresh pages in every build, as in a process that builds once.
    mallopt(M_MMAP_THRESHOLD, 1 << 17);
    mallopt(M_TRIM_THRESHOLD, 1 << 17);
    started_ = UtcTime("%Y-%m-%dT%H:%M:%SZ");
    bool interrupted = false;
    try {
      CheckSetNames(options_.sets);
      ray_files_ = RayFiles(options_.ray_files);
      for (const std::string& file : ray_files_) ReadRayFileHeader(file);  // before scenes that take long
      LoadScenes();
      ReadRayFiles();
      const std::string out =
          options_.out.empty() ? "results/" + UtcTime("%Y-%m-%dT%H-%M-%SZ") : options_.out;
      results_.emplace(out, options_.resume);
      for (size_t i = 0; i < scenes_.size(); ++i) {
        if (!options_.quick) Probe(i);
        Expect(i, replayed_.empty() ? UsualSets(i) : double(replayed_[i].size()));
      }
      if (options_.report) costs_.Plan(Work::kReport, "", kReportGuess);
      WriteRunJson(false);
      for (scene_index_ = 0; scene_index_ < scenes_.size(); ++scene_index_) RunScene();
    } catch (...) {
      // Whatever ends the run, a cancelled build included, the finished cases stay readable.
      interrupted = Interrupted();
      if (!interrupted) {
        if (results_) results_->WriteCsvs();
        throw;
      }
    }
    progress_.Clear();
    return Finish(interrupted);
  }

 private:
  // ---- scenes ----

  void LoadScenes() {
    std::vector<std::string> names = options_.scenes;
    if (names.empty()) {
      if (FetchDefaultModel()) names.push_back(kDefaultModel);
      names.insert(names.end(), std::begin(kDefaultGenerators), std::end(kDefaultGenerators));
    }
    std::set<std::string> seen;
    DistinctNames distinct;
    for (const std::string& name : names) {
      if (!seen.insert(name).second) throw InputError(fmt::format("scene '{}' is given twice", name));
      LoadOptions load;
      load.seed = options_.seed;
      load.drop_bad = options_.drop_bad;
      scenes_.push_back(LoadWithProgress(name, load));
      const Scene& scene = scenes_.back();
      if (scene.primitive_count() == 0) throw InputError(fmt::format("scene '{}' has no primitives", name));
      names_.push_back(name);
      stems_.push_back(distinct(FileStem(name)));
      scene_notes_.push_back(Json(scene.stats.notes));
      ray_set_facts_.push_back(Json::array());
      oracles_.push_back(nullptr);
      anchors_.push_back(nullptr);
      const SceneNeeds needs = NeedsOf(scene);
      build_needs_.push_back(needs.BuildNeeds() | kCheckedNeeds);
      needs_.push_back(FactsOf(needs, scene, Examine(scene)));
      progress_.Say(fmt::format(
          "{}: {} triangles, {} procedural primitives{}", name, scene.triangles.size(),
          scene.procedural_count(),
          scene.stats.degenerate_triangles == 0
              ? std::string()
              : fmt::format("; {} degenerate triangles left out", scene.stats.degenerate_triangles)));
      for (const std::string& note : scene.stats.notes) progress_.Say(fmt::format("{}: {}", name, note));
    }
  }

  bool FetchDefaultModel() {
    try {
      const ManifestEntry entry = FindManifestEntry(kDefaultModel);
      if (!IsFetched(entry)) Fetch(entry, [&](const std::string& line) { progress_.Say(line); });
      return true;
    } catch (const InputError& error) {
      ThrowIfInterrupted();
      Warn(fmt::format(
          "the real model '{}' cannot be had, so the run goes on without it and ends inconclusive (3): {}",
          kDefaultModel, error.what()));
      inconclusive_ = true;
      return false;
    }
  }

  void Warn(const std::string& text) {
    progress_.Say("WARNING: " + text);
    warnings_.push_back(text);
  }

  /// Says it and keeps it with the scene in run.json.
  void Note(const std::string& text) {
    progress_.Say(fmt::format("{}: {}", names_[scene_index_], text));
    scene_notes_[scene_index_].push_back(text);
  }

  // ---- what is left ----

  /// What building and asking one structure costs.
  struct Price {
    double build, ray;  ///< seconds, with all threads and with one
  };

  /// Learns the prices of a scene for all that are not linear, so that what is slow on a scene to come is
  /// known from the start.
  void Probe(size_t scene) {
    if (scenes_[scene].primitive_count() > kLargestProbed) return;
    std::vector<rb_ray> rays = RandomRays(scenes_[scene], kProbeRays / 2, options_.seed).rays;
    const uint32_t side = 16;
    const CameraRays camera(scenes_[scene], side, side);
    for (uint32_t i = 0; i < side * side; ++i) rays.push_back(camera.Through(i % side + 0.5, i / side + 0.5));
    RaySet set;
    set.rays = std::move(rays);
    Answers answers(set.rays.size());
    for (const Contestant& contestant : contestants_) {
      const rb_structure& structure = *contestant.structure;
      const bool takes =
          scenes_[scene].procedural_count() == 0 || (structure.capabilities & RB_CAN_PROCEDURAL) != 0;
      if (!takes || (structure.capabilities & RB_LINEAR) != 0) continue;
      ThrowIfInterrupted();
      rb_build_options build = BuildOptions(AllThreads(), options_.seed, build_needs_[scene]);
      build.memory_limit = memory_;
      try {
        const double begin = progress_.Elapsed();
        const Tree tree(contestant, scenes_[scene].Geometry(), build);
        const double built = progress_.Elapsed();
        tree.Query(answers.Ask(set));
        prices_[{scene, contestant.Spec()}] = {built - begin,
                                               (progress_.Elapsed() - built) / double(set.rays.size())};
      } catch (const BuildError&) {
        ThrowIfInterrupted();  // what cannot be built is skipped, with the reason, when its turn comes
      } catch (const std::bad_alloc&) {
      }
    }
  }

  /// The sets that a scene will have, as far as that is known before they are captured.
  double UsualSets(size_t scene) const {
    const SceneNeeds needs = NeedsOf(scenes_[scene]);
    const double sets = 6 + 2.0 * options_.depth * (int(needs.reflection_rays) + int(needs.refraction_rays));
    return options_.sets.empty() ? sets : std::min(sets, double(options_.sets.size()));
  }

  /// Plans, or plans again, all work on a scene with so many ray sets. Guesses are those of one machine with
  /// two processors, or follow from what a probe measured; what is measured later corrects them.
  void Expect(size_t scene, double sets) {
    Forget(scene);
    const auto plan = [&](Work work, const std::string& who, double guess) {
      planned_[scene][{work, who}] += guess;
      costs_.Plan(work, LearnsAs(work, who), guess);
    };
    const double primitives = double(scenes_[scene].primitive_count()), rays = double(options_.RaysPerSet());
    const double threads = AllThreads();
    if (replayed_.empty()) plan(Work::kCapture, "", 2e-6 * primitives + 6e-6 * rays * options_.depth);
    plan(Work::kTruth, "", 5e-6 * primitives + 30e-6 * double(options_.RaysVerified()) * sets / threads);
    for (const Contestant& contestant : contestants_) {
      const std::string spec = contestant.Spec();
      const auto probed = prices_.find({scene, spec});
      const Price price = probed != prices_.end() ? probed->second : Price{3e-6 * primitives / threads, 1e-6};
      const double cases = sets * double(QueryThreads().size());
      double builds = 0;
      for (uint32_t t : BuildThreads()) {
        const double each = price.build * threads / t;
        plan(Work::kBuild, spec, each);
        builds += each * budget_.Samples(each);
      }
      plan(Work::kTree, spec, 3e-6 * primitives);
      plan(Work::kCheck, spec, (2 * price.ray / threads + 0.3e-6) * rays * sets);
      if (replayed_.empty()) plan(Work::kHeat, spec, (price.ray / threads + 1e-6) * HeatSide() * HeatSide());
      const double least = price.ray * std::min(rays, double(2 * kLeastRays));
      plan(Work::kFirstPasses, spec, cases * (0.1 * budget_.seconds + 2 * least));
      plan(Work::kTiming, spec, cases * std::max(budget_.seconds, 2 * least * budget_.fewest) + builds);
    }
  }

  /// Timing costs what the budget says, whoever it is.
  static std::string LearnsAs(Work work, const std::string& who) {
    return work == Work::kTiming || work == Work::kFirstPasses ? "" : who;
  }

  /// Takes back what is still planned on a scene, for one structure or all.
  void Forget(size_t scene, const std::string* who = nullptr) {
    std::erase_if(planned_[scene], [&](const auto& entry) {
      const auto& [work, doer] = entry.first;
      if (who != nullptr && doer != *who) return false;
      costs_.Withdraw(work, LearnsAs(work, doer), entry.second);
      return true;
    });
  }

  /// A piece of the work on the current scene begins; the last one has ended.
  void Begin(Work work, std::span<const std::string> who, std::string what) {
    End();
    double guess = 0;
    for (const std::string& doer : who) {
      const auto found = planned_[scene_index_].find({work, doer});
      if (found == planned_[scene_index_].end()) continue;
      guess += found->second;
      planned_[scene_index_].erase(found);
    }
    const std::string learner = who.size() == 1 ? LearnsAs(work, who[0]) : "";
    piece_ = Piece{
        work, learner, std::move(what), guess, costs_.Expect(work, learner, guess), progress_.Elapsed()};
    Update(0);
  }
  void Begin(Work work, const std::string& who, std::string what) {
    Begin(work, std::span(&who, 1), std::move(what));
  }

  void End() {
    if (!piece_) return;
    costs_.Finish(piece_->work, piece_->learner, piece_->guess, progress_.Elapsed() - piece_->begin);
    piece_.reset();
  }

  /// So much of the current piece is done; 0: unknown.
  void Update(double fraction) {
    const double elapsed = progress_.Elapsed() - piece_->begin;
    // Its parts may differ much: what is done says the more, the more it is.
    const double expected = std::max(0.0, piece_->expected - elapsed);
    const double rest = fraction > 0 ? elapsed * (1 - fraction) + (1 - fraction) * expected : expected;
    const double others = costs_.Left() - costs_.Expect(piece_->work, piece_->learner, piece_->guess);
    progress_.UpdateLeft(std::max(0.0, others) + rest,
                         fmt::format("{}: {}", names_[scene_index_], piece_->what));
  }

  const Scene& scene() const { return scenes_[scene_index_]; }

  void RunScene() {
    std::vector<PreparedSet> sets = GetRaySets();
    for (const PreparedSet& s : sets) {
      if (s.set.invalid_rays > 0)
        Note(fmt::format("{}: {} of {} rays are invalid and taken for misses", s.set.Label(),
                         s.set.invalid_rays, s.set.rays.size()));
    }
    std::vector<Entrant> entrants = Plan(sets);
    const bool all_done =
        std::all_of(entrants.begin(), entrants.end(), [&](const Entrant& e) { return AllDone(e); });
    if (all_done) {
      progress_.Say(fmt::format("{}: all {} cases are there already", names_[scene_index_], plan_size_));
    } else {
      Ask(sets);
    }
    RecordSets(sets);
    WriteRunJson(false);
    if (!all_done) {
      size_t most = 0;
      for (const PreparedSet& s : sets) most = std::max(most, s.set.rays.size());
      Answers answers(most), counted(most);
      on_scene_.emplace(OnScene{scene().Geometry(), sets, answers, counted});
      for (Entrant* entrant : AnchorsFirst(entrants)) {
        Enter(*entrant);
        ThrowIfInterrupted();
      }
      TimeGroup();
      on_scene_.reset();
    }
    End();
    Forget(scene_index_);
  }

  /// What can be an anchor first: embree, then what does not look at every primitive, then what answers some
  /// sets at least.
  static std::vector<Entrant*> AnchorsFirst(std::vector<Entrant>& entrants) {
    std::vector<Entrant*> order;
    for (Entrant& entrant : entrants) order.push_back(&entrant);
    const auto place = [](const Entrant* e) {
      const rb_structure& structure = *e->contestant->structure;
      if (e->contestant->Spec() == "embree") return 0;
      return std::string_view(structure.name) == "null"  ? 3
             : (structure.capabilities & RB_LINEAR) != 0 ? 2
                                                         : 1;
    };
    std::stable_sort(order.begin(), order.end(),
                     [&](const Entrant* a, const Entrant* b) { return place(a) < place(b); });
    return order;
  }

  /// Builds, judges and counts one structure and puts it into the group that is timed together. The group
  /// before is timed first, and its trees given back, where there is no room beside it.
  void Enter(Entrant& entrant) {
    OnScene& now = *on_scene_;
    const std::string spec = entrant.contestant->Spec();
    const bool done = AllDone(entrant);
    const bool anchors =
        now.anchor == nullptr && std::string_view(entrant.contestant->structure->name) != "null";
    const bool nothing_to_do = std::all_of(entrant.cases.begin(), entrant.cases.end(),
                                           [&](const PlannedCase& c) { return !c.skip.empty() || Done(c); });
    // On a resumed run, who has its times already can still be the anchor of the others.
    const bool was_timed = std::any_of(entrant.cases.begin(), entrant.cases.end(), [&](const PlannedCase& c) {
      return !c.key.IsBuild() && results_->IsTimed(c.key.Id());
    });
    if (nothing_to_do && !(anchors && was_timed)) {
      if (!done) Close(entrant, "skipped", "");
      Forget(scene_index_, &spec);
      return;
    }
    if (!BuildInGroup(entrant)) return Forget(scene_index_, &spec);
    if (nothing_to_do) {
      now.anchor = &entrant;
      if (!done) StoreSkipped(entrant);
      return Forget(scene_index_, &spec);
    }
    if (!Judge(entrant)) return Forget(scene_index_, &spec);
    if (anchors) now.anchor = &entrant;
    now.group.push_back(&entrant);
  }

  /// Bytes of the trees that are held.
  uint64_t Held() const {
    const OnScene& now = *on_scene_;
    uint64_t bytes = 0;
    for (const Entrant* e : now.group) bytes += e->tree_bytes;
    const bool apart =
        now.anchor != nullptr && std::find(now.group.begin(), now.group.end(), now.anchor) == now.group.end();
    return bytes + (apart ? now.anchor->tree_bytes : 0);
  }

  /// Without a tree afterwards, which is what false says, all cases are closed.
  bool BuildInGroup(Entrant& entrant) {
    OnScene& now = *on_scene_;
    for (;;) {
      std::string why;
      try {
        BuildAll(entrant);
      } catch (const BuildError& error) {
        ThrowIfInterrupted();
        why = error.what();
      } catch (const std::bad_alloc&) {
        why = "out of memory";
      }
      const bool others = std::any_of(now.group.begin(), now.group.end(),
                                      [&](const Entrant* e) { return e != now.anchor && e->tree_bytes > 0; });
      if (why.empty()) {
        // While times are taken, any of them is built again beside all.
        uint64_t most = entrant.build_bytes;
        for (const Entrant* e : now.group) most = std::max(most, e->build_bytes);
        if (!others || Held() + entrant.tree_bytes + most <= memory_) return true;
      }
      entrant.tree = Tree();
      if (others) {
        TimeGroup();
        continue;
      }
      Note(fmt::format("{} is skipped: {}", entrant.contestant->Spec(), why));
      Close(entrant, "skipped", why);
      return false;
    }
  }

  // ---- ray sets ----

  /// Before anything is written: what is wrong with a file is said now.
  void ReadRayFiles() {
    if (options_.ray_files.empty()) return;
    replayed_ = ReplayRayFiles(ray_files_, scenes_, options_.rays);
    if (!options_.shuffled) return;
    for (size_t i = 0; i < scenes_.size(); ++i)
      AddShuffledTwins(replayed_[i], options_.seed, scenes_[i].bounds());
  }

  std::vector<PreparedSet> GetRaySets() {
    std::vector<SourcedSet> sourced =
        replayed_.empty() ? CaptureSets() : std::exchange(replayed_[scene_index_], {});
    std::vector<PreparedSet> sets;
    for (SourcedSet& s : sourced) sets.push_back({std::move(s), {}, {}, {}});
    return sets;
  }

  std::vector<SourcedSet> CaptureSets() {
    CaptureOptions options;
    options.rays = options_.RaysPerSet();
    options.seed = options_.seed;
    options.depth = options_.depth;
    options.shuffled = options_.shuffled;
    options.sets = options_.sets;
    Begin(Work::kCapture, "", "capturing rays");
    options.progress = [&](double fraction) { Update(fraction); };
    options.note = [&](const std::string& line) { Note(line); };
    Capture capture = CaptureRaySets(registry_, scene(), options);
    const std::string image = (results_->path() / "images" / stems_[scene_index_]).string();
    for (const char* extension : {".png", ".exr"})
      WriteImage(capture.image, image + extension, SoftwareName());
    return std::move(capture.sets);
  }

  /// Asks the oracle about a seeded part of each set.
  void Ask(std::vector<PreparedSet>& sets) {
    Begin(Work::kTruth, "", "asking for truth");
    oracle_.reset();  // the last scene's, before there are two
    oracle_ = MakeOracle(scene());
    uint64_t audited = 0;
    for (size_t i = 0; i < sets.size(); ++i) {
      PreparedSet& s = sets[i];
      s.picks = PickSample(s.set.rays.size(), options_.RaysVerified(), options_.seed, s.set.hash);
      for (uint32_t pick : s.picks) s.picked.push_back(s.set.rays[pick]);
      const auto progress = [&](double fraction) {
        ThrowIfInterrupted();
        Update((double(i) + fraction) / double(sets.size()));
      };
      s.truth = CachedTruth(*oracle_, scene(), s.picked, 0,
                            {progress, [&](const std::string& line) { progress_.Say(line); }});
      audited += oracle_->Audit(s.picked, s.truth, options_.seed, kAuditedRays);
    }
    oracles_[scene_index_] = {{"name", oracle_->Name()}, {"exact", oracle_->Exact()}, {"audited", audited}};
  }

  void RecordSets(const std::vector<PreparedSet>& sets) {
    for (const PreparedSet& s : sets) {
      Json facts = FactsOf(s);
      facts["verified"] = s.picks.size();
      ray_set_facts_[scene_index_].push_back(std::move(facts));
    }
  }

  // ---- plan ----

  std::vector<uint32_t> BuildThreads() const {
    if (!options_.threads.empty()) return options_.threads;
    return AllThreads() > 1 ? std::vector<uint32_t>{1, AllThreads()} : std::vector<uint32_t>{1};
  }
  std::vector<uint32_t> QueryThreads() const {
    return options_.threads.empty() ? std::vector<uint32_t>{1} : options_.threads;
  }

  uint32_t HeatSide() const { return options_.quick ? kQuickHeatSide : kHeatSide; }

  std::vector<Entrant> Plan(const std::vector<PreparedSet>& sets) {
    const double budget = options_.quick ? kLinearBudget / 4 : kLinearBudget;
    std::vector<Entrant> entrants;
    plan_size_ = 0;
    for (const Contestant& contestant : contestants_) {
      Entrant entrant;
      entrant.contestant = &contestant;
      Case key;
      key.scene = names_[scene_index_];
      key.scene_hash = scene().hash();
      key.primitives = scene().primitive_count();
      key.structure = contestant.structure->name;
      key.spec = contestant.Spec();
      key.params = contestant.Params();
      key.seed = options_.seed;
      std::string skip;
      if (scene().procedural_count() > 0 && (contestant.structure->capabilities & RB_CAN_PROCEDURAL) == 0) {
        skip = "the scene has procedural primitives and the structure takes triangles only";
      }
      const auto plan = [&](const Case& c, size_t set, const std::string& why) {
        entrant.cases.push_back({c, set, why});
        // Scenes are planned one after the other, and ray sets known only then; so the place is (scene, place
        // within).
        entrant.cases.back().key.plan_index = (uint64_t{scene_index_} << 32) + plan_size_++;
      };
      for (uint32_t threads : BuildThreads()) {
        key.threads = threads;
        plan(key, 0, skip);
      }
      for (size_t i = 0; i < sets.size(); ++i) {
        const RaySet& set = sets[i].set;
        key.ray_set = set.Label(), key.ray_hash = set.hash, key.order = set.order;
        key.query = QueryName(set.query), key.rays = set.rays.size();
        std::string why = skip;
        const bool linear = (contestant.structure->capabilities & RB_LINEAR) != 0;
        if (why.empty() && set.invalid_rays == set.rays.size()) why = kAllInvalid;
        if (why.empty() && linear && double(key.rays) * double(key.primitives) > budget) {
          why = fmt::format("rays x primitives exceeds {:.0f} million tests a pass", budget * 1e-6);
          entrant.too_slow = true;
        }
        for (uint32_t threads : QueryThreads()) {
          key.threads = threads;
          plan(key, i, why);
        }
      }
      const auto is_skipped = [](const PlannedCase& c) { return !c.skip.empty(); };
      const auto queries = entrant.cases.begin() + long(BuildThreads().size());
      const auto tells = [&](const PlannedCase& c) { return is_skipped(c) && c.skip != kAllInvalid; };
      const bool all = std::all_of(queries, entrant.cases.end(), is_skipped);
      auto skipped = std::find_if(queries, entrant.cases.end(), tells);
      if (skipped != entrant.cases.end())
        Note(fmt::format("{} is skipped{}: {}", key.spec, all ? "" : " on large ray sets", skipped->skip));
      // A tree that answers no set gets no verdict, and without a verdict no time either.
      if (all) {
        if (skipped == entrant.cases.end()) skipped = queries;
        std::for_each(entrant.cases.begin(), queries, [&](PlannedCase& c) { c.skip = skipped->skip; });
      }
      entrants.push_back(std::move(entrant));
    }
    return entrants;
  }

  bool Done(const PlannedCase& c) const { return results_->Has(c.key.Id()); }
  bool AllDone(const Entrant& e) const {
    return std::all_of(e.cases.begin(), e.cases.end(), [&](const PlannedCase& c) { return Done(c); });
  }

  void StoreSkipped(const Entrant& entrant) {
    for (const PlannedCase& c : entrant.cases)
      if (!c.skip.empty() && !Done(c)) {
        Row row;
        row[column::status] = "skipped";
        row[column::note] = c.skip;
        results_->Store(c.key, row, {});
      }
  }

  /// Ends all open cases of a tree without a time.
  void Close(Entrant& entrant, const std::string& status, const std::string& note) {
    StoreSkipped(entrant);
    for (PlannedCase& c : entrant.cases) {
      if (Done(c)) continue;
      Row values = ValuesOf(entrant, c);
      values[column::status] = status;
      values[column::note] = note;
      results_->Store(c.key, values, {});
    }
    entrant.tree = Tree();
  }

  // ---- build, verdict, counts ----

  /// Judges and counts. If the tree does not stand, which is what false says, all cases are closed.
  bool Judge(Entrant& entrant) {
    OnScene& now = *on_scene_;
    const std::string spec = entrant.contestant->Spec();
    const std::vector<PreparedSet>& sets = now.sets;
    const rb_geometry& geometry = now.geometry;
    Begin(Work::kTree, spec, "reading " + spec);
    std::string flaw;
    if (const auto statistics = ReadTree(entrant.tree, geometry)) {
      flaw = statistics->flaw;
      const uint64_t samples = options_.quick ? kQuickTreeSamples : kTreeSamples;
      AddTreeValues(entrant, *statistics, EndPointOverlap(entrant.tree, geometry, samples, options_.seed),
                    BoundTightness(entrant.tree, geometry, samples, options_.seed));
    }
    Begin(Work::kCheck, spec, "checking " + spec);
    entrant.set_values.assign(sets.size(), Row());
    for (size_t i = 0; i < sets.size(); ++i) {
      const bool wanted = std::any_of(entrant.cases.begin(), entrant.cases.end(), [&](const PlannedCase& c) {
        return !c.key.IsBuild() && c.set == i && c.skip.empty();
      });
      if (!wanted) continue;
      ThrowIfInterrupted();
      const std::string broken = CheckAnswers(entrant.tree, *oracle_, scene().primitive_count(), sets[i],
                                              entrant.set_values[i], now.answers, now.counted);
      if (!broken.empty() && flaw.empty()) flaw = fmt::format("{}: {}", sets[i].set.Label(), broken);
      Update(double(i + 1) / double(sets.size()));
    }
    if (!flaw.empty()) {
      Note(fmt::format("REFUSED: {} - {}", spec, flaw));
      Close(entrant, "refused", flaw);
      return false;
    }
    Begin(Work::kHeat, spec, "heat map of " + spec);
    CountPixels(entrant);
    return true;
  }

  /// What the report's heat maps show. `null` costs no ray anything; where rays are replayed, nobody knows
  /// what camera to look through.
  void CountPixels(const Entrant& entrant) const {
    const rb_structure& structure = *entrant.contestant->structure;
    if (!replayed_.empty() || std::string_view(structure.name) == "null") return;
    const std::string spec = entrant.contestant->Spec(), &stem = stems_[scene_index_];
    HeatFiles files(results_->path() / "heat" / stem, names_[scene_index_], "../../images/" + stem + ".png");
    if (files.Has(spec)) return;
    const std::string why =
        entrant.too_slow ? "is too slow for full ray sets" : WhyNotCounted(structure, scene());
    if (!why.empty()) return files.AddNotCounted(spec, why);
    HeatOptions heat;
    heat.width = heat.height = HeatSide();
    files.Add(spec, CountPerPixel(scene(), entrant.tree, heat));
  }

  void BuildAll(Entrant& entrant) {
    const std::string spec = entrant.contestant->Spec();
    Begin(Work::kBuild, spec, "building " + spec);
    const uint64_t held = Held();
    entrant.build_limit = memory_ > held ? memory_ - held : 1;
    entrant.build_bytes = 0;
    std::vector<uint32_t> counts = BuildThreads();
    std::reverse(counts.begin(), counts.end());  // the first one's is kept, and never two at once
    for (uint32_t threads : counts) {
      const bool kept = threads == counts.back();
      malloc_trim(0);
      const bool has_peak = ResetPeakMemory();
      const uint64_t before = ResidentMemory();
      Seconds seconds;
      Tree tree = TimedBuild(entrant, threads, seconds);
      const uint64_t peak = PeakMemory();
      Row& values = entrant.build_values[threads];
      values[column::claim] = ClaimName(tree.Claims());
      if (has_peak) values[column::build_peak_bytes] = peak > before ? peak - before : 0;
      values[column::cold_ns] = (threads == 1 ? seconds.cpu : seconds.wall) * 1e9;
      entrant.build_seconds[threads] = seconds.wall;
      uint64_t nodes = 0, prims = 0;
      int needs_geometry = 0;
      tree.structure().memory(tree.get(), &nodes, &prims, &needs_geometry);
      entrant.build_bytes =
          std::max({entrant.build_bytes, nodes + prims, has_peak && peak > before ? peak - before : 0});
      // Without the promise of the same tree at any thread count, its figures would change from run to run.
      if (kept || (tree.structure().capabilities & RB_DETERMINISTIC) != 0) {
        values[column::node_bytes] = nodes;
        values[column::prim_bytes] = prims;
        values[column::needs_geometry] = needs_geometry != 0;
      }
      if (!kept) continue;
      entrant.tree_bytes = nodes + prims;
      entrant.tree = std::move(tree);
    }
  }

  Tree TimedBuild(const Entrant& entrant, uint32_t threads, Seconds& seconds) const {
    rb_build_options build = BuildOptions(threads, options_.seed, build_needs_[scene_index_]);
    build.memory_limit = entrant.build_limit;
    Pinned pinned(threads == 1);
    const Stopwatch watch(/*process=*/true);
    Tree tree(*entrant.contestant, on_scene_->geometry, build);
    seconds = watch.Elapsed();
    return tree;
  }

  static void AddTreeValues(Entrant& entrant, const TreeStatistics& s, std::optional<double> overlap,
                            std::optional<double> tightness) {
    for (auto& [threads, values] : entrant.build_values) {
      if (!values.Has(column::node_bytes)) continue;
      values[column::inner_nodes] = s.inner_nodes;
      values[column::leaf_nodes] = s.leaf_nodes;
      values[column::empty_leaf_nodes] = s.empty_leaf_nodes;
      values[column::references] = s.references;
      values[column::depth] = s.depth;
      values[column::sah_cost] = s.sah_cost;
      values[column::epo] = overlap;
      values[column::leaf_depth] = s.leaf_depth;
      values[column::tightness] = tightness;
    }
  }

  /// The columns known before timing.
  Row ValuesOf(const Entrant& entrant, const PlannedCase& c) const {
    Row values;
    if (entrant.build_values.empty()) return values;
    if (c.key.IsBuild()) {
      if (const auto own = entrant.build_values.find(c.key.threads); own != entrant.build_values.end())
        return own->second;
      return values;
    }
    // A query case shows the tree it ran on.
    values = entrant.build_values.begin()->second;
    values[column::build_peak_bytes] = std::optional<uint64_t>();
    values[column::cold_ns] = std::optional<double>();
    if (c.set < entrant.set_values.size()) values.Take(entrant.set_values[c.set]);
    return values;
  }

  // ---- times ----

  /// Where on the ladder (time_budget.h) a set is timed by so many threads.
  struct Part {
    size_t set = 0;
    uint32_t threads = 1, step = 0;
    auto operator<=>(const Part&) const = default;
  };

  const RaySet& RaysOf(const Part& part) {
    OnScene& now = *on_scene_;
    if (part.step == 0) return now.sets[part.set].set;
    auto& kept = now.parts[{part.set, part.step}];
    if (!kept) kept = std::make_unique<RaySet>(PartOf(now.sets[part.set].set, part.step, options_.seed));
    return *kept;
  }

  uint32_t LastStepOf(size_t set, uint32_t threads) const {
    return LastStep(on_scene_->sets[set].set.rays.size(), threads == 1 ? kLeastRays : threads * kLeastChunks);
  }

  std::function<void()> PassOver(const Tree& tree, const Part& part) {
    return [&tree, &set = RaysOf(part), &answers = on_scene_->answers, threads = part.threads] {
      const rb_query query = answers.Ask(set);
      if (threads == 1) {
        tree.Query(query);
      } else {
        QueryParallel(tree, query, threads);
      }
    };
  }

  static Seconds TimeOf(const std::function<void()>& pass, uint32_t threads) {
    Pinned pinned(threads == 1);
    const Stopwatch watch(threads > 1);
    pass();
    return watch.Elapsed();
  }

  /// The step of the ladder at which a pass of this tree fits into its budget. Tried on the smallest part
  /// and on larger ones only while a pass says nothing yet; the shorter of two passes counts, since what
  /// disturbs only makes them longer.
  uint32_t ChooseStep(const Tree& tree, size_t set, uint32_t threads) {
    const uint32_t last = LastStepOf(set, threads);
    for (Part part{set, threads, last};; --part.step) {
      const std::function<void()> pass = PassOver(tree, part);
      double seconds = TimeOf(pass, threads).wall;
      if (seconds < kLongPassSeconds) seconds = std::min(seconds, TimeOf(pass, threads).wall);
      if (seconds < kProbeSeconds && part.step > 0) continue;
      const double whole = double(on_scene_->sets[set].set.rays.size()) / double(RaysOf(part).rays.size());
      return StepFor(seconds * whole, last, budget_);
    }
  }

  struct Open {
    Entrant* entrant;
    PlannedCase* planned;
    Row values;
    Part part = {};
  };

  TimedTask BuildTask(const Open& open) {
    TimedTask task;
    const uint32_t threads = open.planned->key.threads;
    task.build = [this, entrant = open.entrant, threads] {
      malloc_trim(0);
      Seconds seconds;
      TimedBuild(*entrant, threads, seconds);
      return seconds;
    };
    task.sample_cost = open.entrant->build_seconds.at(threads);
    task.samples = budget_.Samples(task.sample_cost);
    return task;
  }

  /// The length of a sample follows from the shorter of the first two passes. `cold`: the first one.
  TimedTask QueryTask(const Tree& tree, const Part& part, Seconds& cold) {
    TimedTask task;
    task.pass = PassOver(tree, part);
    cold = TimeOf(task.pass, part.threads);
    const double shorter =
        cold.wall < kLongPassSeconds ? std::min(cold.wall, TimeOf(task.pass, part.threads).wall) : cold.wall;
    const SamplePlan plan = PlanSamples(shorter, budget_);
    task.passes = plan.passes, task.warm_up = plan.warm_up, task.samples = plan.samples;
    task.sample_cost = std::max(plan.sample_cost, engine_.min_time().value_or(0));
    return task;
  }

  /// Times all open cases of the group and gives its trees back, but for the anchor's.
  void TimeGroup() {
    OnScene& now = *on_scene_;
    if (now.group.empty()) return;
    std::vector<std::string> specs;
    for (const Entrant* entrant : now.group) specs.push_back(entrant->contestant->Spec());
    Begin(Work::kFirstPasses, specs, "first passes");
    std::vector<Open> open;
    for (Entrant* entrant : now.group) {
      StoreSkipped(*entrant);
      for (PlannedCase& c : entrant->cases)
        if (c.skip.empty() && !Done(c)) {
          Row values = ValuesOf(*entrant, c);
          ++seen_, last_name_ = c.Name();
          if (engine_.Takes(c.Name())) {
            ++taken_;
            open.push_back({entrant, &c, std::move(values)});
          } else {
            values[column::status] = "skipped";
            values[column::note] = "left out by --benchmark_filter";
            results_->Store(c.key, values, {});
          }
        }
    }
    // Neighbours in this order are different trees, so that each finds its nodes out of the caches.
    std::stable_sort(open.begin(), open.end(), [](const Open& a, const Open& b) {
      const auto key = [](const Open& o) {
        return std::tuple(!o.planned->key.IsBuild(), o.planned->set, o.planned->key.threads);
      };
      return key(a) < key(b);
    });
    std::vector<TimedTask> tasks;
    std::map<Part, size_t> anchors;  // the task of the anchor on each part
    for (Open& o : open) {
      const Case& key = o.planned->key;
      if (key.IsBuild()) {
        tasks.push_back(BuildTask(o));
      } else {
        // On a part that both can do, the anchor's time is measured beside every other one.
        o.part = {o.planned->set, key.threads, 0};
        const uint32_t own = ChooseStep(o.entrant->tree, o.part.set, key.threads);
        if (o.entrant == now.anchor) now.anchor_steps[{o.part.set, key.threads}] = own;
        o.part.step = std::max(own, AnchorStep(o.part));
        Seconds cold;
        tasks.push_back(QueryTask(o.entrant->tree, o.part, cold));
        const uint64_t rays = RaysOf(o.part).rays.size();
        o.values[column::cold_ns] = (key.threads == 1 ? cold.cpu : cold.wall) * 1e9 / double(rays);
        o.values[column::timed_rays] = rays;
        if (o.entrant == now.anchor) anchors[o.part] = tasks.size() - 1;
      }
      tasks.back().name = o.planned->Name();
      tasks.back().parallel = key.threads > 1;
      ThrowIfInterrupted();
      Update(double(tasks.size()) / double(open.size()));
    }
    for (const Open& o : open) {
      if (o.planned->key.IsBuild() || !Anchors(o.part) || anchors.contains(o.part)) continue;
      anchors[o.part] = tasks.size();
      Seconds cold;
      tasks.push_back(QueryTask(now.anchor->tree, o.part, cold));
      tasks.back().name =
          fmt::format("anchor of set {}/step {}/threads:{}", o.part.set, o.part.step, o.part.threads);
      tasks.back().parallel = o.part.threads > 1;
      ThrowIfInterrupted();
    }
    double seconds = 0;
    for (const TimedTask& task : tasks) seconds += task.sample_cost * task.samples;
    Begin(Work::kTiming, specs, "timing");
    piece_->expected = seconds;
    const std::vector<Measurement> measured = Measure(tasks, [&](double fraction) { Update(fraction); });
    for (size_t i = 0; i < open.size(); ++i) {
      Open& o = open[i];
      const auto anchor = o.planned->key.IsBuild() ? anchors.end() : anchors.find(o.part);
      const bool has_anchor = anchor != anchors.end();
      if (measured[i].empty() || (has_anchor && measured[anchor->second].empty())) continue;  // interrupted
      AddTimes(o.values, o.planned->key, measured[i]);
      if (has_anchor) {
        o.values[column::anchor] = now.anchor->contestant->Spec();
        o.values[column::anchor_ns] = MedianOf(TimesOf(measured[anchor->second], o.part.threads)).median *
                                      1e9 / double(RaysOf(o.part).rays.size());
      }
      results_->Store(o.planned->key, o.values, measured[i]);
    }
    ThrowIfInterrupted();
    for (Entrant* entrant : now.group)
      if (entrant != now.anchor) entrant->tree = Tree();
    now.group.clear();
  }

  /// Whether the anchor answers this set.
  bool Anchors(const Part& part) const {
    const Entrant* anchor = on_scene_->anchor;
    if (anchor == nullptr) return false;
    return std::any_of(anchor->cases.begin(), anchor->cases.end(), [&](const PlannedCase& c) {
      return !c.key.IsBuild() && c.set == part.set && c.skip.empty();
    });
  }

  /// The anchor's step on this set, 0 where there is no anchor.
  uint32_t AnchorStep(const Part& part) {
    if (!Anchors(part)) return 0;
    auto& steps = on_scene_->anchor_steps;
    const std::pair key(part.set, part.threads);
    if (!steps.contains(key)) steps[key] = ChooseStep(on_scene_->anchor->tree, part.set, part.threads);
    return steps.at(key);
  }

  static std::vector<double> TimesOf(const Measurement& samples, uint32_t threads) {
    std::vector<double> times;
    for (const Sample& s : samples) times.push_back(threads == 1 ? s.time.cpu : s.time.wall);
    return times;
  }

  static void AddTimes(Row& values, const Case& key, const Measurement& samples) {
    const MedianInterval interval = MedianOf(TimesOf(samples, key.threads));
    const uint64_t rays = key.IsBuild() ? 0 : *values.Get(column::timed_rays);
    const double to_ns = key.IsBuild() ? 1e9 : 1e9 / double(rays);
    const uint64_t items = key.IsBuild() ? key.primitives : rays;
    values[column::status] = "timed";
    values[column::samples] = samples.size();
    values[column::median_ns] = interval.median * to_ns;
    if (interval.lo) values[column::lo_ns] = *interval.lo * to_ns;
    if (interval.hi) values[column::hi_ns] = *interval.hi * to_ns;
    if (interval.median > 0) values[column::rate] = double(items) / interval.median;
  }

  // ---- files ----

  void WriteRunJson(bool finished, bool interrupted = false, size_t finished_cases = 0) const {
    Json scenes = Json::array();
    for (size_t i = 0; i < scenes_.size(); ++i) {
      Json facts = {{"scene", names_[i]}};
      facts.update(FactsOf(scenes_[i]));
      facts["needs"] = needs_[i];
      facts["image"] = replayed_.empty() ? Json("images/" + stems_[i] + ".png") : Json();
      facts["oracle"] = oracles_[i];
      facts["anchor"] = anchors_[i];
      facts["ray_sets"] = ray_set_facts_[i];
      facts["notes"] = scene_notes_[i];
      scenes.push_back(std::move(facts));
    }
    Json structures = Json::array();
    for (const Contestant& c : contestants_) structures.push_back(FactsOf(c, registry_));
    Json run;
    run["started"] = started_;
    run["ended"] = finished ? Json(UtcTime("%Y-%m-%dT%H:%M:%SZ")) : Json();
    run["interrupted"] = interrupted;
    run["finished_cases"] = finished_cases;
    run["seconds"] = progress_.Elapsed();
    for (Work work = Work::kCapture; work != Work::kReport; work = Work(int(work) + 1))
      run["phases"][WorkName(work)] = costs_.Spent(work);
    run.update(FactsOf(options_));
    run["build_threads"] = BuildThreads();
    run["query_threads"] = QueryThreads();
    run["memory_for_trees"] = memory_;
    run["timing"] = TimingFacts(options_);
    run["build"] = BuildFacts();
    run["machine"] = machine_;
    run["libraries"] = libraries_;
    run["structures"] = structures;
    run["scenes"] = scenes;
    run["warnings"] = warnings_;
    results_->WriteRunJson(run);
  }

  int Finish(bool interrupted) {
    if (!results_) return 130;  // interrupted while loading: nothing was written
    results_->WriteCsvs();
    const std::vector<FinishedCase> cases = results_->Cases();
    for (const FinishedCase& finished : cases) {
      const auto scene = std::find(names_.begin(), names_.end(), finished.row.Get(column::scene));
      if (scene != names_.end() && finished.row.Has(column::anchor))
        anchors_[size_t(scene - names_.begin())] = finished.row.Get(column::anchor);
    }
    WriteRunJson(true, interrupted, cases.size());
    const std::string table = FormatTable(cases);
    fmt::print("{}", table);
    const auto is = [](const char* status) {
      return [status](const FinishedCase& c) { return c.row.Get(column::status) == status; };
    };
    const bool refused = std::any_of(cases.begin(), cases.end(), is("refused"));
    const std::string folder = results_->path().string();
    fmt::print("cases   {}/cases.csv\nsamples {}/samples.csv\n", folder, folder);
    for (const std::string& stem : stems_) {
      const std::string image = fmt::format("{}/images/{}.png", folder, stem);
      if (fs::exists(image)) fmt::print("picture {}\n", image);
    }
    std::fflush(stdout);
    if (interrupted) {
      progress_.Say(fmt::format(
          "interrupted: {} finished cases are kept; the same command with --out {} --resume goes on",
          cases.size(), folder));
      return 130;
    }
    if (options_.report) {
      DrawReportIfPossible(folder);
    } else {
      fmt::print("plots   raybench report {}\n", folder);
    }
    fmt::print("took    {}\n", FormatDuration(progress_.Elapsed()));
    std::fflush(stdout);
    for (const std::string& warning : warnings_) progress_.Say("WARNING: " + warning);
    if (refused) {
      progress_.Say("a structure broke its claim: it got no time (REFUSED above)");
      return 1;
    }
    if (seen_ > 0 && taken_ == 0) {
      throw InputError(fmt::format("--benchmark_filter={}: none of the {} cases is named so; the last is {}",
                                   engine_.filter(), seen_, last_name_));
    }
    if (std::none_of(cases.begin(), cases.end(), is("timed"))) {
      progress_.Say("no case got a time: the notes above say why");
      return 3;
    }
    return inconclusive_ ? 3 : 0;
  }

  /// What is at work on the current scene.
  struct OnScene {
    rb_geometry geometry;
    const std::vector<PreparedSet>& sets;
    Answers &answers, &counted;
    std::vector<Entrant*> group = {};  ///< whose trees are held to be timed together
    Entrant* anchor = nullptr;         ///< its tree is held to the end
    std::map<std::pair<size_t, uint32_t>, uint32_t> anchor_steps = {};          ///< by set and threads
    std::map<std::pair<size_t, uint32_t>, std::unique_ptr<RaySet>> parts = {};  ///< by set and step
  };
  struct Piece {
    Work work;
    std::string learner, what;
    double guess, expected, begin;  ///< seconds
  };

  const Registry& registry_;
  const RunOptions& options_;
  const EngineFlags engine_;
  const TimeBudget budget_;
  const uint64_t memory_;  ///< for trees held at once and one building
  Progress progress_;
  CostModel costs_;
  std::map<std::pair<size_t, std::string>, Price> prices_;                    ///< by scene and structure
  std::map<size_t, std::map<std::pair<Work, std::string>, double>> planned_;  ///< by scene: guesses
  std::optional<Piece> piece_;
  std::optional<OnScene> on_scene_;
  uint64_t seen_ = 0, taken_ = 0;  ///< cases ready to be timed, and those that the filter let through
  std::string last_name_;
  std::vector<Contestant> contestants_;
  std::vector<Scene> scenes_;
  std::vector<std::string> names_, stems_;  // one per scene, as the seven below
  std::vector<Json> scene_notes_, ray_set_facts_, oracles_, needs_, anchors_;
  std::vector<uint64_t> build_needs_;
  std::vector<std::string> ray_files_;
  std::vector<std::vector<SourcedSet>> replayed_;  // by scene; empty: captured
  size_t scene_index_ = 0;
  uint64_t plan_size_ = 0;
  std::unique_ptr<Oracle> oracle_;  // of the current scene
  std::optional<ResultFolder> results_;
  std::vector<std::string> warnings_;
  std::string started_;
  bool inconclusive_ = false;
  const Json machine_ = MachineFacts(), libraries_ = LibraryFacts();
};

}  // namespace

int RunBenchmark(const Registry& registry, const RunOptions& options) { return Run(registry, options).Go(); }

}  // namespace raybench
