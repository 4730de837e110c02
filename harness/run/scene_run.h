// What a run does with one scene: capture, truth, then each structure built, judged and timed.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "datasets/scene/scene.h"
#include "harness/measure/measure.h"
#include "harness/plan/plan.h"
#include "harness/plan/time_budget.h"
#include "harness/rays/ray_sets.h"
#include "harness/results/results.h"
#include "harness/run/earlier_run.h"
#include "harness/run/entrant.h"
#include "harness/run/ladder.h"
#include "harness/run/prepared_set.h"
#include "harness/run/recall.h"
#include "harness/run/schedule.h"
#include "harness/terminal/progress.h"
#include "harness/truth/oracle.h"

namespace raybench {

/// A scene and what run.json says of it.
struct SceneRecord {
  size_t index = 0;        ///< among all scenes of the run, of all shards
  std::string name, stem;  ///< as the user named it; of files
  Scene scene;
  uint64_t build_needs = 0;          ///< RB_NEED_* of its trees
  std::vector<SourcedSet> replayed;  ///< taken when its turn comes
  Json needs, oracle, anchor;        ///< null until known
  Json notes = Json::array(), ray_sets = Json::array();
  std::unique_ptr<Recall> recall;  ///< since there are results
  uint64_t cases = 0;              ///< planned, of this shard; 0 until known
  Json finished;  ///< what run.json said of it when an earlier session had finished it; else null
};

/// What all scenes of a run share.
struct RunContext {
  const Registry& registry;
  const RunOptions& options;
  const EngineFlags& engine;
  const TimeBudget& budget;
  const uint64_t memory;  ///< for trees held at once and one building
  const std::vector<Contestant>& contestants;
  const ResultFolder& results;
  Progress& progress;
  Schedule& schedule;
  const bool replays;                   ///< ray files instead of captured sets
  const uint32_t process;               ///< of --processes, from 0
  const size_t scenes;                  ///< of all shards
  const EarlierRun* earlier = nullptr;  ///< whose rays and verdicts are used; null: none
  const TimedParts& parts;              ///< of another run, on which the same cases are timed

  uint64_t seen = 0, taken = 0;  ///< cases ready to be timed, and those that the filter let through
  std::string last_name = {};    ///< of such a case

  /// Whether the samples of this process are the last ones of each case.
  bool LastProcess() const { return process + 1 == options.processes; }
  /// Whether this shard measures the structure on this scene.
  bool Owns(size_t scene, const Contestant& contestant) const;
  std::vector<uint32_t> BuildThreads() const;
  std::vector<uint32_t> QueryThreads() const;
  /// Pixels across a heat map.
  uint32_t HeatSide() const;
};

class SceneRun {
 public:
  /// The record must have its `recall`.
  SceneRun(RunContext& context, SceneRecord& record);

  /// Gets the ray sets, plans the cases and asks for truth.
  void Prepare();
  /// Builds, judges and times all unfinished cases. Throws InterruptedError; what is known is kept.
  void Measure();

 private:
  std::vector<SourcedSet> CaptureSets();
  std::vector<SourcedSet> RecallSets();
  void WriteSets(const std::filesystem::path& folder, const std::vector<SourcedSet>& sets) const;
  void ForgetSets() const;
  std::string SetsWanted() const;
  std::filesystem::path JournalFolder() const;
  void ReckonWithKnown();
  Entrant PlanEntrant(const Contestant& contestant);
  void AskForTruth();

  bool IsOpen(const PlannedCase& c) const;
  bool IsOpen(const Entrant& entrant) const;
  bool IsSampled(const PlannedCase& c) const;
  bool LacksAnchor(const PlannedCase& c) const;
  bool LacksAnchor(const Entrant& entrant) const;
  bool WasTimed(const Entrant& entrant) const;
  void Enter(Entrant& entrant);
  size_t GroupLimit() const;
  void Remember(Entrant& entrant);
  uint64_t Held() const;
  bool BuildInGroup(Entrant& entrant);
  void BuildAll(Entrant& entrant);
  Tree TimedBuild(const Entrant& entrant, uint32_t threads, Seconds& seconds) const;
  bool Judge(Entrant& entrant);
  bool JudgeAnswering(Entrant& entrant);
  void GiveUp(Entrant& entrant, const std::string& why);
  bool IsAsBefore(Entrant& entrant);
  void CountPixels(const Entrant& entrant) const;

  struct Open;
  std::vector<Open> OpenCases();
  TimedTask BuildTask(const Entrant& entrant, uint32_t threads);
  bool Anchors(const Part& part) const { return anchor_ != nullptr && anchor_->Answers(part.set); }
  uint32_t OwnStep(const Entrant& entrant, const Part& part);
  KeptPlan PlanPart(const Entrant& entrant, const Part& part);
  void Choose(Open& open);
  std::string AnchorKey(const Part& part) const;
  std::vector<Sample> AnchorSamples(const Part& part) const;
  std::optional<double> AnchorSeconds(const Part& part, std::span<const Sample> samples) const;
  void StoreTimed(const Entrant& entrant, const PlannedCase& c);
  void TimeGroup();

  /// Says it and keeps it with the scene in run.json.
  void Note(const std::string& text);
  bool Done(const PlannedCase& c) const { return context_.results.Has(c.key.Id()); }
  const Scene& scene() const { return record_.scene; }

  RunContext& context_;
  const RunOptions& options_;
  Schedule& schedule_;
  SceneRecord& record_;
  Recall& recall_;
  const rb_geometry geometry_;
  std::vector<PreparedSet> sets_;
  std::vector<Entrant> entrants_;
  uint64_t plan_place_ = 0, plan_size_ = 0;  ///< of the next case, of all shards; of this one
  std::unique_ptr<Oracle> oracle_;
  std::optional<Answers> answers_, counted_;  ///< for the largest set
  std::optional<Ladder> ladder_;
  std::vector<Entrant*> group_;  ///< whose trees are held to be timed together
  Entrant* anchor_ = nullptr;    ///< its tree is held to the end
  std::vector<std::pair<Entrant*, const PlannedCase*>> sampled_;  ///< whose rows are to be stored
};

}  // namespace raybench
