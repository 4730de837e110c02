#include "harness/run/run.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <malloc.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <new>
#include <set>
#include <system_error>

#include "accel/base/hash.h"
#include "datasets/models/fetch.h"
#include "datasets/scene/facts.h"
#include "datasets/scene/needs.h"
#include "harness/judge/ask.h"
#include "harness/measure/machine.h"
#include "harness/measure/machine_state.h"
#include "harness/measure/measure.h"
#include "harness/plan/build_options.h"
#include "harness/rays/ray_sets.h"
#include "harness/results/python.h"
#include "harness/results/results.h"
#include "harness/results/run_facts.h"
#include "harness/results/table.h"
#include "harness/results/without_effect.h"
#include "harness/run/scene_run.h"
#include "harness/run/schedule.h"
#include "harness/terminal/interrupt.h"
#include "harness/terminal/load.h"
#include "harness/terminal/progress.h"
#include "tracer/camera_rays.h"
#include "tracer/rays/ray_file.h"

namespace raybench {
namespace fs = std::filesystem;
namespace {

/// Rays that are traced beforehand, through camera and anywhere half of them, to learn what a scene costs
/// a structure; and the largest scene on which all are built for that. Larger ones cost more to build than
/// to ask.
constexpr uint64_t kProbeRays = 512, kLargestProbed = 300000;

/// A run on smaller ray sets is over before its probe would have paid.
constexpr uint64_t kProbedFrom = 1 << 14;

/// Seconds that drawing the report takes, more or less.
constexpr double kReportGuess = 12;

/// What building and asking one structure costs.
struct Price {
  double build, ray;  ///< seconds, with all threads and with one
};

class Run {
 public:
  Run(const Registry& registry, const RunOptions& options)
      : registry_(registry),
        options_(options),
        engine_(options.benchmark_flags),
        budget_{options.Budget(), options.Repetitions(),
                options.repetitions != 0 || engine_.min_time().has_value(), options.suite.fewest_samples,
                options.passes},
        memory_(options.memory_limit != 0 ? options.memory_limit : UsableMemory() / 2),
        schedule_(progress_) {}

  int Go() {
    contestants_ = ChooseContestants(registry_, options_.structures);
    InitialiseEngine(engine_);
    // Big blocks come from fresh pages in every build, as in a process that builds once.
    mallopt(M_MMAP_THRESHOLD, 1 << 17);
    mallopt(M_TRIM_THRESHOLD, 1 << 17);
    session_started_ = UtcTime("%Y-%m-%dT%H:%M:%SZ");
    machine_["fingerprint"] = MachineFingerprint();
    bool interrupted = false;
    try {
      CheckFamilyNames("--sets", options_.sets, CapturedFamilies());
      ray_files_ = RayFiles(options_.ray_files);
      for (const std::string& file : ray_files_) ReadRayFileHeader(file);  // before scenes that take long
      if (!options_.again.empty()) earlier_.emplace(options_.again, program_);
      if (earlier_) parts_ = earlier_->parts();
      if (!options_.parts_of.empty()) parts_ = ReadTimedParts(options_.parts_of);
      LoadScenes();
      ReadRayFiles();
      const std::string out =
          options_.out.empty() ? "results/" + UtcTime("%Y-%m-%dT%H-%M-%SZ") : options_.out;
      results_.emplace(out, options_.resume);
      GoOnFromBefore();
      context_.emplace(RunContext{.registry = registry_,
                                  .options = options_,
                                  .engine = engine_,
                                  .budget = budget_,
                                  .memory = memory_,
                                  .contestants = contestants_,
                                  .results = *results_,
                                  .progress = progress_,
                                  .schedule = schedule_,
                                  .replays = !ray_files_.empty(),
                                  .process = process_,
                                  .scenes = scene_count_,
                                  .earlier = earlier_ ? &*earlier_ : nullptr,
                                  .parts = parts_});
      const std::vector<FinishedCase> there = results_->Cases();
      for (SceneRecord& record : scenes_) Recollect(record, there);
      for (size_t i = 0; i < scenes_.size(); ++i) {
        if (!scenes_[i].finished.is_null()) continue;
        if (options_.RaysPerSet() > kProbedFrom && !earlier_) Probe(i);
        Expect(i);
      }
      if (options_.report) schedule_.PlanAtEnd(Work::kReport, kReportGuess);
      WriteRunJson(false);
      for (SceneRecord& record : scenes_) {
        if (!record.finished.is_null()) continue;
        SceneRun scene(*context_, record);
        scene.Prepare();
        WriteRunJson(false);
        scene.Measure();
      }
    } catch (...) {
      // Whatever ends the run, a cancelled build included, the finished cases stay readable.
      interrupted = Interrupted();
      if (!interrupted) {
        if (results_) results_->WriteCsvs();
        throw;
      }
    }
    progress_.Clear();
    if (!interrupted && !context_->LastProcess()) NextProcess();
    return Finish(interrupted);
  }

