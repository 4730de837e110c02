#include "harness/verify/verify.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <new>
#include <optional>
#include <set>

#include "accel/base/files.h"
#include "datasets/scene/needs.h"
#include "harness/base/json.h"
#include "harness/judge/claim.h"
#include "harness/judge/truth_cache.h"
#include "harness/measure/machine.h"
#include "harness/plan/build_options.h"
#include "harness/plan/plan.h"
#include "harness/rays/aim.h"
#include "harness/rays/ray_sets.h"
#include "harness/results/results.h"
#include "harness/results/run_facts.h"
#include "harness/results/table.h"
#include "harness/terminal/interrupt.h"
#include "harness/terminal/load.h"
#include "harness/terminal/progress.h"
#include "harness/verify/report.h"
#include "tracer/rays/ray_file.h"
#include "tracer/tracer.h"

namespace raybench {
namespace fs = std::filesystem;
namespace {

/// Rays made, asked and judged at a time: what bounds the memory.
constexpr uint64_t kChunk = 1 << 15;
/// Any-hit queries are asked of every fourth ray.
constexpr uint64_t kAnyStride = 4;
/// Primitives that a linear structure (RB_LINEAR) tests per set unless it was named: a second or two in exact
/// arithmetic, and an eighth of that with --all.
constexpr double kLinearBudget = 0x1p25, kLinearBudgetOfAll = 0x1p22;

/// Part of a ray set with its truth.
struct Chunk {
  uint64_t first = 0, step = 1;  ///< ray i is ray first + i step of the set
  RaySet rays;
  std::vector<Truth> truth;
};

/// The rays of which the set's index is a multiple of `stride`.
Chunk Every(const Chunk& chunk, uint64_t stride) {
  Chunk part;
  const uint64_t skip = (stride - chunk.first % stride) % stride;
  part.first = chunk.first + skip;
  part.step = stride;
  for (uint64_t i = skip; i < chunk.rays.rays.size(); i += stride) {
    part.rays.rays.push_back(chunk.rays.rays[i]);
    part.truth.push_back(chunk.truth[i]);
  }
  return part;
}

/// A set as it is judged.
struct Source {
  std::string name;
  uint64_t count = 0;
  uint32_t query = RB_CLOSEST;  ///< RB_ANY: a recorded set that asks nothing else
  std::function<void(uint64_t first, std::span<rb_ray> rays, uint32_t threads)> fill;
};

/// An answer worth a look; `nth` of its badness in its row.
struct Kept {
  int badness;
  uint64_t nth;
  JudgedAnswer example;
};

struct Entrant {
  VerifiedTree result;
  Tree tree;
  uint64_t stride = 1;  ///< more than 1: it gets a part of the rays
  std::vector<Kept> kept;
};

/// What a scene's trees answered: those of a claim apart.
struct SceneSum {
  std::string scene;
  uint64_t primitives = 0;
  double seconds = 0;
  uint64_t trees = 0, without = 0, broken = 0, answers = 0;
  uint64_t watertight = 0, leaks = 0, plain = 0, exact = 0, loose = 0;

  void Add(const VerifiedTree& tree) {
    (tree.skipped.empty() ? trees : without) += 1;
    broken += tree.Broken() ? 1 : 0;
    for (const VerdictRow& row : tree.rows) {
      answers += row.counts.rays;
      if (tree.claim == RB_CLAIM_WATERTIGHT) {
        watertight += row.counts.rays;
        leaks += row.counts.leaks();
        plain += row.counts.plain_errors();
      }
      if (tree.claim == RB_CLAIM_EXACT) {
        exact += row.counts.rays;
        loose += row.counts.rays - row.counts.strict;
      }
    }
  }
  void Add(const SceneSum& s) {
    primitives += s.primitives;
    seconds += s.seconds;
    trees += s.trees;
    without += s.without;
    broken += s.broken;
    answers += s.answers;
    watertight += s.watertight;
    leaks += s.leaks;
    plain += s.plain;
    exact += s.exact;
    loose += s.loose;
  }
  std::vector<std::string> Cells() const {
    std::vector<std::string> row{scene};
    for (uint64_t n : {primitives, trees, without, answers, watertight, leaks, plain, exact, loose, broken})
      row.push_back(std::to_string(n));
    row.push_back(fmt::format("{:.0f}", seconds));
    return row;
  }
};

class Verification {
 public:
  Verification(const Registry& registry, const VerifyOptions& options)
      : registry_(registry), options_(options) {}

