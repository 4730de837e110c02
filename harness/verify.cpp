#include "harness/verify.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <new>
#include <optional>
#include <set>

#include "datasets/scene_needs.h"
#include "harness/build_options.h"
#include "harness/check.h"
#include "harness/interrupt.h"
#include "harness/load.h"
#include "harness/machine.h"
#include "harness/plan.h"
#include "harness/progress.h"
#include "harness/ray_aim.h"
#include "harness/ray_sets.h"
#include "harness/results.h"
#include "harness/run_facts.h"
#include "harness/truth_cache.h"
#include "harness/verify_report.h"
#include "tracer/ray_file.h"
#include "tracer/tracer.h"

namespace raybench {
namespace fs = std::filesystem;
namespace {

/// Rays made, asked and judged at a time: what bounds the memory.
constexpr uint64_t kChunk = 1 << 15;
/// Any-hit queries are asked of every fourth ray.
constexpr uint64_t kAnyStride = 4;
/// Primitives that a linear structure (RB_LINEAR) which nobody named looks at for a set, a fraction of a
/// second.
constexpr double kLinearBudget = 0x1p25;

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
  part.first = chunk.first + skip, part.step = stride;
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
  VerifyExample example;
};

struct Entrant {
  VerifiedTree result;
  Tree tree;
  uint64_t stride = 1;  ///< more than 1: it gets a part of the rays
  std::vector<Kept> kept;
};

class Verification {
 public:
  Verification(const Registry& registry, const VerifyOptions& options)
      : registry_(registry), options_(options) {}