 private:
  // ---- scenes ----

  void LoadScenes() {
    std::vector<std::string> names;
    for (const std::string& name : options_.scenes)
      if (options_.named_scenes || FetchModel(name)) names.push_back(name);
    if (names.empty())
      throw InputError(fmt::format("suite {}: none of its models can be had", options_.suite.name));
    std::set<std::string> seen;
    DistinctNames distinct;
    scene_count_ = names.size();
    for (size_t index = 0; index < names.size(); ++index) {
      const std::string& name = names[index];
      if (!seen.insert(name).second) throw InputError(fmt::format("scene '{}' is given twice", name));
      const std::string stem = distinct(FileStem(name));
      bool ours = !ray_files_.empty();  // which say themselves what scene they belong to
      for (size_t c = 0; c < contestants_.size(); ++c)
        ours = ours || Owns(options_, index, names.size(), c, contestants_.size());
      if (!ours) continue;
      LoadOptions load;
      load.seed = options_.seed;
      load.drop_bad = options_.drop_bad;
      SceneRecord& record = scenes_.emplace_back();
      record.name = name;
      record.scene = LoadWithProgress(name, load);
      const Scene& scene = record.scene;
      if (scene.primitive_count() == 0) throw InputError(fmt::format("scene '{}' has no primitives", name));
      record.index = index;
      record.stem = stem;
      record.notes = Json(scene.stats.notes);
      const SceneNeeds needs = NeedsOf(scene);
      record.build_needs = needs.BuildNeeds() | kCheckedNeeds;
      record.needs = FactsOf(needs, scene, Examine(scene));
      progress_.Say(fmt::format(
          "{}: {} triangles, {} procedural primitives{}", name, scene.triangles.size(),
          scene.procedural_count(),
          scene.stats.degenerate_triangles == 0
              ? std::string()
              : fmt::format("; {} degenerate triangles left out", scene.stats.degenerate_triangles)));
      for (const std::string& note : scene.stats.notes) progress_.Say(fmt::format("{}: {}", name, note));
    }
    if (scenes_.empty())
      throw InputError(fmt::format("--shard {}/{}: there are only {} pairs of scene and structure",
                                   options_.shard, options_.shards, names.size() * contestants_.size()));
  }

  /// A model of a suite is fetched where it is not there; false: it cannot be had.
  bool FetchModel(const std::string& name) {
    for (const ManifestEntry& entry : Manifest()) {
      if (entry.name != name || IsFetched(entry)) continue;
      try {
        Fetch(entry, [&](const std::string& line) { progress_.Say(line); });
      } catch (const InputError& error) {
        ThrowIfInterrupted();
        // Else shards would not be of the same whole.
        if (options_.shards > 1) throw;
        Warn(fmt::format(
            "the real model '{}' cannot be had, so the run goes on without it and ends inconclusive (3): {}",
            name, error.what()));
        inconclusive_ = true;
        return false;
      }
    }
    return true;
  }

  void Warn(const std::string& text) {
    progress_.Say("WARNING: " + text);
    warnings_.push_back(text);
  }

  /// Before anything is written, so that faults of a file are reported first.
  void ReadRayFiles() {
    if (ray_files_.empty()) return;
    std::vector<const Scene*> scenes;
    for (const SceneRecord& record : scenes_) scenes.push_back(&record.scene);
    std::vector<std::vector<SourcedSet>> sets = ReplayRayFiles(ray_files_, scenes, options_.rays);
    for (size_t i = 0; i < scenes_.size(); ++i) {
      scenes_[i].replayed = std::move(sets[i]);
      if (options_.shuffled) AddShuffledTwins(scenes_[i].replayed, options_.seed, scenes_[i].scene.bounds());
    }
  }

  // ---- going on ----

