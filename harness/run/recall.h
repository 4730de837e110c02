// What earlier sessions found out about the unfinished cases of a scene, and what this one adds: so that a
// run that is killed at any moment loses the pass it was in and no more.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "harness/plan/time_budget.h"
#include "harness/results/journal.h"
#include "harness/run/entrant.h"
#include "harness/run/ladder.h"
#include "harness/run/prepared_set.h"

namespace raybench {

/// How a case is timed: chosen once, so that all sessions take the same samples.
struct KeptPlan {
  uint32_t step = 0;  ///< of the ladder
  SamplePlan samples;
  double cold = 0;  ///< seconds of the first pass; no meaning for a build
};

class Recall {
 public:
  /// `depends_on`: all that the records depend on and that their keys do not say. `process`: of --processes.
  Recall(std::filesystem::path file, Json depends_on, uint64_t session, uint32_t process)
      : journal_(std::move(file), std::move(depends_on), session), process_(process) {}

  Journal& journal() { return journal_; }
  const Journal& journal() const { return journal_; }

  // Seconds that building and asking a structure cost, as a probe before the run found.
  bool HasPrice(const std::string& spec) const { return !journal_.Find("price", spec).is_null(); }
  void AddPrice(const std::string& spec, double build, double ray);
  double PriceOfBuild(const std::string& spec) const { return journal_.Find("price", spec).at("build"); }
  double PriceOfRay(const std::string& spec) const { return journal_.Find("price", spec).at("ray"); }

  /// Fills what is known of a build with so many threads; false: nothing.
  bool Build(Entrant& entrant, uint32_t threads) const;
  void AddBuild(const Entrant& entrant, uint32_t threads);

  /// What reading the tree and checking its answers found, in words; none if it is not known. Fills columns.
  std::optional<std::string> Tree(Entrant& entrant) const;
  bool IsRead(const Entrant& entrant) const { return !journal_.Find("tree", entrant.Spec()).is_null(); }
  void AddTree(const Entrant& entrant, const std::string& flaw);
  std::optional<std::string> Check(Entrant& entrant, size_t set, const PreparedSet& prepared) const;
  bool IsChecked(const Entrant& entrant, const PreparedSet& prepared) const;
  void AddCheck(const Entrant& entrant, size_t set, const PreparedSet& prepared, const std::string& flaw);

  /// Of the sets that were captured, or null.
  const Json& Capture(const std::string& wanted) const { return journal_.Find("capture", wanted); }
  void AddCapture(const std::string& wanted, Json facts) {
    journal_.Add("capture", wanted, std::move(facts));
  }

  std::optional<KeptPlan> Plan(const std::string& key) const;
  void AddPlan(const std::string& key, const KeptPlan& plan);
  std::optional<uint32_t> Step(const std::string& key) const;
  void AddStep(const std::string& key, uint32_t step) { journal_.Add("step", key, {{"step", step}}); }

  std::vector<Sample> Samples(const std::string& key) const { return journal_.SamplesOf(key); }
  void AddSample(const std::string& key, Sample sample);
  /// Of this process of --processes.
  uint32_t Missing(const std::string& key, const KeptPlan& plan) const;

 private:
  Journal journal_;
  const uint32_t process_;
};

}  // namespace raybench
