#include "harness/plan/cost_model.h"

#include <algorithm>

namespace raybench {
namespace {

/// So many seconds of guesses that were checked count as much as what was believed before.
constexpr double kBeliefSeconds = 0.2;

}  // namespace

const char* WorkName(Work work) {
  static constexpr const char* kNames[] = {"capture",   "truth",        "build",  "tree",  "check",
                                           "heat_maps", "first_passes", "timing", "report"};
  static_assert(std::size(kNames) == size_t(Work::kCount));
  return kNames[size_t(work)];
}

void CostModel::Plan(Work work, const std::string& who, double guess) {
  accounts_[{work, who}].planned += guess;
}

void CostModel::Withdraw(Work work, const std::string& who, double guess) {
  double& planned = accounts_[{work, who}].planned;
  planned = std::max(0.0, planned - guess);
}

void CostModel::Finish(Work work, const std::string& who, double guess, double seconds) {
  Withdraw(work, who, guess);
  Account& account = accounts_[{work, who}];
  account.guessed += guess;
  account.took += seconds;
}

double CostModel::Correction(const Account& account, double prior) const {
  return (account.took + kBeliefSeconds * prior) / (account.guessed + kBeliefSeconds);
}

double CostModel::Correction() const {
  Account all;
  for (const auto& [key, account] : accounts_) {
    all.guessed += account.guessed;
    all.took += account.took;
  }
  return Correction(all, 1);
}

double CostModel::Correction(Work work) const {
  Account kind;
  for (const auto& [key, account] : accounts_)
    if (key.first == work) {
      kind.guessed += account.guessed;
      kind.took += account.took;
    }
  return Correction(kind, Correction());
}

double CostModel::Expect(Work work, const std::string& who, double guess) const {
  const double prior = Correction(work);
  const auto own = accounts_.find({work, who});
  return guess * (own == accounts_.end() ? prior : Correction(own->second, prior));
}

double CostModel::Left() const {
  double left = 0;
  for (const auto& [key, account] : accounts_)
    if (account.planned > 0) left += Expect(key.first, key.second, account.planned);
  return left;
}

double CostModel::Spent(Work work) const {
  double spent = 0;
  for (const auto& [key, account] : accounts_)
    if (key.first == work) spent += account.took;
  return spent;
}

}  // namespace raybench