  /// Which session and process of --processes this is.
  void GoOnFromBefore() {
    before_ = results_->PreviousRun();
    if (before_.is_null()) return;
    const Json build = BuildFacts();
    if (before_.contains("build") && before_.at("build") != build)
      throw InputError(
          fmt::format("{}: begun by {}, and this is {}; results of two builds are kept apart: "
                      "choose another --out",
                      results_->path().string(), BuildName(before_.at("build")), BuildName(build)));
    if (!before_.contains("sessions") || before_.at("sessions").empty()) return;
    const Json& last = before_.at("sessions").back();
    session_ = before_.at("sessions").size();
    process_ = last.value("process", 0u);
    if (last.value("done", false)) ++process_;
    process_ %= options_.processes;
  }

  static std::string BuildName(const Json& build) {
    std::vector<std::string> facts;
    for (const Json& fact : build)
      if (fact.is_string()) facts.push_back(fact.get<std::string>());
    return fmt::format("raybench {}", fmt::join(facts, ", "));
  }

  /// What the samples of a scene, and what is known besides, depend on.
  Json DependsOn(const SceneRecord& record) const {
    Json plugins = Json::array();
    for (const std::string& plugin : options_.plugins) {
      std::error_code error;
      plugins.push_back({plugin, fs::file_size(plugin, error),
                         fs::last_write_time(plugin, error).time_since_epoch().count()});
    }
    Json depends = FactsOf(options_);
    for (const char* key : {"command_line", "plugins", "processes", "shard", "quick", "suite"})
      depends.erase(key);
    depends["heat_pixels"] = options_.suite.heat_pixels;
    depends["tree_samples"] = options_.suite.tree_samples;
    depends["linear_tests"] = options_.suite.linear_tests;
    return {{"build", BuildFacts()},
            {"machine", MachineFingerprint()},
            {"scene", record.scene.hash()},
            {"options", depends},
            {"repetitions", options_.Repetitions()},
            {"budget", options_.Budget()},
            {"passes", options_.passes},
            {"min_time", engine_.min_time().value_or(0)},
            {"plugins", plugins}};
  }

  /// Names the plan of a scene: if it is the same, and all cases are there, nothing is left to do.
  std::string PlanName(const SceneRecord& record) const {
    Hash64 hash;
    hash.Add(std::string_view(Dump(DependsOn(record))));
    hash.Add(std::string_view(Dump(FactsOf(options_).at("shard"))));
    for (const Contestant& c : contestants_) hash.Add(std::string_view(c.Spec() + c.Params()));
    for (const auto& threads : {context_->BuildThreads(), context_->QueryThreads()})
      for (uint32_t t : threads) hash.AddValue(uint64_t{t});
    for (const std::string& set : options_.sets) hash.Add(std::string_view(set));
    hash.AddValue(uint64_t{options_.shuffled});
    hash.Add(std::string_view(engine_.filter()));
    return hash.Hex();
  }

  /// Finds out what earlier sessions know of a scene.
  void Recollect(SceneRecord& record, const std::vector<FinishedCase>& cases) {
    record.recall = std::make_unique<Recall>(results_->path() / "journal" / (record.stem + ".jsonl"),
                                             DependsOn(record), session_, process_);
    const Journal& journal = record.recall->journal();
    if (journal.dropped())
      progress_.Say(
          fmt::format("{}: begun otherwise (machine, options, scene or plugin): unfinished cases are "
                      "measured anew",
                      record.name));
    if (journal.samples() > 0)
      progress_.Say(fmt::format("{}: {} samples are kept", record.name, journal.samples()));
    if (before_.is_null()) return;
    for (const Json& scene : before_.at("scenes")) {
      if (scene.value("scene", "") != record.name || scene.value("hash", "") != record.scene.hash()) continue;
      for (const Json& note : scene.at("notes"))
        if (std::find(record.notes.begin(), record.notes.end(), note) == record.notes.end())
          record.notes.push_back(note);
      const auto there = uint64_t(std::count_if(cases.begin(), cases.end(), [&](const FinishedCase& c) {
        return c.row.Get(column::scene) == record.name &&
               c.row.Get(column::scene_hash) == record.scene.hash();
      }));
      if (context_->replays || there == 0 || there != scene.value("cases", uint64_t{0}) ||
          scene.value("plan", "") != PlanName(record))
        continue;
      record.finished = scene;
      progress_.Say(fmt::format("{}: all {} cases are there already", record.name, there));
    }
  }

