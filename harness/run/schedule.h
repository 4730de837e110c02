// What a run still has to do and how long that takes: what stands behind the time left.
#pragma once

#include <map>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "harness/plan/cost_model.h"
#include "harness/terminal/progress.h"

namespace raybench {

/// The work on all scenes, planned piece by piece in guessed seconds, and the piece that is under way. `who`
/// does a piece: a structure's short form, or empty for the run itself.
class Schedule {
 public:
  explicit Schedule(Progress& progress) : progress_(progress) {}

  void Plan(size_t scene, Work work, const std::string& who, double guess);
  /// What is done once, after all scenes.
  void PlanAtEnd(Work work, double guess) { costs_.Plan(work, "", guess); }
  /// Of what is planned on a scene of this kind and by this structure so much is left to do, in [0, 1].
  void Scale(size_t scene, Work work, const std::string& who, double left);
  /// Takes back what is still planned on a scene, by one structure or all.
  void Forget(size_t scene, const std::string* who = nullptr);

  /// The pieces that follow are of this scene.
  void Enter(size_t scene, std::string name) {
    scene_ = scene;
    scene_name_ = std::move(name);
  }
  /// A piece begins; the last one has ended.
  void Begin(Work work, std::span<const std::string> who, std::string what);
  void Begin(Work work, const std::string& who, std::string what) {
    Begin(work, std::span(&who, 1), std::move(what));
  }
  /// The piece under way is known to take so many seconds.
  void Expect(double seconds) { piece_->expected = seconds; }
  /// So much of it is done; 0: unknown.
  void Update(double fraction);
  void End();

  /// Seconds that this kind of work has taken.
  double Spent(Work work) const { return costs_.Spent(work); }

 private:
  struct Piece {
    Work work;
    std::string learner, what;
    double guess, expected, begin;  ///< seconds
  };

  Progress& progress_;
  CostModel costs_;
  std::map<size_t, std::map<std::pair<Work, std::string>, double>> planned_;  ///< by scene: guesses
  size_t scene_ = 0;
  std::string scene_name_;
  std::optional<Piece> piece_;
};

}  // namespace raybench