  int Go() {
    contestants_ = EveryArithmetic(registry_, options_.structures);
    CheckFamilyNames("--sets", options_.sets, AimedFamilies());
    CheckOut();
    const std::vector<std::string> files = RayFiles(options_.ray_files);
    for (const std::string& file : files) ReadRayFileHeader(file);  // before scenes that take long
    std::set<std::string> seen;
    for (const std::string& name : options_.scenes) {
      if (!seen.insert(name).second) throw InputError(fmt::format("scene '{}' is given twice", name));
      LoadOptions load;
      load.seed = options_.seed;
      load.drop_bad = options_.drop_bad;
      scenes_.push_back(LoadWithProgress(name, load));
      if (scenes_.back().primitive_count() == 0)
        throw InputError(fmt::format("scene '{}' has no primitives", name));
    }
    if (!files.empty()) {
      std::vector<const Scene*> scenes;
      for (const Scene& scene : scenes_) scenes.push_back(&scene);
      replayed_ = ReplayRayFiles(files, scenes, options_.rays);
    }
    MakeOut();
    bool interrupted = false;
    for (scene_index_ = 0; scene_index_ < scenes_.size() && !interrupted; ++scene_index_) {
      const auto start = std::chrono::steady_clock::now();
      try {
        VerifyScene();
      } catch (const std::exception&) {
        if (!Interrupted()) throw;
        interrupted = true;
      }
      Report(std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
    }
    if (!options_.out.empty()) WriteFiles(interrupted);
    if (options_.all) fmt::print("{}\n", SumUp());
    if (interrupted) {
      fmt::print(stderr, "interrupted: the verdicts up to then are above\n");
      return 130;
    }
    return broken_ ? 1 : inconclusive_ ? 3 : 0;
  }

 private:
  const Scene& scene() const { return scenes_[scene_index_]; }
  const std::string& scene_name() const { return options_.scenes[scene_index_]; }

  void CheckOut() const {
    std::error_code error;
    if (!options_.out.empty() && fs::exists(fs::path(options_.out) / "verdicts.csv", error))
      throw InputError(fmt::format("{}: holds the results of another verification", options_.out));
  }

  void MakeOut() {
    if (options_.out.empty()) return;
    std::error_code error;
    fs::create_directories(options_.out, error);
    if (error) throw InputError(fmt::format("{}: cannot be made: {}", options_.out, error.message()));
    lock_.emplace(options_.out);
  }

  void Update(std::string_view what) {
    progress_.Update((double(scene_index_) + done_ / std::max(1.0, work_)) / double(scenes_.size()),
                     fmt::format("{}: {}", scene_name(), what));
  }

  void VerifyScene() {
    entrants_.clear();
    absent_.clear();
    done_ = 0;
    work_ = 1;
    audited_ = 0;
    Update("preparing truth");
    oracle_ = MakeOracle(scene());
    BuildAll();
    ThinLinear();
    const std::vector<Source> sources = SharedSources();
    const uint64_t planes =
        std::count_if(planes_.begin(), planes_.end(), [](const AimedSet& set) { return set.absent.empty(); });
    const uint64_t rays = options_.RaysPerSet();
    done_ = 0;
    work_ = double(planes) * double(rays);
    for (const Source& source : sources) work_ += double(source.count);
    for (Source source : sources) {
      if (replayed_.empty()) source.count = rays;
      std::vector<Entrant*> all;
      for (Entrant& entrant : entrants_)
        if (entrant.tree) all.push_back(&entrant);
      Judge(source, all);
    }
    for (size_t i = 0; i < planes_.size(); ++i) {
      if (planes_[i].absent.empty() && entrants_[i].tree) {
        Judge({planes_[i].name, rays, RB_CLOSEST, planes_[i].fill}, {&entrants_[i]});
      } else if (entrants_[i].tree) {
        entrants_[i].result.notes.push_back(fmt::format("{}: none: {}", planes_[i].name, planes_[i].absent));
      }
    }
  }

  // ---- trees ----

  void BuildAll() {
    const rb_geometry geometry = scene().Geometry();
    const rb_build_options build =
        BuildOptions(options_.threads, options_.seed, NeedsOf(scene()).BuildNeeds() | kCheckedNeeds);
    planes_.clear();
    for (const Contestant& contestant : contestants_) {
      ThrowIfInterrupted();
      Update("building " + contestant.Spec());
      Entrant& entrant = entrants_.emplace_back();
      VerifiedTree& result = entrant.result;
      result.contestant = contestant;
      planes_.push_back({"planes", {}, "not asked for"});
      result.skipped = WhyNotTaken(*contestant.structure, scene());
      if (!result.skipped.empty()) continue;
      try {
        entrant.tree = Tree(contestant, geometry, build);
      } catch (const BuildError& error) {
        result.skipped = error.what();
      } catch (const std::bad_alloc&) {
        result.skipped = "out of memory";
      }
      if (!entrant.tree) {
        ThrowIfInterrupted();
        inconclusive_ = true;
        continue;
      }
      result.claim = entrant.tree.Claims();
      result.statistics = ReadTree(entrant.tree, geometry);
      if (replayed_.empty() && Wanted("planes"))
        planes_.back() = PlanesSet(scene(), entrant.tree, options_.seed);
    }
  }

  // ---- ray sets ----

  bool Wanted(const std::string& name) const {
    return options_.sets.empty() ||
           std::find(options_.sets.begin(), options_.sets.end(), name) != options_.sets.end();
  }

  std::vector<Source> SharedSources() {
    std::vector<Source> sources;
    if (!replayed_.empty()) {
      for (const SourcedSet& s : replayed_[scene_index_]) {
        const auto fill = [&set = s.set](uint64_t first, std::span<rb_ray> rays, uint32_t) {
          std::copy_n(set.rays.begin() + ptrdiff_t(first), rays.size(), rays.begin());
        };
        sources.push_back({s.set.Label(), s.set.rays.size(), s.set.query, fill});
        if (s.set.invalid_rays > 0)
          absent_.push_back(fmt::format("{}: {} of {} rays are invalid (RAYS.md) and became misses",
                                        s.set.Label(), s.set.invalid_rays, s.set.rays.size()));
      }
      return sources;
    }
    ThrowIfInterrupted();
    Update("finding edges");
    edges_ = MeshEdges(scene());
    for (AimedSet& set : SharedSets(scene(), edges_, options_.RaysPerSet(), options_.seed)) {
      if (!Wanted(set.name)) continue;
      if (!set.absent.empty()) {
        absent_.push_back(fmt::format("{}: none: {}", set.name, set.absent));
      } else {
        sources.push_back({set.name, options_.RaysPerSet(), RB_CLOSEST, std::move(set.fill)});
      }
    }
    return sources;
  }

  /// A linear structure that was not named gets a part of the rays.
  void ThinLinear() {
    if (!options_.structures.empty() && options_.structures != std::vector<std::string>{"all"}) return;
    const double tests = double(options_.RaysPerSet()) * double(scene().primitive_count());
    for (Entrant& entrant : entrants_) {
      if ((entrant.result.contestant.structure->capabilities & RB_LINEAR) == 0 || !entrant.tree) continue;
      entrant.stride =
          uint64_t(std::max(1.0, std::ceil(tests / (options_.all ? kLinearBudgetOfAll : kLinearBudget))));
      if (entrant.stride > 1)
        entrant.result.notes.push_back(
            fmt::format("gets one ray of {}, since each is tested against every primitive; when named by "
                        "--structures it gets all",
                        entrant.stride));
    }
  }

  // ---- verdicts ----

  void Judge(const Source& source, const std::vector<Entrant*>& entrants) {
    for (Entrant* entrant : entrants) {
      for (uint32_t query : {RB_CLOSEST, RB_ANY})
        if (query == RB_ANY || source.query == RB_CLOSEST)
          entrant->result.rows.push_back({source.name, query, {}, {}, {}});
    }
    for (uint64_t first = 0; first < source.count; first += kChunk) {
      ThrowIfInterrupted();
      Update(fmt::format("judging {}", source.name));
      Chunk chunk;
      chunk.first = first;
      chunk.rays.rays.resize(std::min(kChunk, source.count - first));
      source.fill(first, chunk.rays.rays, options_.threads);
      chunk.truth = CachedTruth(
          *oracle_, scene(), chunk.rays.rays, options_.threads,
          {[](double) { ThrowIfInterrupted(); }, [&](const std::string& line) { progress_.Say(line); }});
      if (first == 0) audited_ += oracle_->Audit(chunk.rays.rays, chunk.truth, options_.seed, kAuditedRays);
      for (Entrant* entrant : entrants) {
        ThrowIfInterrupted();
        if (!entrant->tree) continue;
        const Chunk part = entrant->stride > 1 ? Every(chunk, entrant->stride) : Chunk();
        const Chunk& own = entrant->stride > 1 ? part : chunk;
        std::vector<VerdictRow>& rows = entrant->result.rows;
        try {
          if (source.query == RB_CLOSEST) Judge(*entrant, rows[rows.size() - 2], own);
          const bool all = options_.any || source.query == RB_ANY;
          Judge(*entrant, rows.back(), all ? own : Every(chunk, kAnyStride * entrant->stride));
        } catch (const QueryError& error) {
          GiveUp(*entrant, error.what());
        }
      }
      done_ += double(chunk.rays.rays.size());
    }
  }

  /// Of a device that ceased to answer. Only what breaks a claim outlives that: of a part of the rays no verdict is told.
  void GiveUp(Entrant& entrant, const std::string& why) {
    entrant.tree = Tree();
    inconclusive_ = true;
    VerifiedTree& result = entrant.result;
    if (result.Broken()) {
      result.notes.push_back("not asked to the end: " + why);
      return;
    }
    result.skipped = why;
    result.rows.clear();
    entrant.kept.clear();
  }

  void Judge(Entrant& entrant, VerdictRow& row, const Chunk& chunk) {
    const std::vector<rb_ray>& rays = chunk.rays.rays;
    if (rays.empty()) return;
    VerifiedTree& result = entrant.result;
    const Question question{row.query, rays};
    const Known known{chunk.truth};
    Answers answers(rays.size());
    const Verdicts verdicts = AskAndJudge(entrant.tree, *oracle_, scene().primitive_count(), question, known,
                                          answers, options_.threads);
    if (result.contract_flaw.empty() && !verdicts.contract_flaw.empty())
      result.contract_flaw =
          fmt::format("{} (of those from {} on, of set {})", verdicts.contract_flaw, chunk.first, row.set);
    const auto in_set = [&](JudgedAnswer answer) {
      answer.set = row.set;
      answer.index = chunk.first + answer.index * chunk.step;
      return answer;
    };
    if (verdicts.breaking && !result.breaking) result.breaking = in_set(*verdicts.breaking);
    row.counts.Add(verdicts.counts);
    for (size_t i = 0; i < rays.size(); ++i) {
      const Judged& judged = verdicts.judged[i];
      if (judged.t_error) row.t_errors.Add(*judged.t_error);
      const int badness = Badness(judged, result.claim);
      if (badness > 2) continue;
      const uint64_t nth = row.bad[badness]++;
      if (nth < options_.examples)
        entrant.kept.push_back(
            {badness, nth, in_set(verdicts.Answer(i, *oracle_, question, known, answers))});
    }
  }

  // ---- results ----

  void Report(double seconds) {
    progress_.Clear();
    const ReplayContext context{scene_name(), options_.seed, options_.plugins, options_.drop_bad,
                                scene().scale_exponent};
    std::string text =
        fmt::format("{}: {} triangles, {} procedural primitives; truth: {}; seed {}; {} rays audited\n",
                    scene_name(), scene().triangles.size(), scene().procedural_count(),
                    oracle_ ? oracle_->Name() : "none", options_.seed, audited_);
    if (const uint64_t left_out = scene().stats.degenerate_triangles + scene().stats.dropped_triangles)
      text += fmt::format(
          "  {} degenerate or bad triangles are left out; primitives are numbered without them\n", left_out);
    for (const std::string& note : absent_) text += fmt::format("  {}\n", note);
    SceneSum sum{scene_name(), scene().primitive_count(), seconds};
    for (Entrant& entrant : entrants_) {
      VerifiedTree& result = entrant.result;
      // The worst first, and of the same badness one of each set before the second of any.
      std::stable_sort(entrant.kept.begin(), entrant.kept.end(), [](const Kept& a, const Kept& b) {
        return std::pair(a.badness, a.nth) < std::pair(b.badness, b.nth);
      });
      for (Kept& kept : entrant.kept)
        if (result.examples.size() < options_.examples) result.examples.push_back(std::move(kept.example));
      if (!options_.all || result.Broken()) text += "\n" + FormatVerified(result, context);
      broken_ |= result.Broken();
      sum.Add(result);
    }
    // Of all scenes only what is broken needs its table; the others are a line in the last one.
    if (!options_.all || sum.broken > 0) fmt::print("{}\n", text);
    if (options_.all)
      progress_.Say(fmt::format("{}: {} answers of {} trees, {} broken, {}", sum.scene, sum.answers,
                                sum.trees, sum.broken, FormatDuration(seconds)));
    sums_.push_back(std::move(sum));
    std::fflush(stdout);
    if (!options_.out.empty()) Keep();
  }

  /// What was run, and what came of it, a line a scene.
  std::string SumUp() const {
    Grid table({"scene", "primitives", "trees", "without", "answers", "of watertight", "leaks",
                "plain errors", "of exact", "not exact", "broken", "s"});
    SceneSum total{"all", 0, 0};
    for (const SceneSum& s : sums_) {
      table.Add(s.Cells());
      total.Add(s);
    }
    table.Add(total.Cells());
    return table.Format(1, 150);
  }

  /// For the files: what outlives the scene's trees.
  void Keep() {
    Json facts = {{"scene", scene_name()}};
    facts.update(FactsOf(scene()));
    facts["oracle"] = oracle_ ? Json(oracle_->Name()) : Json();
    facts["audited"] = audited_;
    facts["notes"] = absent_;
    facts["structures"] = Json::array();
    std::map<std::pair<std::string, uint32_t>, std::pair<std::string, RaySet>> files;
    for (const Entrant& entrant : entrants_) {
      const VerifiedTree& result = entrant.result;
      facts["structures"].push_back(FactsOf(result));
      for (Row& row : VerdictRows(result)) {
        row[column::scene] = scene_name();
        row[column::scene_hash] = scene().hash();
        row[column::primitives] = scene().primitive_count();
        row[column::oracle] = oracle_->Name();
        row[column::seed] = options_.seed;
        rows_.push_back(std::move(row));
      }
      for (const JudgedAnswer& example : result.examples) {
        Json entry = {{"scene", scene_name()}, {"structure", result.contestant.Spec()}};
        entry.update(FactsOf(example, scene().scale_exponent));
        if (HasFileForm(example.ray, scene())) {
          auto [it, is_new] = files.try_emplace({result.contestant.Spec(), example.query});
          auto& [file, set] = it->second;
          if (is_new)
            file = distinct_(fmt::format("{}-{}-{}", FileStem(scene_name()), FileStem(it->first.first),
                                         QueryName(example.query))) +
                   ".rays";
          set.kind = "example";
          set.order = "recorded";
          set.query = example.query;
          set.rays.push_back(example.ray);
          entry["file"] = file;
        } else {
          entry["file"] = nullptr;  // its coordinates in the file's scale are no floats
        }
        examples_.push_back(std::move(entry));
      }
    }
    for (auto& [key, named] : files) {
      auto& [file, set] = named;
      Freeze(set, scene().bounds());
      WriteRayFile(fs::path(options_.out) / file, set, scene(), SoftwareName());
    }
    scene_facts_.push_back(std::move(facts));
  }

  void WriteFiles(bool interrupted) const {
    std::string csv = CsvHeader(kVerdictsColumns) + "\n";
    for (const Row& row : rows_) csv += row.ToCsv(kVerdictsColumns) + "\n";
    const fs::path out(options_.out);
    Json structures = Json::array();
    for (const Contestant& c : contestants_) structures.push_back(FactsOf(c, registry_));
    const Json facts = {{"format", kResultFormat},     {"command_line", options_.command_line},
                        {"interrupted", interrupted},  {"seed", options_.seed},
                        {"plugins", options_.plugins}, {"build", BuildFacts()},
                        {"machine", MachineFacts()},   {"libraries", LibraryFacts()},
                        {"structures", structures},    {"scenes", scene_facts_}};
    WriteFileAtomically(out / "examples.json", Dump(examples_));
    WriteFileAtomically(out / "verify.json", Dump(facts));
    WriteFileAtomically(out / "verdicts.csv", csv);
    fmt::print("verdicts {}\n", (out / "verdicts.csv").string());
    if (!examples_.empty()) fmt::print("examples {}\n", (out / "examples.json").string());
  }

  const Registry& registry_;
  const VerifyOptions& options_;
  Progress progress_;
  std::optional<OneProcessLock> lock_;
  std::vector<Contestant> contestants_;
  std::vector<Scene> scenes_;
  std::vector<std::vector<SourcedSet>> replayed_;  // by scene; empty: sets are made
  size_t scene_index_ = 0;
  double work_ = 1, done_ = 0;  // rays of the scene
  bool broken_ = false, inconclusive_ = false;
  DistinctNames distinct_;
  Json examples_ = Json::array(), scene_facts_ = Json::array();
  std::vector<Row> rows_;
  std::vector<SceneSum> sums_;

  // Of the current scene.
  std::unique_ptr<Oracle> oracle_;
  uint64_t audited_ = 0;  ///< rays of the scene whose truth was derived a second time
  std::vector<MeshEdge> edges_;
  std::vector<Entrant> entrants_;
  std::vector<AimedSet> planes_;  // one an entrant
  std::vector<std::string> absent_;
};

}  // namespace

int RunVerify(const Registry& registry, const VerifyOptions& options) {
  return Verification(registry, options).Go();
}

namespace {

constexpr const char* kItems[] = {"ox", "oy", "oz", "tnear", "dx", "dy", "dz", "tfar"};
constexpr const char* kForm = "--replay: write ox,oy,oz,tnear,dx,dy,dz,tfar";

/// Where the eight numbers begin.
std::array<const char*, 8> ReadNumbers(const std::string& text) {
  std::array<const char*, 8> numbers;
  const char* at = text.c_str();
  for (size_t i = 0; i < 8; ++i) {
    char* end = nullptr;
    std::strtod(numbers[i] = at, &end);
    if (end == at || *end != (i < 7 ? ',' : '\0'))
      throw InputError(fmt::format("{}; {} is not a number there", kForm, kItems[i]));
    at = end + 1;
  }
  return numbers;
}

}  // namespace

int ReplayOneRay(const Registry& registry, const VerifyOptions& options, const std::string& text) {
  ReadNumbers(text);  // refuses bad text at once
  const std::vector<Contestant> contestants = EveryArithmetic(registry, options.structures);
  LoadOptions load;
  load.seed = options.seed;
  load.drop_bad = options.drop_bad;
  const Scene scene = LoadWithProgress(options.scenes.at(0), load);
  const auto [ray, rounded] = ParseRay(text, scene.scale_exponent);
  const auto oracle = MakeOracle(scene);
  const rb_geometry geometry = scene.Geometry();
  const std::vector<Truth> truth = oracle->Ask(std::span(&ray, 1), options.threads);
  const auto in_file = [&](float x) {
    const double value = std::ldexp(double(x), -scene.scale_exponent);
    return double(float(value)) == value ? fmt::format("{}", float(value)) : fmt::format("{}", value);
  };
  fmt::print(
      "{}: {} triangles, {} procedural primitives; truth: {}\nray {}\n  org {} {} {}, dir {} {} {}, "
      "t in ({}, {}]\n",
      options.scenes[0], scene.triangles.size(), scene.procedural_count(), oracle->Name(),
      FormatRay(ray, scene.scale_exponent), in_file(ray.org[0]), in_file(ray.org[1]), in_file(ray.org[2]),
      in_file(ray.dir[0]), in_file(ray.dir[1]), in_file(ray.dir[2]), ray.tnear, ray.tfar);
  if (!rounded.empty()) fmt::print("  {}\n", rounded);
  if (scene.scale_exponent != 0)
    fmt::print(
        "  the scene, and with it the ray, is traced at 2^{} times the size in the file; t is the same\n",
        scene.scale_exponent);
  bool broken = false;
  for (const Contestant& contestant : contestants) {
    ThrowIfInterrupted();
    const Tree tree(contestant, geometry,
                    BuildOptions(options.threads, options.seed, NeedsOf(scene).BuildNeeds() | kCheckedNeeds));
    for (uint32_t query : {RB_CLOSEST, RB_ANY}) {
      const Question question{query, {&ray, 1}};
      const Known known{truth};
      Answers answers(1);
      const Verdicts verdicts =
          AskAndJudge(tree, *oracle, scene.primitive_count(), question, known, answers, 1);
      JudgedAnswer answer = verdicts.Answer(0, *oracle, question, known, answers);
      answer.set = "replay";
      const std::string& flaw = verdicts.contract_flaw;
      const bool breaks = verdicts.breaking || !flaw.empty();
      broken |= breaks;
      fmt::print("{}, claims {}{}\n     {}", contestant.Spec(), ClaimName(tree.Claims()),
                 !flaw.empty() ? ": contract BROKEN: " + flaw
                 : breaks      ? ": BROKEN"
                               : "",
                 FormatExample(answer));
      if (query == RB_CLOSEST && truth[0].hit && !truth[0].coplanar && answer.hit.prim != RAYBENCH_NONE)
        fmt::print("     t is off by {:.3g} ulp\n", ErrorInUlp(answer.hit.t, truth[0].t));
      if (answer.judged.uv_error)
        fmt::print("     u and v are off by {:.3g} of what is allowed\n", *answer.judged.uv_error);
    }
  }
  return broken ? 1 : 0;
}

std::string FormatRay(const rb_ray& ray, int scale_exponent) {
  const auto in_file = [&](float x) { return std::ldexp(double(x), -scale_exponent); };  // exact in double
  return fmt::format("{:a},{:a},{:a},{:a},{:a},{:a},{:a},{:a}", in_file(ray.org[0]), in_file(ray.org[1]),
                     in_file(ray.org[2]), double(ray.tnear), in_file(ray.dir[0]), in_file(ray.dir[1]),
                     in_file(ray.dir[2]), double(ray.tfar));
}

TypedRay ParseRay(const std::string& text, int scale_exponent) {
  float values[8];
  std::string rounded;
  const std::array<const char*, 8> numbers = ReadNumbers(text);
  for (size_t i = 0; i < 8; ++i) {
    const double value = std::strtod(numbers[i], nullptr);
    const int exponent = i == 3 || i == 7 ? 0 : scale_exponent;
    const double exact = std::ldexp(value, exponent);
    values[i] = float(exact);
    if (double(values[i]) != exact && !std::isnan(value)) {
      // A decimal means the float that a file would have there; a scene's scale may take of its bits.
      const float in_file = std::strtof(numbers[i], nullptr);
      values[i] = std::ldexp(in_file, exponent);
      if (std::isinf(values[i]) && !std::isinf(value))
        throw InputError(
            fmt::format("{}; {} = {} is beyond float{}", kForm, kItems[i], value,
                        std::isinf(in_file) ? "" : " at the scale at which the scene is traced"));
      rounded += fmt::format("{}{} = {:a} ({})", rounded.empty() ? "rounded to the nearest float: " : ", ",
                             kItems[i], std::ldexp(double(values[i]), -exponent), in_file);
    }
  }
  const rb_ray ray{
      {values[0], values[1], values[2]}, values[3], {values[4], values[5], values[6]}, values[7]};
  if (!IsValidRay(ray))
    throw InputError(
        fmt::format("{}; all but tfar must be finite, tnear at least 0, and the direction not 0", kForm));
  return {ray, rounded};
}

}  // namespace raybench