  /// Another process of --processes takes over: the same command in a fresh address space.
  [[noreturn]] void NextProcess() {
    WriteRunJson(true);
    progress_.Say(fmt::format("process {} of {} is done", process_ + 1, options_.processes));
    std::vector<std::string> words = options_.command_line;
    if (!options_.resume) words.push_back("--resume");
    if (options_.out.empty()) words.insert(words.end(), {"--out", results_->path().string()});
    std::vector<char*> argv;
    for (std::string& word : words) argv.push_back(word.data());
    argv.push_back(nullptr);
    std::fflush(nullptr);
    execv("/proc/self/exe", argv.data());
    throw InputError(fmt::format("process {} of {} cannot be started: {}", process_ + 2, options_.processes,
                                 std::generic_category().message(errno)));
  }

  // ---- what is left ----

  /// Learns the costs on a scene of all structures that are not linear, so that slow ones are known before
  /// later scenes.
  void Probe(size_t index) {
    SceneRecord& record = scenes_[index];
    const Scene& scene = record.scene;
    if (scene.primitive_count() > kLargestProbed) return;
    std::vector<rb_ray> rays = RandomRays(scene, kProbeRays / 2, options_.seed).rays;
    const uint32_t side = 16;
    const CameraRays camera(scene, side, side);
    for (uint32_t i = 0; i < side * side; ++i) rays.push_back(camera.Through(i % side + 0.5, i / side + 0.5));
    const Question question{RB_CLOSEST, rays};
    Answers answers(rays.size());
    for (const Contestant& contestant : contestants_) {
      const rb_structure& structure = *contestant.structure;
      if (record.recall->HasPrice(contestant.Spec()) || !context_->Owns(record.index, contestant)) continue;
      if (!WhyNotTaken(structure, scene).empty() || (structure.capabilities & RB_LINEAR) != 0) continue;
      ThrowIfInterrupted();
      rb_build_options build = BuildOptions(AllThreads(), options_.seed, record.build_needs);
      build.memory_limit = memory_;
      try {
        const double begin = progress_.Elapsed();
        const Tree tree(contestant, scene.Geometry(), build);
        const double built = progress_.Elapsed();
        Ask(tree, question, answers, 1);
        record.recall->AddPrice(contestant.Spec(), built - begin,
                                (progress_.Elapsed() - built) / double(rays.size()));
      } catch (const BuildError&) {
        ThrowIfInterrupted();        // what cannot be built is skipped, with the reason, when its turn comes
      } catch (const QueryError&) {  // and so is what cannot be asked
      } catch (const std::bad_alloc&) {
      }
    }
  }

  /// The sets that a scene will have, as far as that is known before they are captured.
  double UsualSets(const SceneRecord& record) const {
    if (context_->replays) return double(record.replayed.size());
    const SceneNeeds needs = NeedsOf(record.scene);
    const double sets = 6 + 2.0 * options_.depth * (int(needs.reflection_rays) + int(needs.refraction_rays));
    return options_.sets.empty() ? sets : std::min(sets, double(options_.sets.size()));
  }

  /// Plans all work on a scene. Guesses are those of one machine with two processors, or follow from what a
  /// probe measured; what is measured later corrects them.
  void Expect(size_t index) {
    const auto plan = [&](Work work, const std::string& who, double guess) {
      schedule_.Plan(scenes_[index].index, work, who, guess);
    };
    const Recall& recall = *scenes_[index].recall;
    const double sets = UsualSets(scenes_[index]), rays = double(options_.RaysPerSet());
    const double primitives = double(scenes_[index].scene.primitive_count()), threads = AllThreads();
    const double pixels = double(context_->HeatSide()) * context_->HeatSide();
    const bool judges = !earlier_;
    if (judges && !context_->replays)
      plan(Work::kCapture, "", 2e-6 * primitives + 6e-6 * rays * options_.depth);
    if (judges)
      plan(Work::kTruth, "", 5e-6 * primitives + 30e-6 * double(options_.RaysVerified()) * sets / threads);
    for (const Contestant& contestant : contestants_) {
      const std::string spec = contestant.Spec();
      if (!context_->Owns(scenes_[index].index, contestant)) continue;
      const Price price = recall.HasPrice(spec) ? Price{recall.PriceOfBuild(spec), recall.PriceOfRay(spec)}
                                                : Price{3e-6 * primitives / threads, 1e-6};
      const double cases = sets * double(context_->QueryThreads().size());
      double builds = 0;
      for (uint32_t t : context_->BuildThreads()) {
        const double each = price.build * threads / t;
        plan(Work::kBuild, spec, each);
        builds += each * budget_.Samples(each);
      }
      if (judges) plan(Work::kTree, spec, 3e-6 * primitives);
      plan(Work::kCheck, spec, (2 * price.ray / threads + 0.3e-6) * rays * sets);
      if (judges && !context_->replays) plan(Work::kHeat, spec, (price.ray / threads + 1e-6) * pixels);
      const double least = price.ray * std::min(rays, double(2 * kLeastRays));
      plan(Work::kFirstPasses, spec, cases * (0.1 * budget_.seconds + 2 * least));
      plan(Work::kTiming, spec, cases * std::max(budget_.seconds, 2 * least * budget_.fewest) + builds);
    }
  }

