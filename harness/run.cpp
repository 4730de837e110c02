#include "harness/run.h"

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

#include "datasets/fetch.h"
#include "datasets/hash.h"
#include "datasets/scene_facts.h"
#include "datasets/scene_needs.h"
#include "harness/bound_tightness.h"
#include "harness/build_options.h"
#include "harness/check.h"
#include "harness/end_point_overlap.h"
#include "harness/heat_files.h"
#include "harness/interrupt.h"
#include "harness/load.h"
#include "harness/machine.h"
#include "harness/measure.h"
#include "harness/oracle.h"
#include "harness/progress.h"
#include "harness/python.h"
#include "harness/ray_sets.h"
#include "harness/results.h"
#include "harness/run_facts.h"
#include "harness/statistics.h"
#include "harness/table.h"
#include "harness/truth_cache.h"
#include "tracer/image_io.h"
#include "tracer/tracer.h"

namespace raybench {
namespace fs = std::filesystem;
namespace {

/// A sample should last this long; one pass of a full set takes longer and then is the sample.
constexpr double kSampleSeconds = 0.02;
/// A pass longer than this fills the caches in a small part of itself and needs no untimed one before it.
constexpr double kLongPassSeconds = 0.25;
/// What is linear (RB_LINEAR) is left out where one pass would look at more primitives than this, about half
/// a second; in a quick run a quarter of it.
constexpr double kLinearBudget = 0x1p25;

/// Triangles whose overlap with strange nodes is measured.
constexpr uint64_t kTreeSamples = 1 << 14;

/// Pixels across the heat maps of the report.
constexpr uint32_t kHeatSide = 256;

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
};

/// One structure on one scene.
struct Entrant {
  const Contestant* contestant = nullptr;
  std::vector<PlannedCase> cases;         ///< builds first
  Tree tree;                              ///< the one that is judged and timed
  std::map<uint32_t, Json> build_values;  ///< by threads
  std::vector<Json> set_values;           ///< verdict, hits and counters of each set
};

class Run {
 public:
  Run(const Registry& registry, const RunOptions& options) : registry_(registry), options_(options) {}