  int Go() {
    contestants_ = EveryArithmetic(registry_, options_.structures);
    CheckAimedSetNames(options_.sets);
    CheckOut();
    const std::vector<std::string> files = RayFiles(options_.ray_files);
    for (const std::string& file : files) ReadRayFileHeader(file);  // before scenes that take long
    std::set<std::string> seen;
    for (const std::string& name : options_.scenes) {
      if (!seen.insert(name).second) throw InputError(fmt::format("scene '{}' is given twice", name));
      LoadOptions load;
      load.seed = options_.seed, load.drop_bad = options_.drop_bad;
      scenes_.push_back(LoadWithProgress(name, load));
      if (scenes_.back().primitive_count() == 0)
        throw InputError(fmt::format("scene '{}' has no primitives", name));
    }
    if (!files.empty()) replayed_ = ReplayRayFiles(files, scenes_, options_.rays);
    MakeOut();
    bool interrupted = false;
    for (scene_index_ = 0; scene_index_ < scenes_.size() && !interrupted; ++scene_index_) {
      try {
        VerifyScene();
      } catch (const std::exception&) {
        if (!Interrupted()) throw;
        interrupted = true;
      }
      Report();
    }
    if (!options_.out.empty()) WriteFiles(interrupted);
    if (interrupted) {
      fmt::print(stderr, "interrupted: what was judged until then stands above\n");
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
    entrants_.clear(), absent_.clear();
    done_ = 0, work_ = 1, audited_ = 0;
    Update("preparing truth");
    oracle_ = MakeOracle(scene());
    BuildAll();
    const std::vector<Source> sources = SharedSources();
    const uint64_t planes =
        std::count_if(planes_.begin(), planes_.end(), [](const AimedSet& set) { return set.absent.empty(); });
    const uint64_t rays = RaysPerSet();
    done_ = 0, work_ = double(planes) * double(rays);
    for (const Source& source : sources) work_ += double(source.count);
    for (Source source : sources) {
      if (replayed_.empty()) source.count = rays;
      std::vector<Entrant*> all;
      for (Entrant& entrant : entrants_)
        if (entrant.tree) all.push_back(&entrant);
      Judge(source, all);
    }
    for (size_t i = 0; i < planes_.size(); ++i) {
      if (planes_[i].absent.empty()) {
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
      if (scene().procedural_count() > 0 && (contestant.structure->capabilities & RB_CAN_PROCEDURAL) == 0) {
        result.skipped = "it takes triangles only, and the scene has procedural primitives";
        continue;
      }
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

  /// As asked for; what is linear gets a part by default.
  uint64_t RaysPerSet() {
    const uint64_t rays = options_.RaysPerSet();
    const double primitives = double(scene().primitive_count());
    for (Entrant& entrant : entrants_) {
      if ((entrant.result.contestant.structure->capabilities & RB_LINEAR) == 0 || !entrant.tree) continue;
      if (!options_.structures.empty()) continue;
      entrant.stride = uint64_t(std::max(1.0, std::ceil(double(rays) * primitives / kLinearBudget)));
      if (entrant.stride > 1)
        entrant.result.notes.push_back(
            fmt::format("gets one ray of {}, since it takes each to every primitive; when named by "
                        "--structures it gets all",
                        entrant.stride));
    }
    return rays;
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
        const Chunk part = entrant->stride > 1 ? Every(chunk, entrant->stride) : Chunk();
        const Chunk& own = entrant->stride > 1 ? part : chunk;
        std::vector<VerdictRow>& rows = entrant->result.rows;
        if (source.query == RB_CLOSEST) Judge(*entrant, rows[rows.size() - 2], own);
        const bool all = options_.any || source.query == RB_ANY;
        Judge(*entrant, rows.back(), all ? own : Every(chunk, kAnyStride * entrant->stride));
      }
      done_ += double(chunk.rays.rays.size());
    }
  }

  void Judge(Entrant& entrant, VerdictRow& row, const Chunk& chunk) {
    const std::vector<rb_ray>& rays = chunk.rays.rays;
    if (rays.empty()) return;
    VerifiedTree& result = entrant.result;
    RaySet set;
    set.query = row.query;
    set.rays = rays;
    Answers answers(rays.size());
    QueryParallel(entrant.tree, answers.Ask(set), options_.threads);
    if (result.contract_flaw.empty()) {
      result.contract_flaw = ContractFlaw(set, answers, scene().primitive_count());
      if (!result.contract_flaw.empty())
        result.contract_flaw += fmt::format(" (of those from {} on, of set {})", chunk.first, row.set);
    }
    std::vector<Verdict> verdicts;
    row.Add(JudgeAll(*oracle_, row.query, rays, chunk.truth, answers.hits, answers.occluded, options_.threads,
                     &verdicts));
    for (size_t i = 0; i < rays.size(); ++i) {
      const Truth& truth = chunk.truth[i];
      if (row.query == RB_CLOSEST && truth.hit && verdicts[i] <= Verdict::kNeighbour)
        row.t_errors.Add(ErrorInUlp(answers.hits[i].t, truth.t));
      const bool loose = result.claim == RB_CLAIM_EXACT && row.query == RB_CLOSEST &&
                         !oracle_->IsStrict(rays[i], truth, answers.hits[i]);
      const int badness = std::min(Badness(verdicts[i], result.claim), loose ? 2 : 3);
      if (badness > 2) continue;
      const uint64_t nth = row.bad[badness]++;
      if (nth >= options_.examples) continue;
      entrant.kept.push_back({badness,
                              nth,
                              {row.set, row.query, chunk.first + i * chunk.step, rays[i], answers.hits[i],
                               answers.occluded[i] != 0, truth, verdicts[i]}});
    }
  }

  // ---- results ----

  void Report() {
    progress_.Clear();
    const ReplayContext context{scene_name(), options_.seed, options_.plugins, options_.drop_bad};
    std::string text =
        fmt::format("{}: {} triangles, {} procedural primitives; truth: {}; seed {}; {} rays audited\n",
                    scene_name(), scene().triangles.size(), scene().procedural_count(),
                    oracle_ ? oracle_->Name() : "none", options_.seed, audited_);
    if (scene().scale_exponent != 0)
      text += fmt::format("  coordinates below are those of the file times 2^{}\n", scene().scale_exponent);
    for (const std::string& note : absent_) text += fmt::format("  {}\n", note);
    for (Entrant& entrant : entrants_) {
      VerifiedTree& result = entrant.result;
      // The worst first, and of the same badness one of each set before the second of any.
      std::stable_sort(entrant.kept.begin(), entrant.kept.end(), [](const Kept& a, const Kept& b) {
        return std::pair(a.badness, a.nth) < std::pair(b.badness, b.nth);
      });
      for (Kept& kept : entrant.kept)
        if (result.examples.size() < options_.examples) result.examples.push_back(std::move(kept.example));
      text += "\n" + FormatVerified(result, context);
      broken_ |= result.Broken();
    }
    fmt::print("{}\n", text);
    std::fflush(stdout);
    if (!options_.out.empty()) Keep();
  }

  /// For the files: what outlives the scene's trees.
  void Keep() {
    Json facts = {{"scene", scene_name()}};
    facts.update(FactsOf(scene()));
    facts["oracle"] = oracle_ ? Json(oracle_->Name()) : Json();
    facts["audited"] = audited_;
    facts["notes"] = absent_;
    facts["structures"] = Json::array();
    std::map<std::pair<std::string, uint32_t>, RaySet> sets;
    for (const Entrant& entrant : entrants_) {
      const VerifiedTree& result = entrant.result;
      facts["structures"].push_back(FactsOf(result));
      for (Json& row : VerdictRows(result)) {
        row["scene"] = scene_name(), row["scene_hash"] = scene().hash();
        row["primitives"] = scene().primitive_count();
        row["oracle"] = oracle_->Name(), row["seed"] = options_.seed;
        rows_.push_back(std::move(row));
      }
      for (const VerifyExample& example : result.examples) {
        Json entry = {{"scene", scene_name()}, {"structure", result.contestant.Spec()}};
        entry.update(FactsOf(example));
        examples_.push_back(std::move(entry));
        RaySet& set = sets[{result.contestant.Spec(), example.query}];
        set.kind = "example", set.order = "recorded", set.query = example.query;
        set.rays.push_back(example.ray);
      }
    }
    for (auto& [key, set] : sets) {
      Freeze(set, scene().bounds());
      WriteRayFile(fs::path(options_.out) / fmt::format("{}-{}-{}.rays", FileStem(scene_name()),
                                                        FileStem(key.first), QueryName(key.second)),
                   set, scene(), SoftwareName());
    }
    scene_facts_.push_back(std::move(facts));
  }

  void WriteFiles(bool interrupted) const {
    const std::vector<std::string> columns = VerdictColumns();
    std::string csv = fmt::format("{}\n", fmt::join(columns, ","));
    for (const Json& row : rows_) {
      std::vector<std::string> fields;
      for (const std::string& column : columns)
        fields.push_back(row.contains(column) ? CsvField(row.at(column)) : std::string());
      csv += fmt::format("{}\n", fmt::join(fields, ","));
    }
    const fs::path out(options_.out);
    Json structures = Json::array();
    for (const Contestant& c : contestants_) structures.push_back(FactsOf(c, registry_));
    const Json facts = {{"format", 1},
                        {"command_line", options_.command_line},
                        {"interrupted", interrupted},
                        {"seed", options_.seed},
                        {"plugins", options_.plugins},
                        {"build", BuildFacts()},
                        {"machine", MachineFacts()},
                        {"libraries", LibraryFacts()},
                        {"structures", structures},
                        {"scenes", scene_facts_}};
    const auto dump = [](const Json& json) {
      return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
    };
    WriteFileAtomically(out / "examples.json", dump(examples_));
    WriteFileAtomically(out / "verify.json", dump(facts));
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
  Json examples_ = Json::array(), scene_facts_ = Json::array();
  std::vector<Json> rows_;

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

int ReplayOneRay(const Registry& registry, const VerifyOptions& options, const rb_ray& ray) {
  const std::vector<Contestant> contestants = EveryArithmetic(registry, options.structures);
  LoadOptions load;
  load.seed = options.seed, load.drop_bad = options.drop_bad;
  const Scene scene = LoadWithProgress(options.scenes.at(0), load);
  const auto oracle = MakeOracle(scene);
  const rb_geometry geometry = scene.Geometry();
  const std::vector<Truth> truth = oracle->Ask(std::span(&ray, 1), options.threads);
  fmt::print(
      "{}: {} triangles, {} procedural primitives; truth: {}\nray {}\n  org {} {} {}, dir {} {} {}, "
      "t in ({}, {}]\n",
      options.scenes[0], scene.triangles.size(), scene.procedural_count(), oracle->Name(), FormatRay(ray),
      ray.org[0], ray.org[1], ray.org[2], ray.dir[0], ray.dir[1], ray.dir[2], ray.tnear, ray.tfar);
  bool broken = false;
  for (const Contestant& contestant : contestants) {
    ThrowIfInterrupted();
    const Tree tree(contestant, geometry,
                    BuildOptions(options.threads, options.seed, NeedsOf(scene).BuildNeeds() | kCheckedNeeds));
    for (uint32_t query : {RB_CLOSEST, RB_ANY}) {
      RaySet set;
      set.query = query;
      set.rays = {ray};
      Answers answers(1);
      tree.Query(answers.Ask(set));
      std::vector<Verdict> verdicts;
      const VerdictCounts counts = JudgeAll(*oracle, query, set.rays, truth, answers.hits, answers.occluded,
                                            options.threads, &verdicts);
      const std::string flaw = ContractFlaw(set, answers, scene.primitive_count());
      const bool breaks = BreaksClaim(tree.Claims(), counts) || !flaw.empty();
      broken |= breaks;
      fmt::print("{}, claims {}{}\n     {}", contestant.Spec(), ClaimName(tree.Claims()),
                 !flaw.empty() ? ": contract BROKEN: " + flaw
                 : breaks      ? ": BROKEN"
                               : "",
                 FormatExample({"replay", query, 0, ray, answers.hits[0], answers.occluded[0] != 0, truth[0],
                                verdicts[0]}));
      if (query == RB_CLOSEST && truth[0].hit && answers.hits[0].prim != RAYBENCH_NONE)
        fmt::print("     t is off by {:.3g} ulp\n", ErrorInUlp(answers.hits[0].t, truth[0].t));
    }
  }
  return broken ? 1 : 0;
}

std::string FormatRay(const rb_ray& ray) {
  return fmt::format("{:a},{:a},{:a},{:a},{:a},{:a},{:a},{:a}", double(ray.org[0]), double(ray.org[1]),
                     double(ray.org[2]), double(ray.tnear), double(ray.dir[0]), double(ray.dir[1]),
                     double(ray.dir[2]), double(ray.tfar));
}

rb_ray ParseRay(const std::string& text) {
  static constexpr const char* kItems[] = {"ox", "oy", "oz", "tnear", "dx", "dy", "dz", "tfar"};
  constexpr const char* kForm = "--replay: write ox,oy,oz,tnear,dx,dy,dz,tfar";
  float values[8];
  const char* at = text.c_str();
  for (int i = 0; i < 8; ++i) {
    char* end = nullptr;
    const double value = std::strtod(at, &end);
    values[i] = float(value);
    if (end == at || *end != (i < 7 ? ',' : '\0'))
      throw InputError(fmt::format("{}; {} is not a number there", kForm, kItems[i]));
    if (!(double(values[i]) == value))
      throw InputError(fmt::format("{}; {} = {} is no float", kForm, kItems[i], value));
    at = end + 1;
  }
  const rb_ray ray{
      {values[0], values[1], values[2]}, values[3], {values[4], values[5], values[6]}, values[7]};
  if (!IsValidRay(ray))
    throw InputError(
        fmt::format("{}; finite but for tfar, tnear at least 0, and not all of the direction 0", kForm));
  return ray;
}

}  // namespace raybench