  // ---- files ----

  void WriteRunJson(bool finished, bool interrupted = false, size_t finished_cases = 0) const {
    Json scenes = Json::array();
    for (const SceneRecord& record : scenes_) {
      Json facts = {{"scene", record.name}};
      facts.update(FactsOf(record.scene));
      facts["needs"] = record.needs;
      facts["image"] = context_->replays ? Json() : Json("images/" + record.stem + ".png");
      const Json& known = record.finished;
      facts["oracle"] = known.is_null() ? record.oracle : known.at("oracle");
      facts["anchor"] = known.is_null() ? record.anchor : known.at("anchor");
      facts["ray_sets"] = known.is_null() ? record.ray_sets : known.at("ray_sets");
      facts["notes"] = record.notes;
      facts["cases"] = known.is_null() ? Json(record.cases) : known.at("cases");
      facts["plan"] = PlanName(record);
      scenes.push_back(std::move(facts));
    }
    Json structures = Json::array();
    for (const Contestant& c : contestants_) structures.push_back(FactsOf(c, registry_));
    const std::string now = UtcTime("%Y-%m-%dT%H:%M:%SZ");
    Json sessions = before_.is_null() ? Json::array() : before_.value("sessions", Json::array());
    sessions.push_back({{"started", session_started_},
                        {"ended", finished ? Json(now) : Json()},
                        {"process", process_},
                        {"done", finished && !interrupted},
                        {"machine", MachineFingerprint()},
                        {"command_line", options_.command_line}});
    Json run;
    run["started"] = sessions.front().at("started");
    run["ended"] = finished && context_->LastProcess() ? Json(now) : Json();
    run["interrupted"] = interrupted;
    run["finished_cases"] = finished_cases;
    const auto earlier = [&](const Json& from, const char* key) {
      return from.is_object() ? from.value(key, 0.0) : 0;
    };
    run["seconds"] = earlier(before_, "seconds") + progress_.Elapsed();
    const Json phases = before_.is_object() ? before_.value("phases", Json()) : Json();
    for (Work work = Work::kCapture; work != Work::kReport; work = Work(int(work) + 1))
      run["phases"][WorkName(work)] = earlier(phases, WorkName(work)) + schedule_.Spent(work);
    run.update(FactsOf(options_));
    run["command_line"] = sessions.front().at("command_line");
    run["sessions"] = sessions;
    run["build_threads"] = context_->BuildThreads();
    run["query_threads"] = context_->QueryThreads();
    run["memory_for_trees"] = memory_;
    run["judged_in"] = options_.again.empty() ? Json() : Json(options_.again);
    run["program"] = program_;
    run["timing"] = TimingFacts(options_);
    run["build"] = BuildFacts();
    run["machine"] = machine_;
    run["machine_state"] = FactsOf(state_);
    run["without_effect"] = without_effect_;
    run["libraries"] = libraries_;
    run["structures"] = structures;
    run["scenes"] = scenes;
    run["warnings"] = warnings_;
    results_->WriteRunJson(run);
  }

  uint64_t UnfinishedSamples() const {
    uint64_t samples = 0;
    for (const SceneRecord& record : scenes_)
      if (record.recall) samples += record.recall->journal().samples();
    return samples;
  }