  int Go() {
    contestants_ = ChooseContestants(registry_, options_.structures);
    InitialiseEngine(options_.benchmark_flags, options_.Repetitions());
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

  void Update(double within_scene, std::string_view what) {
    progress_.Update((double(scene_index_) + within_scene) / double(scenes_.size()),
                     fmt::format("{}: {}", names_[scene_index_], what));
  }

  const Scene& scene() const { return scenes_[scene_index_]; }

  void RunScene() {
    const rb_geometry geometry = scene().Geometry();
    std::vector<PreparedSet> sets = GetRaySets();
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
    if (all_done) return;
    size_t most = 0;
    for (const PreparedSet& s : sets) most = std::max(most, s.set.rays.size());
    Answers answers(most), counted(most);
    for (size_t i = 0; i < entrants.size(); ++i) {
      if (AllDone(entrants[i])) continue;
      Update(0.2 + 0.25 * double(i) / double(entrants.size()), "checking " + entrants[i].contestant->Spec());
      Prepare(entrants[i], geometry, sets, answers, counted);
      ThrowIfInterrupted();
    }
    Time(entrants, geometry, sets, answers);
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
    options.progress = [&](double fraction) { Update(0.06 * fraction, "capturing rays"); };
    options.note = [&](const std::string& line) { Note(line); };
    Capture capture = CaptureRaySets(registry_, scene(), options);
    const std::string image = (results_->path() / "images" / stems_[scene_index_]).string();
    for (const char* extension : {".png", ".exr"})
      WriteImage(capture.image, image + extension, SoftwareName());
    return std::move(capture.sets);
  }

  /// Asks the oracle about a seeded part of each set.
  void Ask(std::vector<PreparedSet>& sets) {
    Update(0.08, "preparing truth");
    oracle_ = MakeOracle(scene());
    uint64_t audited = 0;
    for (size_t i = 0; i < sets.size(); ++i) {
      PreparedSet& s = sets[i];
      s.picks = PickSample(s.set.rays.size(), options_.RaysVerified(), options_.seed, s.set.hash);
      for (uint32_t pick : s.picks) s.picked.push_back(s.set.rays[pick]);
      const auto progress = [&](double fraction) {
        ThrowIfInterrupted();
        Update(0.1 + 0.1 * (double(i) + fraction) / double(sets.size()), "asking for truth");
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
        if (why.empty() && linear && double(key.rays) * double(key.primitives) > budget)
          why = fmt::format("rays x primitives exceeds {:.0f} million tests a pass", budget * 1e-6);
        for (uint32_t threads : QueryThreads()) {
          key.threads = threads;
          plan(key, i, why);
        }
      }
      const auto is_skipped = [](const PlannedCase& c) { return !c.skip.empty(); };
      const auto queries = entrant.cases.begin() + long(BuildThreads().size());
      if (const auto skipped = std::find_if(queries, entrant.cases.end(), is_skipped);
          skipped != entrant.cases.end()) {
        const bool all = std::all_of(queries, entrant.cases.end(), is_skipped);
        // A tree that answers no set gets no verdict, and without a verdict no time either.
        if (all)
          std::for_each(entrant.cases.begin(), queries, [&](PlannedCase& c) { c.skip = skipped->skip; });
        Note(fmt::format("{} is skipped{}: {}", key.spec, all ? "" : " on large ray sets", skipped->skip));
      }
      entrants.push_back(std::move(entrant));
    }
    return entrants;
  }

  bool Done(const PlannedCase& c) const { return results_->Has(c.key.Id()); }
  bool AllDone(const Entrant& e) const {
    return std::all_of(e.cases.begin(), e.cases.end(), [&](const PlannedCase& c) { return Done(c); });
  }

  /// Ends all open cases of a tree without a time.
  void Close(Entrant& entrant, const std::string& status, const std::string& note) {
    for (PlannedCase& c : entrant.cases) {
      if (Done(c)) continue;
      if (!c.skip.empty()) {
        results_->Store(c.key, {{"status", "skipped"}, {"note", c.skip}}, {});
        continue;
      }
      Json values = ValuesOf(entrant, c);
      values["status"] = status;
      values["note"] = note;
      results_->Store(c.key, values, {});
    }
    entrant.tree = Tree();
  }

  // ---- build, verdict, counts ----

  /// Builds the tree that is timed, judges it, counts. Without a tree afterwards, all cases are closed.
  void Prepare(Entrant& entrant, const rb_geometry& geometry, const std::vector<PreparedSet>& sets,
               Answers& answers, Answers& counted) {
    const bool nothing_to_do = std::all_of(entrant.cases.begin(), entrant.cases.end(),
                                           [&](const PlannedCase& c) { return !c.skip.empty() || Done(c); });
    if (nothing_to_do) return Close(entrant, "skipped", "");
    try {
      BuildAll(entrant, geometry);
    } catch (const BuildError& error) {
      ThrowIfInterrupted();
      Note(fmt::format("{} is skipped: {}", entrant.contestant->Spec(), error.what()));
      return Close(entrant, "skipped", error.what());
    } catch (const std::bad_alloc&) {
      Note(fmt::format("{} is skipped: out of memory", entrant.contestant->Spec()));
      return Close(entrant, "skipped", "out of memory");
    }
    std::string flaw;
    if (const auto statistics = ReadTree(entrant.tree, geometry)) {
      flaw = statistics->flaw;
      AddTreeValues(entrant, *statistics,
                    EndPointOverlap(entrant.tree, geometry, kTreeSamples, options_.seed),
                    BoundTightness(entrant.tree, geometry, kTreeSamples, options_.seed));
    }
    entrant.set_values.assign(sets.size(), Json::object());
    for (size_t i = 0; i < sets.size(); ++i) {
      const bool wanted = std::any_of(entrant.cases.begin(), entrant.cases.end(), [&](const PlannedCase& c) {
        return !c.key.IsBuild() && c.set == i && c.skip.empty();
      });
      if (!wanted) continue;
      ThrowIfInterrupted();
      const std::string broken = CheckAnswers(entrant.tree, *oracle_, scene().primitive_count(), sets[i],
                                              entrant.set_values[i], answers, counted);
      if (!broken.empty() && flaw.empty()) flaw = fmt::format("{}: {}", sets[i].set.Label(), broken);
    }
    if (flaw.empty()) return CountPixels(entrant);
    Note(fmt::format("REFUSED: {} - {}", entrant.contestant->Spec(), flaw));
    Close(entrant, "refused", flaw);
  }

  /// What the report's heat maps show. `null` costs no ray anything; where rays are replayed, nobody knows
  /// what camera to look through.
  void CountPixels(const Entrant& entrant) const {
    const rb_structure& structure = *entrant.contestant->structure;
    if (!replayed_.empty() || std::string_view(structure.name) == "null") return;
    const std::string spec = entrant.contestant->Spec(), &stem = stems_[scene_index_];
    HeatFiles files(results_->path() / "heat" / stem, names_[scene_index_], "../../images/" + stem + ".png");
    if (files.Has(spec)) return;
    const bool slow = std::any_of(entrant.cases.begin(), entrant.cases.end(),
                                  [](const PlannedCase& c) { return !c.skip.empty(); });
    const std::string why = slow ? "is too slow for full ray sets" : WhyNotCounted(structure, scene());
    if (!why.empty()) return files.AddNotCounted(spec, why);
    HeatOptions heat;
    heat.width = heat.height = kHeatSide;
    files.Add(spec, CountPerPixel(scene(), entrant.tree, heat));
  }

  void BuildAll(Entrant& entrant, const rb_geometry& geometry) {
    for (uint32_t threads : BuildThreads()) {
      malloc_trim(0);
      const bool has_peak = ResetPeakMemory();
      const uint64_t before = ResidentMemory();
      Seconds seconds;
      Tree tree = TimedBuild(entrant, geometry, threads, seconds);
      const uint64_t peak = PeakMemory();
      Json& values = entrant.build_values[threads];
      values = {{"claim", ClaimName(tree.Claims())}};
      if (has_peak) values["build_peak_bytes"] = peak > before ? peak - before : 0;
      values["cold_ns"] = (threads == 1 ? seconds.cpu : seconds.wall) * 1e9;
      const bool kept = !entrant.tree;
      // Without the promise of the same tree at any thread count, its figures would change from run to run.
      if (kept || (tree.structure().capabilities & RB_DETERMINISTIC) != 0) {
        uint64_t nodes = 0, prims = 0;
        int needs_geometry = 0;
        tree.structure().memory(tree.get(), &nodes, &prims, &needs_geometry);
        values["node_bytes"] = nodes;
        values["prim_bytes"] = prims;
        values["needs_geometry"] = needs_geometry != 0 ? 1 : 0;
      }
      if (kept) entrant.tree = std::move(tree);
    }
  }

  Tree TimedBuild(const Entrant& entrant, const rb_geometry& geometry, uint32_t threads,
                  Seconds& seconds) const {
    rb_build_options build = BuildOptions(threads, options_.seed, build_needs_[scene_index_]);
    build.memory_limit = options_.memory_limit;
    Pinned pinned(threads == 1);
    const Stopwatch watch(/*process=*/true);
    Tree tree(*entrant.contestant, geometry, build);
    seconds = watch.Elapsed();
    return tree;
  }

  static void AddTreeValues(Entrant& entrant, const TreeStatistics& s, std::optional<double> overlap,
                            std::optional<double> tightness) {
    for (auto& [threads, values] : entrant.build_values) {
      if (!values.contains("node_bytes")) continue;
      values["inner_nodes"] = s.inner_nodes;
      values["leaf_nodes"] = s.leaf_nodes;
      values["empty_leaf_nodes"] = s.empty_leaf_nodes;
      values["references"] = s.references;
      values["depth"] = s.depth;
      if (s.sah_cost) values["sah_cost"] = *s.sah_cost;
      if (overlap) values["epo"] = *overlap;
      if (s.leaf_depth) values["leaf_depth"] = *s.leaf_depth;
      if (tightness) values["tightness"] = *tightness;
    }
  }

  /// The columns known before timing.
  Json ValuesOf(const Entrant& entrant, const PlannedCase& c) const {
    Json values = Json::object();
    if (entrant.build_values.empty()) return values;
    if (c.key.IsBuild()) {
      if (const auto own = entrant.build_values.find(c.key.threads); own != entrant.build_values.end())
        return own->second;
      return values;
    }
    // A query case shows the tree it ran on.
    values = entrant.build_values.begin()->second;
    values.erase("build_peak_bytes");
    values.erase("cold_ns");
    if (c.set < entrant.set_values.size()) values.update(entrant.set_values[c.set]);
    return values;
  }

  // ---- times ----

  void Time(std::vector<Entrant>& entrants, const rb_geometry& geometry, const std::vector<PreparedSet>& sets,
            Answers& answers) {
    struct Open {
      Entrant* entrant;
      PlannedCase* planned;
      Json values;
    };
    std::vector<Open> open;
    for (Entrant& entrant : entrants) {
      if (!entrant.tree) continue;
      for (PlannedCase& c : entrant.cases) {
        if (Done(c)) continue;
        if (!c.skip.empty()) {
          results_->Store(c.key, {{"status", "skipped"}, {"note", c.skip}}, {});
        } else {
          open.push_back({&entrant, &c, ValuesOf(entrant, c)});
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
    for (Open& o : open) {
      const Case& key = o.planned->key;
      TimedTask task;
      task.name = fmt::format("{}/{}/{}/{}/{}/threads:{}", key.scene, key.spec, key.ray_set, key.order,
                              key.query, key.threads);
      task.parallel = key.threads > 1;
      if (key.IsBuild()) {
        task.build = [this, &geometry, entrant = o.entrant, threads = key.threads] {
          malloc_trim(0);
          Seconds seconds;
          TimedBuild(*entrant, geometry, threads, seconds);
          return seconds;
        };
      } else {
        task.pass = [&tree = o.entrant->tree, &set = sets[o.planned->set].set, &answers,
                     threads = key.threads] {
          const rb_query query = answers.Ask(set);
          if (threads == 1) {
            tree.Query(query);
          } else {
            QueryParallel(tree, query, threads);
          }
        };
        FirstPasses(task, o.values, key);
      }
      tasks.push_back(std::move(task));
      ThrowIfInterrupted();
      Update(0.45 + 0.1 * double(tasks.size()) / double(open.size()), "first passes");
    }
    const std::vector<Measurement> measured =
        Measure(tasks, [&](double fraction) { Update(0.55 + 0.45 * fraction, "timing"); });
    for (size_t i = 0; i < open.size(); ++i) {
      const Case& key = open[i].planned->key;
      Json& values = open[i].values;
      switch (measured[i].status) {
        case MeasureStatus::kInterrupted:
          break;  // not finished, so no file
        case MeasureStatus::kFilteredOut:
          if (Interrupted()) break;
          values["status"] = "skipped";
          values["note"] = "left out by --benchmark_filter";
          results_->Store(key, values, {});
          break;
        case MeasureStatus::kTimed:
          AddTimes(values, key, measured[i].samples);
          results_->Store(key, values, measured[i].samples);
      }
    }
    ThrowIfInterrupted();
  }

  /// The first pass is recorded, the second discarded; the length of a sample follows from the shorter one.
  static void FirstPasses(TimedTask& task, Json& values, const Case& key) {
    Pinned pinned(!task.parallel);
    const Stopwatch cold(task.parallel);
    task.pass();
    const Seconds first = cold.Elapsed();
    const Stopwatch warm(task.parallel);
    task.pass();
    const double second = warm.Elapsed().wall;
    values["cold_ns"] = (key.threads == 1 ? first.cpu : first.wall) * 1e9 / double(key.rays);
    const double shorter = std::max(1e-7, std::min(first.wall, second));
    task.warm_up = shorter < kLongPassSeconds;
    task.passes = uint64_t(std::max(1.0, std::round(kSampleSeconds / shorter)));
  }

  static void AddTimes(Json& values, const Case& key, const std::vector<Sample>& samples) {
    std::vector<double> times;
    for (const Sample& s : samples) times.push_back(key.threads == 1 ? s.time.cpu : s.time.wall);
    const MedianInterval interval = MedianOf(times);
    const double to_ns = key.IsBuild() ? 1e9 : 1e9 / double(key.rays);
    const uint64_t items = key.IsBuild() ? key.primitives : key.rays;
    values["status"] = "timed";
    values["samples"] = samples.size();
    values["median_ns"] = interval.median * to_ns;
    if (interval.lo) values["lo_ns"] = *interval.lo * to_ns;
    if (interval.hi) values["hi_ns"] = *interval.hi * to_ns;
    if (interval.median > 0) values["rate"] = double(items) / interval.median;
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
      facts["ray_sets"] = ray_set_facts_[i];
      facts["notes"] = scene_notes_[i];
      scenes.push_back(std::move(facts));
    }
    Json structures = Json::array();
    for (const Contestant& c : contestants_) structures.push_back(FactsOf(c, registry_));
    Json run;
    run["format"] = 1;
    run["started"] = started_;
    run["ended"] = finished ? Json(UtcTime("%Y-%m-%dT%H:%M:%SZ")) : Json();
    run["interrupted"] = interrupted;
    run["finished_cases"] = finished_cases;
    run.update(FactsOf(options_));
    run["build_threads"] = BuildThreads();
    run["query_threads"] = QueryThreads();
    run["timing"] = TimingFacts(options_, kSampleSeconds);
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
    const std::vector<Json> cases = results_->Cases();
    WriteRunJson(true, interrupted, cases.size());
    const std::string table = FormatTable(cases);
    fmt::print("{}", table);
    const bool refused = std::any_of(cases.begin(), cases.end(),
                                     [](const Json& c) { return c.at("case").at("status") == "refused"; });
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
    for (const std::string& warning : warnings_) progress_.Say("WARNING: " + warning);
    if (refused) {
      progress_.Say("a structure broke its claim: it got no time (REFUSED above)");
      return 1;
    }
    return inconclusive_ ? 3 : 0;
  }

  const Registry& registry_;
  const RunOptions& options_;
  Progress progress_;
  std::vector<Contestant> contestants_;
  std::vector<Scene> scenes_;
  std::vector<std::string> names_, stems_;  // one per scene, as the six below
  std::vector<Json> scene_notes_, ray_set_facts_, oracles_, needs_;
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
