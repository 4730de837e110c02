#include "harness/run/scene_run.h"

#include <fmt/format.h>
#include <malloc.h>

#include <algorithm>
#include <filesystem>
#include <new>
#include <tuple>

#include "datasets/scene/needs.h"
#include "harness/judge/ask.h"
#include "harness/judge/bound_tightness.h"
#include "harness/judge/claim.h"
#include "harness/judge/end_point_overlap.h"
#include "harness/judge/tree_statistics.h"
#include "harness/judge/truth_cache.h"
#include "harness/measure/machine.h"
#include "harness/measure/statistics.h"
#include "harness/plan/build_options.h"
#include "harness/results/heat_files.h"
#include "harness/terminal/interrupt.h"
#include "tracer/heat_map.h"
#include "tracer/image_io.h"
#include "tracer/tracer.h"

namespace raybench {
namespace {

/// A linear structure (RB_LINEAR) is left out where one pass would test more primitives than this, about half
/// a second; in a quick run a quarter of that.
constexpr double kLinearBudget = 0x1p25;

/// Triangles whose overlap with strange nodes is measured, and lines that meet bounds; also of a quick run.
constexpr uint64_t kTreeSamples = 1 << 14, kQuickTreeSamples = 1 << 12;

/// Pixels across the heat maps of the report, and of a quick run's.
constexpr uint32_t kHeatSide = 256, kQuickHeatSide = 128;

constexpr const char* kAllInvalid = "all rays of the set are invalid";

std::vector<double> TimesOf(const Measurement& samples, uint32_t threads) {
  std::vector<double> times;
  for (const Sample& s : samples) times.push_back(threads == 1 ? s.time.cpu : s.time.wall);
  return times;
}

void AddTimes(Row& values, const Case& key, const Measurement& samples) {
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

}  // namespace

std::vector<uint32_t> RunContext::BuildThreads() const {
  if (!options.threads.empty()) return options.threads;
  return AllThreads() > 1 ? std::vector<uint32_t>{1, AllThreads()} : std::vector<uint32_t>{1};
}

std::vector<uint32_t> RunContext::QueryThreads() const {
  return options.threads.empty() ? std::vector<uint32_t>{1} : options.threads;
}

uint32_t RunContext::HeatSide() const { return options.quick ? kQuickHeatSide : kHeatSide; }

SceneRun::SceneRun(RunContext& context, SceneRecord& record, size_t index)
    : context_(context),
      options_(context.options),
      schedule_(context.schedule),
      record_(record),
      index_(index),
      geometry_(record.scene.Geometry()) {
  schedule_.Enter(index, record.name);
}

void SceneRun::Note(const std::string& text) {
  context_.progress.Say(fmt::format("{}: {}", record_.name, text));
  record_.notes.push_back(text);
}

void SceneRun::Prepare() {
  std::vector<SourcedSet> sourced = context_.replays ? std::exchange(record_.replayed, {}) : CaptureSets();
  for (SourcedSet& s : sourced) sets_.push_back({std::move(s), {}, {}});
  for (const PreparedSet& s : sets_) {
    if (s.set.invalid_rays > 0)
      Note(fmt::format("{}: {} of {} rays are invalid and count as misses", s.set.Label(), s.set.invalid_rays,
                       s.set.rays.size()));
  }
  for (const Contestant& contestant : context_.contestants) entrants_.push_back(PlanEntrant(contestant));
  if (std::all_of(entrants_.begin(), entrants_.end(),
                  [&](const Entrant& e) { return e.AllDone(context_.results); })) {
    context_.progress.Say(fmt::format("{}: all {} cases are there already", record_.name, plan_size_));
    entrants_.clear();
  } else if (context_.earlier == nullptr) {
    AskForTruth();
  }
  for (const PreparedSet& s : sets_) {
    Json facts = FactsOf(s);
    facts["verified"] = s.picks.size();
    record_.ray_sets.push_back(std::move(facts));
  }
}

void SceneRun::Measure() {
  if (!entrants_.empty()) {
    size_t most = 0;
    for (const PreparedSet& s : sets_) most = std::max(most, s.set.rays.size());
    answers_.emplace(most);
    counted_.emplace(most);
    ladder_.emplace(sets_, *answers_, context_.budget, context_.engine.min_time().value_or(0), options_.seed);
    for (Entrant* entrant : AnchorsFirst(entrants_)) {
      Enter(*entrant);
      ThrowIfInterrupted();
    }
    TimeGroup();
  }
  schedule_.End();
  schedule_.Forget(index_);
}

// ---- rays, plan, truth ----

std::vector<SourcedSet> SceneRun::CaptureSets() {
  if (context_.earlier != nullptr) return context_.earlier->Rays(record_.stem, scene());
  CaptureOptions options;
  options.rays = options_.RaysPerSet();
  options.seed = options_.seed;
  options.depth = options_.depth;
  options.shuffled = options_.shuffled;
  options.sets = options_.sets;
  schedule_.Begin(Work::kCapture, "", "capturing rays");
  options.progress = [&](double fraction) { schedule_.Update(fraction); };
  options.note = [&](const std::string& line) { Note(line); };
  Capture capture = CaptureRaySets(context_.registry, scene(), options);
  const std::string image = (context_.results.path() / "images" / record_.stem).string();
  for (const char* extension : {".png", ".exr"}) WriteImage(capture.image, image + extension, SoftwareName());
  if (options_.keep_rays) {
    const std::filesystem::path& folder = context_.results.path();
    std::filesystem::create_directories(KeptRays(folder, record_.stem, 0).parent_path());
    for (size_t i = 0; i < capture.sets.size(); ++i)
      WriteRayFile(KeptRays(folder, record_.stem, i), capture.sets[i].set, scene(), SoftwareName());
  }
  return std::move(capture.sets);
}

Entrant SceneRun::PlanEntrant(const Contestant& contestant) {
  const double budget = options_.quick ? kLinearBudget / 4 : kLinearBudget;
  Entrant entrant;
  entrant.contestant = &contestant;
  Case key;
  key.scene = record_.name;
  key.scene_hash = scene().hash();
  key.primitives = scene().primitive_count();
  key.structure = contestant.structure->name;
  key.spec = contestant.Spec();
  key.params = contestant.Params();
  key.seed = options_.seed;
  const std::string not_taken = WhyNotTaken(*contestant.structure, scene());
  const auto plan = [&](const Case& c, size_t set, const std::string& why) {
    entrant.cases.push_back({c, set, why});
    // Scenes are planned one after the other, and ray sets known only then; so the place is (scene,
    // place within).
    entrant.cases.back().key.plan_index = (uint64_t{index_} << 32) + plan_size_++;
  };
  for (uint32_t threads : context_.BuildThreads()) {
    key.threads = threads;
    plan(key, 0, not_taken);
  }
  for (size_t i = 0; i < sets_.size(); ++i) {
    const RaySet& set = sets_[i].set;
    key.ray_set = set.Label();
    key.ray_hash = set.hash;
    key.order = set.order;
    key.query = QueryName(set.query);
    key.rays = set.rays.size();
    std::string why = not_taken;
    if (why.empty() && set.invalid_rays == set.rays.size()) why = kAllInvalid;
    if (why.empty() && entrant.Can(RB_LINEAR) && double(key.rays) * double(key.primitives) > budget) {
      why = fmt::format("rays x primitives exceeds {:.0f} million tests a pass", budget * 1e-6);
      entrant.too_slow = true;
    }
    for (uint32_t threads : context_.QueryThreads()) {
      key.threads = threads;
      plan(key, i, why);
    }
  }
  const auto is_skipped = [](const PlannedCase& c) { return !c.skip.empty(); };
  const auto queries = entrant.cases.begin() + long(context_.BuildThreads().size());
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
  return entrant;
}

/// Asks the oracle about a seeded part of each set.
void SceneRun::AskForTruth() {
  schedule_.Begin(Work::kTruth, "", "asking for truth");
  oracle_ = MakeOracle(scene());
  uint64_t audited = 0;
  for (size_t i = 0; i < sets_.size(); ++i) {
    PreparedSet& s = sets_[i];
    s.picks = PickSample(s.set.rays.size(), options_.RaysVerified(), options_.seed, s.set.hash);
    std::vector<rb_ray> picked;
    for (uint32_t pick : s.picks) picked.push_back(s.set.rays[pick]);
    const auto progress = [&](double fraction) {
      ThrowIfInterrupted();
      schedule_.Update((double(i) + fraction) / double(sets_.size()));
    };
    s.truth = CachedTruth(*oracle_, scene(), picked, 0,
                          {progress, [&](const std::string& line) { context_.progress.Say(line); }});
    audited += oracle_->Audit(picked, s.truth, options_.seed, kAuditedRays);
  }
  record_.oracle = {{"name", oracle_->Name()}, {"exact", oracle_->Exact()}, {"audited", audited}};
}

// ---- building and judging ----

/// Builds, judges and counts one structure and puts it into the group that is timed together. The group
/// before is timed first, and its trees given back, where there is no room beside it.
void SceneRun::Enter(Entrant& entrant) {
  const std::string spec = entrant.Spec();
  const bool done = entrant.AllDone(context_.results);
  const bool anchors = anchor_ == nullptr && !entrant.Is("null");
  const bool nothing_to_do = std::all_of(entrant.cases.begin(), entrant.cases.end(),
                                         [&](const PlannedCase& c) { return !c.skip.empty() || Done(c); });
  // In a resumed run, a structure that is already timed can still be the anchor of the others.
  const bool was_timed = std::any_of(entrant.cases.begin(), entrant.cases.end(), [&](const PlannedCase& c) {
    return !c.key.IsBuild() && context_.results.IsTimed(c.key.Id());
  });
  if (nothing_to_do && !(anchors && was_timed)) {
    if (!done) entrant.Close(context_.results, "skipped", "");
    schedule_.Forget(index_, &spec);
    return;
  }
  if (!BuildInGroup(entrant)) return schedule_.Forget(index_, &spec);
  if (nothing_to_do) {
    anchor_ = &entrant;
    if (!done) entrant.StoreSkipped(context_.results);
    return schedule_.Forget(index_, &spec);
  }
  if (!Judge(entrant)) return schedule_.Forget(index_, &spec);
  if (anchors) anchor_ = &entrant;
  group_.push_back(&entrant);
}

/// Bytes of the trees that are held.
uint64_t SceneRun::Held() const {
  uint64_t bytes = 0;
  for (const Entrant* e : group_) bytes += e->tree_bytes;
  const bool apart = anchor_ != nullptr && std::find(group_.begin(), group_.end(), anchor_) == group_.end();
  return bytes + (apart ? anchor_->tree_bytes : 0);
}

/// Without a tree afterwards, which is what false says, all cases are closed.
bool SceneRun::BuildInGroup(Entrant& entrant) {
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
    const bool others = std::any_of(group_.begin(), group_.end(),
                                    [&](const Entrant* e) { return e != anchor_ && e->tree_bytes > 0; });
    if (why.empty()) {
      // While times are taken, any of them is built again beside all.
      uint64_t most = entrant.build_bytes;
      for (const Entrant* e : group_) most = std::max(most, e->build_bytes);
      if (!others || Held() + entrant.tree_bytes + most <= context_.memory) return true;
    }
    entrant.tree = Tree();
    if (others) {
      TimeGroup();
      continue;
    }
    Note(fmt::format("{} is skipped: {}", entrant.Spec(), why));
    entrant.Close(context_.results, "skipped", why);
    return false;
  }
}

void SceneRun::BuildAll(Entrant& entrant) {
  const std::string spec = entrant.Spec();
  schedule_.Begin(Work::kBuild, spec, "building " + spec);
  const uint64_t held = Held();
  entrant.build_limit = context_.memory > held ? context_.memory - held : 1;
  entrant.build_bytes = 0;
  std::vector<uint32_t> counts = context_.BuildThreads();
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

Tree SceneRun::TimedBuild(const Entrant& entrant, uint32_t threads, Seconds& seconds) const {
  rb_build_options build = BuildOptions(threads, options_.seed, record_.build_needs);
  build.memory_limit = entrant.build_limit;
  Pinned pinned(threads == 1);
  const Stopwatch watch(/*process=*/true);
  Tree tree(*entrant.contestant, geometry_, build);
  seconds = watch.Elapsed();
  return tree;
}

/// Judges and counts. If the tree does not stand, which is what false says, all cases are closed.
bool SceneRun::Judge(Entrant& entrant) {
  const std::string spec = entrant.Spec();
  if (context_.earlier != nullptr && IsAsBefore(entrant)) return true;
  if (oracle_ == nullptr) AskForTruth();
  schedule_.Begin(Work::kTree, spec, "reading " + spec);
  std::string flaw;
  if (const auto statistics = ReadTree(entrant.tree, geometry_)) {
    flaw = statistics->flaw;
    const uint64_t samples = options_.quick ? kQuickTreeSamples : kTreeSamples;
    entrant.SetTreeValues(*statistics, EndPointOverlap(entrant.tree, geometry_, samples, options_.seed),
                          BoundTightness(entrant.tree, geometry_, samples, options_.seed));
  }
  schedule_.Begin(Work::kCheck, spec, "checking " + spec);
  entrant.set_values.assign(sets_.size(), Row());
  for (size_t i = 0; i < sets_.size(); ++i) {
    if (!entrant.Answers(i)) continue;
    ThrowIfInterrupted();
    const std::string broken =
        CheckAnswers(entrant.tree, *oracle_, scene(), sets_[i], entrant.set_values[i], *answers_, *counted_);
    if (!broken.empty() && flaw.empty()) flaw = fmt::format("{}: {}", sets_[i].set.Label(), broken);
    schedule_.Update(double(i + 1) / double(sets_.size()));
  }
  if (!flaw.empty()) {
    Note(fmt::format("REFUSED: {} - {}", spec, flaw));
    entrant.Close(context_.results, "refused", flaw);
    return false;
  }
  schedule_.Begin(Work::kHeat, spec, "heat map of " + spec);
  CountPixels(entrant);
  return true;
}

/// Whether the earlier run judged this very tree: all nodes and all answers have the digests they had. Its
/// verdicts, which follow from these, and its counters are the entrant's then.
bool SceneRun::IsAsBefore(Entrant& entrant) {
  schedule_.Begin(Work::kCheck, entrant.Spec(), "checking " + entrant.Spec());
  const std::string digest = TreeDigest(entrant.tree);
  std::vector<Row> sets(sets_.size());
  std::map<uint32_t, Row> builds;
  for (const PlannedCase& c : entrant.cases) {
    if (!c.skip.empty()) continue;
    const Row* before = context_.earlier->Find(c.key.Id());
    if (before == nullptr) return false;
    if (c.key.IsBuild()) {
      builds[c.key.threads] = *before;
      continue;
    }
    if (before->Get(column::tree_digest) != digest) return false;
    if (sets[c.set].Has(column::hits_digest)) continue;  // at another number of threads
    const Question question = sets_[c.set].Asked();
    Ask(entrant.tree, question, *answers_, 0);
    if (before->Get(column::hits_digest) != DigestOf(question, *answers_)) return false;
    sets[c.set] = *before;
    ThrowIfInterrupted();
  }
  for (auto& [threads, values] : entrant.build_values) {
    Row all = builds[threads];
    all.Take(values);  // what was measured anew
    values = all;
  }
  entrant.set_values = std::move(sets);
  return true;
}

/// What the report's heat maps show. `null` costs no ray anything; where rays are replayed, nobody knows
/// what camera to look through.
void SceneRun::CountPixels(const Entrant& entrant) const {
  if (context_.replays || entrant.Is("null")) return;
  const std::string spec = entrant.Spec(), &stem = record_.stem;
  HeatFiles files(context_.results.path() / "heat" / stem, record_.name, "../../images/" + stem + ".png");
  if (files.Has(spec)) return;
  const std::string why = entrant.too_slow ? "is too slow for full ray sets"
                                           : WhyNotCounted(*entrant.contestant->structure, scene());
  if (!why.empty()) return files.AddNotCounted(spec, why);
  HeatOptions heat;
  heat.width = heat.height = context_.HeatSide();
  files.Add(spec, CountPerPixel(scene(), entrant.tree, heat));
}

// ---- times ----

struct SceneRun::Open {
  Entrant* entrant;
  const PlannedCase* planned;
  Row values;
  Part part = {};
};

/// The cases of the group that are to be timed. Neighbours are of different trees, so that each finds its
/// nodes out of the caches.
std::vector<SceneRun::Open> SceneRun::OpenCases() {
  std::vector<Open> open;
  for (Entrant* entrant : group_) {
    entrant->StoreSkipped(context_.results);
    for (const PlannedCase& c : entrant->cases) {
      if (!c.skip.empty() || Done(c)) continue;
      Row values = entrant->ValuesOf(c);
      ++context_.seen;
      context_.last_name = c.Name();
      if (context_.engine.Takes(c.Name())) {
        ++context_.taken;
        open.push_back({entrant, &c, std::move(values)});
      } else {
        values[column::status] = "skipped";
        values[column::note] = "left out by --benchmark_filter";
        context_.results.Store(c.key, values, {});
      }
    }
  }
  std::stable_sort(open.begin(), open.end(), [](const Open& a, const Open& b) {
    const auto key = [](const Open& o) {
      return std::tuple(!o.planned->key.IsBuild(), o.planned->set, o.planned->key.threads);
    };
    return key(a) < key(b);
  });
  return open;
}

TimedTask SceneRun::BuildTask(const Open& open) {
  TimedTask task;
  const uint32_t threads = open.planned->key.threads;
  task.build = [this, entrant = open.entrant, threads] {
    malloc_trim(0);
    Seconds seconds;
    TimedBuild(*entrant, threads, seconds);
    return seconds;
  };
  task.sample_cost = open.entrant->build_seconds.at(threads);
  task.samples = context_.budget.Samples(task.sample_cost);
  return task;
}

/// The anchor's step on this set, 0 where there is no anchor.
uint32_t SceneRun::AnchorStep(const Part& part) {
  if (!Anchors(part)) return 0;
  const std::pair key(part.set, part.threads);
  if (!anchor_steps_.contains(key))
    anchor_steps_[key] = ladder_->ChooseStep(anchor_->tree, part.set, part.threads);
  return anchor_steps_.at(key);
}

/// Times all open cases of the group and gives its trees back, but for the anchor's.
void SceneRun::TimeGroup() {
  if (group_.empty()) return;
  std::vector<std::string> specs;
  for (const Entrant* entrant : group_) specs.push_back(entrant->Spec());
  schedule_.Begin(Work::kFirstPasses, specs, "first passes");
  std::vector<Open> open = OpenCases();
  std::vector<TimedTask> tasks;
  std::map<Part, size_t> anchors;  // the task of the anchor on each part
  for (Open& o : open) {
    const Case& key = o.planned->key;
    if (key.IsBuild()) {
      tasks.push_back(BuildTask(o));
    } else {
      // On a part that both can do, the anchor's time is measured beside every other one.
      o.part = {o.planned->set, key.threads, 0};
      const uint32_t own = ladder_->ChooseStep(o.entrant->tree, o.part.set, key.threads);
      if (o.entrant == anchor_) anchor_steps_[{o.part.set, key.threads}] = own;
      o.part.step = std::max(own, AnchorStep(o.part));
      Seconds cold;
      tasks.push_back(ladder_->Task(o.entrant->tree, o.part, cold));
      const uint64_t rays = ladder_->RaysOf(o.part).rays.size();
      o.values[column::cold_ns] = (key.threads == 1 ? cold.cpu : cold.wall) * 1e9 / double(rays);
      o.values[column::timed_rays] = rays;
      if (o.entrant == anchor_) anchors[o.part] = tasks.size() - 1;
    }
    tasks.back().name = o.planned->Name();
    tasks.back().parallel = key.threads > 1;
    ThrowIfInterrupted();
    schedule_.Update(double(tasks.size()) / double(open.size()));
  }
  for (const Open& o : open) {
    if (o.planned->key.IsBuild() || !Anchors(o.part) || anchors.contains(o.part)) continue;
    anchors[o.part] = tasks.size();
    Seconds cold;
    tasks.push_back(ladder_->Task(anchor_->tree, o.part, cold));
    tasks.back().name =
        fmt::format("anchor of set {}/step {}/threads:{}", o.part.set, o.part.step, o.part.threads);
    tasks.back().parallel = o.part.threads > 1;
    ThrowIfInterrupted();
  }
  double seconds = 0;
  for (const TimedTask& task : tasks) seconds += task.sample_cost * task.samples;
  schedule_.Begin(Work::kTiming, specs, "timing");
  schedule_.Expect(seconds);
  const std::vector<Measurement> measured =
      raybench::Measure(tasks, [&](double fraction) { schedule_.Update(fraction); });
  for (size_t i = 0; i < open.size(); ++i) {
    Open& o = open[i];
    const auto anchor = o.planned->key.IsBuild() ? anchors.end() : anchors.find(o.part);
    const bool has_anchor = anchor != anchors.end();
    if (measured[i].empty() || (has_anchor && measured[anchor->second].empty())) continue;  // interrupted
    AddTimes(o.values, o.planned->key, measured[i]);
    if (has_anchor) {
      o.values[column::anchor] = anchor_->Spec();
      o.values[column::anchor_ns] = MedianOf(TimesOf(measured[anchor->second], o.part.threads)).median * 1e9 /
                                    double(ladder_->RaysOf(o.part).rays.size());
    }
    context_.results.Store(o.planned->key, o.values, measured[i]);
  }
  ThrowIfInterrupted();
  for (Entrant* entrant : group_)
    if (entrant != anchor_) entrant->tree = Tree();
  group_.clear();
}

}  // namespace raybench
