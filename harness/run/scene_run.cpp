#include "harness/run/scene_run.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <malloc.h>

#include <algorithm>
#include <filesystem>
#include <new>

#include "datasets/scene/needs.h"
#include "harness/judge/ask.h"
#include "harness/judge/bound_tightness.h"
#include "harness/judge/claim.h"
#include "harness/judge/end_point_overlap.h"
#include "harness/judge/tree_statistics.h"
#include "harness/judge/truth_cache.h"
#include "harness/measure/machine.h"
#include "harness/plan/build_options.h"
#include "harness/results/box_files.h"
#include "harness/results/heat_files.h"
#include "harness/terminal/interrupt.h"
#include "tracer/heat_map.h"
#include "tracer/image_io.h"
#include "tracer/tracer.h"

namespace raybench {
namespace {

constexpr const char* kAllInvalid = "all rays of the set are invalid";

/// Whether a tree that was built again can be the one that an earlier session judged: structures promise it, or on
/// one thread leave no choice. Where nodes are shown, Judge() looks whether it is.
bool SameTree(const Row& known, const Row& now, const Tree& tree, uint32_t threads) {
  return ((tree.structure().capabilities & RB_DETERMINISTIC) != 0 || threads == 1) &&
         known.Get(column::claim) == now.Get(column::claim) &&
         known.Get(column::node_bytes) == now.Get(column::node_bytes) &&
         known.Get(column::prim_bytes) == now.Get(column::prim_bytes);
}

}  // namespace

bool RunContext::Owns(size_t scene, const Contestant& contestant) const {
  return raybench::Owns(options, scene, scenes, size_t(&contestant - contestants.data()), contestants.size());
}

std::vector<uint32_t> RunContext::BuildThreads() const {
  if (!options.threads.empty()) return options.threads;
  return AllThreads() > 1 ? std::vector<uint32_t>{1, AllThreads()} : std::vector<uint32_t>{1};
}

std::vector<uint32_t> RunContext::QueryThreads() const {
  return options.threads.empty() ? std::vector<uint32_t>{1} : options.threads;
}

uint32_t RunContext::HeatSide() const { return options.suite.heat_pixels; }

SceneRun::SceneRun(RunContext& context, SceneRecord& record)
    : context_(context),
      options_(context.options),
      schedule_(context.schedule),
      record_(record),
      recall_(*record.recall),
      geometry_(record.scene.Geometry()) {
  const bool several = options_.processes > 1;
  schedule_.Enter(record.index, several ? fmt::format("process {} of {}, {}", context.process + 1,
                                                      options_.processes, record.name)
                                        : record.name);
}

void SceneRun::Note(const std::string& text) {
  context_.progress.Say(fmt::format("{}: {}", record_.name, text));
  if (std::find(record_.notes.begin(), record_.notes.end(), text) == record_.notes.end())
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
  record_.cases = plan_size_;
  if (std::all_of(entrants_.begin(), entrants_.end(),
                  [&](const Entrant& e) { return e.foreign || e.AllDone(context_.results); })) {
    context_.progress.Say(fmt::format("{}: all {} cases are there already", record_.name, plan_size_));
    entrants_.clear();
  } else {
    ReckonWithKnown();
    if (context_.earlier == nullptr) AskForTruth();
  }
  for (const PreparedSet& s : sets_) {
    Json facts = FactsOf(s);
    facts["verified"] = s.picks.size();
    record_.ray_sets.push_back(std::move(facts));
  }
}

/// The time left is of what earlier sessions have not done.
void SceneRun::ReckonWithKnown() {
  for (const Entrant& entrant : entrants_) {
    const std::string spec = entrant.Spec();
    double samples = 0, missing = 0, unplanned = 0, unchecked = 0, sets = 0;
    for (const PlannedCase& c : entrant.cases) {
      if (!c.skip.empty() || Done(c) || entrant.foreign) continue;
      const std::optional<KeptPlan> plan = recall_.Plan(c.key.Id());
      const uint32_t wanted = plan ? plan->samples.samples : options_.Repetitions();
      samples += wanted;
      missing += plan ? recall_.Missing(c.key.Id(), *plan) : wanted;
      if (c.key.IsBuild()) continue;
      unplanned += plan ? 0 : 1;
      unchecked += recall_.IsChecked(entrant, sets_[c.set]) ? 0 : 1;
      ++sets;
    }
    const auto scale = [&](Work work, double left, double whole) {
      schedule_.Scale(record_.index, work, spec, whole > 0 ? left / whole : 0);
    };
    scale(Work::kTiming, missing, samples);
    scale(Work::kFirstPasses, unplanned, sets);
    scale(Work::kCheck, unchecked, sets);
    scale(Work::kTree, recall_.IsRead(entrant) ? 0 : 1, 1);
  }
}

void SceneRun::Measure() {
  if (!entrants_.empty()) {
    recall_.journal().Begin();
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
  schedule_.Forget(record_.index);
  if (!context_.LastProcess()) return;
  ForgetSets();
  recall_.journal().Remove();
}

// ---- rays, plan, truth ----

std::vector<SourcedSet> SceneRun::CaptureSets() {
  if (context_.earlier != nullptr) return context_.earlier->Rays(record_.stem, scene());
  if (std::vector<SourcedSet> sets = RecallSets(); !sets.empty()) return sets;
  CaptureOptions options;
  options.rays = options_.RaysPerSet();
  options.seed = options_.seed;
  options.depth = options_.depth;
  options.shuffled = options_.shuffled;
  options.sets = options_.sets;
  schedule_.Begin(Work::kCapture, "", "capturing rays");
  options.progress = [&](double fraction) { schedule_.Update(fraction); };
  Json notes = Json::array();
  options.note = [&](const std::string& line) {
    Note(line);
    notes.push_back(line);
  };
  Capture capture = CaptureRaySets(context_.registry, scene(), options);
  const std::string image = (context_.results.path() / "images" / record_.stem).string();
  for (const char* extension : {".png", ".exr"}) WriteImage(capture.image, image + extension, SoftwareName());
  if (options_.keep_rays) WriteSets(context_.results.path(), capture.sets);
  try {
    WriteSets(JournalFolder(), capture.sets);
    Json captured = Json::array();
    for (const SourcedSet& s : capture.sets) captured.push_back(s.captured);
    recall_.AddCapture(SetsWanted(), {{"captured", captured}, {"notes", notes}});
  } catch (const std::runtime_error&) {  // no room on the disk: the next session captures anew
    ForgetSets();
  }
  return std::move(capture.sets);
}

void SceneRun::WriteSets(const std::filesystem::path& folder, const std::vector<SourcedSet>& sets) const {
  std::filesystem::remove_all(KeptRays(folder, record_.stem, 0).parent_path());
  std::filesystem::create_directories(KeptRays(folder, record_.stem, 0).parent_path());
  for (size_t i = 0; i < sets.size(); ++i)
    WriteRayFile(KeptRays(folder, record_.stem, i), sets[i].set, scene(), SoftwareName());
}

/// The sets that an earlier session captured; none if they are not known.
std::vector<SourcedSet> SceneRun::RecallSets() {
  const Json& known = recall_.Capture(SetsWanted());
  if (known.is_null()) return {};
  std::vector<SourcedSet> sets = ReadKeptRays(JournalFolder(), record_.stem, scene());
  if (sets.size() != known.at("captured").size()) return {};
  for (size_t i = 0; i < sets.size(); ++i) sets[i].captured = known.at("captured").at(i);
  for (const Json& note : known.at("notes")) Note(note.get<std::string>());
  return sets;
}

/// Of what captured sets depend on, all that the journal as a whole does not.
std::string SceneRun::SetsWanted() const {
  return fmt::format("{}{}", fmt::join(options_.sets, ","), options_.shuffled ? " shuffled" : "");
}

std::filesystem::path SceneRun::JournalFolder() const { return context_.results.path() / "journal"; }

void SceneRun::ForgetSets() const {
  std::error_code error;
  const std::filesystem::path sets = KeptRays(JournalFolder(), record_.stem, 0).parent_path();
  std::filesystem::remove_all(sets, error);
  std::filesystem::remove(sets.parent_path(), error);  // if it is empty
}

Entrant SceneRun::PlanEntrant(const Contestant& contestant) {
  const double budget = double(options_.suite.linear_tests);
  Entrant entrant;
  entrant.contestant = &contestant;
  entrant.foreign = !context_.Owns(record_.index, contestant);
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
    entrant.cases.back().key.plan_index = (uint64_t{record_.index} << 32) + plan_place_++;
    if (!entrant.foreign) ++plan_size_;
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
  if (skipped != entrant.cases.end() && !entrant.foreign)
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

/// Whether something of it must be timed in this session.
bool SceneRun::IsOpen(const PlannedCase& c) const {
  if (!c.skip.empty() || Done(c)) return false;
  const std::optional<KeptPlan> plan = recall_.Plan(c.key.Id());
  return !plan || recall_.Missing(c.key.Id(), *plan) > 0;
}

bool SceneRun::IsOpen(const Entrant& entrant) const {
  return !entrant.foreign && std::any_of(entrant.cases.begin(), entrant.cases.end(),
                                         [&](const PlannedCase& c) { return IsOpen(c); });
}

/// Whether all its samples are there and only its row is not.
bool SceneRun::IsSampled(const PlannedCase& c) const { return c.skip.empty() && !Done(c) && !IsOpen(c); }

/// Whether a case of it has all its samples, and none of the anchor beside them.
bool SceneRun::LacksAnchor(const Entrant& entrant) const {
  return &entrant != anchor_ &&
         std::any_of(entrant.cases.begin(), entrant.cases.end(),
                     [&](const PlannedCase& c) { return IsSampled(c) && LacksAnchor(c); });
}

/// Can be the anchor of the others though nothing of it is left to do: it has times.
bool SceneRun::WasTimed(const Entrant& entrant) const {
  return std::any_of(entrant.cases.begin(), entrant.cases.end(), [&](const PlannedCase& c) {
    return !c.key.IsBuild() && (IsSampled(c) || context_.results.IsTimed(c.key.Id()));
  });
}

/// Builds, judges and counts one structure and puts it into the group that is timed together. The group
/// before is timed first, and its trees given back, where there is no room beside it.
void SceneRun::Enter(Entrant& entrant) {
  const std::string spec = entrant.Spec();
  const bool anchors = anchor_ == nullptr && !entrant.Is("null");
  const bool open = IsOpen(entrant);
  Remember(entrant);
  // Of another shard, and here only because something must be the anchor.
  if (entrant.foreign) {
    const bool all_skipped = std::all_of(entrant.cases.begin(), entrant.cases.end(),
                                         [](const PlannedCase& c) { return !c.skip.empty(); });
    if (anchors && !all_skipped && BuildInGroup(entrant) && Judge(entrant)) anchor_ = &entrant;
    return schedule_.Forget(record_.index, &spec);
  }
  if (!open) {
    entrant.StoreSkipped(context_.results);
    if (anchors && WasTimed(entrant)) {
      anchor_ = &entrant;
      if (std::any_of(entrants_.begin(), entrants_.end(),
                      [&](const Entrant& e) { return IsOpen(e) || LacksAnchor(e); }))
        BuildInGroup(entrant);
    }
    for (const PlannedCase& c : entrant.cases)
      if (IsSampled(c)) sampled_.push_back({&entrant, &c});
    return schedule_.Forget(record_.index, &spec);
  }
  if (group_.size() >= GroupLimit()) TimeGroup();
  if (!BuildInGroup(entrant) || !Judge(entrant)) return schedule_.Forget(record_.index, &spec);
  if (anchors) anchor_ = &entrant;
  group_.push_back(&entrant);
}

/// How many trees are built before they are timed: half as many for each session before that got nowhere, so
/// that one gets somewhere as soon as set-up and one pass fit into it.
size_t SceneRun::GroupLimit() const {
  const uint64_t fruitless = std::min<uint64_t>(recall_.journal().FruitlessSessions(), 63);
  return std::max<size_t>(1, entrants_.size() >> fruitless);
}

/// What earlier sessions found out about it.
void SceneRun::Remember(Entrant& entrant) {
  for (uint32_t threads : context_.BuildThreads()) recall_.Build(entrant, threads);
  entrant.set_values.assign(sets_.size(), Row());
  if (entrant.build_values.size() < context_.BuildThreads().size()) return;
  if (!recall_.Tree(entrant)) return;
  for (size_t i = 0; i < sets_.size(); ++i) recall_.Check(entrant, i, sets_[i]);
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
    GiveUp(entrant, why);
    return false;
  }
}

/// All cases that have no row yet are skipped, and the tree is given back.
void SceneRun::GiveUp(Entrant& entrant, const std::string& why) {
  Note(fmt::format("{} is skipped: {}", entrant.Spec(), why));
  entrant.Close(context_.results, "skipped", why);
  if (&entrant == anchor_) anchor_ = nullptr;
}

void SceneRun::BuildAll(Entrant& entrant) {
  const std::string spec = entrant.Spec();
  schedule_.Begin(Work::kBuild, spec, "building " + spec);
  const uint64_t held = Held();
  entrant.build_limit = context_.memory > held ? context_.memory - held : 1;
  std::vector<uint32_t> counts = context_.BuildThreads();
  std::reverse(counts.begin(), counts.end());  // the first one's is kept, and never two at once
  for (uint32_t threads : counts) {
    const bool kept = threads == counts.back(), known = entrant.build_values.contains(threads);
    if (known && !kept) continue;
    malloc_trim(0);
    const bool has_peak = ResetPeakMemory();
    const uint64_t before = ResidentMemory();
    Seconds seconds;
    Tree tree = TimedBuild(entrant, threads, seconds);
    const uint64_t peak = PeakMemory();
    uint64_t nodes = 0, prims = 0;
    int needs_geometry = 0;
    tree.structure().memory(tree.get(), &nodes, &prims, &needs_geometry);
    Row values;
    values[column::claim] = ClaimName(tree.Claims());
    if (has_peak) values[column::build_peak_bytes] = peak > before ? peak - before : 0;
    values[column::cold_ns] = (threads == 1 ? seconds.cpu : seconds.wall) * 1e9;
    // Without the promise of the same tree at any thread count, its figures would change from run to run.
    if (kept || (tree.structure().capabilities & RB_DETERMINISTIC) != 0) {
      values[column::node_bytes] = nodes;
      values[column::prim_bytes] = prims;
      values[column::needs_geometry] = needs_geometry != 0;
    }
    if (const std::optional<rb_device> device = tree.Device()) {
      values[column::device] = std::string(device->is_software ? "software: " : "") + device->name;
      values[column::device_ns] = device->build * 1e9;
      values[column::copies_ns] = device->build_copies * 1e9;
    }
    entrant.recalled = known && SameTree(entrant.build_values.at(threads), values, tree, threads);
    if (!entrant.recalled) {
      entrant.build_seconds[threads] = seconds.wall;
      entrant.build_values[threads] = std::move(values);
      entrant.build_bytes =
          std::max({entrant.build_bytes, nodes + prims, has_peak && peak > before ? peak - before : 0});
      recall_.AddBuild(entrant, threads);
    }
    if (!kept) continue;
    entrant.tree_bytes = nodes + prims;
    entrant.tree = std::move(tree);
  }
}

Tree SceneRun::TimedBuild(const Entrant& entrant, uint32_t threads, Seconds& seconds) const {
  rb_build_options build = BuildOptions(threads, options_.seed, record_.build_needs);
  build.memory_limit = entrant.build_limit;
  const bool device = entrant.Can(RB_DEVICE);
  Pinned pinned(threads == 1 && !device);
  const Stopwatch watch(/*process=*/true);
  Tree tree(*entrant.contestant, geometry_, build);
  seconds = watch.Elapsed();
  if (device) seconds.cpu = seconds.wall;
  return tree;
}

/// Judges and counts, but for what an earlier session found out about the same tree. If it does not stand, or its
/// device ceases to answer, which is what false says, all cases are closed.
bool SceneRun::Judge(Entrant& entrant) {
  try {
    return JudgeAnswering(entrant);
  } catch (const QueryError& error) {
    GiveUp(entrant, error.what());
    return false;
  }
}

bool SceneRun::JudgeAnswering(Entrant& entrant) {
  const std::string spec = entrant.Spec();
  if (context_.earlier != nullptr && IsAsBefore(entrant)) return true;
  if (oracle_ == nullptr) AskForTruth();
  schedule_.Begin(Work::kTree, spec, "reading " + spec);
  std::optional<std::string> known;
  entrant.recalled = entrant.recalled && entrant.MayHaveDigest(TreeDigest(entrant.tree));
  if (entrant.recalled) known = recall_.Tree(entrant);
  std::string flaw = known.value_or("");
  if (!known) {
    if (const auto statistics = ReadTree(entrant.tree, geometry_)) {
      flaw = statistics->flaw;
      const uint64_t samples = options_.suite.tree_samples;
      entrant.SetTreeValues(*statistics, EndPointOverlap(entrant.tree, geometry_, samples, options_.seed),
                            BoundTightness(entrant.tree, geometry_, samples, options_.seed));
    }
    recall_.AddTree(entrant, flaw);
  }
  schedule_.Begin(Work::kCheck, spec, "checking " + spec);
  for (size_t i = 0; i < sets_.size(); ++i) {
    if (!entrant.Answers(i)) continue;
    ThrowIfInterrupted();
    known = std::nullopt;
    if (entrant.recalled) known = recall_.Check(entrant, i, sets_[i]);
    if (!known) {
      entrant.set_values[i] = Row();
      known = CheckAnswers(entrant.tree, *oracle_, scene(), sets_[i], entrant.set_values[i], *answers_,
                           *counted_);
      recall_.AddCheck(entrant, i, sets_[i], *known);
    }
    if (!known->empty() && flaw.empty()) flaw = fmt::format("{}: {}", sets_[i].set.Label(), *known);
    schedule_.Update(double(i + 1) / double(sets_.size()));
  }
  if (!flaw.empty()) {
    Note(fmt::format("REFUSED: {} - {}", spec, flaw));
    entrant.Close(context_.results, "refused", flaw);
    return false;
  }
  schedule_.Begin(Work::kHeat, spec, "heat map of " + spec);
  if (!entrant.foreign) {
    CountPixels(entrant);
    AddBoxes(context_.results.path() / "boxes" / (record_.stem + ".json"), spec, entrant.tree);
  }
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

}  // namespace raybench
