// What a run still has to do, in seconds: guesses made beforehand, corrected by what was measured since.
#pragma once

#include <map>
#include <string>
#include <utility>

namespace raybench {

enum class Work { kCapture, kTruth, kBuild, kTree, kCheck, kHeat, kFirstPasses, kTiming, kReport, kCount };
/// "capture", "truth", "build", ...; the key in run.json.
const char* WorkName(Work work);

/// Knows no clock. Work is planned by kind and by `who`, a structure (empty: the run itself), with a guessed
/// cost. Guesses of work ahead are multiplied by the ratio of true to guessed cost of finished work: of the
/// same kind and structure as far as there is any, else of the kind, else of all work.
class CostModel {
 public:
  void Plan(Work work, const std::string& who, double guess);
  /// Takes planned work back.
  void Withdraw(Work work, const std::string& who, double guess);
  /// Work planned at `guess` is done and took `seconds`.
  void Finish(Work work, const std::string& who, double guess, double seconds);

  /// What work guessed at `guess` is expected to take now.
  double Expect(Work work, const std::string& who, double guess) const;
  /// Of all planned work.
  double Left() const;
  /// What work of this kind has taken so far.
  double Spent(Work work) const;

 private:
  struct Account {
    double planned = 0, guessed = 0, took = 0;  // ahead; of what is done: the guess and the truth
  };
  double Correction(const Account& account, double prior) const;
  double Correction() const;
  double Correction(Work work) const;

  std::map<std::pair<Work, std::string>, Account> accounts_;
};

}  // namespace raybench