  int Finish(bool interrupted) {
    if (!results_) return 130;  // interrupted while loading: nothing was written
    const std::vector<FinishedCase> cases = results_->WriteCsvs();
    for (const FinishedCase& finished : cases) {
      if (!finished.row.Has(column::anchor)) continue;
      for (SceneRecord& record : scenes_)
        if (record.name == finished.row.Get(column::scene)) record.anchor = finished.row.Get(column::anchor);
    }
    const std::vector<Twins> twins = FindTwins(cases, contestants_);
    without_effect_ = Json::array();
    for (const Twins& t : twins)
      without_effect_.push_back({{"scene", t.scene}, {"a", t.a}, {"b", t.b}, {"parameters", t.parameters}});
    WriteRunJson(true, interrupted, cases.size());
    // Of a scene that was finished, but not forgotten yet, when the run was killed.
    std::error_code error;
    if (!interrupted) fs::remove_all(results_->path() / "journal", error);
    const std::string table = FormatTable(cases);
    fmt::print("{}", table);
    const auto is = [](const char* status) {
      return [status](const FinishedCase& c) { return c.row.Get(column::status) == status; };
    };
    const bool refused = std::any_of(cases.begin(), cases.end(), is("refused"));
    const std::string folder = results_->path().string();
    fmt::print("cases   {}/cases.csv\nsamples {}/samples.csv\n", folder, folder);
    for (const SceneRecord& record : scenes_) {
      const std::string image = fmt::format("{}/images/{}.png", folder, record.stem);
      if (fs::exists(image)) fmt::print("picture {}\n", image);
    }
    std::fflush(stdout);
    if (interrupted) {
      progress_.Say(fmt::format(
          "interrupted: {} finished cases are kept, and {} samples of unfinished scenes; the same command "
          "with --out {} --resume "
          "continues",
          cases.size(), UnfinishedSamples(), folder));
      return 130;
    }
    if (options_.report) {
      DrawReportIfPossible(folder);
    } else {
      fmt::print("report  raybench report {} makes it\n", folder);
    }
    fmt::print("took    {}\n", FormatDuration(progress_.Elapsed()));
    std::fflush(stdout);
    for (const std::string& warning : warnings_) progress_.Say("WARNING: " + warning);
    for (const Twins& t : twins) progress_.Say("NOTE: " + Say(t));
    if (const MachineFinding worst = WorstOf(state_); worst.severity == MachineFinding::kWarning)
      progress_.Say(fmt::format("NOTE: {}: {} (raybench doctor says what to do)", worst.subject, worst.says));
    if (refused) {
      progress_.Say("a structure broke its claim: it got no time (REFUSED above)");
      return 1;
    }
    if (context_->seen > 0 && context_->taken == 0) {
      throw InputError(fmt::format("--benchmark_filter={}: none of the {} cases matches; the last is {}",
                                   engine_.filter(), context_->seen, context_->last_name));
    }
    if (std::none_of(cases.begin(), cases.end(), is("timed"))) {
      progress_.Say("no case got a time: the notes above say why");
      return 3;
    }
    return inconclusive_ ? 3 : 0;
  }

  const Registry& registry_;
  const RunOptions& options_;
  const EngineFlags engine_;
  const TimeBudget budget_;
  const uint64_t memory_;  ///< for trees held at once and one building
  Progress progress_;
  Schedule schedule_;
  std::vector<Contestant> contestants_;
  std::vector<SceneRecord> scenes_;
  std::vector<std::string> ray_files_;
  std::optional<ResultFolder> results_;
  std::optional<RunContext> context_;  ///< since there are results
  std::optional<EarlierRun> earlier_;
  TimedParts parts_;
  std::vector<std::string> warnings_;
  std::string session_started_;
  Json before_;             ///< run.json of the session before; null: this is the first
  size_t scene_count_ = 0;  ///< of all shards
  uint64_t session_ = 0;
  uint32_t process_ = 0;  ///< of --processes
  bool inconclusive_ = false;
  Json without_effect_;  ///< null until all is measured
  const std::vector<MachineFinding> state_ = ExamineMachine();
  Json machine_ = MachineFacts();
  const Json libraries_ = LibraryFacts();
  const std::string program_ = ProgramDigest(options_.plugins);
};

}  // namespace

int RunBenchmark(const Registry& registry, const RunOptions& options) { return Run(registry, options).Go(); }

}  // namespace raybench
